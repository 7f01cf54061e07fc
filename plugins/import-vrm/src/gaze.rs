//! Gaze of a VRM animation: `VRMC_vrm_animation` 1.0, "LookAt".
//!
//! A node's rotation, relative to the head: yaw about Y, then pitch about the rotated X, then a roll that eyes ignore (extrinsic
//! ZXY). Each character has its own mapping from gaze to eye rotation, so the clip stores the angles, as weights of the four
//! expressions [`GAZE`] that every character with eyes has.

use choreo_asset::{GAZE, eyes};
use choreo_motion::{Clip, ClipError, ExpressionCurve, Interpolation, Path, Pose, Sample, Time};
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// Rotation between two samples, degrees. Interpolated angles then stay within 0.01° of the interpolated rotation.
const STEP_DEGREES: f64 = 2.0;
/// Samples between two keys, at most.
const MAX_STEPS: usize = 128;
const TICKS_A_STEP: i64 = Time::TICKS_PER_SECOND / 60;

/// The four gaze curves; none where the clip does not rotate the joint.
pub(crate) fn curves(clip: &Clip, joint: u32) -> Result<Vec<ExpressionCurve>, ClipError> {
    let turns = clip.curves().iter().find(|c| c.joint == joint && c.path == Path::Rotation);
    let Some(turns) = turns else { return Ok(Vec::new()) };
    let alone = Clip::new(clip.name.clone(), clip.joint_count(), vec![turns.clone()])?;
    let mut pose = Pose::identity(clip.joint_count());
    let mut angles_at = |time: Time| {
        Sample { clip: &alone, time, pose: &mut pose }.run();
        let way = pose.get(joint as usize).rotation.as_dquat() * DVec3::Z;
        let (yaw, pitch) = eyes::angles_of(way);
        (way, yaw, pitch)
    };
    let (mut times, mut angles) = (Vec::new(), Vec::new());
    for (index, &time) in turns.times.iter().enumerate() {
        let now = angles_at(time);
        times.push(time);
        angles.push((now.1, now.2));
        let Some(&next) = turns.times.get(index + 1) else { break };
        let apart = now.0.angle_between(angles_at(next).0).to_degrees();
        let steps = match turns.interpolation {
            Interpolation::Step => 1,
            Interpolation::Linear => (apart / STEP_DEGREES) as usize + 1,
            Interpolation::CubicSpline => {
                next.0.saturating_sub(time.0).max(0) as usize / TICKS_A_STEP as usize + 1
            }
        };
        let steps = steps.clamp(1, MAX_STEPS);
        let long = next.0.saturating_sub(time.0);
        for step in 1..steps as i64 {
            let between = Time(time.0 + long / steps as i64 * step);
            // Keys can be closer than the samples' times in ticks.
            if times.last().is_some_and(|last| *last < between) && between < next {
                let now = angles_at(between);
                times.push(between);
                angles.push((now.1, now.2));
            }
        }
    }
    let interpolation = match turns.interpolation {
        Interpolation::Step => Interpolation::Step,
        Interpolation::Linear | Interpolation::CubicSpline => Interpolation::Linear,
    };
    let times: Arc<[Time]> = times.into();
    let side = |of: fn(&(f64, f64)) -> f64| -> Arc<[f32]> {
        angles.iter().map(|angles| (of(angles).max(0.0) / FRAC_PI_2) as f32).collect()
    };
    let sides = [side(|a| a.0), side(|a| -a.0), side(|a| a.1), side(|a| -a.1)];
    let curve = |(name, values): (&str, Arc<[f32]>)| ExpressionCurve {
        name: name.to_string(),
        interpolation,
        times: times.clone(),
        values,
    };
    Ok(GAZE.into_iter().zip(sides).map(curve).collect())
}
