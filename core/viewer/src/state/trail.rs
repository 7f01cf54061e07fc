//! Positions of an actor's joints at all frames, for motion trails and onion skins. Computed on a thread of its own, because the scene is evaluated
//! once per frame.

use choreo_motion::Time;
use choreo_session::Scene;
use glam::DVec3;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Largest number of frames; longer scenes are sampled less densely.
const MAX_FRAMES: i64 = 600;

/// A selected joint of an actor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointRef {
    pub actor: String,
    pub joint: usize,
}

/// Positions of an actor's joints over time, world space.
#[derive(Clone, Debug, Default)]
pub struct Trail {
    /// Times with the positions of all joints, in order of time. No positions while the actor is invisible.
    pub frames: Vec<(Time, Vec<DVec3>)>,
}

impl Trail {
    /// Index of the frame nearest to a time.
    pub fn nearest_frame(&self, time: Time) -> Option<usize> {
        let after = self.frames.partition_point(|(at, _)| *at < time);
        let before = after.saturating_sub(1);
        let distance = |index: &usize| (self.frames[*index].0 - time).0.abs();
        [before, after].into_iter().filter(|index| *index < self.frames.len()).min_by_key(distance)
    }
}

/// The trail of one actor in one version of the scene, once it is computed.
#[derive(Default)]
pub struct Trails {
    /// Number of the scene version, and name of the actor.
    target: Option<(u64, String)>,
    result: Arc<Mutex<Option<Arc<Trail>>>>,
    stop: Arc<AtomicBool>,
}

impl Trails {
    /// The trail of an actor. `None` until it is computed; then `changed` is called.
    pub fn of(
        &mut self,
        scene: &Arc<Scene>,
        actor: &str,
        changed: impl FnOnce() + Send + 'static,
    ) -> Option<Arc<Trail>> {
        let wanted = (scene.number, actor.to_string());
        if self.target.as_ref() != Some(&wanted) {
            self.stop.store(true, Ordering::Relaxed);
            *self = Trails::default();
            self.target = Some(wanted);
            let (scene, actor) = (scene.clone(), actor.to_string());
            let (found, stop) = (self.result.clone(), self.stop.clone());
            let thread = std::thread::Builder::new().name("trail".into());
            // If no thread can be started, there is no trail.
            let _ = thread.spawn(move || {
                if let Some(trail) = compute_trail(&scene, &actor, &stop) {
                    *found.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::new(trail));
                    changed();
                }
            });
        }
        self.result.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for Trails {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn compute_trail(scene: &Scene, actor: &str, stop: &AtomicBool) -> Option<Trail> {
    let index = scene.stage.actors.iter().position(|a| a.name == actor)?;
    let settings = &scene.stage.settings;
    let frames = settings.fps.frames_in(settings.length).max(1);
    let step = ((frames + MAX_FRAMES - 1) / MAX_FRAMES).max(1);
    let mut evaluator = scene.evaluator.clone().posing_hidden();
    let mut trail = Trail::default();
    for frame in (0..frames).step_by(step as usize) {
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let time = settings.fps.time_of(frame);
        let snapshot = evaluator.at(time).ok()?;
        let state = snapshot.actors.get(index)?;
        let place = |m: &glam::Affine3A| state.world_from_model.transform_point3(m.translation.as_dvec3());
        let joints = match state.visible {
            true => state.model_from_joint.iter().map(place).collect(),
            false => Vec::new(),
        };
        trail.frames.push((time, joints));
    }
    Some(trail)
}
