//! Lights of a stage: the default sun, lights of files, parents, keys and callbacks.

use crate::support::*;
use choreo_asset::*;
use choreo_motion::{Interpolation, Time};
use choreo_stage::*;
use glam::{DVec3, Vec3};
use std::sync::Arc;

fn point_light(intensity: f32) -> Light {
    Light { kind: LightKind::Point, color: Vec3::ONE, intensity, range: Some(3.0) }
}

/// A figure whose file has a spot light in the hand.
fn torch_bearer() -> Arc<Asset> {
    let light = Light { kind: LightKind::Spot { inner: 0.1, outer: 0.3 }, ..point_light(5.0) };
    Arc::new(Asset {
        lights: vec![AssetLight { name: "torch".into(), joint: HAND, light }],
        ..(*figure()).clone()
    })
}

#[test]
fn default_sun_shines_only_on_a_stage_without_lights() {
    let mut stage = Stage::default();
    assert_eq!(stage.at(Time::ZERO).unwrap().lights, [default_sun()]);
    stage.cast("anna", torch_bearer());
    assert_eq!(stage.at(Time::ZERO).unwrap().lights.len(), 1);
    assert!(matches!(stage.at(Time::ZERO).unwrap().lights[0].light.kind, LightKind::Spot { .. }));
    // Hiding her does not bring the sun out; taking her file's light away does.
    stage.actors[0].visible = false;
    assert!(stage.at(Time::ZERO).unwrap().lights.is_empty());
    stage.actors[0].file_lights = false;
    assert_eq!(stage.at(Time::ZERO).unwrap().lights, [default_sun()]);
    // A light of the stage that is off is still the author's choice of light.
    stage.lights.push(StageLight::new("off", point_light(0.0)));
    assert!(stage.at(Time::ZERO).unwrap().lights.is_empty());
}

#[test]
fn default_sun_and_ambient_light_white_to_about_one() {
    // A matte surface that faces it, under all of the ambient light from above.
    let LightState { light, direction, .. } = default_sun();
    let lit = light.color * light.intensity / std::f32::consts::PI + Settings::default().ambient_up;
    assert!(lit.max_element() < 1.2 && lit.max_element() > 1.0, "{lit}");
    assert!(light.color.x > light.color.y && light.color.y > light.color.z, "warm");
    assert!((direction.length() - 1.0).abs() < 1e-6 && direction.y < -0.5);
}

#[test]
fn light_of_a_file_moves_with_its_joint() {
    let asset = torch_bearer();
    let mut stage = Stage::default();
    stage.cast("anna", asset.clone());
    stage.actors[0].transform = Placement::at(0.0, 0.0, 3.0).turned(std::f64::consts::FRAC_PI_2);
    stage.play(0, Cue { repeat: Repeat::Once, ..Cue::new(asset.clips[RAISE].clone()) });
    let light = stage.at(secs(2.0)).unwrap().lights[0];
    // Arm straight up at x 0.3 of a model whose x is the world's -z.
    assert_close(light.position, v(0.0, 2.0, 2.7), 1e-6);
    // -Z of the hand: the model's -Z, the world's -X.
    assert_close(light.direction.as_dvec3(), v(-1.0, 0.0, 0.0), 1e-6);
}

#[test]
fn lights_follow_parents_keys_and_callbacks() {
    let mut stage = Stage::default();
    stage.cast("anna", figure());
    stage.actors[0].transform = Placement::at(5.0, 0.0, 0.0).turned(std::f64::consts::FRAC_PI_2);
    let mut lamp = StageLight::new("lamp", point_light(2.0));
    lamp.position = v(0.0, 0.0, 0.5);
    lamp.parent = Some(Attachment { actor: 0, joint: Some(HEAD) });
    let key = |property, values: &[f64]| Channel {
        property,
        interpolation: Interpolation::Linear,
        times: vec![secs(0.0), secs(2.0)],
        values: values.to_vec(),
    };
    lamp.channels =
        vec![key(Property::Intensity, &[2.0, 0.0]), key(Property::Color, &[1.0, 1.0, 1.0, 1.0, 0.0, 0.0])];
    stage.lights.push(lamp);
    let turn = glam::DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2).to_array();
    let mut sun = StageLight::sun("sun", Vec3::X, 1.0);
    sun.channels = vec![key(Property::Rotation, &[turn, turn].concat())];
    stage.lights.push(sun);
    assert_eq!(stage.check().len(), 0, "{:?}", stage.check());
    let lights = stage.at(secs(1.0)).unwrap().lights;
    assert_close(lights[0].position, v(5.5, 1.6, 0.0), 1e-6);
    assert_eq!((lights[0].light.intensity, lights[0].light.color), (1.0, Vec3::new(1.0, 0.5, 0.5)));
    // As in glTF a rotation turns -Z: here to straight down.
    assert_close(lights[1].direction.as_dvec3(), v(0.0, -1.0, 0.0), 1e-6);
    // Out at 2 s: not in the list at all.
    assert_eq!(stage.at(secs(2.0)).unwrap().lights.len(), 1);
    #[derive(Debug)]
    struct Callback;
    impl FrameCallback for Callback {
        fn run(&self, _: Time, edits: &mut FrameEdits) -> Result<(), StageError> {
            edits.lights.push((0, LightEdit::Intensity(9.0)));
            edits.lights.push((0, LightEdit::Color(Vec3::Y)));
            edits.lights.push((0, LightEdit::MoveTo(DVec3::ZERO)));
            edits.lights.push((1, LightEdit::Intensity(0.0)));
            edits.lights.push((50, LightEdit::Intensity(1.0)));
            Ok(())
        }
    }
    stage.frame_callbacks.push(Arc::new(Callback));
    let lights = stage.at(secs(2.0)).unwrap().lights;
    assert_eq!(lights.len(), 1);
    assert_eq!((lights[0].light.intensity, lights[0].light.color), (9.0, Vec3::Y));
    assert_close(lights[0].position, v(5.0, 1.6, 0.0), 1e-6);
}

#[test]
fn lights_of_files_and_scripts_have_the_same_units() {
    let mut asset = (*torch_bearer()).clone();
    asset.lights[0].light = Light { kind: LightKind::Directional, ..point_light(5.0) };
    let mut stage = Stage::default();
    stage.cast("anna", Arc::new(asset));
    stage.lights.push(StageLight::new("mine", Light { kind: LightKind::Directional, ..point_light(5.0) }));
    let intensities: Vec<f32> =
        stage.at(Time::ZERO).unwrap().lights.iter().map(|l| l.light.intensity).collect();
    assert_eq!(intensities, [5.0, 5.0]);
}
