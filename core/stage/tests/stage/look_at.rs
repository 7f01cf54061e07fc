//! Look-at in cases that scripts cannot express; other cases are in `tests/suite/looks`.

use crate::support::*;
use choreo_asset::*;
use choreo_stage::*;
use glam::DVec3;
use std::sync::Arc;

fn stage_with_look_at(target: Target) -> Stage {
    let mut stage = Stage::default();
    let anna = stage.cast("anna", figure());
    stage.actors[anna].transform = Placement::at(3.0, 1.0, -2.0).turned(0.5);
    stage.actors[anna].look_at.push(LookAt::new(HEAD, target));
    stage
}

#[test]
fn look_at_uses_the_model_forward_axis_whatever_the_rest_rotation() {
    // A head joint whose own axes are permuted, under a joint that stands on its head.
    let rest = |q: glam::Quat| choreo_motion::Transform { rotation: q, ..at(0.0, 1.0, 0.0) };
    let skeleton = skeleton(&[
        ("Spine", None, rest(glam::Quat::from_rotation_z(3.0))),
        ("Head", Some(0), rest(glam::Quat::from_xyzw(0.5, 0.5, 0.5, 0.5))),
    ]);
    let asset = Arc::new(Asset { skeleton, ..Asset::default() });
    let mut stage = Stage::default();
    stage.cast("a", asset.clone());
    let target = v(0.7, 0.3, 4.0);
    stage.actors[0].look_at.push(LookAt::new(1, Target::Point(target)));
    let snapshot = stage.at(secs(0.0)).unwrap();
    let turn = joint_axes(&snapshot.actors[0].model_from_joint[1])
        * joint_axes(&asset.rest_model_from_joint()[1]).inverse();
    let way = (target - joint_world(&snapshot, 0, 1)).normalize();
    assert_close((turn * DVec3::Z).normalize(), way, 1e-6);
}

#[test]
fn look_at_targets_behind_and_inside_the_head_stay_finite_and_continuous() {
    let mut last: Option<f64> = None;
    // All the way round, through straight behind.
    for i in 0..=720 {
        let angle = (i as f64 / 2.0).to_radians();
        let mut stage =
            stage_with_look_at(Target::Point(v(0.0, 1.6, 0.0) + v(angle.sin(), 0.0, angle.cos())));
        stage.actors[0].transform = Placement::default();
        let snapshot = stage.at(secs(0.0)).unwrap();
        let z = joint_axes(&snapshot.actors[0].model_from_joint[HEAD as usize]) * DVec3::Z;
        let yaw = z.x.atan2(z.z).to_degrees();
        assert!(yaw.is_finite() && yaw.abs() <= 80.001, "{yaw}");
        assert!(last.is_none_or(|l| (l - yaw).abs() < 0.6), "jumps from {last:?} to {yaw} at {i}");
        last = Some(yaw);
    }
    let mut inside = stage_with_look_at(Target::Point(DVec3::ZERO));
    inside.actors[0].transform = Placement::default();
    inside.actors[0].look_at[0].target = Target::Joint { actor: 0, joint: HEAD };
    let snapshot = inside.at(secs(0.0)).unwrap();
    assert_eq!(snapshot.actors[0].model_from_joint, figure().rest_model_from_joint());
}

#[test]
fn eye_bones_turn_by_the_angle_that_the_head_leaves() {
    use choreo_motion::{HumanBone, Humanoid};
    let q = glam::Quat::from_xyzw(0.5, 0.5, 0.5, 0.5);
    // Joints turned at rest, the eyes 6 cm apart.
    let bone = |x: f32, y: f32, z: f32| choreo_motion::Transform { rotation: q.inverse(), ..at(x, y, z) };
    let head = choreo_motion::Transform { rotation: q, ..at(0.0, 1.5, 0.0) };
    let eye = |x: f32| {
        let place = q.inverse() * glam::Vec3::new(x, 0.1, 0.05);
        bone(place.x, place.y, place.z)
    };
    let human = [HumanBone::Hips, HumanBone::Head, HumanBone::LeftEye, HumanBone::RightEye];
    let skeleton = skeleton(&[
        ("Hips", None, at(0.0, 0.0, 0.0)),
        ("Head", Some(0), head),
        ("LeftEye", Some(1), eye(0.03)),
        ("RightEye", Some(1), eye(-0.03)),
    ]);
    let humanoid = Humanoid::new(human.into_iter().zip(0..)).unwrap();
    let map = |most: f32, out: f32| RangeMap { input_max: most.to_radians(), output_scale: out.to_radians() };
    let eyes = Eyes {
        offset_from_head: q.inverse() * glam::Vec3::new(0.0, 0.1, 0.05),
        moved_by: EyesMovedBy::Bones,
        inner: map(90.0, 45.0),
        outer: map(90.0, 30.0),
        down: map(90.0, 90.0),
        up: map(90.0, 90.0),
    };
    let skeleton = (*skeleton).clone().with_humanoid(humanoid).unwrap();
    let asset = Arc::new(Asset { skeleton: Arc::new(skeleton), eyes: Some(eyes), ..Asset::default() });
    // 60 degrees to the left of where the eyes are, at their height; the head goes no part of the way, half of it, all of it.
    let angle = 60f64.to_radians();
    let target = v(0.0, 1.6, 0.05) + v(angle.sin(), 0.0, angle.cos()) * 1e4;
    for (weight, left) in [(0.0f32, 0.0f64), (0.5, 30.0), (1.0, 0.0)] {
        let mut stage = Stage::default();
        stage.cast("a", asset.clone());
        stage.actors[0].transform = Placement::at(2.0, 0.0, 1.0).turned(0.7);
        let target = stage.actors[0].transform.translation + glam::DQuat::from_rotation_y(0.7) * target;
        stage.actors[0].look_at.push(LookAt { weight, ..LookAt::new(1, Target::Point(target)) });
        let snapshot = stage.at(secs(0.0)).unwrap();
        let yaw = |joint: usize| {
            let now = joint_axes(&snapshot.actors[0].model_from_joint[joint]);
            let turn = now * joint_axes(&asset.rest_model_from_joint()[joint]).inverse();
            let z = turn * DVec3::Z;
            z.x.atan2(z.z).to_degrees()
        };
        // The eyes turn by the rest of the angle, mapped, times the weight of the look; the right eye turns towards the nose.
        let head = 60.0 * f64::from(weight);
        let expected = [head, head + left / 3.0 * f64::from(weight), head + left / 2.0 * f64::from(weight)];
        for (joint, expected) in [1, 2, 3].into_iter().zip(expected) {
            assert!(
                (yaw(joint) - expected).abs() < 0.02,
                "{weight}, joint {joint}: {} not {expected}",
                yaw(joint)
            );
        }
    }
}

/// A head without bones for eyes: pupils are a texture and a morph target, and a smile holds them still.
#[test]
fn gaze_expressions_are_reduced_by_expressions_that_override_gaze() {
    use choreo_motion::{HumanBone, Humanoid};
    use glam::Vec2;
    let skeleton = skeleton(&[("Hips", None, at(0.0, 0.0, 0.0)), ("Head", Some(0), at(0.0, 1.5, 0.0))]);
    let humanoid = Humanoid::new([HumanBone::Hips, HumanBone::Head].into_iter().zip(0..)).unwrap();
    let skeleton = (*skeleton).clone().with_humanoid(humanoid).unwrap();
    let map = |most: f32| RangeMap { input_max: most.to_radians(), output_scale: 1.0 };
    let eyes = Eyes {
        offset_from_head: glam::Vec3::ZERO,
        moved_by: EyesMovedBy::Expressions,
        inner: map(90.0),
        outer: map(60.0),
        down: map(90.0),
        up: map(90.0),
    };
    let face = |name: &str| Expression {
        name: name.into(),
        group: ExpressionGroup::of_preset(name),
        ..Expression::default()
    };
    let texture = TextureRef {
        image: 0,
        sampler: Sampler::default(),
        uv_set: 0,
        uv_transform: glam::Affine2::IDENTITY,
    };
    let asset = Arc::new(Asset {
        skeleton: Arc::new(skeleton),
        eyes: Some(eyes),
        materials: vec![Material { base_color_texture: Some(texture), ..Material::default() }],
        meshes: vec![Arc::new(Mesh { morph_targets: 1, ..Mesh::default() })],
        instances: vec![MeshInstance { joint: 1, mesh: 0, weights: vec![0.25], ..MeshInstance::default() }],
        expressions: vec![
            Expression {
                morphs: vec![MorphBind { instance: 0, target: 0, weight: 0.5 }],
                uvs: vec![UvBind { material: 0, offset: Vec2::new(0.2, 0.0), scale: Vec2::ONE }],
                ..face("lookLeft")
            },
            face("lookRight"),
            Expression { over_gaze: Override::Blend, ..face("happy") },
            Expression { over_gaze: Override::Block, ..face("angry") },
        ],
        ..Asset::default()
    });
    // 30 degrees to its left, by eyes alone: half of what they can.
    let angle = 30f64.to_radians();
    let target = Target::Point(v(0.0, 1.5, 0.0) + v(angle.sin(), 0.0, angle.cos()) * 5.0);
    let shown = |requested: &[(&str, f32)], weight: f32| {
        let mut stage = Stage::default();
        stage.cast("a", asset.clone());
        for (name, weight) in requested {
            let index = asset.expressions.iter().position(|e| e.name == *name).unwrap() as u32;
            stage.actors[0].expressions.push((index, *weight));
        }
        let look = LookAt { weight, ..LookAt::new(1, target) };
        stage.actors[0].look_at.push(look);
        let snapshot = stage.at(secs(0.0)).unwrap();
        let state = &snapshot.actors[0];
        let moved = state.materials.iter().find(|m| m.material == 0);
        let texture = moved.and_then(|m| m.now.base_color_texture.as_ref());
        (state.morph_weights[0][0], texture.map_or(0.0, |t| t.uv_transform.translation.x))
    };
    let near = |got: (f32, f32), weight: f32| {
        let expected = (0.25 + 0.5 * weight, 0.2 * weight);
        let off = (got.0 - expected.0).abs().max((got.1 - expected.1).abs());
        assert!(off < 1e-5, "{got:?} not {expected:?}");
    };
    // The head would turn all the way and leave nothing to the eyes; at weight ½ it leaves 15 degrees of 60, by half.
    near(shown(&[], 1.0), 0.0);
    near(shown(&[], 0.5), 0.125);
    near(shown(&[("happy", 0.75)], 0.5), 0.125 * 0.25);
    near(shown(&[("angry", 0.01)], 0.5), 0.0);
    // A script's weight of the same expression is added, up to 1.
    near(shown(&[("lookLeft", 0.5)], 0.5), 0.625);
    near(shown(&[("lookLeft", 0.95)], 0.5), 1.0);
}
