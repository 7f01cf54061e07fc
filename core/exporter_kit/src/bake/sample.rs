//! Adaptive sampling of a scene: denser where linear interpolation between samples is too far from it.
//!
//! The first samples are at all frames and where something is known to begin or end. Then the middle of each interval is compared with the
//! interpolation of its ends, and the interval is halved until both are near enough; a jump is halved down to a tick.

use crate::bake::keys;
use crate::bake::rig::{self, STRIDE, Spaces};
use crate::bake::signals::{self, Quantity, Signal};
use crate::parallel::in_parallel;
use choreo_plugin::ExportedScene;
use choreo_plugin::motion::Time;
use choreo_plugin::stage::{Camera, Evaluator, Property, Rig, Snapshot, Stage, StageError};
use std::sync::Arc;

/// An actor whose rig is sampled.
#[derive(Clone, Copy, Debug)]
pub(super) struct SampledActor {
    pub actor: usize,
    /// The joints are sampled as well, not only the actor's transform.
    pub pose: bool,
    /// Index of its first number in a row.
    pub offset: usize,
    pub joints: usize,
    /// Distance of its farthest vertex in rest pose, metres.
    pub reach: f32,
}

pub(crate) struct Row {
    pub time: Time,
    pub values: Vec<f32>,
}

pub(super) struct Sampler<'a> {
    stage: &'a Stage,
    evaluator: Evaluator,
    pub signals: Vec<Signal>,
    pub actors: Vec<SampledActor>,
    /// Largest error of a joint in the middle between samples, metres.
    tolerance: f32,
}

/// Samples a part of the timeline.
struct Worker<'s> {
    sampler: &'s Sampler<'s>,
    evaluator: Evaluator,
    snapshot: Snapshot,
    spaces: Spaces,
}

/// Number of parts in which the timeline is sampled: more than cores, because some parts take longer than others.
const PARTS: usize = 32;

/// Largest number of clip keys per frame; with more, clip keys are no first times of samples.
const MAX_KEYS_PER_FRAME: usize = 8;

/// Largest number of samples between two of the first ones; one jump takes 24. Faster changes are not followed, and count as error.
const MAX_ADDED_SAMPLES: usize = 128;

impl<'a> Sampler<'a> {
    pub(super) fn new(
        stage: &'a Arc<Stage>,
        signals: Vec<Signal>,
        actors: Vec<SampledActor>,
        tolerance: f32,
    ) -> Sampler<'a> {
        let evaluator = match stage_without_others(stage, &signals, &actors) {
            Some(fewer) => Evaluator::new(Arc::new(fewer)),
            None => Evaluator::new(stage.clone()).posing_hidden(),
        };
        Sampler { stage, evaluator, signals, actors, tolerance }
    }

    /// Count of numbers in a row.
    pub(super) fn width(signals: &[Signal], actors: &[SampledActor]) -> usize {
        let of_signals = signals.last().map_or(0, |last| last.offset + last.width);
        actors.last().map_or(of_signals, |last| last.offset + last.joints * STRIDE)
    }

    /// Rows at these times, which increase, and between them where needed. Parts of the timeline are sampled on all cores: the rows between
    /// two of the times depend on nothing else.
    pub(super) fn rows(&self, times: &[Time]) -> Result<Vec<Row>, StageError> {
        let last = times.len().saturating_sub(1);
        let step = last.div_ceil(PARTS).max(1);
        let parts: Vec<&[Time]> =
            (0..last.max(1)).step_by(step).map(|from| &times[from..=(from + step).min(last)]).collect();
        let mut out: Vec<Row> = Vec::with_capacity(2 * times.len());
        for rows in in_parallel(&parts, |times| self.worker().rows(times)) {
            // The last row of a part is the first one of the next.
            out.pop();
            out.extend(rows?);
        }
        Ok(out)
    }

    fn worker(&self) -> Worker<'_> {
        let (evaluator, snapshot) = (self.evaluator.clone(), Snapshot::default());
        Worker { sampler: self, evaluator, snapshot, spaces: Spaces::default() }
    }
}

impl Worker<'_> {
    fn row(&mut self, time: Time) -> Result<Row, StageError> {
        let Worker { sampler, evaluator, snapshot, .. } = self;
        evaluator.at_into(time, snapshot)?;
        let mut values = Vec::with_capacity(Sampler::width(&sampler.signals, &sampler.actors));
        let lights = evaluator.stage_lights(snapshot);
        signals::append(sampler.stage, &sampler.signals, snapshot, &lights, &mut values);
        for sampled in &sampler.actors {
            let (actor, state) = (&sampler.stage.actors[sampled.actor], &snapshot.actors[sampled.actor]);
            rig::append(actor, state, sampled.pose, &mut values);
        }
        Ok(Row { time, values })
    }

    /// Rows at these times, and between them where needed.
    fn rows(&mut self, times: &[Time]) -> Result<Vec<Row>, StageError> {
        let mut out: Vec<Row> = Vec::with_capacity(2 * times.len());
        for time in times {
            let next = self.row(*time)?;
            if let Some(last) = out.pop() {
                out.extend(self.refined(last, next)?);
            } else {
                out.push(next);
            }
        }
        Ok(out)
    }

    /// The rows of an interval. The part with the largest error is halved first, so that noise in one part does not use up the samples for
    /// a jump in another.
    fn refined(&mut self, start: Row, end: Row) -> Result<Vec<Row>, StageError> {
        let mut done = vec![start, end];
        let mut parts: Vec<Interval> = Vec::new();
        let mut left = MAX_ADDED_SAMPLES;
        parts.extend(self.interval(&done[0], &done[1])?);
        while left > 0 {
            left -= 1;
            // Few intervals are open at a time, so they are searched one by one.
            let worst = (0..parts.len()).max_by(|a, b| parts[*a].error.total_cmp(&parts[*b].error));
            let Some(worst) = worst.filter(|worst| parts[*worst].error > 1.0) else { break };
            let Interval { middle, .. } = parts.swap_remove(worst);
            let place = done.partition_point(|row| row.time < middle.time);
            done.insert(place, middle);
            parts.extend(self.interval(&done[place - 1], &done[place])?);
            parts.extend(self.interval(&done[place], &done[place + 1])?);
        }
        Ok(done)
    }

    /// The row halfway between two rows, and its error; `None` if they are one tick apart.
    fn interval(&mut self, a: &Row, b: &Row) -> Result<Option<Interval>, StageError> {
        if (b.time - a.time).0 <= 1 {
            return Ok(None);
        }
        let middle = self.row(a.time.middle(b.time))?;
        let error = self.error(a, b, &middle);
        Ok(Some(Interval { middle, error }))
    }

    /// Error of linear interpolation in the middle of two rows, as a multiple of the allowed error.
    fn error(&mut self, a: &Row, b: &Row, middle: &Row) -> f32 {
        let t = middle.time.fraction(a.time, b.time);
        let (mut value, mut worst) = (Vec::new(), 0.0f32);
        for signal in &self.sampler.signals {
            let [a, b, truth] = [a, b, middle].map(|row| &row.values[signal.offset..][..signal.width]);
            value.resize(signal.width, 0.0);
            signal.interpolate(a, b, t, &mut value);
            worst = worst.max(signal.error(&value, truth));
        }
        for sampled in &self.sampler.actors {
            let rows = [a, b, middle].map(|row| &row.values[sampled.offset..][..sampled.joints * STRIDE]);
            let parents = self.sampler.stage.actors[sampled.actor].asset.skeleton.parents();
            // Far from the origin, f32 cannot place anything more accurately.
            let far = rows[2][..3].iter().fold(0.0f32, |most, v| most.max(v.abs()));
            let allowed = self.sampler.tolerance.max(far * 4.0 * f32::EPSILON);
            worst = worst.max(rig::max_distance(parents, rows, t, sampled.reach, &mut self.spaces) / allowed);
        }
        worst
    }
}

/// A part of the timeline between two rows.
struct Interval {
    middle: Row,
    /// Error of linear interpolation in the middle, as a multiple of the allowed error.
    error: f32,
}

/// The stage with all actors hidden that are neither sampled nor parents of anything, so that they are not posed. `None` if hiding them
/// could change the rest: with callbacks, without cameras, or with a camera that frames all visible actors.
fn stage_without_others(stage: &Stage, signals: &[Signal], sampled: &[SampledActor]) -> Option<Stage> {
    let frames = |camera: &Camera| matches!(camera.rig, Rig::Frame { .. });
    if !stage.frame_callbacks.is_empty() || stage.cameras.is_empty() || stage.cameras.iter().any(frames) {
        return None;
    }
    let parents = stage.actors.iter().flat_map(|a| &a.parents).filter_map(|p| p.to);
    let mut kept: Vec<usize> = parents.map(|to| to.actor).collect();
    kept.extend(stage.lights.iter().filter_map(|l| l.parent).map(|to| to.actor));
    kept.extend(sampled.iter().map(|s| s.actor));
    kept.extend(signals.iter().filter_map(|s| match s.quantity {
        Quantity::Material { actor, .. } | Quantity::Weights { actor, .. } => Some(actor),
        Quantity::Camera { .. } | Quantity::Light { .. } => None,
    }));
    let mut fewer = stage.clone();
    for (_, actor) in fewer.actors.iter_mut().enumerate().filter(|(index, _)| !kept.contains(index)) {
        actor.visible = false;
        actor.channels.retain(|channel| channel.property != Property::Visible);
    }
    Some(fewer)
}

/// First times of samples, increasing, from `start` to `end`: times at which something begins, ends or jumps, each with the tick before it;
/// the frames; and the keys of the clips of the `posed` actors, where the slope of curves jumps.
pub(crate) fn first_times(scene: &ExportedScene, start: Time, end: Time, posed: &[usize]) -> Vec<Time> {
    let stage = &scene.stage;
    let mut jumps: Vec<Time> = stage.cuts.iter().map(|cut| cut.at).collect();
    let mut out: Vec<Time> = Vec::new();
    for actor in posed {
        keys::add_key_times(&stage.actors[*actor], start, end, &mut out);
        out.sort_unstable();
        out.dedup();
        // Clips with that many keys are nearly smooth.
        if out.len() > MAX_KEYS_PER_FRAME * scene.times.len() {
            out.clear();
            break;
        }
    }
    for cut in &stage.cuts {
        out.push(cut.at + cut.dissolve);
    }
    for actor in &stage.actors {
        for cue in actor.layers.iter().flat_map(|layer| &layer.cues) {
            jumps.extend([cue.start].into_iter().chain(cue.end));
            out.push(cue.start + cue.fade_in);
            out.extend(cue.end.map(|end| end - cue.fade_out));
        }
        for parent in &actor.parents {
            jumps.push(parent.start);
            out.push(parent.start + parent.blend);
        }
        for look in &actor.look_at {
            out.extend([look.start, look.start + look.fade].into_iter().chain(look.end));
            out.extend(look.end.map(|end| end - look.fade));
        }
        out.extend(actor.channels.iter().flat_map(|channel| &channel.times));
    }
    out.extend(stage.cameras.iter().flat_map(|c| &c.channels).flat_map(|channel| &channel.times));
    out.extend(stage.lights.iter().flat_map(|l| &l.channels).flat_map(|channel| &channel.times));
    out.extend(jumps.iter().flat_map(|jump| [*jump - Time(1), *jump]));
    out.extend([start, end]);
    out.sort_unstable();
    // Some players merge keys that are less than a hundredth of a frame apart.
    let near = Time(scene.fps.time_of(1).0 / 64);
    let is_alone = |frame: &&Time| {
        let next = out.partition_point(|time| time < *frame);
        let before = next.checked_sub(1).and_then(|i| out.get(i)).is_none_or(|time| **frame - *time > near);
        before && out.get(next).is_none_or(|time| *time - **frame > near)
    };
    let frames: Vec<Time> = scene.times.iter().filter(is_alone).copied().collect();
    out.extend(frames);
    out.retain(|time| start <= *time && *time <= end);
    out.sort_unstable();
    out.dedup();
    out
}
