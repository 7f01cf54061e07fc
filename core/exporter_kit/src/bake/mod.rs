//! A scene over time as curves (decision 61): clips that play unchanged keep their own keys, everything else is sampled and reduced.

pub mod check;
mod keys;
mod reduce;
pub mod rig;
mod sample;
pub mod shots;
pub mod signals;
pub mod tracks;

pub use reduce::Series;

use crate::bake::rig::STRIDE;
use crate::bake::sample::{SampledActor, Sampler};
use crate::bake::shots::Shot;
use crate::bake::signals::{CameraPart, Quantity, Signal};
use crate::bake::tracks::{TrackSet, Values};
use crate::parallel::in_parallel;
use choreo_plugin::motion::{Interpolation, Path, Time, Transform};
use choreo_plugin::stage::{Actor, LightState, Property, Snapshot, Stage, StageError};
use choreo_plugin::{ExportedScene, glam};
use std::collections::BTreeMap;

/// Largest count of numbers in the rows of samples together; scenes with more are sampled in parts.
const MAX_NUMBERS: usize = 32 << 20;

pub struct Baked<'a> {
    pub start: Time,
    pub end: Time,
    /// The scene at the start, with the stage's own lights.
    pub first: Snapshot,
    pub lights: Vec<Option<LightState>>,
    pub sets: Vec<TrackSet<'a>>,
    /// One per actor.
    pub motions: Vec<Motion>,
    /// Signals except those of cameras; one that never changes has a single key.
    pub series: Vec<(Signal, Series)>,
    pub shots: Vec<Shot>,
}

#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// Indices into [`Baked::sets`]: keys of clips, and sampled curves.
    pub sets: Vec<usize>,
    /// The actor is never visible.
    pub hidden: bool,
}

/// The curves that a format can hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Each curve has key times and an interpolation of its own; splines are kept.
    Separate,
    /// All joints of an actor have values at the same times, with straight lines between.
    Common,
}

/// The part of an actor that must be sampled.
#[derive(Clone, Copy, PartialEq)]
enum SampledPart {
    Nothing,
    Transform,
    Pose,
}

/// Bakes a scene to curves. `tolerance`: largest error of a joint, metres.
///
/// # Errors
/// The stage cannot be evaluated at a time.
pub fn bake<'a>(scene: &'a ExportedScene, tolerance: f64, style: Style) -> Result<Baked<'a>, StageError> {
    let stage = &scene.stage;
    let (start, end) = span(scene);
    let mut evaluator = choreo_plugin::stage::Evaluator::new(stage.clone()).posing_hidden();
    let first = evaluator.at(start)?;
    let lights = evaluator.stage_lights(&first);
    drop(evaluator);
    let mut baked = Baked {
        start,
        end,
        first,
        lights,
        sets: Vec::new(),
        motions: vec![Motion::default(); stage.actors.len()],
        series: Vec::new(),
        shots: shots::of_stage(stage, start, end),
    };
    let needs = bake_clip_keys(stage, style, &mut baked);
    // Half of the tolerance is for errors between samples, half for keys that are removed.
    let signals = signals::of_stage(stage, tolerance as f32 * 0.5, |actor| needs[actor] == SampledPart::Pose);
    sample(scene, &needs, signals, (tolerance, style), &mut baked)?;
    shots::place_still(scene, &mut baked)?;
    Ok(baked)
}

/// Start and end of the export: the time of the first frame, and the time of the last frame or, if no frame of the stage follows, the end
/// of the stage.
fn span(scene: &ExportedScene) -> (Time, Time) {
    let first = scene.times.first().copied().unwrap_or(Time::ZERO);
    let last = scene.times.last().copied().unwrap_or(first);
    let whole = last + scene.fps.time_of(1) >= scene.stage.settings.length;
    (first, if whole { scene.stage.settings.length.max(last) } else { last })
}

/// Takes the keys of clips that play unchanged. Returns the part of each actor that remains to be sampled.
fn bake_clip_keys<'a>(stage: &'a Stage, style: Style, baked: &mut Baked<'a>) -> Vec<SampledPart> {
    let mut known: BTreeMap<Vec<u64>, Option<usize>> = BTreeMap::new();
    let mut needs = Vec::with_capacity(stage.actors.len());
    for (index, actor) in stage.actors.iter().enumerate() {
        if !keys::plays_unchanged(stage, actor) {
            needs.push(SampledPart::Pose);
            continue;
        }
        let (sets, start, end) = (&mut baked.sets, baked.start, baked.end);
        let set = *known.entry(keys::identity(actor)).or_insert_with(|| {
            let (times, tracks, still, keys) = keys::keys(actor, start, end)?;
            if style == Style::Common && tracks.iter().any(|t| t.interpolation == Interpolation::CubicSpline)
            {
                return None;
            }
            sets.push(TrackSet { times, tracks, still, values: Values::Keys(keys) });
            Some(sets.len() - 1)
        });
        baked.motions[index].sets.extend(set);
        baked.motions[index].hidden = !baked.first.actors[index].visible;
        needs.push(match (set, has_constant_transform(stage, actor)) {
            (None, _) => SampledPart::Pose,
            (_, true) => SampledPart::Nothing,
            (_, false) => SampledPart::Transform,
        });
    }
    needs
}

fn has_constant_transform(stage: &Stage, actor: &Actor) -> bool {
    let moves = |p: Property| {
        matches!(p, Property::Translation | Property::Rotation | Property::Scale | Property::Visible)
    };
    stage.frame_callbacks.is_empty()
        && actor.parents.is_empty()
        && actor.face.is_none()
        && actor.path_following.is_none()
        && !actor.channels.iter().any(|c| moves(c.property))
}

/// Samples the actors and signals that need it, in parts that fit into memory.
fn sample(
    scene: &ExportedScene,
    needs: &[SampledPart],
    mut signals: Vec<Signal>,
    (tolerance, style): (f64, Style),
    baked: &mut Baked<'_>,
) -> Result<(), StageError> {
    let stage = &scene.stage;
    let posed: Vec<usize> = (0..needs.len()).filter(|a| needs[*a] == SampledPart::Pose).collect();
    let times = sample::first_times(scene, baked.start, baked.end, &posed);
    let most = (MAX_NUMBERS / (4 * times.len())).max(1);
    let mut left: Vec<usize> = (0..needs.len()).filter(|a| needs[*a] != SampledPart::Nothing).collect();
    left.reverse();
    while !left.is_empty() || !signals.is_empty() {
        let mut actors: Vec<SampledActor> = Vec::new();
        while let Some(actor) = left.last().copied().filter(|_| Sampler::width(&signals, &actors) < most) {
            left.pop();
            let asset = &stage.actors[actor].asset;
            let pose = needs[actor] == SampledPart::Pose;
            let joints = if pose { asset.skeleton.len() + 1 } else { 1 };
            let offset = Sampler::width(&signals, &actors);
            let bounds = asset.spread(&asset.rest_bounds());
            let reach = bounds.min.abs().max(bounds.max.abs()).length();
            let reach = if reach.is_finite() { reach } else { 1.0 };
            actors.push(SampledActor { actor, pose, offset, joints, reach });
        }
        let sampler = Sampler::new(stage, std::mem::take(&mut signals), actors, tolerance as f32 * 0.5);
        let rows = sampler.rows(&times)?;
        let is_camera = |s: &&Signal| matches!(s.quantity, Quantity::Camera { .. });
        let all: Vec<&sample::Row> = rows.iter().collect();
        let others = sampler.signals.iter().filter(|s| !is_camera(s));
        baked.series.extend(others.map(|signal| (*signal, reduce::series(signal, &all))));
        shots::take_moves(&sampler.signals, &rows, &mut baked.shots);
        let tracks = in_parallel(&sampler.actors, |sampled| {
            let mut sizes = rows.iter().map(|row| &row.values[sampled.offset + 7..][..3]);
            let seen = sizes.any(|size| *size != [0.0; 3]);
            let actor = &stage.actors[sampled.actor];
            let reduced = match style {
                Style::Separate => reduce::actor_tracks,
                Style::Common => reduce::common_tracks,
            };
            seen.then(|| reduced(actor, sampled, &rows, tolerance * 0.5))
        });
        for (sampled, tracks) in sampler.actors.iter().zip(tracks) {
            let motion = &mut baked.motions[sampled.actor];
            motion.hidden = tracks.is_none();
            if let Some(tracks) = tracks {
                motion.sets.push(baked.sets.len());
                baked.sets.push(tracks);
            }
        }
    }
    Ok(())
}

impl Baked<'_> {
    /// Local transforms of an actor's rig where no curve moves it: the actor as placed at the start, joints at rest, and the constant
    /// values of its sets.
    pub fn still_rig(&self, actor: &Actor, index: usize) -> Vec<Transform> {
        let state = &self.first.actors[index];
        let mut rows = Vec::with_capacity(STRIDE);
        rig::append(actor, state, false, &mut rows);
        let mut out = vec![rig::transform(&rows)];
        out.extend_from_slice(actor.asset.skeleton.rest());
        for set in &self.motions[index].sets {
            for (joint, path, value) in &self.sets[*set].still {
                let Some(t) = out.get_mut(*joint as usize) else { continue };
                // Differences from the rest pose within rounding are ignored.
                let near = |rest: &[f32]| rest.iter().zip(value).all(|(a, b)| (a - b).abs() <= 1e-6);
                match path {
                    Path::Translation if !near(&t.translation.to_array()) => {
                        t.translation = glam::Vec3::from_slice(value);
                    }
                    Path::Rotation if !near(&t.rotation.to_array()) => {
                        t.rotation = glam::Quat::from_slice(value)
                    }
                    Path::Scale if !near(&t.scale.to_array()) => t.scale = glam::Vec3::from_slice(value),
                    _ => {}
                }
            }
        }
        out
    }

    /// The series of a quantity that was sampled; `None` if it was not.
    pub fn series_of(&self, quantity: Quantity) -> Option<&Series> {
        self.series.iter().find(|(signal, _)| signal.quantity == quantity).map(|(_, series)| series)
    }
}

/// The parts of a camera's signals.
pub(crate) const CAMERA_PARTS: [CameraPart; 3] =
    [CameraPart::Position, CameraPart::Rotation, CameraPart::Lens];
