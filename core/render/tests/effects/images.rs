//! Image parameters of effects: in every hook that shaders run, two images in one effect, two uses with different images
//! in one frame, and the default images of the file; closed forms in both renderers.

use crate::common::*;
use choreo_asset::{Image, Material};
use choreo_plugin::{Effect, Frame, Registry};
use choreo_render::plan::frame_key::frame_key;
use choreo_render::*;
use choreo_stage::EffectImageUse;
use choreo_wgsl_effect::{TextureImage, WgslEffect};
use glam::{DAffine3, Vec3, Vec4};
use std::sync::Arc;

const SIZE: [u32; 2] = [200, 150];
const HALF: f64 = 128.0 / 255.0;

/// Texels of an image of two columns and three rows: all texels and all channels of a texel differ.
const TEXELS: [[[u8; 4]; 2]; 3] = [
    [[51, 204, 0, 255], [204, 102, 26, 255]],
    [[153, 0, 77, 255], [0, 128, 230, 255]],
    [[102, 51, 255, 255], [255, 179, 128, 255]],
];

/// The only texel of a second image.
const TINT: [u8; 4] = [188, 100, 230, 255];

fn map_image() -> Arc<Image> {
    image(2, 3, |x, y| TEXELS[y as usize][x as usize])
}

/// The image with its columns swapped.
fn mirrored_map_image() -> Arc<Image> {
    image(2, 3, |x, y| TEXELS[y as usize][1 - x as usize])
}

fn tint_image() -> Arc<Image> {
    image(1, 1, |_, _| TINT)
}

/// Bilinear sample of the image `map`, which repeats in both directions.
fn sample_map(u: f64, v: f64) -> [f64; 3] {
    let (x, y) = (u * 2.0 - 0.5, v * 3.0 - 0.5);
    let texel = |dx: f64, dy: f64| {
        let column = (x.floor() + dx).rem_euclid(2.0) as usize;
        let row = (y.floor() + dy).rem_euclid(3.0) as usize;
        let share = (1.0 - (x - x.floor() - dx).abs()) * (1.0 - (y - y.floor() - dy).abs());
        [0, 1, 2].map(|c| share * f64::from(TEXELS[row][column][c]) / 255.0)
    };
    let all = [texel(0.0, 0.0), texel(1.0, 0.0), texel(0.0, 1.0), texel(1.0, 1.0)];
    [0, 1, 2].map(|c| all.iter().map(|texel| texel[c]).sum())
}

/// The second image, whose bytes are encoded as sRGB (IEC 61966-2-1).
fn tint_color() -> [f64; 3] {
    [0, 1, 2].map(|c| ((f64::from(TINT[c]) / 255.0 + 0.055) / 1.055).powf(2.4))
}

fn product(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|c| a[c] * b[c])
}

/// An effect with the images `tint` (colors) and `map` (data), whose product it weights by `share`. Its default `map`,
/// `own.png`, is half gray, and its default `tint` is white.
fn effect(name: &str, head: &str, function: &str) -> Effect {
    let text = format!(
        "// effect: {name}\n{head}// param share = 1 in 0..1: how much\n// param tint = texture(): a color\n\
         // param map = texture(own.png as data): numbers\n{function}\n"
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
    return color * map(1.5 * uv - 0.25) * tint(uv) * p.share; }",
        ),
        (
            "on_image",
            "// hook: image\n",
            "fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    let uv = (vec2<f32>(at) + 0.5) / vec2<f32>(picture_size());
    return picture(at) * map(1.5 * uv - 0.25) * tint(uv) * p.share; }",
        ),
        (
            "on_surfaces",
            "// hook: surface\n",
            "fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> {
    let uv = vec2(0.375 * surface.world.x + 0.5, 0.5 - 0.5 * surface.world.y);
    return color * map(1.5 * uv - 0.25) * tint(uv) * p.share; }",
        ),
        (
            "on_light",
            "// hook: lighting\n",
            "fn effect(sample: LightSample, p: Parameters) -> vec3<f32> {
    return map(vec2(0.25, 0.5)).xyz * tint(vec2(0.0)).xyz * p.share; }",
        ),
        (
            "on_vertices",
            "// hook: vertex\n// reach: 1\n",
            "fn effect(vertex: VertexSample, p: Parameters) -> vec3<f32> {
    return vec3(0.0, 0.5 * map(vec2(0.75, 5.0 / 6.0)).z * tint(vec2(0.0)).y * p.share, 0.0); }",
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

/// Adds an effect with the given images; it keeps its default images for the others.
fn use_effect_with_images(scene: &mut Scene, name: &str, images: &[(&str, Arc<Image>)]) {
    use_effect(scene, name, &[], &[]);
    let used = scene.stage.effects.last_mut().unwrap();
    used.images.extend(images.iter().map(|(parameter, image)| EffectImageUse {
        parameter: (*parameter).into(),
        hash: image.content_hash(),
        image: image.clone(),
    }));
}

/// The frame on both devices.
fn draw_on_both(scene: &Scene) -> Vec<(&'static str, Frame)> {
    let registry = registry().settled_for([&scene.stage]);
    let effects = registry.effects();
    let options = PlanOptions { effects, ..PlanOptions::new(SIZE, 1) };
    let mut out = vec![("CPU", draw_with(&mut CpuRenderer::new(effects), scene, &options))];
    let gpu = GpuOptions { effects: effects.to_vec(), ..GpuOptions::default() };
    out.extend(vulkan(gpu).map(|mut renderer| ("Vulkan", draw_with(&mut renderer, scene, &options))));
    out
}

#[test]
fn pixel_image_and_surface_effects_read_the_chosen_images() {
    for name in ["on_pixels", "on_image", "on_surfaces"] {
        for (images, own) in [(&[("map", map_image()), ("tint", tint_image())][..], false), (&[], true)] {
            let mut scene = wall(2.0, unlit(Vec4::ONE));
            use_effect_with_images(&mut scene, name, images);
            for (device, frame) in draw_on_both(&scene) {
                for [x, y] in [[9, 140], [50, 20], [75, 75], [120, 101], [149, 130], [195, 6]] {
                    let uv = |at: u32, size: u32| 1.5 * (f64::from(at) + 0.5) / f64::from(size) - 0.25;
                    let expected = match own {
                        true => [HALF; 3],
                        false => product(sample_map(uv(x, SIZE[0]), uv(y, SIZE[1])), tint_color()),
                    };
                    assert_color(pixel(&frame, x, y), expected, &format!("{name} at {x}, {y} on {device}"));
                }
            }
        }
    }
}

#[test]
fn light_and_vertex_effects_read_the_chosen_images() {
    let chosen = [("map", map_image()), ("tint", tint_image())];
    let lit = product(sample_map(0.25, 0.5), tint_color());
    let moved = 0.5 * sample_map(0.75, 5.0 / 6.0)[2] * tint_color()[1];
    for (images, lit, moved) in [(&chosen[..], lit, moved), (&[], [HALF; 3], HALF * 0.5)] {
        let mut scene = wall(2.0, matte(Vec4::ONE));
        use_effect_with_images(&mut scene, "on_light", images);
        for (device, frame) in draw_on_both(&scene) {
            assert_color(pixel(&frame, 100, 75), lit, &format!("light on {device}"));
        }
        let mut scene = wall(0.25, unlit(Vec4::ONE));
        use_effect_with_images(&mut scene, "on_vertices", images);
        for (device, frame) in draw_on_both(&scene) {
            let last = (0..SIZE[1]).rfind(|y| pixel(&frame, 100, *y)[0] > 128).unwrap_or(0);
            let bottom = 75.0 + 75.0 * (0.25 - moved);
            assert!((f64::from(last) + 1.0 - bottom).abs() <= 0.51, "vertices on {device}: {last} {bottom}");
        }
    }
}

/// Each use of an effect has its own images, and a use without images keeps the defaults of the file.
#[test]
fn uses_with_different_images_draw_side_by_side() {
    let mut scene = wall(2.0, unlit(Vec4::ONE));
    use_effect_with_images(&mut scene, "on_pixels", &[("map", map_image())]);
    use_effect_with_images(&mut scene, "on_pixels", &[("map", mirrored_map_image()), ("tint", tint_image())]);
    use_effect_with_images(&mut scene, "on_pixels", &[]);
    let names: Vec<String> = scene.stage.effects.iter().map(|used| used.effect_name().into_owned()).collect();
    assert!(names[0] != names[1] && names[0].starts_with("on_pixels (map: ") && names[2] == "on_pixels");
    // The left column of the first image is the right column of the second.
    let mut surfaces = wall(2.0, unlit(Vec4::ONE));
    use_effect_with_images(&mut surfaces, "on_surfaces", &[("map", mirrored_map_image())]);
    use_effect_with_images(&mut surfaces, "on_surfaces", &[("tint", tint_image()), ("map", map_image())]);
    use_effect_with_images(&mut surfaces, "on_surfaces", &[]);
    let [x, y] = [66, 24];
    let v = 1.5 * (f64::from(y) + 0.5) / f64::from(SIZE[1]) - 0.25;
    let u = 1.5 * (f64::from(x) + 0.5) / f64::from(SIZE[0]) - 0.25;
    let both = product(sample_map(u, v), product(sample_map(1.0 - u, v), tint_color()));
    for (device, frame) in draw_on_both(&scene).into_iter().chain(draw_on_both(&surfaces)) {
        assert_color(pixel(&frame, x, y), both.map(|c| c * HALF), &format!("both on {device}"));
    }
}

#[test]
fn frames_with_different_effect_images_have_different_keys() {
    let key = |images: &[(&str, Arc<Image>)]| {
        let mut scene = wall(1.0, unlit(Vec4::ONE));
        use_effect_with_images(&mut scene, "on_surfaces", images);
        let registry = registry().settled_for([&scene.stage]);
        let options = PlanOptions { effects: registry.effects(), ..PlanOptions::new(SIZE, 1) };
        let (resources, plan) = scene.plan(&options);
        frame_key(&plan, &resources, registry.effects())
    };
    let mapped = key(&[("map", map_image())]);
    assert!(mapped == key(&[("map", map_image())]));
    assert!(
        mapped != key(&[("map", mirrored_map_image())])
            && mapped != key(&[])
            && mapped != key(&[("tint", map_image())])
    );
}
