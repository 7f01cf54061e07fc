//! Small assets whose motion has a closed form, and the numbers to compare with.
#![allow(dead_code)]

#[path = "../../../motion/tests/support/random.rs"]
pub(crate) mod random;

use choreo_asset::*;
use choreo_motion::spring::{RigBone, SpringBone, SpringRig};
use choreo_motion::{Clip, Curve, Interpolation, Path, Skeleton, Time, Transform};
use choreo_stage::*;
use glam::{Affine3A, DMat3, DVec3, Mat4, Quat, Vec3};
use std::sync::Arc;

pub(crate) fn secs(s: f64) -> Time {
    Time::from_secs(s)
}

pub(crate) fn skeleton(joints: &[(&str, Option<u32>, Transform)]) -> Arc<Skeleton> {
    let names = joints.iter().map(|j| j.0.to_string()).collect();
    let parents = joints.iter().map(|j| j.1).collect();
    Arc::new(Skeleton::new(names, parents, joints.iter().map(|j| j.2).collect()).unwrap())
}

pub(crate) fn at(x: f32, y: f32, z: f32) -> Transform {
    Transform { translation: Vec3::new(x, y, z), ..Transform::IDENTITY }
}

pub(crate) fn curve(joint: u32, path: Path, keys: &[(f64, &[f32])]) -> Curve {
    Curve {
        joint,
        path,
        interpolation: Interpolation::Linear,
        times: keys.iter().map(|k| secs(k.0)).collect::<Vec<_>>().into(),
        values: keys.iter().flat_map(|k| k.1.iter().copied()).collect::<Vec<_>>().into(),
    }
}

pub(crate) fn clip(name: &str, joints: usize, curves: Vec<Curve>) -> Arc<Clip> {
    Arc::new(Clip::new(name.to_string(), joints, curves).unwrap())
}

/// Joints of [`figure`].
pub(crate) const HIPS: u32 = 0;
pub(crate) const CHEST: u32 = 1;
pub(crate) const HEAD: u32 = 2;
pub(crate) const ARM: u32 = 3;
pub(crate) const HAND: u32 = 4;
/// Clips of [`figure`]: hips at x = t, at y = 2t (both 4 s long); arm about Z to 90° in 2 s; head about Y to 40° in 1 s.
pub(crate) const ALONG_X: usize = 0;
pub(crate) const ALONG_Y: usize = 1;
pub(crate) const RAISE: usize = 2;
pub(crate) const NOD: usize = 3;

/// A person of five joints, 1.8 m high, facing +Z: a box skinned to hips and chest, a rigid box on the head.
pub(crate) fn figure() -> Arc<Asset> {
    let skeleton = skeleton(&[
        ("Hips", None, Transform::IDENTITY),
        ("Chest", Some(0), at(0.0, 1.2, 0.0)),
        ("Head", Some(1), at(0.0, 0.4, 0.0)),
        ("Arm", Some(1), at(0.3, 0.2, 0.0)),
        ("Hand", Some(3), at(0.6, 0.0, 0.0)),
    ]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let head = Quat::from_rotation_y(40f32.to_radians()).to_array();
    let clips = vec![
        clip(
            "along_x",
            5,
            vec![curve(0, Path::Translation, &[(0.0, &[0.0, 0.0, 0.0]), (4.0, &[4.0, 0.0, 0.0])])],
        ),
        clip(
            "along_y",
            5,
            vec![curve(0, Path::Translation, &[(0.0, &[0.0, 0.0, 0.0]), (4.0, &[0.0, 8.0, 0.0])])],
        ),
        clip(
            "raise",
            5,
            vec![curve(3, Path::Rotation, &[(0.0, &[0.0, 0.0, 0.0, 1.0]), (2.0, &[0.0, 0.0, half, half])])],
        ),
        clip("nod", 5, vec![curve(2, Path::Rotation, &[(0.0, &[0.0, 0.0, 0.0, 1.0]), (1.0, &head)])]),
    ];
    let body = Mesh {
        name: "body".into(),
        primitives: vec![skinned_box(Vec3::new(-0.3, 0.0, -0.15), Vec3::new(0.3, 1.5, 0.15))],
        ..Mesh::default()
    };
    let head = Mesh {
        name: "head".into(),
        primitives: vec![box_primitive(Vec3::new(-0.12, 0.0, -0.12), Vec3::new(0.12, 0.2, 0.12))],
        ..Mesh::default()
    };
    Arc::new(Asset {
        name: "figure".into(),
        skins: vec![Skin {
            joints: vec![HIPS, CHEST],
            inverse_bind: vec![Mat4::IDENTITY, Mat4::from_translation(Vec3::new(0.0, -1.2, 0.0))],
        }],
        meshes: vec![Arc::new(body), Arc::new(head)],
        instances: vec![
            MeshInstance { joint: HIPS, mesh: 0, skin: Some(0), ..Default::default() },
            MeshInstance { joint: HEAD, mesh: 1, ..Default::default() },
        ],
        cameras: vec![AssetCamera {
            name: "eyes".into(),
            joint: HEAD,
            projection: Projection::Perspective { yfov: 0.9, near: 0.1, far: Some(50.0) },
        }],
        skeleton,
        clips,
        ..Asset::default()
    })
}

/// A rigid unit stick along +Y with a flat morph: target 0 moves every vertex by +X, target 1 by +Z.
pub(crate) fn stick() -> Arc<Asset> {
    let mut primitive = box_primitive(Vec3::new(-0.05, 0.0, -0.05), Vec3::new(0.05, 1.0, 0.05));
    let n = primitive.positions.len();
    for offset in [Vec3::X, Vec3::Z] {
        primitive.morphs.push(MorphTarget { positions: vec![offset; n], ..MorphTarget::default() });
    }
    let weights = |a: f32, b: f32| [a, b];
    let morphing = curve(0, Path::Weights(2), &[(0.0, &weights(0.0, 0.5)), (2.0, &weights(1.0, 0.5))]);
    Arc::new(Asset {
        name: "stick".into(),
        skeleton: skeleton(&[("Stick", None, Transform::IDENTITY)]),
        meshes: vec![Arc::new(Mesh {
            name: "stick".into(),
            primitives: vec![primitive],
            morph_targets: 2,
            morph_names: vec!["along_x".into(), "along_z".into()],
        })],
        instances: vec![MeshInstance {
            joint: 0,
            mesh: 0,
            skin: None,
            weights: vec![0.1, 0.2],
            ..Default::default()
        }],
        clips: vec![clip("morph", 1, vec![morphing])],
        ..Asset::default()
    })
}

pub(crate) fn box_primitive(min: Vec3, max: Vec3) -> Primitive {
    let positions = Aabb { min, max }.corners().to_vec();
    let normals = positions.iter().map(|p| (*p - (min + max) * 0.5).normalize()).collect();
    let indices = vec![
        0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3,
        7, 5,
    ];
    Primitive { indices, positions, normals, ..Primitive::default() }
}

/// Lower corners on skin joint 0, upper ones half on 0 and half on 1.
fn skinned_box(min: Vec3, max: Vec3) -> Primitive {
    let mut primitive = box_primitive(min, max);
    primitive.influences = 4;
    for position in &primitive.positions {
        let upper = position.y == max.y;
        primitive.joint_indices.extend([0, 1, 0, 0]);
        primitive.joint_weights.extend(if upper { [0.5, 0.5, 0.0, 0.0] } else { [1.0, 0.0, 0.0, 0.0] });
    }
    primitive
}

/// World position of a joint.
pub(crate) fn joint_world(snapshot: &Snapshot, actor: usize, joint: u32) -> DVec3 {
    let state = &snapshot.actors[actor];
    let in_model = Vec3::from(state.model_from_joint[joint as usize].translation).as_dvec3();
    state.world_from_model.transform_point3(in_model)
}

pub(crate) fn joint_axes(m: &Affine3A) -> DMat3 {
    glam::Mat3::from(m.matrix3).as_dmat3()
}

#[track_caller]
pub(crate) fn assert_close(actual: DVec3, expected: DVec3, tolerance: f64) {
    let error = (actual - expected).length();
    assert!(error <= tolerance, "expected {expected}, actual {actual}: {error} > {tolerance}");
}

pub(crate) fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Springs of these joints, each with this tail in its joint's space.
pub(crate) fn spring_rig(joints: impl IntoIterator<Item = u32>, tail: Vec3) -> SpringRig {
    let mut rig = SpringRig::default();
    for joint in joints {
        rig.add(RigBone {
            joint,
            tail,
            spring: SpringBone::new(2.5, 0.15),
            gravity: DVec3::NEG_Y * 9.81,
            pull: DVec3::ZERO,
            hit_radius: 0.01,
            center: None,
            colliders: vec![],
        });
    }
    rig
}
