//! A posed skeleton whose joints can be turned together with all joints below them.

use choreo_motion::Skeleton;
use glam::{Affine3A, DMat3, DQuat, DVec3, Mat3, Mat3A, Vec3, Vec3A};

pub(crate) struct PosedSkeleton<'a> {
    pub skeleton: &'a Skeleton,
    pub model_from_joint: &'a mut [Affine3A],
    /// Reusable buffer: whether each joint is the moved one or a descendant of it.
    pub is_descendant: &'a mut Vec<bool>,
}

impl PosedSkeleton<'_> {
    /// Position of a joint in model space.
    pub(crate) fn position(&self, joint: u32) -> DVec3 {
        Vec3::from(self.model_from_joint[joint as usize].translation).as_dvec3()
    }

    /// Rotation of a joint in model space, without its scale.
    pub(crate) fn rotation(&self, joint: u32) -> DQuat {
        rotation_of(&self.model_from_joint[joint as usize])
    }

    /// Whether `joint` is below `above` in the skeleton.
    pub(crate) fn is_below(&self, joint: u32, above: u32) -> bool {
        let parents = self.skeleton.parents();
        std::iter::successors(parents[joint as usize], |j| parents[*j as usize]).any(|j| j == above)
    }

    /// Turns a joint and all joints below it about its position; model space.
    pub(crate) fn turn(&mut self, joint: u32, turn: DQuat) {
        let pivot = self.position(joint);
        self.move_subtree(joint, turn, pivot, DVec3::ZERO);
    }

    /// Moves a joint and all joints below it; model space.
    pub(crate) fn shift(&mut self, joint: u32, by: DVec3) {
        self.move_subtree(joint, DQuat::IDENTITY, DVec3::ZERO, by);
    }

    fn move_subtree(&mut self, joint: u32, turn: DQuat, pivot: DVec3, by: DVec3) {
        if !(turn.is_finite() && by.is_finite()) || (turn == DQuat::IDENTITY && by == DVec3::ZERO) {
            return;
        }
        let rotation = Mat3A::from(Mat3::from_quat(turn.as_quat()));
        let joint = joint as usize;
        self.is_descendant.clear();
        self.is_descendant.resize(self.skeleton.len(), false);
        self.is_descendant[joint] = true;
        // Children come after their parents.
        for (index, parent) in self.skeleton.parents().iter().enumerate().skip(joint) {
            if index != joint {
                self.is_descendant[index] = parent.is_some_and(|p| self.is_descendant[p as usize]);
            }
            if self.is_descendant[index] {
                let m = &mut self.model_from_joint[index];
                let at = Vec3::from(m.translation).as_dvec3();
                let at = pivot + turn * (at - pivot) + by;
                *m = Affine3A { matrix3: rotation * m.matrix3, translation: Vec3A::from(at.as_vec3()) };
            }
        }
    }
}

/// Rotation of a joint's matrix without scale and shear. A mirrored joint is treated alike in the pose and at rest, so that the difference
/// of both rotations is right.
pub(crate) fn rotation_of(m: &Affine3A) -> DQuat {
    let m = Mat3::from(m.matrix3).as_dmat3();
    let y = m.y_axis.try_normalize().unwrap_or(DVec3::Y);
    let x = (m.x_axis - y * m.x_axis.dot(y)).try_normalize().unwrap_or_else(|| y.any_orthonormal_vector());
    DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))).normalize()
}
