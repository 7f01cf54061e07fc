//! Sampling: a clip at a time, into a pose.

use crate::{Clip, Curve, Interpolation, Path, Pose, Time};
use glam::{Quat, Vec3};

/// Evaluates a clip at a time. Joints and properties that the clip does not animate keep what is in the pose.
pub struct Sample<'a> {
    pub clip: &'a Clip,
    /// Clip time; before the first and after the last key the end values hold.
    pub time: Time,
    /// As many joints as the clip's skeleton.
    pub pose: &'a mut Pose,
}

impl Sample<'_> {
    pub fn check(&self) -> Result<(), String> {
        if self.pose.len() != self.clip.joint_count() {
            return Err(format!(
                "`Sample.pose` has {} joints, the clip \"{}\" needs {}",
                self.pose.len(),
                self.clip.name,
                self.clip.joint_count()
            ));
        }
        Ok(())
    }

    /// Joints that the pose does not have are left out.
    pub fn run(&mut self) {
        for curve in self.clip.curves() {
            let joint = curve.joint as usize;
            if joint >= self.pose.len() || matches!(curve.path, Path::Weights(_)) {
                continue;
            }
            let mut v = [0.0f32; 4];
            curve_at(curve, self.time, &mut v);
            let mut transform = self.pose.get(joint);
            match curve.path {
                Path::Translation => transform.translation = Vec3::new(v[0], v[1], v[2]),
                Path::Scale => transform.scale = Vec3::new(v[0], v[1], v[2]),
                Path::Rotation => transform.rotation = Quat::from_array(v),
                Path::Weights(_) => {}
            }
            self.pose.set(joint, transform);
        }
    }
}

/// One curve at a time, any path.
pub(crate) fn curve_at(curve: &Curve, time: Time, out: &mut [f32]) {
    let width = curve.path.width();
    let stride = curve.stride();
    let cubic = curve.interpolation == Interpolation::CubicSpline;
    let value_at = if cubic { width } else { 0 };
    let count = width.min(out.len());
    let next = curve.times.partition_point(|t| *t <= time);
    if next == 0 || next == curve.times.len() || curve.interpolation == Interpolation::Step {
        let at = next.saturating_sub(1) * stride + value_at;
        out[..count].copy_from_slice(&curve.values[at..at + count]);
        return;
    }
    let (t0, t1) = (curve.times[next - 1], curve.times[next]);
    let s = time.fraction(t0, t1);
    let a = &curve.values[(next - 1) * stride..next * stride];
    let b = &curve.values[next * stride..(next + 1) * stride];
    if cubic {
        // glTF 2.0 Appendix C.4: Hermite with tangents per second.
        let span = (t1 - t0).as_secs() as f32;
        let (s2, s3) = (s * s, s * s * s);
        let (h00, h10) = (2.0 * s3 - 3.0 * s2 + 1.0, span * (s3 - 2.0 * s2 + s));
        let (h01, h11) = (3.0 * s2 - 2.0 * s3, span * (s3 - s2));
        for i in 0..count {
            out[i] = h00 * a[width + i] + h10 * a[2 * width + i] + h01 * b[width + i] + h11 * b[i];
        }
        if curve.path == Path::Rotation && count == 4 {
            let q = Quat::from_slice(out);
            out[..4].copy_from_slice(&q.normalize().to_array());
        }
    } else if curve.path == Path::Rotation && count == 4 {
        let q = Quat::from_slice(a).slerp(Quat::from_slice(b), s);
        out[..4].copy_from_slice(&q.to_array());
    } else {
        for i in 0..count {
            out[i] = a[i] + (b[i] - a[i]) * s;
        }
    }
}
