//! Pose and vertices of an asset's clip at a time, through the jobs that the program uses.

use choreo_asset::{Asset, Primitive};
use choreo_motion::{LocalToModel, Pose, Sample, Time};
use glam::{Affine3A, Mat4, Vec3};

/// Model-from-joint of every joint; the rest pose for no clip.
pub fn at(asset: &Asset, clip: Option<usize>, secs: f64) -> Vec<Affine3A> {
    let mut pose = Pose::rest(&asset.skeleton);
    if let Some(clip) = clip {
        let mut job = Sample { clip: &asset.clips[clip], time: Time::from_secs(secs), pose: &mut pose };
        job.check().unwrap_or_else(|e| panic!("{e}"));
        job.run();
    }
    let mut out = vec![Affine3A::IDENTITY; asset.skeleton.len()];
    let mut job = LocalToModel { skeleton: &asset.skeleton, pose: &pose, model_from_joint: &mut out };
    job.check().unwrap_or_else(|e| panic!("{e}"));
    job.run();
    out
}

/// Vertices of every primitive of an instance in model space, skinned, without morph targets.
pub fn vertices(asset: &Asset, instance: usize, model_from_joint: &[Affine3A]) -> Vec<Vec<Vec3>> {
    let instance = &asset.instances[instance];
    let skin = instance.skin.map(|s| &asset.skins[s as usize]);
    let skinning: Option<Vec<Mat4>> = skin.map(|s| {
        let pairs = s.joints.iter().zip(&s.inverse_bind);
        pairs.map(|(joint, bind)| Mat4::from(model_from_joint[*joint as usize]) * *bind).collect()
    });
    let place = |p: &Primitive| -> Vec<Vec3> {
        let vertex = |v: usize| {
            let at = p.positions[v];
            match &skinning {
                Some(skinning) if p.influences > 0 => (0..p.influences)
                    .map(|i| v * p.influences + i)
                    .map(|i| {
                        skinning[usize::from(p.joint_indices[i])].transform_point3(at) * p.joint_weights[i]
                    })
                    .sum(),
                _ => model_from_joint[instance.joint as usize].transform_point3(at),
            }
        };
        (0..p.positions.len()).map(vertex).collect()
    };
    asset.meshes[instance.mesh as usize].primitives.iter().map(place).collect()
}
