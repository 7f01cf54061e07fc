//! The clips. Each is a function from time to [`Pose`], sampled at 30 Hz into curves.

mod calm;
mod dance;
mod gait;
mod gestures;

use crate::pose::{Pose, joint_rotations};
use crate::rig::{self, Joint};
use choreo_motion::{Clip, ClipError, Curve, Interpolation, Path, Time};
use glam::Quat;
use std::sync::Arc;

/// A looping movement: its last pose equals its first.
pub(crate) struct Movement {
    pub name: &'static str,
    pub duration_secs: f32,
    pub pose: fn(f32) -> Pose,
}

pub(crate) const KEYS_PER_SECOND: f32 = 30.0;

pub(crate) fn movements() -> Vec<Movement> {
    let at = |name, duration_secs, pose| Movement { name, duration_secs, pose };
    vec![
        at("Idle", 6.0, calm::idle),
        at("Walk", gait::WALK.period, gait::walk),
        at("Run", gait::RUN.period, gait::run),
        at("Wave", 3.0, gestures::wave),
        at("Dance_Groove", 8.0, dance::groove),
        at("Dance_Spin", 3.0, dance::spin),
        at("Bow", 3.5, gestures::bow),
        at("Jump", 1.8, gestures::jump),
    ]
}

fn curve(joint: usize, path: Path, times: &Arc<[Time]>, keys: Vec<Vec<f32>>) -> Curve {
    // A constant joint needs only one key, which still overrides other layers.
    let still = keys.iter().all(|k| k.iter().zip(&keys[0]).all(|(a, b)| (a - b).abs() < 1e-6));
    let (times, keys) = if still { (times[..1].into(), &keys[..1]) } else { (times.clone(), &keys[..]) };
    Curve {
        joint: joint as u32,
        path,
        interpolation: Interpolation::Linear,
        times,
        values: keys.concat().into(),
    }
}

pub(crate) fn clip(movement: &Movement, joints: &[Joint], scale: f32) -> Result<Clip, ClipError> {
    let intervals = (movement.duration_secs * KEYS_PER_SECOND).round() as usize;
    let mut times = Vec::new();
    let mut hips = Vec::new();
    let mut turns: Vec<Vec<Quat>> = vec![Vec::new(); joints.len()];
    for i in 0..=intervals {
        let secs = movement.duration_secs * i as f32 / intervals as f32;
        times.push(Time::from_secs(f64::from(secs)));
        // The last key copies the first, so that no rounding shows at the loop point.
        let secs = if i == intervals { 0.0 } else { secs };
        let authored = (movement.pose)(secs).solve(joints);
        hips.push((authored.hips * scale).to_array().to_vec());
        for (list, q) in turns.iter_mut().zip(joint_rotations(joints, &authored)) {
            let near = list.last().is_none_or(|last: &Quat| last.dot(q) >= 0.0);
            list.push(if near { q } else { -q });
        }
    }
    let times: Arc<[Time]> = times.into();
    let mut curves = vec![curve(rig::HIPS, Path::Translation, &times, hips)];
    for (joint, list) in turns.into_iter().enumerate() {
        let keys = list.into_iter().map(|q| q.to_array().to_vec()).collect();
        curves.push(curve(joint, Path::Rotation, &times, keys));
    }
    Clip::new(movement.name.into(), joints.len(), curves)
}
