//! Images as parameters of effects: in the functions of every hook that shaders run, two uses with different images in one frame, the
//! images of the file where none is given; closed forms on both devices.

mod common;

use choreo_asset::{Image, Material};
use choreo_plugin::{Effect, Frame, Registry};
use choreo_render::plan::frame_key::frame_key;
use choreo_render::*;
use choreo_stage::EffectImageUse;
use choreo_wgsl_effect::{TextureImage, WgslEffect};
use common::*;
use glam::{DAffine3, Vec3, Vec4};
use std::sync::Arc;

const SIZE: [u32; 2] = [200, 150];

/// Two columns of data: 0.2 and 0.8 of red, and the same of the other end of green.
const COLUMNS: [[u8; 4]; 2] = [[51, 204, 0, 255], [204, 51, 0, 255]];

fn columns(rows: u32) -> Arc<Image> {
    image(2, rows, |x, _| COLUMNS[x as usize])
}

/// An effect whose image `map` multiplies with what its number says. Its own image, `own.png`, is half gray.
fn effect(name: &str, head: &str, function: &str) -> Effect {
    let text = format!(
        "// effect: {name}\n{head}// param share = 1 in 0..1: how much\n// param map = texture(own.png as data): what it multiplies\n\
         // param white = texture(): nothing given\n{function}\n"
    );
    let own = |file: &str| match file {
        "own.png" => Ok(TextureImage { size: [1, 1], rgba: vec![128, 128, 128, 255], file: None }),
        other => Err(format!("no {other}")),
    };
    WgslEffect::with_textures("my.wgsl", &text, own).unwrap_or_else(|e| panic!("{e}\n{text}")).into()
}

fn registry() -> Registry {
    let mut registry = Registry::default();
    for (name, head, function) in [
        (
            "on_pixels",
            "",
            "fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32> {
    return color * map(uv) * white(uv) * p.share; }",
        ),
        (
            "on_image",
            "// hook: image\n",
            "fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    return picture(at) * map((vec2<f32>(at) + 0.5) / vec2<f32>(picture_size())) * white(vec2(0.5)) * p.share; }",
        ),
        (
            "on_surfaces",
            "// hook: surface\n",
            "fn effect(color: vec4<f32>, seen: Seen, p: Parameters) -> vec4<f32> {
    return color * map(seen.world.xy * 0.375 + 0.5) * p.share; }",
        ),
        (
            "on_light",
            "// hook: lighting\n",
            "fn effect(falling: Falling, p: Parameters) -> vec3<f32> { return map(vec2(0.25, 0.5)).xyz * p.share; }",
        ),
        (
            "on_vertices",
            "// hook: vertex\n// reach: 1\n",
            "fn effect(place: Place, p: Parameters) -> vec3<f32> { return vec3(0.0, 0.5 * map(vec2(0.75, 0.5)).x * p.share, 0.0); }",
        ),
    ] {
        registry.add_effect(effect(name, head, function));
    }
    registry
}

fn wall(half: f32, material: Material) -> Scene {
    let mut scene = Scene::ortho(2.0);
    scene.sun(Vec3::NEG_Z, Vec3::ONE, 1.0);
    scene.add(&asset(vec![quad(half, half)], vec![material], vec![]), DAffine3::IDENTITY);
    scene
}

/// Uses an effect with an image, or with its own.
fn choose(scene: &mut Scene, name: &str, map: Option<Arc<Image>>) {
    use_effect(scene, name, &[], &[]);
    let used = scene.stage.effects.last_mut().unwrap();
    used.images.extend(map.map(|image| EffectImageUse {
        parameter: "map".into(),
        hash: image.content_hash(),
        image,
    }));
}

/// The frame on both devices.
fn drawn(scene: &Scene) -> Vec<(&'static str, Frame)> {
    let registry = registry().settled_for([&scene.stage]);
    let effects = registry.effects();
    let options = PlanOptions { effects, ..PlanOptions::new(SIZE, 1) };
    let mut out = vec![("CPU", draw_with(&mut CpuRenderer::new(effects), scene, &options))];
    let gpu = GpuOptions { effects: effects.to_vec(), ..GpuOptions::default() };
    out.extend(vulkan(gpu).map(|mut renderer| ("Vulkan", draw_with(&mut renderer, scene, &options))));
    out
}

const HALF: f64 = 128.0 / 255.0;

#[test]
fn functions_of_a_place_read_the_chosen_image() {
    for name in ["on_pixels", "on_image", "on_surfaces"] {
        for (map, left, right) in
            [(Some(columns(1)), [0.2, 0.8, 0.0], [0.8, 0.2, 0.0]), (None, [HALF; 3], [HALF; 3])]
        {
            let mut scene = wall(2.0, unlit(Vec4::ONE));
            choose(&mut scene, name, map);
            for (device, frame) in drawn(&scene) {
                // The middles of the two columns of texels.
                for (x, expected) in [(50, left), (149, right)] {
                    assert_color(pixel(&frame, x, 75), expected, &format!("{name} at {x} on {device}"));
                }
            }
        }
    }
}

#[test]
fn functions_of_light_and_vertices_read_the_chosen_image() {
    for (map, lit, moved) in [(Some(columns(1)), [0.2, 0.8, 0.0], 0.4), (None, [HALF; 3], HALF * 0.5)] {
        let mut scene = wall(2.0, matte(Vec4::ONE));
        choose(&mut scene, "on_light", map.clone());
        for (device, frame) in drawn(&scene) {
            assert_color(pixel(&frame, 100, 75), lit, &format!("light on {device}"));
        }
        let mut scene = wall(0.25, unlit(Vec4::ONE));
        choose(&mut scene, "on_vertices", map);
        for (device, frame) in drawn(&scene) {
            let last = (0..SIZE[1]).rfind(|y| pixel(&frame, 100, *y)[0] > 128).unwrap_or(0);
            let bottom = 75.0 + 75.0 * (0.25 - moved);
            assert!((f64::from(last) + 1.0 - bottom).abs() <= 0.51, "vertices on {device}: {last} {bottom}");
        }
    }
}

/// Each use has its own image, and the effect without one keeps the file's.
#[test]
fn uses_with_different_images_draw_side_by_side() {
    let swapped = image(2, 1, |x, _| COLUMNS[1 - x as usize]);
    let mut scene = wall(2.0, unlit(Vec4::ONE));
    choose(&mut scene, "on_pixels", Some(columns(1)));
    choose(&mut scene, "on_pixels", Some(swapped.clone()));
    choose(&mut scene, "on_pixels", None);
    choose(&mut scene, "on_surfaces", Some(columns(4)));
    choose(&mut scene, "on_surfaces", Some(swapped));
    let names: Vec<String> = scene.stage.effects.iter().map(|used| used.drawn_by().into_owned()).collect();
    assert!(names[0] != names[1] && names[0].starts_with("on_pixels (map: ") && names[2] == "on_pixels");
    for (device, frame) in drawn(&scene) {
        for x in [50, 149] {
            let product = 0.16 * 0.16 * HALF;
            assert_color(pixel(&frame, x, 75), [product, product, 0.0], &format!("at {x} on {device}"));
        }
    }
}

#[test]
fn frames_with_other_images_are_not_equal() {
    let key = |map: Option<Arc<Image>>| {
        let mut scene = wall(1.0, unlit(Vec4::ONE));
        choose(&mut scene, "on_surfaces", map);
        let registry = registry().settled_for([&scene.stage]);
        let options = PlanOptions { effects: registry.effects(), ..PlanOptions::new(SIZE, 1) };
        let (resources, plan) = scene.plan(&options);
        frame_key(&plan, &resources, registry.effects())
    };
    assert!(key(Some(columns(1))) == key(Some(columns(1))));
    assert!(key(Some(columns(1))) != key(Some(columns(2))) && key(Some(columns(1))) != key(None));
}
