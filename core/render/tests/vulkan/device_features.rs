//! Optional device features: frames are drawn with the documented fallback where a feature is missing, and features that exist have
//! their effect.

use crate::common::*;
use choreo_asset::*;
use choreo_plugin::Frame;
use choreo_render::vulkan::{Ability, DeviceTime};
use choreo_render::*;
use choreo_stage::*;
use glam::{DAffine3, DQuat, DVec3, Vec2, Vec4};
use std::sync::Arc;

const SIZE: [u32; 2] = [160, 96];
/// Side, in pixels, of the squares over which the supersampled reference is averaged.
const FINE: u32 = 8;

/// A checkered floor that reaches to the horizon, seen from low above it.
fn striped_floor() -> Scene {
    let mut scene = Scene::perspective(0.7, 3.0);
    scene.snapshot.camera.world_from_view.translation.y = 0.6;
    let stripes =
        image(64, 64, |x, y| if (x / 8 + y / 8) % 2 == 0 { [230, 230, 230, 255] } else { [20, 20, 20, 255] });
    let mut plane = quad(30.0, 30.0);
    plane.uvs[0].iter_mut().for_each(|uv| *uv *= Vec2::splat(30.0));
    let sampler = Sampler { mip_linear: Some(true), ..Sampler::default() };
    let texture = TextureRef { sampler, ..texture(0) };
    let material = Material { base_color_texture: Some(texture), ..unlit(Vec4::ONE) };
    let flat = DAffine3::from_rotation_translation(
        DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2),
        DVec3::new(0.0, 0.0, -20.0),
    );
    scene.add(&asset(vec![plane], vec![material], vec![stripes]), flat);
    scene
}

/// The image reduced by `FINE` per side, as means in linear light.
fn downsample(frame: &Frame) -> Vec<f64> {
    let mut out = Vec::new();
    for (y, x) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (y, x))) {
        let inside = (0..FINE * FINE).map(|i| (x * FINE + i % FINE, y * FINE + i / FINE));
        let sum: f64 = inside.map(|(x, y)| decode(pixel(frame, x, y)[0])).sum();
        out.push(sum / f64::from(FINE * FINE));
    }
    out
}

fn root_mean_square_error(frame: &Frame, truth: &[f64]) -> f64 {
    let of = |i: usize| (decode(frame.rgba[4 * i]) - truth[i]).powi(2);
    ((0..truth.len()).map(of).sum::<f64>() / truth.len() as f64).sqrt()
}

#[test]
fn anisotropic_filtering_is_closer_to_supersampling() {
    let scene = striped_floor();
    let draw = |options: GpuOptions, size: [u32; 2]| {
        vulkan(options).map(|mut gpu| draw_with(&mut gpu, &scene, &PlanOptions::new(size, 1)))
    };
    let with = |anisotropy| GpuOptions { anisotropy, ..GpuOptions::default() };
    let Some(fine) = draw(with(Some(1.0)), SIZE.map(|s| s * FINE)) else { return };
    let truth = downsample(&fine);
    let [plain, most] = [Some(1.0), Some(16.0)].map(|a| draw(with(a), SIZE).unwrap());
    println!(
        "root mean square off 64 samples: {:.4} without, {:.4} with 16",
        root_mean_square_error(&plain, &truth),
        root_mean_square_error(&most, &truth)
    );
    assert!(root_mean_square_error(&most, &truth) < 0.8 * root_mean_square_error(&plain, &truth));
    // Filtering is isotropic by default on a CPU device, and on one without the feature.
    let kind = vulkan(GpuOptions::default()).map(|gpu| gpu.device().kind);
    if kind == Some(DeviceKind::VulkanCpu) {
        assert_eq!(draw(with(None), SIZE).unwrap().rgba, plain.rgba);
    }
    let lacking = GpuOptions { without: vec![Ability::SamplerAnisotropy], ..with(Some(16.0)) };
    assert_eq!(draw(lacking, SIZE).unwrap().rgba, plain.rgba);
}

/// The busy scene on a device without any optional feature is drawn without validation messages.
#[test]
fn a_device_without_any_optional_feature_draws() {
    let mut scene = busy_scene(DVec3::ZERO);
    scene.stage.settings.transparency = Transparency::Independent;
    for samples in [1, 4] {
        for without in [Ability::ALL.to_vec(), vec![]] {
            let Some(mut gpu) = vulkan(GpuOptions { without, ..GpuOptions::default() }) else { return };
            let frame = draw_with(&mut gpu, &scene, &PlanOptions::new(SIZE, samples));
            assert!(frame.rgba.chunks_exact(4).filter(|p| p[0] != 0).count() > 1000);
        }
    }
}

#[test]
fn the_device_time_of_frames_is_measured() {
    let time = Arc::new(DeviceTime::default());
    let options = GpuOptions { device_time: Some(time.clone()), ..GpuOptions::default() };
    let Some(mut gpu) = vulkan(options) else { return };
    let scene = striped_floor();
    for _ in 0..5 {
        draw_with(&mut gpu, &scene, &PlanOptions::new([640, 360], 4));
    }
    let (frames, secs) = time.total();
    println!("{frames} frames, {:.3} ms each", secs * 1e3 / frames as f64);
    assert_eq!(frames, 5);
    assert!(secs > 0.0 && secs < 60.0, "{secs} s");
}
