//! Warnings of every run about things that are valid but probably not intended. Each warning has a rule; the comment
//! `// allow: RULE` silences it.

use crate::api_error::{ApiError, Place};
use crate::build::{ActorDraft, LoadDraft, StageDraft};
use crate::cue_times::times_of_cues;
use crate::diagnostic::Severity;
use choreo_motion::Time;
use choreo_stage::{Cut, Repeat};
use std::sync::Arc;

/// Adds warnings about the drafts to `notes`, before they are resolved to a stage.
pub(crate) fn check_drafts(stage_draft: &StageDraft, notes: &mut Vec<(Severity, Place, ApiError)>) {
    let mut warn = |rule: &'static str, place: &Place, text: String| {
        notes.push((Severity::Warning, place.clone(), ApiError { rule, ..ApiError::new(text) }));
    };
    warn_about_cues(stage_draft, &mut warn);
    warn_about_actors_at_origin(stage_draft, &mut warn);
    for (i, (Cut { at, camera, dissolve }, place)) in stage_draft.cuts.iter().enumerate() {
        let next = stage_draft.cuts.iter().map(|(next, _)| next.at).filter(|next| next > at).min();
        if let Some(next) = next.filter(|next| *next < *at + *dissolve) {
            let text = "this dissolve has not ended at the next cut, at";
            warn("dissolve_cut_off", place, format!("{text} {} s", rounded_secs(next)));
        }
        if *at >= stage_draft.settings.length {
            let end = rounded_secs(stage_draft.settings.length);
            warn(
                "starts_after_end",
                place,
                format!("this cut at {} s comes after the end of the stage, {end} s", rounded_secs(*at)),
            );
        }
        if stage_draft.cuts[..i].iter().any(|(cut, _)| cut.at == *at && cut.camera != *camera) {
            warn(
                "two_cuts",
                place,
                format!("two cameras have a cut at {} s; this one wins", rounded_secs(*at)),
            );
        }
    }
}

/// A time in seconds, rounded to milliseconds for messages.
pub(crate) fn rounded_secs(time: Time) -> f64 {
    libm::round(time.as_secs() * 1000.0) / 1000.0
}

fn warn_about_cues(stage_draft: &StageDraft, warn: &mut impl FnMut(&'static str, &Place, String)) {
    let times = times_of_cues(stage_draft);
    // A pose that is held for less than a frame is not visible; clip lengths are often not whole milliseconds.
    let frame = stage_draft.settings.fps.time_of(1);
    for (id, draft) in stage_draft.cues.iter().enumerate() {
        let name = &draft.cue.clip.name;
        let (start, end) = times[id];
        let length = draft.length();
        let chain = &stage_draft.chains[draft.chain];
        let repeat = draft.repeat_mode(chain.is_layer());
        if let (Repeat::Once, Some(until)) = (repeat, draft.until)
            && until - start >= length + frame
            && length > Time::ZERO
        {
            let text = format!(
                "clip \"{name}\" is played once and takes {} s, but its cue lasts {} s: the last pose is held",
                rounded_secs(length),
                rounded_secs(until - start)
            );
            warn("pose_held", &draft.at, text);
        }
        if let Some(end) = end
            && draft.cue.fade_in > end - start
            && end > start
        {
            let text = format!(
                "clip \"{name}\" fades in over {} s, but its cue lasts {} s: it never reaches full weight",
                rounded_secs(draft.cue.fade_in),
                rounded_secs(end - start)
            );
            warn("fade_longer_than_cue", &draft.at, text);
        }
        if let Some(end) = end
            && draft.cue.inertialization > end - start
            && end > start
            && !draft.has_successor
        {
            let text = format!(
                "clip \"{name}\" takes {} s for the transition from the pose before it, but its cue lasts {} s",
                rounded_secs(draft.cue.inertialization),
                rounded_secs(end - start)
            );
            warn("inertia_longer_than_cue", &draft.at, text);
        }
        if start >= stage_draft.settings.length {
            let end = rounded_secs(stage_draft.settings.length);
            let text = format!(
                "clip \"{name}\" starts at {} s, after the end of the stage, {end} s",
                rounded_secs(start)
            );
            warn("starts_after_end", &draft.at, text);
        }
        if draft.cue.clip.duration == Time::ZERO {
            warn("no_length", &draft.at, format!("clip \"{name}\" has no length: it is a pose"));
        }
    }
    warn_about_restarts(stage_draft, &times, warn);
    // Two chains on the base layer of an actor that begin at the same time: the later one hides the earlier.
    let mut cue_by_start: std::collections::BTreeMap<(usize, Time), usize> =
        std::collections::BTreeMap::new();
    for (id, draft) in stage_draft.cues.iter().enumerate() {
        let chain = &stage_draft.chains[draft.chain];
        if chain.is_layer() {
            continue;
        }
        let first = cue_by_start.insert((chain.actor, times[id].0), id);
        // While the later one fades in, the earlier one is visible.
        if let Some(first) = first.filter(|_| draft.cue.fade_in == Time::ZERO) {
            let hidden = &stage_draft.cues[first];
            let text = format!(
                "clip \"{}\" is never seen: \"{}\" starts at the same time, {} s; use .from, or .on(\"Spine..\") for a layer",
                hidden.cue.clip.name,
                draft.cue.clip.name,
                rounded_secs(times[id].0)
            );
            warn("same_start", &hidden.at, text);
        }
    }
}

/// Warns about a trimmed part of a clip that restarts with a jump while the next clip fades in over it, which is probably not
/// intended. (Whole clips are assumed to loop.)
fn warn_about_restarts(
    stage_draft: &StageDraft,
    times: &[(Time, Option<Time>)],
    warn: &mut impl FnMut(&'static str, &Place, String),
) {
    for (id, next) in stage_draft.cues.iter().enumerate() {
        let Some(before) = next.predecessor else { continue };
        let draft = &stage_draft.cues[before];
        let length = draft.length().as_secs();
        let looped = draft.repeat_mode(stage_draft.chains[draft.chain].is_layer()) == Repeat::Loop;
        if draft.trim.is_none() || draft.repeat.is_some() || !looped || length <= 0.0 {
            continue;
        }
        let from = (times[id].0 - times[before].0).as_secs();
        let to = from + next.cue.fade_in.as_secs();
        // Tolerance in seconds: a restart at either end of the fade does not count.
        const SLACK: f64 = 1e-3;
        let restart = libm::ceil((from - SLACK) / length).max(1.0) * length;
        if restart < to - SLACK {
            let text = format!(
                "this part of clip \"{}\" takes {} s and starts over at {} s, while \"{}\" fades in over it; \
                 add .once() to hold its last pose, or .loop() if it is intended",
                draft.cue.clip.name,
                rounded_secs(draft.length()),
                rounded_secs(times[before].0 + Time::from_secs(restart)),
                next.cue.clip.name
            );
            warn("starts_over", &draft.at, text);
        }
    }
}

/// Warns about several actors at the origin, which is probably not intended. A plane shape, a mesh made from arrays and a file
/// that contains only cameras or lights do not count.
fn warn_about_actors_at_origin(
    stage_draft: &StageDraft,
    warn: &mut impl FnMut(&'static str, &Place, String),
) {
    let is_plane = |a: &ActorDraft| a.actor.asset.name == "shape plane";
    // The vertices of a mesh from arrays can contain its position.
    let is_from_arrays = |a: &ActorDraft| {
        let own = |l: &&LoadDraft| l.load.ready().is_some_and(|made| Arc::ptr_eq(made, &a.actor.asset));
        !a.actor.asset.name.starts_with("shape ")
            && stage_draft.loads.iter().any(|l| l.is_procedural && own(&l))
    };
    // A file without meshes is cast for its cameras and lights.
    let has_only_cameras_or_lights = |a: &ActorDraft| {
        let asset = &a.actor.asset;
        asset.instances.is_empty() && !(asset.cameras.is_empty() && asset.lights.is_empty())
    };
    let is_at_origin = |a: &&ActorDraft| {
        !a.is_placed && !is_plane(a) && !is_from_arrays(a) && !has_only_cameras_or_lights(a)
    };
    let at_origin: Vec<_> = stage_draft.actors.iter().filter(is_at_origin).collect();
    if at_origin.len() < 2 {
        return;
    }
    let names: Vec<&str> = at_origin.iter().map(|a| a.actor.name.as_str()).collect();
    let text = format!(
        "{} actors stand in the same place, the origin: {}; place them with .at(x, y, z)",
        names.len(),
        crate::suggest::list(names.iter().copied(), 8)
    );
    warn("same_place", &at_origin[1].at, text);
}
