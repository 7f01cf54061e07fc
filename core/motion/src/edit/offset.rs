//! Offsets a joint by a constant translation and rotation throughout a clip.

use super::EditError;
use crate::clip::{Clip, Curve, Interpolation, Path};
use crate::skeleton::Skeleton;
use crate::skeleton::model_rest_pose::ModelRestPose;
use crate::time::Time;
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// A constant translation and rotation of a joint, applied at every time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// Translation in metres, along the model's axes with the parent in rest pose.
    pub moved: DVec3,
    /// Rotation after the clip's own, about the joint's own axes.
    pub turned: DQuat,
}

impl Clip {
    /// Applies `by` to each key of a joint; interpolation between keys is unchanged. Properties that the clip does not animate
    /// are offset from the rest pose.
    pub fn offset(&self, joint: u32, by: Offset, skeleton: &Skeleton) -> Result<Clip, EditError> {
        if joint as usize >= self.joint_count().min(skeleton.len()) {
            return Err(EditError::Joint { joint, joints: self.joint_count() });
        }
        let mut curves = self.curves().to_vec();
        let rest = &skeleton.rest()[joint as usize];
        if by.turned != DQuat::IDENTITY {
            let curve = find_or_add_curve(&mut curves, joint, Path::Rotation, &rest.rotation.to_array());
            let turned = curve.values.chunks_exact(4).flat_map(|q| {
                let q = DQuat::from_xyzw(q[0].into(), q[1].into(), q[2].into(), q[3].into()) * by.turned;
                q.to_array().map(|v| v as f32)
            });
            curve.values = turned.collect();
        }
        if by.moved != DVec3::ZERO {
            let moved = offset_in_parent(skeleton, joint, by.moved);
            let curve =
                find_or_add_curve(&mut curves, joint, Path::Translation, &rest.translation.to_array());
            let cubic = curve.interpolation == Interpolation::CubicSpline;
            let values = curve.values.chunks_exact(3).enumerate().flat_map(|(part, v)| {
                let by = if cubic && part % 3 != 1 { [0.0; 3] } else { moved.to_array() };
                [0, 1, 2].map(|i| (f64::from(v[i]) + by[i]) as f32)
            });
            curve.values = values.collect();
        }
        Ok(self.with_curves(self.joint_count(), curves).with_duration(self.duration))
    }
}

/// The curve of a property; if there is none, a new one that holds the rest pose.
fn find_or_add_curve<'a>(curves: &'a mut Vec<Curve>, joint: u32, path: Path, rest: &[f32]) -> &'a mut Curve {
    let at = curves.iter().position(|c| c.joint == joint && c.path == path).unwrap_or_else(|| {
        let times: Arc<[Time]> = [Time::ZERO].into();
        curves.push(Curve { joint, path, interpolation: Interpolation::Linear, times, values: rest.into() });
        curves.len() - 1
    });
    &mut curves[at]
}

/// Converts an offset along the model's axes, metres, to the space of the joint's parent in rest pose.
pub fn offset_in_parent(skeleton: &Skeleton, joint: u32, moved: DVec3) -> DVec3 {
    let Some(parent) = skeleton.parents().get(joint as usize).copied().flatten() else { return moved };
    let (model, parent) = (ModelRestPose::of(skeleton), parent as usize);
    let unit = Some(model.scales[parent]).filter(|s| *s > 0.0).unwrap_or(1.0);
    model.rotations[parent].conjugate() * moved / unit
}
