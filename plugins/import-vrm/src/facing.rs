//! Rotates VRM 0.x models, which look along −Z, to look along +Z like all others.
//!
//! The whole asset is converted to axes rotated by a half turn R about +Y: every joint transform T becomes R·T·R⁻¹, so that joint
//! axes rotate too, and a head's +Z is its forward direction, as in VRM 1.0. R only changes signs, so no precision is lost. Skins
//! follow by their bind matrices. An object on a joint without a skin (mesh, camera, light) gets a joint between, which rests at R,
//! and keeps its vertices.

use choreo_asset::Asset;
use choreo_importer_kit::{Problem, Result};
use choreo_motion::spring::parameters::Springs;
use choreo_motion::{Clip, Curve, Path, Skeleton, Transform};
use glam::{Mat4, Quat, Vec3, Vec4};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Rotation by a half turn about +Y.
const HALF_TURN: Quat = Quat::from_xyzw(0.0, 1.0, 0.0, 0.0);

/// Converts a vector of VRM 0.x's own extension to the axes of the rotated model. UniVRM 0.x writes these vectors in Unity's axes
/// (left-handed, the model looks along +Z, +X is its right), although it converts nodes and vertices to glTF by −z.
pub(crate) fn from_unity(v: Vec3) -> Vec3 {
    Vec3::new(-v.x, v.y, v.z)
}

fn vector(v: Vec3) -> Vec3 {
    Vec3::new(-v.x, v.y, -v.z)
}

fn rotation(q: Quat) -> Quat {
    Quat::from_xyzw(-q.x, q.y, -q.z, q.w)
}

pub(crate) fn turn(asset: &mut Asset) -> Result<()> {
    let old = asset.skeleton.clone();
    let (mut names, mut parents) = (old.names().to_vec(), old.parents().to_vec());
    let turned = |t: &Transform| Transform {
        translation: vector(t.translation),
        rotation: rotation(t.rotation),
        scale: t.scale,
    };
    let mut rest: Vec<Transform> = old.rest().iter().map(turned).collect();

    // Joints between, for objects without a skin. They come last in the list, so parents still precede children.
    let mut between: BTreeMap<u32, u32> = BTreeMap::new();
    let mut joint_between = |joint: u32| -> u32 {
        *between.entry(joint).or_insert_with(|| {
            names.push(format!("{} (as in file)", old.names()[joint as usize]));
            parents.push(Some(joint));
            rest.push(Transform { rotation: HALF_TURN, ..Transform::IDENTITY });
            names.len() as u32 - 1
        })
    };
    for instance in asset.instances.iter_mut().filter(|i| i.skin.is_none()) {
        instance.joint = joint_between(instance.joint);
    }
    asset.cameras.iter_mut().for_each(|c| c.joint = joint_between(c.joint));
    asset.lights.iter_mut().for_each(|l| l.joint = joint_between(l.joint));

    let fail = |e: &dyn std::fmt::Display| Problem::new("nodes", e.to_string());
    let skeleton = Skeleton::new(names, parents, rest).map_err(|e| fail(&e))?;
    let skeleton = match old.humanoid() {
        Some(humanoid) => skeleton.with_humanoid(humanoid.clone()).map_err(|e| fail(&e))?,
        None => skeleton,
    };
    let turned_bind = |m: &Mat4| {
        let row = |c: Vec4| Vec4::new(-c.x, c.y, -c.z, c.w);
        Mat4::from_cols(row(m.x_axis), row(m.y_axis), row(m.z_axis), row(m.w_axis))
    };
    for skin in &mut asset.skins {
        skin.inverse_bind = skin.inverse_bind.iter().map(turned_bind).collect();
    }
    for clip in &mut asset.clips {
        *clip = Arc::new(turned_clip(clip, skeleton.len(), &between)?);
    }
    asset.springs = turned_springs(std::mem::take(&mut asset.springs));
    asset.skeleton = Arc::new(skeleton);
    Ok(())
}

/// The clip rotated by half a turn about y. `joint_count`: of the new skeleton; `between`: joints whose meshes have moved to an added joint,
/// with that joint.
fn turned_clip(clip: &Clip, joint_count: usize, between: &BTreeMap<u32, u32>) -> Result<Clip> {
    let turned = |curve: &Curve| {
        // Tangents have the same signs as values.
        let signs: &[f32] = match curve.path {
            Path::Translation => &[-1.0, 1.0, -1.0],
            Path::Rotation => &[-1.0, 1.0, -1.0, 1.0],
            Path::Scale => return curve.clone(),
            // Weight curves belong to the mesh, which may have moved to a joint between.
            Path::Weights(_) => {
                let joint = between.get(&curve.joint).copied().unwrap_or(curve.joint);
                return Curve { joint, ..curve.clone() };
            }
        };
        let values = curve.values.iter().zip(signs.iter().cycle()).map(|(v, sign)| v * sign).collect();
        Curve { values, ..curve.clone() }
    };
    let curves = clip.curves().iter().map(turned).collect();
    Clip::new(clip.name.clone(), joint_count, curves).map_err(|e| Problem::new("animations", e.to_string()))
}

/// Rotates the tails only: they were computed from nodes, in the file's axes; see [`from_unity`].
fn turned_springs(mut springs: Springs) -> Springs {
    for joint in springs.chains.iter_mut().flat_map(|c| &mut c.joints) {
        joint.tail = vector(joint.tail);
    }
    springs
}
