//! Resolves the script's drafts into a stage: times, positions and references are settled, and mistakes that no single call
//! shows are found.

use crate::api_error::{ApiError, Place};
use crate::build::{
    ActorDraft, Build, CameraDraft, CueDraft, DEFAULT_AZIMUTH, DEFAULT_ELEVATION, HookDraft, ParentDraft,
    RootUse, Shared,
};
use crate::clip_analysis::{AnalyzedClips, in_step, root, standing_fades};
use crate::content::hex;
use crate::cue_times::all_times;
use crate::diagnostic::{Diagnostic, Severity};
use crate::hidden_parts::HiddenParts;
use crate::hook::ScriptHook;
use crate::legs;
use crate::lint::{ClipMarkers, Places};
use choreo_asset::Projection;
use choreo_motion::{Clip, Time};
use choreo_stage::{
    Actor, Camera, CameraLook, Channel, Constraint, ConstraintKind, Cue, CueRootMotion, Described, FootLock,
    Layer, LayerMode, Pace, Parenting, Property, Reference, Repeat, Rig, Stage, StageError, StandingFade,
};
use glam::{DQuat, DVec3, Vec3};
use rhai::Engine;
use std::sync::{Arc, PoisonError};

/// Messages with their places.
type Notes = Vec<(Severity, Place, ApiError)>;

/// Empties the build into a stage, and where its things were made; what is wrong is noted among the build's diagnostics.
///
/// `identity`: of the script that a callback is in, with its parameters and files.
pub fn resolve(
    shared: &Arc<Shared>,
    engine: &Arc<Engine>,
    identity: &dyn Fn(&Place) -> String,
) -> (Stage, Places) {
    let mut stage = Stage::default();
    let mut places = Places::default();
    let mut notes = Notes::new();
    let hooks;
    shared.settle();
    {
        let mut build = shared.build.lock().unwrap_or_else(PoisonError::into_inner);
        stage.settings = build.settings.clone();
        stage.sky = build.sky.take();
        stage.layers_2d = std::mem::take(&mut build.layers_2d);
        if stage.sky.is_some() && !build.ambient_given {
            (stage.settings.ambient_up, stage.settings.ambient_down) = (Vec3::ZERO, Vec3::ZERO);
        }
        crate::check::before(&build, &mut notes);
        places.script_findings = crate::lint::script_findings(&build);
        let clips_only = build.loads.iter().filter(|l| l.clips_only);
        places.clips_only = clips_only.map(|l| (l.load.name.clone(), l.load.at.clone())).collect();
        places.settings = build.settings_at.clone().unwrap_or_default();
        places.actors = build.actors.iter().map(|a| a.at.clone()).collect();
        places.looks = build.actors.iter_mut().map(|a| std::mem::take(&mut a.looks)).collect();
        places.cameras = build.cameras.iter().map(|c| c.at.clone()).collect();
        places.lights = std::mem::take(&mut build.light_places);
        places.effects = std::mem::take(&mut build.effect_places);
        let Layers { layers, places: cue_places, in_step, standing_fades } = layers(&build, &mut notes);
        places.cues = cue_places;
        places.markers = build.markers.clone();
        places.clip_markers = clip_markers(&build, &layers);
        plant_in_step(&mut build, in_step);
        plant_in_fades(&mut build, standing_fades);
        if let Some((place, error)) = crate::totals::too_much(&build, &shared.limits) {
            notes.push((Severity::Error, place, error));
        }
        let mut hidden_parts = HiddenParts::default();
        let actors = std::mem::take(&mut build.actors).into_iter().zip(layers);
        stage.actors = actors.map(|(draft, layers)| actor(draft, layers, &mut hidden_parts)).collect();
        stage.cameras =
            std::mem::take(&mut build.cameras).into_iter().map(|draft| camera(draft, &mut notes)).collect();
        let mut cuts = std::mem::take(&mut build.cuts);
        cuts.sort_by_key(|(cut, _)| cut.at);
        (stage.cuts, places.cuts) = cuts.into_iter().unzip();
        stage.lights = std::mem::take(&mut build.lights);
        stage.effects = std::mem::take(&mut build.effects);
        hooks = std::mem::take(&mut build.hooks);
        build.bound.clear();
        build.shapes.clear();
        build.loads.clear();
        build.cues.clear();
        build.chains.clear();
    }
    for (severity, place, error) in notes {
        shared.note(severity, &place, &error);
    }
    add_hooks(&mut stage, hooks, shared, engine, identity);
    let mut build = shared.build.lock().unwrap_or_else(PoisonError::into_inner);
    if !build.has_errors() {
        for problem in stage.check() {
            let diagnostic = match &problem {
                StageError::Cycle(name, _) => {
                    let place = stage.actor(name).and_then(|index| places.actors.get(index));
                    let error = ApiError::new(problem.to_string());
                    shared.diagnose(Severity::Error, &place.cloned().unwrap_or_default(), &error)
                }
                _ => Diagnostic::error(problem.to_string()),
            };
            build.note(diagnostic);
        }
    }
    drop(build);
    places.sources = Arc::new(shared.sources.lock().unwrap_or_else(PoisonError::into_inner).clone());
    (stage, places)
}

/// The stage that has been built, and what is wrong with it as a whole.
pub(crate) fn finish_stage(shared: &Arc<Shared>, engine: &Arc<Engine>) -> (Stage, Vec<Diagnostic>) {
    // A callback is distinguished from others by the text that it stands in.
    let identity = |place: &Place| {
        let sources = shared.sources.lock().unwrap_or_else(PoisonError::into_inner);
        let text = sources.get(&place.file).cloned().unwrap_or_default();
        hex(blake3::hash(text.as_bytes()).as_bytes())
    };
    let (stage, _) = resolve(shared, engine, &identity);
    let broken = stage.check().iter().map(|problem| Diagnostic::error(problem.to_string())).collect();
    (stage, broken)
}

/// Every hook runs once at time 0: its mistakes are found now, not in the middle of a render.
fn add_hooks(
    stage: &mut Stage,
    hooks: Vec<HookDraft>,
    shared: &Arc<Shared>,
    engine: &Arc<Engine>,
    identity: &dyn Fn(&Place) -> String,
) {
    let all = hooks.len();
    for draft in hooks {
        let identity = identity(&draft.at);
        let hook = ScriptHook::new(engine.clone(), shared.clone(), draft, &identity, all);
        if let Err(diagnostic) = hook.try_at(Time::ZERO) {
            shared.build.lock().unwrap_or_else(PoisonError::into_inner).note(diagnostic);
        }
        stage.hooks.push(Arc::new(hook));
    }
}

/// Markers of the clips that are played, each once.
fn clip_markers(build: &Build, layers: &[Vec<Layer>]) -> Vec<ClipMarkers> {
    let mut all: Vec<ClipMarkers> = Vec::new();
    if build.clip_notes.values().all(|notes| notes.markers.is_empty()) {
        return all;
    }
    for cue in layers.iter().flatten().flat_map(|layer| &layer.cues) {
        if all.iter().any(|known| Arc::ptr_eq(&known.clip, &cue.clip)) {
            continue;
        }
        let markers = build.notes_of(&cue.clip).map(|notes| notes.markers.clone()).unwrap_or_default();
        if !markers.is_empty() {
            all.push(ClipMarkers { clip: cue.clip.clone(), markers });
        }
    }
    all
}

/// Speed in metres a second below which an actor stands.
const STANDING: f64 = 0.01;

/// Warns about root motion of clips that all stand still, which is probably not intended.
fn gets_nowhere(build: &Build, made: &[Option<Cue>], notes: &mut Notes) {
    for (index, actor) in build.actors.iter().enumerate() {
        let paced = actor
            .actor
            .path_following
            .as_ref()
            .is_some_and(|path_following| path_following.pace == Pace::OfClips);
        let carried = actor.root.is_some_and(|root| root.used == RootUse::Carries);
        if !paced && !carried {
            continue;
        }
        let own = build.cues.iter().zip(made).filter(|(draft, _)| build.chains[draft.chain].actor == index);
        let roots = own.filter_map(|(_, cue)| cue.as_ref()?.root.as_deref());
        let moves = |root: &CueRootMotion| {
            let turns =
                root.motion.frame(root.motion.trim.1).yaw != root.motion.frame(root.motion.trim.0).yaw;
            let reach = root.motion.frame(root.motion.trim.1).translation.length();
            turns || reach > STANDING || root.motion.velocity().length() > STANDING
        };
        if roots.into_iter().any(moves) {
            continue;
        }
        let name = &actor.actor.name;
        let error = if paced {
            ApiError::new(format!("\"{name}\" stays at the start of its path: no clip that it plays walks"))
                .hint("give a speed, path(points, #{ speed: 1.2 })")
        } else {
            ApiError::new(format!("\"{name}\" has root motion, but no clip that it plays gets anywhere"))
        };
        notes.push((Severity::Warning, actor.at.clone(), error));
    }
}

/// Ranks from here on are of layers with a priority.
const PRIORITIES: u32 = 1 << 30;

/// The layers that the cues are resolved to.
struct Layers {
    /// Layers of each actor.
    layers: Vec<Vec<Layer>>,
    /// Place of each cue in the script.
    places: Vec<Vec<Vec<Place>>>,
    in_step: Vec<InStep>,
    /// Fades between walking and standing of each actor that gets on.
    standing_fades: Vec<Vec<StandingFade>>,
}

/// The layers of every actor: the base first, then each chain with a mask, in the order of the script.
fn layers(build: &Build, notes: &mut Notes) -> Layers {
    let times = all_times(build);
    let (layers, slots) = empty_layers(build);
    // Where a cue of the chain takes over, the one before it is over.
    let mut taken_over: Vec<Option<Time>> = vec![None; build.cues.len()];
    for (id, draft) in build.cues.iter().enumerate() {
        if let (Some(before), None) = (draft.after, draft.start) {
            taken_over[before] = Some(times[id].0);
        }
    }
    let mut made: Vec<Option<Cue>> = Vec::with_capacity(build.cues.len());
    let mut found = AnalyzedClips::default();
    let mut matched = Vec::new();
    for (id, draft) in build.cues.iter().enumerate() {
        let cue = resolve_cue(build, draft, times[id], taken_over[id], &mut found, notes);
        made.push(cue);
        if made[id].is_some() && draft.in_step {
            matched.extend(match_phases(build, id, &mut made, &mut found, notes));
        }
    }
    gets_nowhere(build, &made, notes);
    // Each cue is stored with its place in the script.
    let mut laid: Vec<Vec<Laid>> = Vec::with_capacity(layers.len());
    for of_actor in layers {
        laid.push(of_actor.into_iter().map(|layer| (layer, Vec::new())).collect());
    }
    for (draft, cue) in build.cues.iter().zip(made) {
        let chain = &build.chains[draft.chain];
        laid[chain.actor][slots[draft.chain]].1.extend(cue.map(|cue| (cue, draft.at.clone())));
    }
    for (laid, draft) in laid.iter_mut().zip(&build.actors) {
        laid.extend(keyed_joints(draft));
    }
    let (layers, places): (Vec<Vec<Layer>>, _) = laid.into_iter().map(of_actor).unzip();
    let fades_of = |(draft, layers): (&ActorDraft, &Vec<Layer>)| {
        let cues = layers.first().map_or(&[][..], |base| &base.cues);
        let carried = cues.iter().any(|cue| cue.root.as_ref().is_some_and(|root| root.carries));
        let gets_on = carried || is_moved(&draft.actor);
        if gets_on { standing_fades(&draft.actor.asset, cues, &mut found) } else { Vec::new() }
    };
    let standing_fades = build.actors.iter().zip(&layers).map(fades_of).collect();
    Layers { layers, places, in_step: matched, standing_fades }
}

/// Whether keyframes or a path move an actor.
fn is_moved(actor: &Actor) -> bool {
    actor.path_following.is_some() || actor.channels.iter().any(|c| c.property == Property::Translation)
}

/// The layers of every actor without cues, and the layer of each chain within its actor.
fn empty_layers(build: &Build) -> (Vec<Vec<Layer>>, Vec<usize>) {
    let mut layers: Vec<Vec<Layer>> = build.actors.iter().map(|_| vec![Layer::default()]).collect();
    let mut slots = Vec::with_capacity(build.chains.len());
    for chain in &build.chains {
        let of_actor = &mut layers[chain.actor];
        if !chain.is_layer() {
            slots.push(0);
            continue;
        }
        // Sorted later. Without a priority each lies over those before it; additive ones in a row are equals.
        let last = of_actor.iter().rfind(|layer| layer.rank < PRIORITIES);
        let additive = |mode: LayerMode| mode != LayerMode::Override;
        let joins = last.is_some_and(|last| additive(last.mode) && additive(chain.mode));
        let next = last.map_or(0, |last| if joins { last.rank } else { last.rank + 1 });
        let rank = chain.priority.map_or(next.min(PRIORITIES - 1), |priority| PRIORITIES + priority);
        let mask = chain.mask.clone().map(Arc::new);
        let weight_keys = chain.weight_keys.clone();
        of_actor.push(Layer { mask, mode: chain.mode, rank, weight_keys, cues: Vec::new() });
        slots.push(of_actor.len() - 1);
    }
    (layers, slots)
}

fn refuse(draft: &CueDraft, what: &str, notes: &mut Notes) {
    let error = ApiError::new(format!("clip \"{}\": {what}", draft.cue.clip.name));
    notes.push((Severity::Error, draft.at.clone(), error));
}

/// A cue with its times, as it is on stage.
fn resolve_cue(
    build: &Build,
    draft: &CueDraft,
    (start, end): (Time, Option<Time>),
    taken_over: Option<Time>,
    found: &mut AnalyzedClips,
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
    let layer = build.chains[draft.chain].is_layer();
    // The base layer holds the last pose of a clip played once anyway.
    let natural = (layer || draft.until.is_some()) && !draft.hold;
    let ends = if draft.hold { draft.until } else { end.filter(|_| natural) };
    let cue = Cue {
        end: taken_over.or(ends),
        fade_out: draft.fade_out.unwrap_or(if layer { draft.cue.fade_in } else { Time::ZERO }),
        repeat: draft.repeats(layer),
        root: if layer { None } else { root(build, draft, found) },
        ..draft.cue(start)
    };
    if layer && cue.inertialization > Time::ZERO {
        refuse(draft, "inertial is for clips that are no layer", notes);
    }
    if layer && draft.root.is_some() {
        refuse(draft, "root motion is for clips that are no layer", notes);
    }
    if cue.inertialization > Time::ZERO && (draft.cue.fade_in > Time::ZERO || draft.in_step) {
        refuse(draft, "inertial begins at once, so there is no fade", notes);
    }
    if layer && draft.in_step {
        refuse(draft, "in_step is for clips that are no layer", notes);
    }
    Some(cue)
}

/// Matches the phases of a cue on the base layer and the cue before it.
fn match_phases(
    build: &Build,
    id: usize,
    made: &mut [Option<Cue>],
    found: &mut AnalyzedClips,
    notes: &mut Notes,
) -> Option<InStep> {
    let draft = &build.cues[id];
    let chain = &build.chains[draft.chain];
    if chain.is_layer() {
        return None;
    }
    let (earlier, [cue, ..]) = made.split_at_mut(id) else { return None };
    let Some((before, from)) = draft.after.and_then(|before| Some((before, earlier[before].as_mut()?)))
    else {
        refuse(draft, "in_step keeps step with the clip before; use it with .then", notes);
        return None;
    };
    let cue = cue.as_mut()?;
    match in_step(build, [before, id], [from, cue], found) {
        Ok(fade) => {
            let fade = Arc::new(fade);
            let carried = [&*from, &*cue].iter().any(|c| c.root.as_ref().is_some_and(|r| r.carries));
            let span = (fade.start(), fade.end());
            cue.in_step[0] = Some(fade.clone());
            from.in_step[1] = Some(fade);
            Some(InStep { actor: chain.actor, span, carried })
        }
        Err(why) => {
            let text = format!("clip \"{}\" cannot keep step: {}", draft.cue.clip.name, why.message);
            notes.push((Severity::Warning, draft.at.clone(), ApiError::new(text)));
            None
        }
    }
}

/// A layer without its cues, and those with their places.
type Laid = (Layer, Vec<(Cue, Place)>);

/// Keys of joints are a clip of their own, added to all that lies below.
fn keyed_joints(draft: &ActorDraft) -> Option<Laid> {
    let (_, at) = draft.joint_keys.first()?;
    let curves = draft.joint_keys.iter().map(|(curve, _)| curve.clone()).collect();
    let clip = Clip::new("keys".into(), draft.actor.asset.skeleton.len(), curves).ok()?;
    let mode = LayerMode::Additive(Reference::Rest);
    let cue = Cue { repeat: Repeat::Once, ..Cue::new(Arc::new(clip)) };
    Some((Layer { mode, rank: u32::MAX, ..Layer::default() }, vec![(cue, at.clone())]))
}

/// An actor's layers and their cues in order, and the places of the cues.
fn of_actor(laid: Vec<Laid>) -> (Vec<Layer>, Vec<Vec<Place>>) {
    let sorted = |(mut layer, mut cues): Laid| {
        cues.sort_by_key(|(cue, _)| cue.start);
        let (cues, places): (Vec<Cue>, Vec<Place>) = cues.into_iter().unzip();
        layer.cues = cues;
        (layer, places)
    };
    let mut all: Vec<(Layer, Vec<Place>)> = laid.into_iter().map(sorted).collect();
    // Equal layers in an order of their own, so that not even rounding depends on how the script is written.
    all[1..].sort_by_cached_key(|(layer, _)| {
        let alone = layer.rank < PRIORITIES && layer.mode == LayerMode::Override;
        (layer.rank, if alone { [0; 32] } else { layer.content_hash() })
    });
    if all.len() == 1 && all[0].0.cues.is_empty() {
        all.clear();
    }
    all.into_iter().unzip()
}

/// A fade in which two clips keep step.
struct InStep {
    actor: usize,
    span: (Time, Time),
    /// Whether root motion moves it.
    carried: bool,
}

/// Plants the feet of actors that fade from one gait to another in step and move along: the two clips' strides are of
/// different lengths, so that the mean of both slides.
fn plant_in_step(build: &mut Build, matched: Vec<InStep>) {
    for InStep { actor, span, carried } in matched {
        let Some(ActorDraft { actor, .. }) = build.actors.get_mut(actor) else { continue };
        let gets_on = carried || is_moved(actor);
        let planted = foot_locks(actor).next().map(|lock| &mut lock.only);
        match planted {
            // Planted as the script states, or by an earlier fade.
            Some(only) => only.extend((!only.is_empty()).then_some(span)),
            None if gets_on => plant(actor, vec![span], Vec::new()),
            None => {}
        }
    }
}

/// A character that fades between walking and standing, and gets on, takes steps in the fade instead of sliding.
fn plant_in_fades(build: &mut Build, standing_fades: Vec<Vec<StandingFade>>) {
    for (ActorDraft { actor, walks, .. }, mut fades) in build.actors.iter_mut().zip(standing_fades) {
        // A walk to a point begins with the turn.
        for walk in walks.iter() {
            fades
                .iter_mut()
                .filter(|f| f.to == walk.walks && !f.ends_standing)
                .for_each(|f| f.from = walk.from);
        }
        let walked = walks.iter().map(|walk| (walk.from, walk.until));
        let spans: Vec<(Time, Time)> = fades.iter().map(|f| (f.from, f.to)).chain(walked).collect();
        if spans.is_empty() {
            continue;
        }
        for lock in foot_locks(actor) {
            if !lock.only.is_empty() {
                lock.only.extend(&spans);
            }
            lock.standing_fades.clone_from(&fades);
        }
        if foot_locks(actor).next().is_none() {
            plant(actor, spans, fades);
        }
    }
}

fn foot_locks(actor: &mut Actor) -> impl Iterator<Item = &mut FootLock> {
    actor.constraints.iter_mut().filter_map(|goal| match &mut goal.kind {
        ConstraintKind::FootLock(lock) => Some(lock),
        _ => None,
    })
}

/// Locks the feet of an actor, if it has legs.
fn plant(actor: &mut Actor, only: Vec<(Time, Time)>, standing_fades: Vec<StandingFade>) {
    let legs = legs::legs(&actor.asset);
    if !legs.is_empty() {
        let hips = legs::hips(&actor.asset, &legs);
        let lock = FootLock { legs, hips, ground: Vec::new(), only, standing_fades };
        actor.constraints.push(Constraint::new(ConstraintKind::FootLock(lock)));
    }
}

fn actor(draft: ActorDraft, layers: Vec<Layer>, hidden_parts: &mut HiddenParts) -> Actor {
    let mut actor = draft.actor;
    actor.asset = hidden_parts.without(&actor.asset, draft.hidden_parts);
    actor.layers = layers;
    actor.parents = parents(draft.parents);
    if let Some(point) = draft.face_point {
        let d = point - actor.transform.translation;
        if DVec3::new(d.x, 0.0, d.z).length() > 1e-9 {
            let yaw = DQuat::from_rotation_y(libm::atan2(d.x, d.z) - actor.asset.front().yaw_rad());
            actor.transform.rotation = (yaw * actor.transform.rotation).normalize();
        }
    }
    actor
}

/// Parents by their starts. One that ends before the next one starts is followed by none.
fn parents(mut drafts: Vec<ParentDraft>) -> Vec<Parenting> {
    drafts.sort_by_key(|draft| draft.parent.start);
    let mut parents = Vec::with_capacity(drafts.len());
    for (index, draft) in drafts.iter().enumerate() {
        parents.push(draft.parent.clone());
        let next = drafts.get(index + 1).map_or(Time::MAX, |next| next.parent.start);
        if let Some(until) = draft.until.filter(|until| *until < next) {
            let keep =
                draft.parent.keep || draft.parent.start == Time::MIN || draft.parent.placement.is_some();
            parents.push(Parenting { blend: draft.parent.blend, keep, ..Parenting::from(None, until) });
        }
    }
    parents
}

/// The targets of a camera, by their starts. After one that ends before the next one starts the camera looks where its rig does.
fn looks(mut drafts: Vec<(CameraLook, Option<Time>)>) -> Vec<CameraLook> {
    drafts.sort_by_key(|(look, _)| look.start);
    let mut looks = Vec::with_capacity(drafts.len());
    for (index, (look, until)) in drafts.iter().enumerate() {
        looks.push(*look);
        let next = drafts.get(index + 1).map_or(Time::MAX, |(next, _)| next.start);
        let end = until.filter(|until| *until < next);
        looks.extend(end.map(|start| CameraLook { target: None, start, ..*look }));
    }
    looks
}

/// Near plane of a camera that sets none, metres.
const NEAR: f32 = 0.05;

fn camera(draft: CameraDraft, notes: &mut Notes) -> Camera {
    let near = draft.near.unwrap_or(NEAR);
    let projection = match draft.ortho {
        Some(height) => {
            // A far plane is needed to map depth; this one is beyond any stage.
            Projection::Orthographic { height, near, far: draft.far.unwrap_or(10_000.0) }
        }
        None => {
            let Projection::Perspective { yfov, .. } = Projection::default() else {
                unreachable!("the default camera has perspective")
            };
            Projection::Perspective { yfov: draft.perspective.unwrap_or(yfov), near, far: draft.far }
        }
    };
    let mut camera = Camera { projection, near_is_set: draft.near.is_some(), ..draft.camera };
    camera.looks = looks(draft.looks);
    let placed = draft.position.is_some() || draft.look_at.is_some() || draft.rotation != DQuat::IDENTITY;
    let rigged = draft.rig.is_some();
    let fixed = placed
        || !camera.looks.is_empty()
        || !camera.channels.iter().all(|c| c.property == Property::FieldOfView);
    camera.rig = draft.rig.unwrap_or(if fixed {
        // Where a person would stand to look at another.
        let position = draft.position.unwrap_or(DVec3::new(0.0, 1.6, 5.0));
        Rig::Fixed { position, rotation: draft.rotation, look_at: draft.look_at }
    } else {
        Rig::Frame { azimuth: DEFAULT_AZIMUTH.to_radians(), elevation: DEFAULT_ELEVATION.to_radians() }
    });
    let mut note = |text: String| {
        let text = format!("camera \"{}\"{text}", camera.name);
        notes.push((Severity::Error, draft.at.clone(), ApiError::new(text)));
    };
    if let Some(far) = draft.far
        && far <= near
    {
        note(format!(": far must be more than near, got {far} and {near}"));
    }
    for field in Camera::FIELDS {
        let keyed = |property| camera.channels.iter().any(|c: &Channel| c.property == property);
        let lacking = (field.lacks)(&camera).filter(|_| field.keyed.is_some_and(|(_, p)| keyed(p)));
        lacking.into_iter().for_each(|why| note(format!(" {why}")));
    }
    if rigged && placed {
        note(" cannot both stand somewhere and follow, orbit or frame".into());
    }
    camera
}
