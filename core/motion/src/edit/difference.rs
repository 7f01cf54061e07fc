//! The difference of a clip from a pose, as a clip.

use super::EditError;
use crate::clip::{Clip, Interpolation, Path};
use crate::pose::Pose;
use crate::skeleton::Skeleton;
use glam::{DQuat, DVec3, Vec3};

impl Clip {
    /// A clip of each joint's motion relative to `reference`, applied to the rest pose. As an additive layer with the rest pose as
    /// reference ([`crate::AdditiveLayers`]) it adds the same as this clip does with `reference`; if `taken_away`, it adds the
    /// opposite. With q the clip's rotation, r the reference's and q₀ that of the rest pose, the result is q₀ r⁻¹ q (q₀ q⁻¹ r if
    /// `taken_away`): linear in q, so that slerp and cubics between keys stay exact. Scales are multiplied (their opposite is
    /// exact only at the keys), morph weights are subtracted.
    pub fn difference_from(
        &self,
        reference: &Pose,
        skeleton: &Skeleton,
        taken_away: bool,
    ) -> Result<Clip, EditError> {
        let joints = self.joint_count();
        if reference.len() != joints || skeleton.len() != joints {
            let joint = reference.len().min(skeleton.len()) as u32;
            return Err(EditError::Joint { joint, joints });
        }
        let curves = self.curves().iter().map(|curve| {
            let (from, rest) = (reference.get(curve.joint as usize), skeleton.rest()[curve.joint as usize]);
            let cubic = curve.interpolation == Interpolation::CubicSpline;
            let tangent = |part: usize| cubic && part % 3 != 1;
            let mut values: Vec<f32> = Vec::with_capacity(curve.values.len());
            for (part, value) in curve.values.chunks_exact(curve.path.width().max(1)).enumerate() {
                match (curve.path, value) {
                    (Path::Rotation, &[x, y, z, w]) => {
                        let q = DQuat::from_xyzw(x.into(), y.into(), z.into(), w.into());
                        let (r, rest) = (from.rotation.as_dquat(), rest.rotation.as_dquat());
                        let delta = if taken_away { q.conjugate() * r } else { r.conjugate() * q };
                        values.extend((rest * delta).to_array().map(|v| v as f32));
                    }
                    (Path::Translation, &[x, y, z]) => {
                        let sign = if taken_away { -1.0 } else { 1.0 };
                        let v = Vec3::new(x, y, z).as_dvec3();
                        let (base, at_rest) = match tangent(part) {
                            true => (DVec3::ZERO, DVec3::ZERO),
                            false => (from.translation.as_dvec3(), rest.translation.as_dvec3()),
                        };
                        values.extend((at_rest + (v - base) * sign).to_array().map(|v| v as f32));
                    }
                    (Path::Scale, value) => {
                        let (from, rest) = (from.scale.to_array(), rest.scale.to_array());
                        values.extend((0..3).map(|i| {
                            scale_difference(value[i], from[i], rest[i], tangent(part), taken_away)
                        }));
                    }
                    (_, value) => values.extend(value),
                }
            }
            crate::clip::Curve { values: values.into(), ..curve.clone() }
        });
        Ok(self.with_curves(joints, curves.collect()).with_duration(self.duration))
    }
}

/// Scale of the difference: rest · now / from, or rest · from / now if `taken_away`. A divisor of 0 gives the ratio 1, as in
/// [`crate::AdditiveLayers`], or 0 for a tangent; the tangent of a scale that is taken away is 0.
fn scale_difference(now: f32, from: f32, rest: f32, tangent: bool, taken_away: bool) -> f32 {
    let (now, from, rest) = (f64::from(now), f64::from(from), f64::from(rest));
    let ratio = match (from.abs() < 1e-12, tangent, taken_away) {
        (true, false, _) => 1.0,
        (true, true, _) | (_, true, true) => 0.0,
        (_, _, false) => now / from,
        (_, false, true) if now.abs() < 1e-12 => 1.0,
        (_, false, true) => from / now,
    };
    (rest * ratio) as f32
}
