//! Bounding boxes contain the posed vertices in any pose, and are tight.

use crate::support::random::Random;
use crate::support::*;
use choreo_asset::*;
use choreo_motion::{Interpolation, Path};
use choreo_stage::*;
use glam::{Affine3A, DAffine3, DVec3, Quat, Vec3};
use std::sync::Arc;

fn random_pose(asset: &Asset, numbers: &mut Random) -> Vec<Affine3A> {
    let rest = asset.rest_model_from_joint();
    rest.iter()
        .map(|m| {
            let axis = numbers.vec3().as_vec3().normalize();
            let turn = Quat::from_axis_angle(axis, 3.0 * numbers.signed64() as f32);
            // Mirrored and uneven scales too.
            let scale = Vec3::ONE + numbers.vec3().as_vec3() * 1.5;
            *m * Affine3A::from_scale_rotation_translation(scale, turn, numbers.vec3().as_vec3())
        })
        .collect()
}

fn bounds_contain_instance(
    bounds: &Aabb,
    asset: &Asset,
    joints: &[Affine3A],
    weights: &[Vec<f32>],
    instance: usize,
) -> bool {
    let posed = posed_meshes_in(asset, joints, weights, DAffine3::IDENTITY);
    let mut points = posed[instance].primitives.iter().flat_map(|p| &p.positions);
    points.all(|p| p.cmpge(bounds.min.as_dvec3()).all() && p.cmple(bounds.max.as_dvec3()).all())
}

#[test]
fn animated_bounds_contain_every_random_pose() {
    let mut numbers = Random(7);
    let (mut smaller_fails, mut volumes) = (0, 0.0);
    for asset in [figure(), stick()] {
        for _ in 0..300 {
            let joints = random_pose(&asset, &mut numbers);
            let weights: Vec<Vec<f32>> = asset
                .instances
                .iter()
                .map(|i| i.weights.iter().map(|_| 2.0 * numbers.signed64() as f32).collect())
                .collect();
            for (index, reach) in asset.instance_bounds().iter().enumerate() {
                let bounds = reach.posed(&joints, &weights[index]);
                assert!(bounds_contain_instance(&bounds, &asset, &joints, &weights, index));
                let smaller = Aabb {
                    min: bounds.center().lerp(bounds.min, 0.6),
                    max: bounds.center().lerp(bounds.max, 0.6),
                };
                smaller_fails +=
                    usize::from(!bounds_contain_instance(&smaller, &asset, &joints, &weights, index));
                volumes += 1.0;
            }
        }
    }
    // The planted fault, boxes of 60 % of their size, is caught nearly always: the boxes are also not much too large.
    assert!(smaller_fails as f64 > 0.95 * volumes, "{smaller_fails} of {volumes}");
}

#[test]
fn rest_bounds_equal_the_extent_of_the_rest_mesh() {
    let Aabb { min, max } = figure().rest_bounds();
    assert_close(min.as_dvec3(), v(-0.3, 0.0, -0.15), 1e-6);
    assert_close(max.as_dvec3(), v(0.3, 1.8, 0.15), 1e-6);
    assert!(Asset::default().rest_bounds().is_empty());
    assert_eq!(Asset::default().rest_bounds().center(), Vec3::ZERO);
}

#[test]
fn skin_influences_of_weight_zero_do_not_widen_bounds() {
    // The lower corners name joint 1 with weight 0: its box holds only the upper four.
    let chest = &figure().instance_bounds()[0].parts[1].reach.clone();
    assert_eq!(chest.min.y, 1.5 - 1.2);
}

#[test]
fn bounds_of_invalid_assets_are_empty_or_finite() {
    let mut asset = (*figure()).clone();
    asset.instances[0].mesh = 99;
    asset.instances[1].joint = 99;
    let bounds = asset.instance_bounds();
    assert!(bounds.iter().all(|b| b.posed(asset.rest_model_from_joint(), &[]).is_empty()));
    let mut asset = (*figure()).clone();
    asset.skins[0].inverse_bind.clear();
    asset.skins[0].joints[1] = 77;
    let mut mesh = (*asset.meshes[0]).clone();
    mesh.primitives[0].positions[0] = Vec3::NAN;
    mesh.primitives[0].joint_indices[2] = 500;
    asset.meshes[0] = Arc::new(mesh);
    let bounds = asset.instance_bounds()[0].posed(asset.rest_model_from_joint(), &[]);
    assert!(bounds.min.is_finite() && bounds.max.is_finite());
}

#[test]
fn posed_meshes_apply_skin_morph_targets_and_placement() {
    let f = figure();
    let mut stage = Stage::default();
    stage.cast("anna", f.clone());
    stage.actors[0].transform = Placement::at(100.0, 0.0, 0.0);
    stage.cast("stick", stick());
    stage.actors[1].morphs = vec![(0, 0, 2.0), (0, 1, 0.0)];
    #[derive(Debug)]
    struct Bow;
    impl FrameCallback for Bow {
        fn run(&self, _: choreo_motion::Time, edits: &mut FrameEdits) -> Result<(), StageError> {
            let rotation = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
            edits.actors.push((0, ActorEdit::TurnJoint { joint: CHEST, rotation }));
            Ok(())
        }
    }
    stage.frame_callbacks.push(Arc::new(Bow));
    let snapshot = stage.at(secs(0.0)).unwrap();
    let body = &posed_meshes(&f, &snapshot.actors[0])[0].primitives[0];
    // A lower corner stays; an upper one goes half way to where the chest, a quarter turn to the left, carries it.
    assert_close(body.positions[0], v(99.7, 0.0, -0.15), 1e-6);
    assert_close(body.positions[2], v(100.0 + (-0.3 - 0.3) / 2.0, (1.5 + 0.9) / 2.0, -0.15), 1e-6);
    assert!(body.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-9));
    let stick_mesh = &posed_meshes(&stick(), &snapshot.actors[1])[0].primitives[0];
    assert_close(stick_mesh.positions[0], v(1.95, 0.0, -0.05), 1e-6);
    // An actor that is not posed has no posed meshes.
    stage.actors[0].visible = false;
    assert!(posed_meshes(&f, &stage.at(secs(0.0)).unwrap().actors[0]).is_empty());
}

/// A culled actor is never in the image, whatever sets the weights of its morph targets. Far away it is culled, unless a spline or a
/// callback can give any weight.
#[test]
fn actors_with_morph_targets_are_culled_only_outside_their_morph_range() {
    #[derive(Debug)]
    struct Pull;
    impl FrameCallback for Pull {
        fn run(&self, _: choreo_motion::Time, edits: &mut FrameEdits) -> Result<(), StageError> {
            edits.actors.push((0, ActorEdit::Morph { instance: 0, target: 0, weight: -90.0 }));
            Ok(())
        }
    }
    let keyed = |interpolation, values: Vec<f64>| Channel {
        property: Property::Morph { instance: 0, target: 0 },
        interpolation,
        times: vec![secs(0.0), secs(2.0)],
        values,
    };
    let play = |stage: &mut Stage, mode| {
        let mut layer = Layer { mode, ..Layer::default() };
        let weights = curve(0, Path::Weights(2), &[(0.0, &[1.0, 0.5]), (2.0, &[-6.0, 0.5])]);
        layer.add(Cue::new(clip("pull", 1, vec![weights])));
        stage.actors[0].layers.push(layer);
    };
    type Change<'a> = &'a dyn Fn(&mut Stage);
    let changes: [(&str, bool, Change); 7] = [
        ("at rest", true, &|_| {}),
        ("fixed", true, &|stage| stage.actors[0].morphs.push((0, 0, -4.0))),
        ("keyed", true, &|stage| {
            stage.actors[0].channels.push(keyed(Interpolation::Linear, vec![0.0, -7.0]))
        }),
        ("a clip", true, &|stage| play(stage, LayerMode::Override)),
        ("an additive clip", true, &|stage| play(stage, LayerMode::Additive(Reference::Rest))),
        ("a spline", false, &|stage| {
            let values = vec![0.0, 0.0, 0.0, -60.0, 0.0, 0.0];
            stage.actors[0].channels.push(keyed(Interpolation::CubicSpline, values));
        }),
        ("a callback", false, &|stage| stage.frame_callbacks.push(Arc::new(Pull))),
    ];
    for (name, is_bounded, change) in changes {
        let mut culled = 0;
        for distance in (8..40).map(f64::from) {
            let mut stage = Stage::default();
            stage.cast("stick", stick());
            stage.actors[0].transform = Placement::at(distance, 0.0, -10.0);
            change(&mut stage);
            let position = DVec3::ZERO;
            let rig = Rig::Fixed { position, rotation: glam::DQuat::IDENTITY, look_at: None };
            let projection =
                Projection::Perspective { yfov: std::f32::consts::FRAC_PI_2, near: 0.1, far: None };
            stage.shoot(Camera { projection, ..Camera::new("camera", rig) });
            let stage = Arc::new(stage);
            for time in [0.0, 0.7, 1.5, 2.0].map(secs) {
                let image = Evaluator::new(stage.clone()).for_images(1.0).at(time).unwrap();
                if !image.actors[0].culled {
                    continue;
                }
                culled += 1;
                let whole = stage.at(time).unwrap();
                let meshes = posed_meshes(&stick(), &whole.actors[0]);
                let vertices = meshes.iter().flat_map(|mesh| &mesh.primitives).flat_map(|p| &p.positions);
                let beside = |v: &DVec3| v.x > -v.z;
                assert!(vertices.into_iter().all(beside), "{name}, {distance} m, {} s", time.as_secs());
            }
        }
        assert_eq!(culled > 0, is_bounded, "{name}: left out {culled} times");
    }
}
