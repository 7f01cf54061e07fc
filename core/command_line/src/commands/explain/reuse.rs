//! Numbers of frames that are drawn, and of frames that reuse the previous one, in the terms of `choreo render`.

use crate::failure::Failure;
use choreo_motion::Time;
use choreo_render::Plan;
use choreo_render::plan::frame_key::Key;
use choreo_stage::Settings;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Time limit for planning. Only the first frames of a scene are counted if it has more than can be planned in this time.
const MAX_PLANNING_TIME: Duration = Duration::from_secs(2);

/// The part of the previous frame that is reused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Reuse {
    Nothing,
    /// The scene is reused, with other 2D layers in front of it.
    Scene,
    Frame,
}

/// Keys of a frame's scene and of the 2D layers in front of it.
type FrameKeys = (Key, Option<Key>);

impl Reuse {
    fn of(previous: Option<&FrameKeys>, now: &FrameKeys) -> Reuse {
        match previous {
            Some(previous) if previous == now => Reuse::Frame,
            Some((scene, _)) if *scene == now.0 => Reuse::Scene,
            _ => Reuse::Nothing,
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Reuse::Nothing => "nothing",
            Reuse::Scene => "scene",
            Reuse::Frame => "frame",
        }
    }
}

/// Numbers of frames, counted from the first one on, in the terms of `choreo render --json`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ReuseCounts {
    /// Number of frames of the scene.
    pub frames: u64,
    /// Number of frames that were planned and compared.
    pub looked_at: u64,
    pub drawn: u64,
    pub repeated: u64,
    pub recomposed: u64,
}

impl ReuseCounts {
    pub(super) fn json(self) -> Value {
        let ReuseCounts { frames, looked_at, drawn, repeated, recomposed } = self;
        json!({
            "frames": frames, "looked_at": looked_at, "drawn": drawn, "reused": repeated + recomposed, "repeated": repeated,
            "recomposed": recomposed,
        })
    }

    pub(super) fn text(self) -> String {
        let ReuseCounts { frames, looked_at, drawn, repeated, recomposed } = self;
        let of = if looked_at < frames { format!("the first {looked_at} of ") } else { String::new() };
        format!(
            "{drawn} of {of}{frames} frames are drawn, {repeated} repeat the one before, {recomposed} reuse \
             only its scene"
        )
    }
}

/// Plans frames and compares them.
pub(super) struct ReuseCounter<P, K> {
    pub plan: P,
    /// Hash of a plan without the 2D layers in front of the scene.
    pub scene_key: K,
}

impl<P: FnMut(Time) -> Result<Plan, Failure>, K: Fn(&Plan) -> Key> ReuseCounter<P, K> {
    fn frame_keys(&self, plan: &Plan) -> FrameKeys {
        ((self.scene_key)(plan), plan.layers_in_front.as_ref().map(|layers| layers.hash))
    }

    /// Compares a frame, whose plan is given, with the previous frame.
    pub(super) fn reuse_at(&mut self, plan: &Plan, at: Time, settings: &Settings) -> Result<Reuse, Failure> {
        let before = at - settings.fps.time_of(1);
        if before < Time::ZERO {
            return Ok(Reuse::Nothing);
        }
        let before = (self.plan)(before)?;
        Ok(Reuse::of(Some(&self.frame_keys(&before)), &self.frame_keys(plan)))
    }

    /// Counts the frames of the scene.
    pub(super) fn count_frames(&mut self, settings: &Settings) -> Result<ReuseCounts, Failure> {
        let frames = settings.fps.frames_in(settings.length).max(1);
        let mut counts = ReuseCounts { frames: frames.unsigned_abs(), ..ReuseCounts::default() };
        let (begun, mut before) = (Instant::now(), None);
        for frame in 0..frames {
            if begun.elapsed() > MAX_PLANNING_TIME {
                break;
            }
            let plan = (self.plan)(settings.fps.time_of(frame))?;
            let now = self.frame_keys(&plan);
            match Reuse::of(before.as_ref(), &now) {
                Reuse::Nothing => counts.drawn += 1,
                Reuse::Scene => counts.recomposed += 1,
                Reuse::Frame => counts.repeated += 1,
            }
            counts.looked_at += 1;
            before = Some(now);
        }
        Ok(counts)
    }
}
