//! Analysis of clips when the stage is resolved: root motion, footsteps and gaits. Actors of the same skeleton share the results.

use crate::api_error::ApiError;
use crate::build::{CueDraft, RootMotionDraft, RootMotionUse, StageDraft};
use choreo_asset::Asset;
use choreo_motion::contacts::{ContactInterval, Contacts, find_feet, leg_length};
use choreo_motion::{Clip, Footsteps, PhaseMatchedFade, RootMotion, RootParts, Time};
use choreo_stage::{Cue, CueRootMotion, Pace, Repeat, StandingFade};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Key for a range of a clip on a skeleton: the addresses of skeleton and clip (the stage draft keeps both alive), start and end.
type ClipRange = (usize, usize, Time, Time);

/// Root motion options for a range of a clip, and the root motion found with them.
type RootMotionEntry = (RootMotionDraft, Option<Arc<CueRootMotion>>);

/// Cache of the results.
#[derive(Default)]
pub(crate) struct ClipAnalyses {
    root_motions: BTreeMap<ClipRange, Vec<RootMotionEntry>>,
    footsteps: BTreeMap<ClipRange, Option<Arc<Footsteps>>>,
    gaits: BTreeMap<ClipRange, Gait>,
}

/// The gait of a character in a clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Gait {
    /// Walks, runs or crawls, on the spot or not.
    Walks,
    /// Stands on all its feet.
    Stands,
    /// Neither: for example a jump, a pose in the air or a character without feet.
    Other,
}

/// Speed in leg lengths per second above which a character walks.
const MIN_WALKING_SPEED: f64 = 0.15;
/// Share of a clip's duration for which every foot of a standing character is on the ground.
const MIN_STANDING_SHARE: f64 = 0.9;

fn clip_range(asset: &Asset, clip: &Arc<Clip>, trim: (Time, Time)) -> ClipRange {
    (Arc::as_ptr(&asset.skeleton) as usize, Arc::as_ptr(clip) as usize, trim.0, trim.1)
}

/// Root motion of a cue on the base layer, if the cue or its actor requests it.
pub(crate) fn root_motion(
    stage_draft: &StageDraft,
    draft: &CueDraft,
    analyses: &mut ClipAnalyses,
) -> Option<Arc<CueRootMotion>> {
    let actor = &stage_draft.actors[stage_draft.chains[draft.chain].actor];
    // An actor that follows a path at the pace of its clips needs their root motion, also if the script does not request it.
    let has_pace_of_clips = actor
        .actor
        .path_following
        .as_ref()
        .is_some_and(|path_following| path_following.pace == Pace::FromRootMotion);
    let default =
        RootMotionDraft { joint: None, parts: RootParts::default(), used: RootMotionUse::MovesActor };
    let request = draft.root.or(actor.root).or(has_pace_of_clips.then_some(default))?;
    let asset = &actor.actor.asset;
    let trim = draft.trim_or_whole();
    let all = analyses.root_motions.entry(clip_range(asset, &draft.cue.clip, trim)).or_default();
    if let Some((_, root)) = all.iter().find(|(known, _)| *known == request) {
        return root.clone();
    }
    let motion = RootMotion::new(&asset.skeleton, &draft.cue.clip, request.joint, request.parts, trim);
    let carries = request.used == RootMotionUse::MovesActor;
    let root = motion.map(|motion| Arc::new(CueRootMotion { motion, carries }));
    all.push((request, root.clone()));
    root
}

/// Footsteps of a cue's clip: those that the script states, else those found from its foot contacts.
fn footsteps(
    stage_draft: &StageDraft,
    draft: &CueDraft,
    analyses: &mut ClipAnalyses,
) -> Option<Arc<Footsteps>> {
    let trim = draft.trim_or_whole();
    if let Some(times) =
        stage_draft.clip_notes_of(&draft.cue.clip).and_then(|notes| notes.footstep_times.as_ref())
    {
        return Footsteps::given(times, trim).map(Arc::new);
    }
    let asset = &stage_draft.actors[stage_draft.chains[draft.chain].actor].actor.asset;
    let entry = analyses.footsteps.entry(clip_range(asset, &draft.cue.clip, trim));
    let find = || {
        let feet = find_feet(&asset.skeleton);
        let contacts = Contacts::find(&asset.skeleton, &draft.cue.clip, trim, &feet)?;
        Footsteps::of(&contacts, trim).map(Arc::new)
    };
    entry.or_insert_with(find).clone()
}

/// The crossfade of two clips with matched phases.
///
/// # Errors
/// Returns an error that states why the phases cannot be matched.
pub(crate) fn phase_matched_fade(
    stage_draft: &StageDraft,
    drafts: [usize; 2],
    cues: [&Cue; 2],
    analyses: &mut ClipAnalyses,
) -> Result<PhaseMatchedFade, ApiError> {
    let drafts = drafts.map(|id| &stage_draft.cues[id]);
    for (draft, cue) in drafts.iter().zip(cues) {
        if cue.repeat != Repeat::Loop || !cue.plays_at_constant_speed() || cue.speed <= 0.0 {
            let text = format!("\"{}\" must loop, forwards and at one speed", draft.cue.clip.name);
            return Err(ApiError::new(text));
        }
    }
    if cues[1].fade_in <= Time::ZERO {
        return Err(ApiError::new("in_step needs a fade"));
    }
    let mut footsteps_of = |draft: &CueDraft| {
        let hint = "give the times when its feet touch down with clip.steps([…])";
        let name = &draft.cue.clip.name;
        let missing = || ApiError::new(format!("no steps are found in \"{name}\"; {hint}"));
        footsteps(stage_draft, draft, analyses).ok_or_else(missing)
    };
    let steps = [footsteps_of(drafts[0])?, footsteps_of(drafts[1])?];
    let played = cues[0].played_ticks(cues[1].start);
    let speeds = cues.map(|cue| cue.speed);
    PhaseMatchedFade::new(
        [&steps[0], &steps[1]],
        speeds,
        played,
        cues[1].start,
        cues[1].fade_in,
        cues[1].ease,
    )
    .ok_or_else(|| ApiError::new(format!("\"{}\" has a different order of steps", drafts[0].cue.clip.name)))
}

/// The gait of a character in the trimmed part of a clip.
pub(crate) fn gait(asset: &Asset, cue: &Cue, analyses: &mut ClipAnalyses) -> Gait {
    let find = || {
        let skeleton = &asset.skeleton;
        let feet = find_feet(skeleton);
        let leg = leg_length(skeleton, &feet)?;
        let motion = RootMotion::new(skeleton, &cue.clip, None, RootParts::default(), cue.trim)?;
        if motion.velocity().with_y(0.0).length() > MIN_WALKING_SPEED * leg {
            return Some(Gait::Walks);
        }
        let contacts = Contacts::find(skeleton, &cue.clip, cue.trim, &feet)?;
        let secs = (cue.trim.1 - cue.trim.0).as_secs();
        let stands = |foot: &Vec<ContactInterval>| {
            let on_ground = |c: &ContactInterval| (c.to - c.from).as_secs();
            foot.iter().map(on_ground).sum::<f64>() >= MIN_STANDING_SHARE * secs
        };
        contacts.intervals.iter().all(stands).then_some(Gait::Stands)
    };
    let entry = analyses.gaits.entry(clip_range(asset, &cue.clip, cue.trim));
    *entry.or_insert_with(|| find().unwrap_or(Gait::Other))
}

/// The fades of a base layer between a walking and a standing clip.
pub(crate) fn standing_fades(asset: &Asset, cues: &[Cue], analyses: &mut ClipAnalyses) -> Vec<StandingFade> {
    let mut fades: Vec<StandingFade> = Vec::new();
    for pair in cues.windows(2) {
        let [before, cue] = pair else { continue };
        let (from, to) = (cue.start, cue.start + cue.fade_in.max(cue.inertialization));
        if to <= from || fades.last().is_some_and(|last| from < last.to) {
            continue;
        }
        let ends_standing = match [gait(asset, before, analyses), gait(asset, cue, analyses)] {
            [Gait::Walks, Gait::Stands] => true,
            [Gait::Stands, Gait::Walks] => false,
            _ => continue,
        };
        fades.push(StandingFade { from, to, ends_standing });
    }
    fades
}
