//! Reference curves, poses and chains in f64, written from the glTF specification (2.0 §3.11, Appendix C) with trigonometry and without
//! shortcuts; slow.

use choreo_motion::{Clip, Curve, Interpolation, Path, Skeleton, Time};
use glam::{DAffine3, DQuat, DVec3};

/// Slerp along the shorter arc, by its angle. Kahan's formula is accurate for angles at which the cosine is not.
pub fn slerp(a: DQuat, b: DQuat, t: f64) -> DQuat {
    let b = if a.dot(b) < 0.0 { -b } else { b };
    let angle = 2.0 * libm::atan2((a - b).length(), (a + b).length());
    if angle < 1e-9 {
        return (a * (1.0 - t) + b * t).normalize();
    }
    let s = libm::sin(angle);
    (a * (libm::sin((1.0 - t) * angle) / s) + b * (libm::sin(t * angle) / s)).normalize()
}

/// The angle between two rotations in radians.
pub fn angle_between(a: DQuat, b: DQuat) -> f64 {
    let (a, b) = (a.normalize(), b.normalize());
    let b = if a.dot(b) < 0.0 { -b } else { b };
    4.0 * libm::atan2((a - b).length(), (a + b).length())
}

/// Local transform of one joint: translation, rotation, scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Local {
    pub translation: DVec3,
    pub rotation: DQuat,
    pub scale: DVec3,
}

impl Local {
    pub fn to_affine(self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }

    /// Interpolates translation and scale linearly, rotation by slerp.
    pub fn mixed(&self, to: &Local, weight: f64) -> Local {
        Local {
            translation: self.translation.lerp(to.translation, weight),
            rotation: slerp(self.rotation, to.rotation, weight),
            scale: self.scale.lerp(to.scale, weight),
        }
    }
}

/// The pose of a clip at a time, joints without curves at rest.
pub fn pose(clip: &Clip, skeleton: &Skeleton, time: Time) -> Vec<Local> {
    let mut locals = rest(skeleton);
    for curve in clip.curves() {
        let Some(local) = locals.get_mut(curve.joint as usize) else { continue };
        let value = |i: usize| evaluate(curve, time)[i];
        match curve.path {
            Path::Translation => local.translation = DVec3::new(value(0), value(1), value(2)),
            Path::Rotation => local.rotation = DQuat::from_xyzw(value(0), value(1), value(2), value(3)),
            Path::Scale => local.scale = DVec3::new(value(0), value(1), value(2)),
            Path::Weights(_) => {}
        }
    }
    locals
}

pub fn rest(skeleton: &Skeleton) -> Vec<Local> {
    let local = |t: &choreo_motion::Transform| Local {
        translation: t.translation.as_dvec3(),
        rotation: t.rotation.as_dquat().normalize(),
        scale: t.scale.as_dvec3(),
    };
    skeleton.rest().iter().map(local).collect()
}

pub fn model_from_joint(skeleton: &Skeleton, locals: &[Local]) -> Vec<DAffine3> {
    let mut out: Vec<DAffine3> = Vec::with_capacity(locals.len());
    for (local, parent) in locals.iter().zip(skeleton.parents()) {
        let parent = parent.and_then(|p| out.get(p as usize).copied()).unwrap_or(DAffine3::IDENTITY);
        out.push(parent * local.to_affine());
    }
    out
}

/// A translation, rotation (unit) or scale curve at a time.
pub fn evaluate(curve: &Curve, time: Time) -> [f64; 4] {
    let width = curve.path.width().min(4);
    let stride = curve.stride();
    let cubic = curve.interpolation == Interpolation::CubicSpline;
    let part = |key: usize, part: usize| -> [f64; 4] {
        let from = key * stride + part * curve.path.width();
        std::array::from_fn(|i| if i < width { f64::from(curve.values[from + i]) } else { 0.0 })
    };
    let value = |key: usize| part(key, usize::from(cubic));
    let rotation = curve.path == Path::Rotation;
    let unit = |v: [f64; 4]| if rotation { DQuat::from_array(v).normalize().to_array() } else { v };
    let last = curve.times.len() - 1;
    if time <= curve.times[0] {
        return unit(value(0));
    }
    if time >= curve.times[last] {
        return unit(value(last));
    }
    let key = curve.times.partition_point(|t| *t <= time) - 1;
    let span = (curve.times[key + 1].0 - curve.times[key].0) as f64;
    let t = (time.0 - curve.times[key].0) as f64 / span;
    let (a, b) = (value(key), value(key + 1));
    match curve.interpolation {
        Interpolation::Step => unit(a),
        Interpolation::Linear if rotation => {
            slerp(DQuat::from_array(a).normalize(), DQuat::from_array(b).normalize(), t).to_array()
        }
        Interpolation::Linear => std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t),
        Interpolation::CubicSpline => {
            let seconds = span / Time::TICKS_PER_SECOND as f64;
            let (out, into) = (part(key, 2), part(key + 1, 0));
            let (t2, t3) = (t * t, t * t * t);
            unit(std::array::from_fn(|i| {
                (2.0 * t3 - 3.0 * t2 + 1.0) * a[i]
                    + seconds * (t3 - 2.0 * t2 + t) * out[i]
                    + (-2.0 * t3 + 3.0 * t2) * b[i]
                    + seconds * (t3 - t2) * into[i]
            }))
        }
    }
}

/// Largest and mean of a set of errors, and the index of the largest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorStats {
    pub worst: f64,
    pub worst_at: usize,
    sum: f64,
    count: usize,
}

impl ErrorStats {
    /// Adds an error; true if it is the worst so far.
    pub fn add(&mut self, error: f64) -> bool {
        let index = self.count;
        self.sum += error;
        self.count += 1;
        let worst = error > self.worst || index == 0;
        if worst {
            (self.worst, self.worst_at) = (error, index);
        }
        worst
    }

    pub fn mean(&self) -> f64 {
        if self.count == 0 { 0.0 } else { self.sum / self.count as f64 }
    }

    pub fn is_empty(&self) -> bool {
        self.count == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slerp_has_constant_angular_speed() {
        for degrees in [1e-7f64, 1.0, 90.0, 170.0, 179.9] {
            let a = DQuat::from_rotation_y(0.3);
            let b = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), degrees.to_radians()) * a;
            for t in [0.0, 0.25, 0.5, 0.9, 1.0] {
                // The angle of a quaternion turned twice as fast is halved.
                let got = angle_between(a, slerp(a, -b, t)).to_degrees();
                assert!((got - degrees * t).abs() < 1e-9 * degrees.max(1.0), "{degrees}° {t}: {got}");
            }
        }
    }

    #[test]
    fn the_worst_error_is_found_with_its_index() {
        let mut s = ErrorStats::default();
        let worse: Vec<bool> = [0.0, 2.0, 1.0].map(|e| s.add(e)).to_vec();
        assert_eq!((worse, s.worst, s.worst_at, s.mean()), (vec![true, true, false], 2.0, 1, 1.0));
    }
}
