//! Mirroring: exchanges left and right in a pose, or in a clip key by key.
//!
//! M is the reflection in the character's middle plane, p(j) the partner of joint j, and G₀ the rotations of the rest pose in
//! model space. A joint turns away from its rest pose as its partner does, reflected: G′ⱼ G₀ⱼ⁻¹ = M G_p(j) G₀_p(j)⁻¹ M. In the
//! joints' own spaces that is q′ⱼ = C_parent(j)⁻¹ · m(q_p(j)) · Cⱼ with Cⱼ = m(G₀_p(j))⁻¹ G₀ⱼ and m(q) the reflected rotation.
//! Each key is mapped alone and q′ is linear in q, so that slerp and cubics between keys are mirrored exactly. The rest pose is
//! mapped to itself, and mirroring twice gives the original, whatever the joints' axes are.

use crate::clip::{Clip, Curve, ExpressionCurve, Interpolation, Path};
use crate::input_error::InputError;
use crate::pose::Pose;
use crate::skeleton::symmetry::{MirrorMap, MirroredJoint};
use glam::DVec3;

impl Clip {
    /// The clip with left and right exchanged, key by key. Curves of joints without a partner are left out. Morph weights move to
    /// the partner joint unchanged: the asset states which target is left and which is right.
    pub fn mirrored(&self, map: &MirrorMap) -> Clip {
        let curves = self.curves().iter().filter_map(|curve| {
            let joint = map.partner(curve.joint)?;
            let own = map.joints[joint as usize].as_ref()?;
            let values = match curve.path {
                Path::Weights(_) => return Some(Curve { joint, ..curve.clone() }),
                path => mirrored_keys(map, joint as usize, own, curve, path.width()),
            };
            Some(Curve { joint, values: values.into(), ..curve.clone() })
        });
        // Suffixes are exchanged: `blinkLeft` becomes `blinkRight`.
        let expressions = self.expressions().iter().map(|e| {
            let side_pairs = [("Left", "Right"), ("Right", "Left")];
            let flip = |(side, opposite): &(&str, &str)| {
                e.name.strip_suffix(side).map(|name| format!("{name}{opposite}"))
            };
            let name = side_pairs.iter().find_map(flip).unwrap_or_else(|| e.name.clone());
            ExpressionCurve { name, ..e.clone() }
        });
        let mut expressions: Vec<ExpressionCurve> = expressions.collect();
        expressions.sort_by(|a, b| a.name.cmp(&b.name));
        self.with_curves(self.joint_count(), curves.collect()).with_checked_expressions(expressions)
    }
}

fn mirrored_keys(
    map: &MirrorMap,
    joint: usize,
    own: &MirroredJoint,
    curve: &Curve,
    width: usize,
) -> Vec<f32> {
    let cubic = curve.interpolation == Interpolation::CubicSpline;
    let mut values = Vec::with_capacity(curve.values.len());
    for (part, value) in curve.values.chunks_exact(width).enumerate() {
        let tangent = cubic && part % 3 != 1;
        match (curve.path, value) {
            (Path::Rotation, &[x, y, z, w]) => values.extend(map.rotation(own, [x, y, z, w])),
            (Path::Translation, &[x, y, z]) if tangent => {
                let tangent = map.offset(own, DVec3::from_array([x, y, z].map(f64::from)));
                values.extend(tangent.to_array().map(|v| v as f32));
            }
            (Path::Translation, &[x, y, z]) => values.extend(map.translation(joint, own, [x, y, z])),
            (_, &[x, y, z]) => values.extend(map.scale(joint, own, [x, y, z])),
            _ => {}
        }
    }
    values
}

/// Exchanges left and right in a pose.
pub struct Mirror<'a> {
    /// Left and right joints of the skeleton.
    pub map: &'a MirrorMap,
    /// Input pose, with as many joints as the map's skeleton.
    pub from: &'a Pose,
    /// Output: the mirrored pose.
    pub out: &'a mut Pose,
}

impl Mirror<'_> {
    /// Names the first field that does not fit.
    pub fn check(&self) -> Result<(), InputError> {
        InputError::check_lengths(&[("Mirror.from", self.from.len(), self.map.joint_count())])
    }

    /// Mirrors the pose. Allocates only if `out` has held fewer joints so far.
    pub fn run(&mut self) {
        self.out.copy_from(self.from);
        for joint in 0..self.from.len().min(self.map.joint_count()) {
            let partner = self.map.partner(joint as u32).map_or(joint, |p| p as usize);
            if partner < self.from.len() {
                self.out.set(joint, self.map.transform(joint, &self.from.get(partner)));
            }
        }
    }
}
