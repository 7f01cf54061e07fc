//! Resolves cues to layers: times, phase matching and order.

use super::Notes;
use super::foot_locking::{PhaseMatchedCues, is_moved_by_channel_or_path};
use crate::api_error::{ApiError, Place};
use crate::build::{ActorDraft, CueDraft, RootMotionUse, StageDraft};
use crate::clip_analysis::{ClipAnalyses, phase_matched_fade, root_motion, standing_fades};
use crate::cue_times::times_of_cues;
use crate::diagnostic::Severity;
use choreo_motion::{Clip, Time};
use choreo_stage::{Cue, CueRootMotion, Layer, LayerMode, Pace, Reference, Repeat, StandingFade};
use std::sync::Arc;

/// Speed in metres per second, and distance in metres, up to which a clip counts as standing still.
const STANDING_TOLERANCE: f64 = 0.01;

/// Warns about root motion or path following of an actor whose clips all stand still, which is probably not intended.
fn warn_about_still_clips(stage_draft: &StageDraft, made: &[Option<Cue>], notes: &mut Notes) {
    for (index, actor) in stage_draft.actors.iter().enumerate() {
        let has_pace_of_clips = actor
            .actor
            .path_following
            .as_ref()
            .is_some_and(|path_following| path_following.pace == Pace::FromRootMotion);
        let has_root_motion = actor.root.is_some_and(|root| root.used == RootMotionUse::MovesActor);
        if !has_pace_of_clips && !has_root_motion {
            continue;
        }
        let own = stage_draft
            .cues
            .iter()
            .zip(made)
            .filter(|(draft, _)| stage_draft.chains[draft.chain].actor == index);
        let roots = own.filter_map(|(_, cue)| cue.as_ref()?.root.as_deref());
        let moves = |root: &CueRootMotion| {
            let turns =
                root.motion.frame(root.motion.trim.1).yaw != root.motion.frame(root.motion.trim.0).yaw;
            let reach = root.motion.frame(root.motion.trim.1).translation.length();
            turns || reach > STANDING_TOLERANCE || root.motion.velocity().length() > STANDING_TOLERANCE
        };
        if roots.into_iter().any(moves) {
            continue;
        }
        let name = &actor.actor.name;
        let error = if has_pace_of_clips {
            ApiError::new(format!("\"{name}\" stays at the start of its path: no clip that it plays walks"))
                .hint("give a speed, path(points, #{ speed: 1.2 })")
        } else {
            ApiError::new(format!("\"{name}\" has root motion, but no clip that it plays travels"))
        };
        notes.push((Severity::Warning, actor.at.clone(), error.rule("goes_nowhere")));
    }
}

/// Smallest rank of layers with a priority.
const FIRST_PRIORITY_RANK: u32 = 1 << 30;

/// The layers of all actors, and what is needed to resolve the rest of the stage.
pub(super) struct ResolvedLayers {
    /// Layers of each actor.
    pub layers: Vec<Vec<Layer>>,
    /// Place of each cue in the script, by actor and layer.
    pub places: Vec<Vec<Vec<Place>>>,
    pub phase_matched_cues: Vec<PhaseMatchedCues>,
    /// Fades between walking and standing of each actor; empty for an actor that stays in place.
    pub standing_fades: Vec<Vec<StandingFade>>,
}

/// The layers of every actor: the base layer first, then the other layers by rank.
pub(super) fn resolve_layers(stage_draft: &StageDraft, notes: &mut Notes) -> ResolvedLayers {
    let times = times_of_cues(stage_draft);
    let (layers, layer_of_chain) = empty_layers(stage_draft);
    // A cue without a start time of its own starts at the end of the preceding cue and ends it.
    let mut successor_start: Vec<Option<Time>> = vec![None; stage_draft.cues.len()];
    for (id, draft) in stage_draft.cues.iter().enumerate() {
        if let (Some(before), None) = (draft.predecessor, draft.start) {
            successor_start[before] = Some(times[id].0);
        }
    }
    let mut made: Vec<Option<Cue>> = Vec::with_capacity(stage_draft.cues.len());
    let mut analyses = ClipAnalyses::default();
    let mut matched = Vec::new();
    for (id, draft) in stage_draft.cues.iter().enumerate() {
        let cue = resolve_cue(stage_draft, draft, times[id], successor_start[id], &mut analyses, notes);
        made.push(cue);
        if made[id].is_some() && draft.in_step {
            matched.extend(match_phases(stage_draft, id, &mut made, &mut analyses, notes));
        }
    }
    warn_about_still_clips(stage_draft, &made, notes);
    // Each cue keeps its place in the script.
    let mut placed_layers: Vec<Vec<PlacedLayer>> = Vec::with_capacity(layers.len());
    for actor_layers in layers {
        placed_layers.push(actor_layers.into_iter().map(|layer| (layer, Vec::new())).collect());
    }
    for (draft, cue) in stage_draft.cues.iter().zip(made) {
        let chain = &stage_draft.chains[draft.chain];
        let cues = &mut placed_layers[chain.actor][layer_of_chain[draft.chain]].1;
        cues.extend(cue.map(|cue| (cue, draft.at.clone())));
    }
    for (placed_layers, draft) in placed_layers.iter_mut().zip(&stage_draft.actors) {
        placed_layers.extend(joint_key_layer(draft));
    }
    let (layers, places): (Vec<Vec<Layer>>, _) = placed_layers.into_iter().map(sort_layers).unzip();
    let fades_of = |(draft, layers): (&ActorDraft, &Vec<Layer>)| {
        let cues = layers.first().map_or(&[][..], |base| &base.cues);
        let has_root_motion = cues.iter().any(|cue| cue.root.as_ref().is_some_and(|root| root.carries));
        let is_moving = has_root_motion || is_moved_by_channel_or_path(&draft.actor);
        if is_moving { standing_fades(&draft.actor.asset, cues, &mut analyses) } else { Vec::new() }
    };
    let standing_fades = stage_draft.actors.iter().zip(&layers).map(fades_of).collect();
    ResolvedLayers { layers, places, phase_matched_cues: matched, standing_fades }
}

/// The layers of every actor, without cues yet, and the index of each chain's layer within its actor.
fn empty_layers(stage_draft: &StageDraft) -> (Vec<Vec<Layer>>, Vec<usize>) {
    let mut layers: Vec<Vec<Layer>> = stage_draft.actors.iter().map(|_| vec![Layer::default()]).collect();
    let mut layer_of_chain = Vec::with_capacity(stage_draft.chains.len());
    for chain in &stage_draft.chains {
        let actor_layers = &mut layers[chain.actor];
        if !chain.is_layer() {
            layer_of_chain.push(0);
            continue;
        }
        // Layers are sorted by rank later. A layer without a priority lies over the layers before it; consecutive additive layers
        // have the same rank.
        let last = actor_layers.iter().rfind(|layer| layer.rank < FIRST_PRIORITY_RANK);
        let is_additive = |mode: LayerMode| mode != LayerMode::Override;
        let has_rank_of_last = last.is_some_and(|last| is_additive(last.mode) && is_additive(chain.mode));
        let next = last.map_or(0, |last| if has_rank_of_last { last.rank } else { last.rank + 1 });
        let rank = chain
            .priority
            .map_or(next.min(FIRST_PRIORITY_RANK - 1), |priority| FIRST_PRIORITY_RANK + priority);
        let mask = chain.mask.clone().map(Arc::new);
        let weight_keys = chain.weight_keys.clone();
        actor_layers.push(Layer { mask, mode: chain.mode, rank, weight_keys, cues: Vec::new() });
        layer_of_chain.push(actor_layers.len() - 1);
    }
    (layers, layer_of_chain)
}

/// Adds an error about the clip of a cue.
fn add_clip_error(draft: &CueDraft, what: &str, notes: &mut Notes) {
    let error = ApiError::new(format!("clip \"{}\": {what}", draft.cue.clip.name));
    notes.push((Severity::Error, draft.at.clone(), error));
}

/// The cue of the stage for a draft. `None` after an error, which is added to `notes`. `successor_start`: start of the next cue
/// in the chain, if that cue ends this one.
fn resolve_cue(
    stage_draft: &StageDraft,
    draft: &CueDraft,
    (start, end): (Time, Option<Time>),
    successor_start: Option<Time>,
    analyses: &mut ClipAnalyses,
    notes: &mut Notes,
) -> Option<Cue> {
    if let Some(until) = draft.until.filter(|until| *until <= start) {
        let error = ApiError::new(format!(
            "clip \"{}\" would end at {} s, before it starts at {} s",
            draft.cue.clip.name,
            until.as_secs(),
            start.as_secs()
        ));
        notes.push((Severity::Error, draft.at.clone(), error));
        return None;
    }
    let layer = stage_draft.chains[draft.chain].is_layer();
    // A cue on the base layer whose clip plays once has no end: it holds the last pose.
    let has_end = (layer || draft.until.is_some()) && !draft.holds_last_pose;
    let own_end = if draft.holds_last_pose { draft.until } else { end.filter(|_| has_end) };
    let cue = Cue {
        end: successor_start.or(own_end),
        fade_out: draft.fade_out.unwrap_or(if layer { draft.cue.fade_in } else { Time::ZERO }),
        repeat: draft.repeat_mode(layer),
        root: if layer { None } else { root_motion(stage_draft, draft, analyses) },
        ..draft.cue(start)
    };
    if layer && cue.inertialization > Time::ZERO {
        add_clip_error(draft, "inertial is for clips that are not a layer", notes);
    }
    if layer && draft.root.is_some() {
        add_clip_error(draft, "root motion is for clips that are not a layer", notes);
    }
    if cue.inertialization > Time::ZERO && (draft.cue.fade_in > Time::ZERO || draft.in_step) {
        add_clip_error(draft, "inertial starts at full weight; it cannot be used with a fade", notes);
    }
    if layer && draft.in_step {
        add_clip_error(draft, "in_step is for clips that are not a layer", notes);
    }
    Some(cue)
}

/// Matches the phases of a cue on the base layer and the cue before it. `None` if that is not possible; then a message is added to
/// `notes`.
fn match_phases(
    stage_draft: &StageDraft,
    id: usize,
    made: &mut [Option<Cue>],
    analyses: &mut ClipAnalyses,
    notes: &mut Notes,
) -> Option<PhaseMatchedCues> {
    let draft = &stage_draft.cues[id];
    let chain = &stage_draft.chains[draft.chain];
    if chain.is_layer() {
        return None;
    }
    let (earlier, [cue, ..]) = made.split_at_mut(id) else { return None };
    let Some((before, from)) = draft.predecessor.and_then(|before| Some((before, earlier[before].as_mut()?)))
    else {
        add_clip_error(draft, "in_step keeps step with the clip before; use it with .then", notes);
        return None;
    };
    let cue = cue.as_mut()?;
    match phase_matched_fade(stage_draft, [before, id], [from, cue], analyses) {
        Ok(fade) => {
            let fade = Arc::new(fade);
            let has_root_motion = [&*from, &*cue].iter().any(|c| c.root.as_ref().is_some_and(|r| r.carries));
            let span = (fade.start(), fade.end());
            cue.phase_matched_fades[0] = Some(fade.clone());
            from.phase_matched_fades[1] = Some(fade);
            Some(PhaseMatchedCues { actor: chain.actor, span, has_root_motion })
        }
        Err(why) => {
            let text = format!("clip \"{}\" cannot keep step: {}", draft.cue.clip.name, why.message);
            notes.push((Severity::Warning, draft.at.clone(), ApiError::new(text).rule("not_in_step")));
            None
        }
    }
}

/// A layer, and its cues with their places.
type PlacedLayer = (Layer, Vec<(Cue, Place)>);

/// An additive layer with the keyframes of joints as a clip, if the actor has any.
fn joint_key_layer(draft: &ActorDraft) -> Option<PlacedLayer> {
    let (_, at) = draft.joint_keys.first()?;
    let curves = draft.joint_keys.iter().map(|(curve, _)| curve.clone()).collect();
    let clip = Clip::new("keys".into(), draft.actor.asset.skeleton.len(), curves).ok()?;
    let mode = LayerMode::Additive(Reference::Rest);
    let cue = Cue { repeat: Repeat::Once, ..Cue::new(Arc::new(clip)) };
    Some((Layer { mode, rank: u32::MAX, ..Layer::default() }, vec![(cue, at.clone())]))
}

/// An actor's layers sorted by rank, each with its cues sorted by start time, and the places of the cues.
fn sort_layers(placed_layers: Vec<PlacedLayer>) -> (Vec<Layer>, Vec<Vec<Place>>) {
    let sorted = |(mut layer, mut cues): PlacedLayer| {
        cues.sort_by_key(|(cue, _)| cue.start);
        let (cues, places): (Vec<Cue>, Vec<Place>) = cues.into_iter().unzip();
        layer.cues = cues;
        (layer, places)
    };
    let mut all: Vec<(Layer, Vec<Place>)> = placed_layers.into_iter().map(sorted).collect();
    // Layers of equal rank are sorted by content, so that not even rounding depends on the order in the script.
    all[1..].sort_by_cached_key(|(layer, _)| {
        let has_unique_rank = layer.rank < FIRST_PRIORITY_RANK && layer.mode == LayerMode::Override;
        (layer.rank, if has_unique_rank { [0; 32] } else { layer.content_hash() })
    });
    if all.len() == 1 && all[0].0.cues.is_empty() {
        all.clear();
    }
    all.into_iter().unzip()
}
