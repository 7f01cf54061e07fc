//! Devices that bind fewer textures than a material has: the least visible textures are left out and reported.

use crate::common::layered::{bulge, layered};
use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_render::commands::texture_slots;
use choreo_render::*;
use glam::{Vec3, Vec4};

/// A material with clearcoat and sheen and eight textures, without those named in `left_out`.
fn scene(left_out: &[&str]) -> Scene {
    let has = |name: &str| (!left_out.contains(&name)).then(|| texture(0));
    let layers = MaterialLayers {
        clearcoat: 0.8,
        clearcoat_roughness: 0.2,
        clearcoat_texture: Some(texture(0)),
        clearcoat_roughness_texture: has("roughness of the coat"),
        sheen_color: Vec3::new(0.9, 0.5, 0.3),
        sheen_color_texture: has("sheen color"),
        sheen_roughness: 0.6,
        sheen_roughness_texture: has("roughness of the sheen"),
        ..MaterialLayers::default()
    };
    let base = Material {
        name: "velvet".into(),
        base_color_texture: Some(texture(0)),
        occlusion_texture: has("occlusion"),
        specular_texture: has("specular"),
        metallic_roughness_texture: Some(texture(1)),
        roughness: 0.6,
        ..matte(Vec4::new(0.7, 0.6, 0.8, 1.0))
    };
    let stripes = image(8, 8, |x, y| {
        let on = (x + y) % 2 == 0;
        if on { [255, 255, 255, 255] } else { [40, 60, 90, 70] }
    });
    let rough = image(4, 4, |x, _| [255, 80 + 40 * x as u8, 0, 255]);
    let mut scene = Scene::perspective(0.9, 1.6);
    scene.sun(Vec3::new(-0.3, -0.4, -0.8), Vec3::ONE, 1.0);
    scene.snapshot.ambient_up = Vec3::splat(0.5);
    scene.snapshot.ambient_down = Vec3::splat(0.3);
    scene.at(&asset(vec![bulge(0.7)], vec![layered(layers, base)], vec![stripes, rough]), 0.0, 0.0, -0.7);
    scene
}

#[test]
fn the_least_visible_textures_are_left_out_and_reported() {
    let (whole, options) = (scene(&[]), PlanOptions::new([160, 160], 1));
    let (_, plan) = whole.plan(&options);
    assert_eq!(texture_slots(plan.draws[0].pipeline.features).count_ones(), 8);
    let complete = draw(&whole, &options);
    let order = ["roughness of the sheen", "roughness of the coat", "specular", "occlusion", "sheen color"];
    // A device with room for all, with room for six, and with room for three.
    for (most, out) in [(None, &order[..0]), (Some(6), &order[..2]), (Some(3), &order[..])] {
        let Some(mut r) = vulkan(GpuOptions { textures: most, ..GpuOptions::default() }) else { return };
        let frame = draw_with(&mut r, &whole, &options);
        let said = r.take_notes();
        let line = most.map(|most| {
            let names = out.join(", ");
            format!("material \"velvet\": this device binds at most {most} textures; left out: {names}")
        });
        assert_eq!(said, Vec::from_iter(line));
        // The shader reads only the bound textures: the image is that of the CPU reference without the others.
        let c = compare(&frame, &draw(&scene(out), &options), 2).unwrap();
        println!("{most:?} textures: {c}");
        assert!(c.mean < 0.15 && c.share_beyond < 0.01, "{most:?}: {c}");
        // The comparison can fail: the image with all textures differs.
        let differs = compare(&frame, &complete, 2).unwrap();
        assert_eq!(differs.share_beyond > 0.02, !out.is_empty(), "{most:?}: {differs}");
        // Bound textures are counted in the recording.
        let bound = r.last_recording().unwrap().commands.iter().find_map(|c| match c {
            choreo_render::commands::Command::BindMaterial { slots, .. } => Some(slots.count_ones()),
            _ => None,
        });
        assert_eq!(bound, Some(8 - out.len() as u32));
    }
}
