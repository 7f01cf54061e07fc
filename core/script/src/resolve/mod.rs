//! Resolves the drafts of a script to a stage: computes times, positions and references, and finds mistakes that only several
//! calls together show.

mod foot_locking;
mod layers;

use self::foot_locking::{lock_feet_in_phase_matched_fades, lock_feet_in_standing_fades};
use self::layers::{ResolvedLayers, resolve_layers};
use crate::api_error::{ApiError, Place};
use crate::build::{ActorDraft, CameraDraft, FrameCallbackDraft, ParentDraft, ScriptContext, StageDraft};
use crate::content::hex;
use crate::diagnostic::{Diagnostic, Severity};
use crate::frame_callback::ScriptCallback;
use crate::hidden_parts::HiddenParts;
use crate::lint::{ClipMarkers, Places};
use choreo_asset::Projection;
use choreo_motion::Time;
use choreo_stage::{Actor, Camera, CameraLook, Channel, Described, Layer, Parenting, Rig, Stage, StageError};
use glam::{DQuat, DVec3, Vec3};
use rhai::Engine;
use std::sync::{Arc, PoisonError};

/// Messages with their places, which are added to the diagnostics when the stage is resolved.
type Notes = Vec<(Severity, Place, ApiError)>;

/// Moves the drafts into a stage and returns it with the places of the calls. Errors are added to the diagnostics.
///
/// `identity`: returns the hash that identifies the script of a callback, with its parameters and files.
pub(crate) fn resolve(
    context: &Arc<ScriptContext>,
    engine: &Arc<Engine>,
    identity: &dyn Fn(&Place) -> String,
) -> (Stage, Places) {
    let mut stage = Stage::default();
    let mut places = Places::default();
    let mut notes = Notes::new();
    let frame_callbacks;
    context.wait_for_loads();
    {
        let mut stage_draft = context.stage_draft.lock().unwrap_or_else(PoisonError::into_inner);
        stage.settings = stage_draft.settings.clone();
        stage.sky = stage_draft.sky.take();
        stage.layers_2d = std::mem::take(&mut stage_draft.layers_2d);
        if stage.sky.is_some() && !stage_draft.sets_ambient {
            (stage.settings.ambient_up, stage.settings.ambient_down) = (Vec3::ZERO, Vec3::ZERO);
        }
        let uses_ambient_of_files = stage.sky.is_none() && !stage_draft.sets_ambient;
        crate::check::check_drafts(&stage_draft, &mut notes);
        places.script_findings = crate::lint::script_findings(&stage_draft);
        let clips_only = stage_draft.loads.iter().filter(|l| l.clips_only);
        places.clips_only = clips_only.map(|l| (l.load.name.clone(), l.load.at.clone())).collect();
        places.settings = stage_draft.settings_at.clone().unwrap_or_default();
        places.actors = stage_draft.actors.iter().map(|a| a.at.clone()).collect();
        places.look_at_constraints =
            stage_draft.actors.iter_mut().map(|a| std::mem::take(&mut a.look_at_places)).collect();
        places.constraints =
            stage_draft.actors.iter_mut().map(|a| std::mem::take(&mut a.constraint_places)).collect();
        places.cameras = stage_draft.cameras.iter().map(|c| c.at.clone()).collect();
        places.lights = std::mem::take(&mut stage_draft.light_places);
        places.sky = stage_draft.sky_at.take();
        places.ambient = stage_draft.ambient_at.take();
        places.effects = std::mem::take(&mut stage_draft.effect_places);
        places.layers_2d = std::mem::take(&mut stage_draft.layer_2d_places);
        let ResolvedLayers { layers, places: cue_places, phase_matched_cues, standing_fades } =
            resolve_layers(&stage_draft, &mut notes);
        places.cues = cue_places;
        stage.markers = std::mem::take(&mut stage_draft.markers);
        places.clip_markers = clip_markers(&stage_draft, &layers);
        lock_feet_in_phase_matched_fades(&mut stage_draft, phase_matched_cues);
        lock_feet_in_standing_fades(&mut stage_draft, standing_fades);
        if let Some((place, error)) = crate::totals::error_of_totals(&stage_draft, &context.limits) {
            notes.push((Severity::Error, place, error));
        }
        let mut hidden_parts = HiddenParts::default();
        let actors = std::mem::take(&mut stage_draft.actors).into_iter().zip(layers);
        stage.actors =
            actors.map(|(draft, layers)| resolve_actor(draft, layers, &mut hidden_parts)).collect();
        if uses_ambient_of_files {
            stage.use_ambient_light_of_files();
        }
        stage.cameras = std::mem::take(&mut stage_draft.cameras)
            .into_iter()
            .map(|draft| resolve_camera(draft, &mut notes))
            .collect();
        let mut cuts = std::mem::take(&mut stage_draft.cuts);
        cuts.sort_by_key(|(cut, _)| cut.at);
        (stage.cuts, places.cuts) = cuts.into_iter().unzip();
        stage.lights = std::mem::take(&mut stage_draft.lights);
        stage.effects = std::mem::take(&mut stage_draft.effects);
        frame_callbacks = std::mem::take(&mut stage_draft.frame_callbacks);
        places.callbacks = frame_callbacks.iter().map(|callback| callback.at.clone()).collect();
        stage_draft.bound_clips.clear();
        stage_draft.shapes.clear();
        stage_draft.loads.clear();
        stage_draft.cues.clear();
        stage_draft.chains.clear();
    }
    for (severity, place, error) in notes {
        context.add_diagnostic(severity, &place, &error);
    }
    add_frame_callbacks(&mut stage, frame_callbacks, context, engine, identity);
    add_stage_errors(context, &stage, &places);
    places.sources = Arc::new(context.sources.lock().unwrap_or_else(PoisonError::into_inner).clone());
    (stage, places)
}

/// Adds errors of the stage as a whole to the diagnostics, if these contain no error.
fn add_stage_errors(context: &ScriptContext, stage: &Stage, places: &Places) {
    let mut stage_draft = context.stage_draft.lock().unwrap_or_else(PoisonError::into_inner);
    if stage_draft.has_errors() {
        return;
    }
    for problem in stage.check() {
        let diagnostic = match &problem {
            StageError::Cycle(name, _) => {
                let place = stage.actor(name).and_then(|index| places.actors.get(index));
                let error = ApiError::new(problem.to_string());
                context.diagnose(Severity::Error, &place.cloned().unwrap_or_default(), &error)
            }
            _ => Diagnostic::error(problem.to_string()),
        };
        stage_draft.add_diagnostic(diagnostic);
    }
}

/// The resolved stage of a test, and the errors of the stage as a whole.
pub(crate) fn resolve_test_stage(
    context: &Arc<ScriptContext>,
    engine: &Arc<Engine>,
) -> (Stage, Vec<Diagnostic>) {
    // The identity of a callback is the hash of the text that contains it.
    let identity = |place: &Place| {
        let sources = context.sources.lock().unwrap_or_else(PoisonError::into_inner);
        let text = sources.get(&place.file).cloned().unwrap_or_default();
        hex(blake3::hash(text.as_bytes()).as_bytes())
    };
    let (stage, _) = resolve(context, engine, &identity);
    let errors = stage.check().iter().map(|problem| Diagnostic::error(problem.to_string())).collect();
    (stage, errors)
}

/// Adds the callbacks to the stage. Each runs once at time 0, so that mistakes are found before rendering.
fn add_frame_callbacks(
    stage: &mut Stage,
    callbacks: Vec<FrameCallbackDraft>,
    context: &Arc<ScriptContext>,
    engine: &Arc<Engine>,
    identity: &dyn Fn(&Place) -> String,
) {
    let count = callbacks.len();
    for draft in callbacks {
        let identity = identity(&draft.at);
        let callback = ScriptCallback::new(engine.clone(), context.clone(), draft, &identity, count);
        if let Err(diagnostic) = callback.check_at(Time::ZERO)
            && !crate::errors::is_follow_up(&diagnostic.message)
        {
            context.stage_draft.lock().unwrap_or_else(PoisonError::into_inner).add_diagnostic(diagnostic);
        }
        stage.frame_callbacks.push(Arc::new(callback));
    }
}

/// Markers of the clips that are played, each once.
fn clip_markers(stage_draft: &StageDraft, layers: &[Vec<Layer>]) -> Vec<ClipMarkers> {
    let mut all: Vec<ClipMarkers> = Vec::new();
    if stage_draft.clip_notes.values().all(|notes| notes.markers.is_empty()) {
        return all;
    }
    for cue in layers.iter().flatten().flat_map(|layer| &layer.cues) {
        if all.iter().any(|known| Arc::ptr_eq(&known.clip, &cue.clip)) {
            continue;
        }
        let markers =
            stage_draft.clip_notes_of(&cue.clip).map(|notes| notes.markers.clone()).unwrap_or_default();
        if !markers.is_empty() {
            all.push(ClipMarkers { clip: cue.clip.clone(), markers });
        }
    }
    all
}

/// The actor of the stage for a draft, with its layers.
fn resolve_actor(draft: ActorDraft, layers: Vec<Layer>, hidden_parts: &mut HiddenParts) -> Actor {
    let mut actor = draft.actor;
    actor.asset = hidden_parts.copy_without(&actor.asset, draft.hidden_parts);
    actor.layers = layers;
    actor.parents = resolve_parents(draft.parents);
    if let Some(point) = draft.face_point {
        let to_point = point - actor.transform.translation;
        if DVec3::new(to_point.x, 0.0, to_point.z).length() > 1e-9 {
            let yaw_rad = libm::atan2(to_point.x, to_point.z) - actor.asset.front().yaw_rad();
            let yaw = DQuat::from_rotation_y(yaw_rad);
            actor.transform.rotation = (yaw * actor.transform.rotation).normalize();
        }
    }
    actor
}

/// Parents sorted by start time. Between the end of a parent and the start of the next one, the actor has no parent.
fn resolve_parents(mut drafts: Vec<ParentDraft>) -> Vec<Parenting> {
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

/// Look-at targets of a camera, sorted by start time. Between the end of a target and the start of the next one, the camera
/// looks where its rig points.
fn resolve_looks(mut drafts: Vec<(CameraLook, Option<Time>)>) -> Vec<CameraLook> {
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

/// Default near plane of a camera, metres.
const NEAR: f32 = 0.05;

/// The camera of the stage for a draft: its projection and rig.
fn resolve_camera(draft: CameraDraft, notes: &mut Notes) -> Camera {
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
    let lens_is_set = draft.perspective.is_some() || draft.ortho.is_some();
    let mut camera = Camera { projection, near_is_set: draft.near.is_some(), lens_is_set, ..draft.camera };
    camera.looks = resolve_looks(draft.looks);
    let has_placement =
        draft.position.is_some() || draft.look_at.is_some() || draft.rotation != DQuat::IDENTITY;
    let has_rig = draft.rig.is_some();
    let has_motion_keys = !camera.channels.iter().all(|c| c.property.is_lens());
    let is_fixed = has_placement || !camera.looks.is_empty() || has_motion_keys;
    camera.rig = draft.rig.unwrap_or(if is_fixed {
        // The default position is at eye height, 5 m in front of the origin.
        let position = draft.position.unwrap_or(DVec3::new(0.0, 1.6, 5.0));
        Rig::Fixed { position, rotation: draft.rotation, look_at: draft.look_at }
    } else {
        let [azimuth, elevation] = Rig::FRAME.map(|option| option.default.to_radians());
        Rig::Frame { azimuth, elevation }
    });
    let mut add_error = |text: String| {
        let text = format!("camera \"{}\"{text}", camera.name);
        notes.push((Severity::Error, draft.at.clone(), ApiError::new(text)));
    };
    if let Some(far) = draft.far
        && far <= near
    {
        add_error(format!(": far must be more than near, got {far} and {near}"));
    }
    for field in Camera::FIELDS {
        let has_keys = |property| camera.channels.iter().any(|c: &Channel| c.property == property);
        let missing =
            (field.missing_reason)(&camera).filter(|_| field.keyed.is_some_and(|(_, p)| has_keys(p)));
        missing.into_iter().for_each(|why| add_error(format!(" {why}")));
    }
    if has_rig && has_placement {
        add_error(" cannot both have a position and follow, orbit or frame".into());
    }
    camera
}
