//! Per-frame overrides of materials: both renderers use the current values, and other actors' materials stay as they are.

use crate::common::*;
use choreo_asset::*;
use choreo_motion::{Clip, Interpolation, MaterialProperty, PropertyCurve, PropertyTarget, Time};
use choreo_render::plan::Features;
use choreo_render::*;
use choreo_stage::*;
use glam::{Affine2, Vec2, Vec3, Vec4};
use std::sync::Arc;

/// A wall whose material is animated by a clip of its file, so that the scene resources expect overrides.
fn asset_with_animated_material(
    material: Material,
    properties: &[MaterialProperty],
    images: Vec<Arc<Image>>,
) -> Arc<Asset> {
    let mut asset = Arc::unwrap_or_clone(asset(vec![quad(2.0, 2.0)], vec![material], images));
    let curves = properties.iter().map(|property| {
        let target = PropertyTarget::Material(0, *property);
        let values = vec![0.0; target.width()].into();
        let times = [Time::ZERO].into();
        PropertyCurve { target, interpolation: Interpolation::Linear, times, values }
    });
    let clip = Clip::new("drives".into(), 1, Vec::new()).unwrap().with_properties(curves.collect()).unwrap();
    asset.clips.push(Arc::new(clip));
    Arc::new(asset)
}

fn override_material(scene: &mut Scene, actor: usize, now: Material) {
    scene.snapshot.actors[actor].materials = vec![ChangedMaterial { material: 0, now }];
}

/// Two walls side by side with a half red, half green texture, which an override moves by half its width on the right wall.
fn two_walls() -> Scene {
    let halves = image(2, 1, |x, _| if x == 0 { [255, 0, 0, 255] } else { [0, 255, 0, 255] });
    let mut texture = texture(0);
    texture.sampler.mag_linear = false;
    let material = Material { base_color_texture: Some(texture), ..unlit(Vec4::ONE) };
    let a = asset_with_animated_material(material.clone(), &[MaterialProperty::UvOffset(0)], vec![halves]);
    let mut scene = Scene::ortho(4.0);
    scene.at(&a, -2.0, 0.0, 0.0);
    scene.at(&a, 2.0, 0.0, 0.0);
    let mut moved = material;
    let shift = Affine2::from_translation(Vec2::new(0.5, 0.0));
    moved.base_color_texture.as_mut().unwrap().uv_transform = shift;
    override_material(&mut scene, 1, moved);
    scene
}

fn scene_with_emission(emissive: Vec3) -> Scene {
    let rest = Material { specular: 0.0, ..matte(Vec4::ZERO) };
    let a = asset_with_animated_material(rest.clone(), &[MaterialProperty::Emissive], vec![]);
    let mut scene = Scene::ortho(2.0);
    scene.at(&a, 0.0, 0.0, 0.0);
    override_material(&mut scene, 0, Material { emissive, ..rest });
    scene
}

fn check_overrides(mut draw: impl FnMut(&Scene, [u32; 2]) -> choreo_plugin::Frame) {
    let frame = draw(&two_walls(), [80, 40]);
    let at = |x| pixel(&frame, x, 20);
    assert_eq!(
        [at(10), at(30)],
        [[255, 0, 0, 255], [0, 255, 0, 255]],
        "the left wall has the material of its file"
    );
    assert_eq!([at(50), at(70)], [[0, 255, 0, 255], [255, 0, 0, 255]], "the right wall's texture is moved");
    // Emission that is zero in the file is added when an override sets it.
    assert_color(
        pixel(&draw(&scene_with_emission(Vec3::new(0.5, 0.25, 1.0)), [5, 5]), 2, 2),
        [0.5, 0.25, 1.0],
        "emission",
    );
    assert_color(pixel(&draw(&scene_with_emission(Vec3::ZERO), [5, 5]), 2, 2), [0.0; 3], "no emission");
}

#[test]
fn the_cpu_renderer_draws_overridden_materials() {
    check_overrides(|scene, size| draw_at(scene, size, 1));
}

#[test]
fn vulkan_draws_overridden_materials() {
    let Some(mut r) = vulkan(GpuOptions::default()) else { return };
    check_overrides(|scene, size| draw_with(&mut r, scene, &PlanOptions::new(size, 1)));
}

#[test]
fn the_plan_holds_only_overridden_materials() {
    let scene = two_walls();
    let (_, plan) = scene.plan(&PlanOptions::new([80, 40], 1));
    assert_eq!(plan.material_overrides.len(), 1);
    let changed: Vec<Option<u32>> = plan.draws.iter().map(|d| d.material_override).collect();
    assert_eq!(changed, [None, Some(0)], "two draws, though the mesh is the same");
    let transforms = plan.draws.iter().map(|d| d.pipeline.features.has(Features::UV_TRANSFORM));
    assert_eq!(transforms.collect::<Vec<_>>(), [false, true], "only the moved one pays for moving");
    // If the snapshot changes nothing, the copies are one draw again.
    let mut still = two_walls();
    still.snapshot.actors[1].materials.clear();
    let (_, plan) = still.plan(&PlanOptions::new([80, 40], 1));
    assert_eq!((plan.material_overrides.len(), plan.draws.len()), (0, 1));
}
