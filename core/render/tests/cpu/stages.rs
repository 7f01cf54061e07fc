//! The stage images of the CPU renderer agree: the same pixels are covered, have a depth, and are shaded.

use crate::common::*;
use choreo_plugin::Frame;
use choreo_render::cpu::STAGE_IMAGE_NAMES;
use choreo_render::{CpuRenderer, PlanOptions, Renderer};
use glam::{DVec3, Vec4};

const SIZE: [u32; 2] = [450, 150];

fn scene(x: f64) -> Scene {
    let mut scene = Scene::perspective(0.9, 6.0);
    let red = asset(vec![quad(1.0, 0.8)], vec![unlit(Vec4::new(1.0, 0.0, 0.0, 1.0))], vec![]);
    scene.at(&red, x, 0.2, 0.0);
    scene.at(&red, x + 0.7, -0.3, -4.0);
    scene
}

fn draw_stages(scene: &Scene) -> Vec<Frame> {
    let (resources, plan) = scene.plan(&PlanOptions::new(SIZE, 1));
    let mut renderer = CpuRenderer::new(&[]);
    renderer.load(resources).unwrap();
    renderer.draw_stage_images(&plan).unwrap()
}

/// Whether each pixel differs from the first one, which shows the background.
fn differs_from_background(frame: &Frame) -> Vec<bool> {
    let pixels = frame.rgba.as_chunks::<4>().0;
    pixels.iter().map(|p| p[..3] != pixels[0][..3]).collect()
}

#[test]
fn coverage_depth_and_shading_stages_agree_on_the_pixels() {
    let pictures = draw_stages(&scene(-1.3));
    assert_eq!(pictures.len(), STAGE_IMAGE_NAMES.len());
    for (picture, name) in pictures.iter().zip(STAGE_IMAGE_NAMES) {
        assert_eq!([picture.width, picture.height], SIZE, "{name}");
        assert!(differs_from_background(picture).iter().any(|d| *d), "{name} shows nothing");
    }
    let [raster, depth, shade] = [3, 4, 5].map(|i| differs_from_background(&pictures[i]));
    assert!(shade.iter().filter(|d| **d).count() > 500);
    assert_eq!(raster, shade);
    assert_eq!(depth, shade);
    // Four triangles, each in its own color, and the nearer quad brighter than the other.
    let colors: std::collections::BTreeSet<&[u8]> =
        pictures[3].rgba.chunks_exact(4).zip(&raster).filter(|(_, d)| **d).map(|(p, _)| p).collect();
    assert_eq!(colors.len(), 4);
    let grays: std::collections::BTreeSet<u8> =
        pictures[4].rgba.chunks_exact(4).zip(&depth).filter(|(_, d)| **d).map(|(p, _)| p[0]).collect();
    assert_eq!(grays.into_iter().collect::<Vec<_>>(), [40, 255], "two planes that face the camera");
    // The planted fault: the stages of another scene.
    assert_ne!(differs_from_background(&draw_stages(&scene(-1.2))[3]), shade);
}

#[test]
fn an_empty_view_is_no_error() {
    let mut scene = Scene::perspective(0.9, 6.0);
    assert_eq!(draw_stages(&scene).len(), STAGE_IMAGE_NAMES.len());
    scene.at(&asset(vec![quad(1.0, 1.0)], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, 1e30);
    scene.snapshot.camera.world_from_view.translation = DVec3::splat(1e7);
    assert_eq!(draw_stages(&scene).len(), STAGE_IMAGE_NAMES.len());
}
