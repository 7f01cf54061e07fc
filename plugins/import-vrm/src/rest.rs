//! The rest pose in model space.

use choreo_motion::Skeleton;
use glam::{DAffine3, DMat3};

/// model-from-joint of every joint at rest.
pub fn model_from_joints(skeleton: &Skeleton) -> Vec<DAffine3> {
    let mut model: Vec<DAffine3> = Vec::with_capacity(skeleton.len());
    for (rest, parent) in skeleton.rest().iter().zip(skeleton.parents()) {
        let parent_from_joint = DAffine3 {
            matrix3: DMat3::from_quat(rest.rotation.as_dquat()) * DMat3::from_diagonal(rest.scale.as_dvec3()),
            translation: rest.translation.as_dvec3(),
        };
        model.push(parent.map_or(parent_from_joint, |p| model[p as usize] * parent_from_joint));
    }
    model
}
