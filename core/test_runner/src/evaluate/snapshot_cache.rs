//! Evaluation of a stage at the times that its expectations need; each snapshot is made once.

use super::judge_error::JudgeError;
use choreo_asset::widen;
use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_render::SceneResources;
use choreo_script::testing::{Expectation, Subject, Timeout, When};
use choreo_stage::{
    ActorState, Attachment, CameraState, Channel, Cut, Evaluator, LightState, Property, Snapshot, Stage,
};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Largest number of evaluations for one expectation: enough for hours of film, and bounds the memory.
pub(super) const MAX_SAMPLES: i64 = 200_000;
/// Largest number of snapshots that are kept for further expectations.
const MAX_CACHED: usize = 4096;

/// Time at which judging a section must end, since a script may request any number of snapshots.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Deadline {
    at: Option<Instant>,
    limit_secs: f64,
    timeout: Option<Timeout>,
}

impl Deadline {
    pub(super) fn after(seconds: f64, timeout: Option<Timeout>) -> Deadline {
        let span = Duration::try_from_secs_f64(seconds).ok();
        Deadline { at: span.and_then(|span| Instant::now().checked_add(span)), limit_secs: seconds, timeout }
    }

    fn check(&self) -> Result<(), JudgeError> {
        self.timeout.map_or(Ok(()), |timeout| timeout.check())?;
        match self.at.is_some_and(|at| Instant::now() > at) {
            true => Err(JudgeError::TooLong(self.limit_secs)),
            false => Ok(()),
        }
    }
}

/// A stage with cached snapshots, for its expectations.
pub(super) struct SnapshotCache<'a> {
    pub stage: Arc<Stage>,
    pub registry: &'a Registry,
    deadline: Deadline,
    evaluator: Evaluator,
    cached: BTreeMap<Time, Arc<Snapshot>>,
    /// Evaluators of copies of the stage in which one camera is active all the time, by the index of that camera.
    camera_evaluators: BTreeMap<usize, Evaluator>,
    /// Evaluators of copies of the stage in which only one light is on, by the index of that light.
    light_evaluators: BTreeMap<usize, Evaluator>,
    resources: Option<Arc<SceneResources>>,
}

impl<'a> SnapshotCache<'a> {
    pub(super) fn new(stage: &Arc<Stage>, registry: &'a Registry, deadline: Deadline) -> SnapshotCache<'a> {
        SnapshotCache {
            stage: stage.clone(),
            registry,
            deadline,
            evaluator: Evaluator::new(stage.clone()),
            cached: BTreeMap::new(),
            camera_evaluators: BTreeMap::new(),
            light_evaluators: BTreeMap::new(),
            resources: None,
        }
    }

    pub(super) fn resources(&mut self) -> Arc<SceneResources> {
        let stage = &self.stage;
        self.resources.get_or_insert_with(|| Arc::new(SceneResources::new(stage))).clone()
    }

    /// Fails once the section's time is used up.
    pub(crate) fn check_deadline(&self) -> Result<(), JudgeError> {
        self.deadline.check()
    }

    /// Snapshot at a time. Fails with the error of a callback and its place.
    pub(super) fn at(&mut self, time: Time) -> Result<Arc<Snapshot>, JudgeError> {
        self.check_deadline()?;
        if let Some(snapshot) = self.cached.get(&time) {
            return Ok(snapshot.clone());
        }
        let snapshot = Arc::new(self.evaluator.at(time)?);
        if self.cached.len() >= MAX_CACHED {
            self.cached.clear();
        }
        self.cached.insert(time, snapshot.clone());
        Ok(snapshot)
    }

    /// State of a camera; `None` stands for the active camera.
    pub(super) fn camera_state(
        &mut self,
        camera: Option<usize>,
        time: Time,
    ) -> Result<CameraState, JudgeError> {
        let Some(camera) = camera else { return Ok(self.at(time)?.camera) };
        let stage = &self.stage;
        let evaluator = self.camera_evaluators.entry(camera).or_insert_with(|| {
            let mut one_camera_stage = (**stage).clone();
            one_camera_stage.cuts = vec![Cut::new(Time(i64::MIN), camera)];
            Evaluator::new(Arc::new(one_camera_stage))
        });
        Ok(evaluator.at(time)?.camera)
    }

    /// State of a light; `None` if it is off.
    pub(super) fn light_state(&mut self, light: usize, time: Time) -> Result<Option<LightState>, JudgeError> {
        let stage = &self.stage;
        let evaluator = self.light_evaluators.entry(light).or_insert_with(|| {
            let mut one_light_stage = (**stage).clone();
            one_light_stage.actors.iter_mut().for_each(|actor| actor.file_lights = false);
            for (_, other) in one_light_stage.lights.iter_mut().enumerate().filter(|(i, _)| *i != light) {
                // Other lights are hidden, not removed: callbacks refer to lights by index.
                other.channels.push(Channel {
                    property: Property::Visible,
                    interpolation: choreo_motion::Interpolation::Step,
                    times: vec![Time::ZERO],
                    values: vec![0.0],
                });
            }
            Evaluator::new(Arc::new(one_light_stage))
        });
        Ok(evaluator.at(time)?.lights.first().copied())
    }

    /// Transform from the subject's space to world space, including scale; NaN if the subject is a hidden actor or a light that is off.
    pub(crate) fn world_from_subject(
        &mut self,
        subject: Subject,
        time: Time,
    ) -> Result<DAffine3, JudgeError> {
        let nowhere = DAffine3 { matrix3: DMat3::IDENTITY, translation: DVec3::NAN };
        Ok(match subject {
            Subject::Actor(actor) => self.world_from_attachment(&Attachment { actor, joint: None }, time)?,
            Subject::Joint { actor, joint } => {
                self.world_from_attachment(&Attachment { actor, joint: Some(joint) }, time)?
            }
            Subject::Camera(camera) => self.camera_state(Some(camera), time)?.world_from_view,
            Subject::Light(light) => match self.light_state(light, time)? {
                Some(state) => {
                    let back = -state.direction.as_dvec3();
                    let right = back.any_orthonormal_vector();
                    DAffine3 {
                        matrix3: DMat3::from_cols(right, back.cross(right), back),
                        translation: state.position,
                    }
                }
                None => nowhere,
            },
        })
    }

    pub(super) fn world_from_attachment(
        &mut self,
        at: &Attachment,
        time: Time,
    ) -> Result<DAffine3, JudgeError> {
        let snapshot = self.at(time)?;
        let nowhere = DAffine3 { matrix3: DMat3::IDENTITY, translation: DVec3::NAN };
        let Some(state) = snapshot.actors.get(at.actor) else { return Ok(nowhere) };
        Ok(match at.joint {
            None => state.world_from_model,
            Some(joint) => model_from_joint(state, joint).map_or(nowhere, |m| state.world_from_model * m),
        })
    }

    /// Times at which an expectation is evaluated.
    pub(super) fn times(&self, e: &Expectation) -> Result<Vec<Time>, JudgeError> {
        let settings = &self.stage.settings;
        let (from, until) = match e.when {
            When::At(time) => return Ok(vec![time]),
            When::Always => (Time::ZERO, None),
            When::During(from, until) => (from, Some(until)),
        };
        let times: Vec<Time> = match (e.step, until) {
            (Some(step), until) => {
                let until = until.unwrap_or(settings.length);
                let count = (until.0.saturating_sub(from.0) / step.0.max(1)).max(0);
                check_count(count)?;
                (0..=count).map(|k| Time(from.0 + k * step.0)).collect()
            }
            (None, None) => {
                let frames = settings.fps.frames_in(settings.length).max(1);
                check_count(frames)?;
                (0..frames).map(|k| settings.fps.time_of(k)).collect()
            }
            (None, Some(until)) => {
                let rate = settings.fps;
                let frame_at = |t: Time| (t.as_secs() * rate.as_fps()).floor() as i64;
                let (first, last) = (frame_at(from) - 1, frame_at(until) + 1);
                check_count(last.saturating_sub(first))?;
                let inside = |t: &Time| (from..=until).contains(t);
                (first..=last).map(|k| rate.time_of(k)).filter(inside).collect()
            }
        };
        Ok(times)
    }

    /// Times as in [`SnapshotCache::times`], and the ends of a span even if they lie between two frames.
    pub(crate) fn times_and_ends(&self, e: &Expectation) -> Result<Vec<Time>, JudgeError> {
        let mut times = self.times(e)?;
        if let When::During(from, until) = e.when {
            if times.first() != Some(&from) {
                times.insert(0, from);
            }
            if times.last() != Some(&until) {
                times.push(until);
            }
        }
        Ok(times)
    }

    /// Time between two evaluations.
    pub(super) fn step(&self, e: &Expectation) -> Time {
        e.step.unwrap_or_else(|| self.stage.settings.fps.time_of(1))
    }
}

fn check_count(count: i64) -> Result<(), JudgeError> {
    match count > MAX_SAMPLES {
        true => Err(JudgeError::TooManySnapshots(count)),
        false => Ok(()),
    }
}

fn model_from_joint(state: &ActorState, joint: u32) -> Option<DAffine3> {
    state.model_from_joint.get(joint as usize).map(widen)
}

/// Rotation of a matrix that includes scale: keeps the +z axis, then +y as well as possible. For a mirrored matrix, x is flipped.
pub(super) fn rotation_of(m: &DMat3) -> DQuat {
    let z = m.z_axis.try_normalize().unwrap_or(DVec3::Z);
    let x = m.y_axis.cross(z).try_normalize().unwrap_or_else(|| z.any_orthonormal_vector());
    DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize()
}

/// Angle in degrees between two rotations, 0..=180; q and −q are the same rotation.
pub(crate) fn angle_deg(a: DQuat, b: DQuat) -> f64 {
    let between = a.conjugate() * b;
    let sine = DVec3::new(between.x, between.y, between.z).length();
    (2.0 * libm::atan2(sine, between.w.abs())).to_degrees()
}
