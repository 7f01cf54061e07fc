//! From local transforms to model space, parents first.

use crate::{Pose, Skeleton};
use glam::Affine3A;

/// `model_from_joint[i] = model_from_joint[parent(i)] * pose[i]`.
pub struct LocalToModel<'a> {
    pub skeleton: &'a Skeleton,
    /// As many joints as the skeleton.
    pub pose: &'a Pose,
    /// One a joint.
    pub model_from_joint: &'a mut [Affine3A],
}

impl LocalToModel<'_> {
    pub fn check(&self) -> Result<(), String> {
        let joints = self.skeleton.len();
        if self.pose.len() != joints {
            return Err(format!(
                "`LocalToModel.pose` has {} joints, the skeleton has {joints}",
                self.pose.len()
            ));
        }
        if self.model_from_joint.len() != joints {
            return Err(format!(
                "`LocalToModel.model_from_joint` holds {}, the skeleton has {joints} joints",
                self.model_from_joint.len()
            ));
        }
        Ok(())
    }

    pub fn run(&mut self) {
        for (joint, parent) in self.skeleton.parents().iter().enumerate() {
            let local = self.pose.get(joint).to_affine();
            self.model_from_joint[joint] = match parent {
                Some(parent) => self.model_from_joint[*parent as usize] * local,
                None => local,
            };
        }
    }
}
