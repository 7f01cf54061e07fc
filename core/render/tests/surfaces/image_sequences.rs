//! Image sequences: the right image at each time, loaded when it is visible, with few images held at once.

use crate::common::*;
use choreo_asset::*;
use choreo_motion::Time;
use choreo_render::*;
use glam::{Vec3, Vec4};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const COUNT: usize = 40;

/// A sequence of images in different grays; if `broken`, the last but one cannot be loaded.
#[derive(Debug, Default)]
struct Grays {
    made: AtomicUsize,
    broken: bool,
}

fn gray(i: usize) -> [u8; 4] {
    [5 + 6 * i as u8; 3].iter().copied().chain([255]).collect::<Vec<u8>>().try_into().unwrap()
}

impl ImageSource for Grays {
    fn image(&self, index: usize) -> Result<Arc<Image>, ImageSourceError> {
        self.made.fetch_add(1, Ordering::Relaxed);
        if self.broken && index == COUNT - 2 {
            return Err(ImageSourceError::Undecodable {
                file: "grey_38.png".into(),
                what: "its data ends early".into(),
            });
        }
        Ok(image(4, 4, |_, _| gray(index)))
    }
}

fn scene(grays: &Arc<Grays>, once: bool) -> Scene {
    let hashes = (0..COUNT).map(|i| [i as u8; 32]).collect();
    let stream = ImageStream { slot: TextureSlot::BaseColor, pictures: grays.clone(), hashes };
    let sequence = ImageSequence { streams: vec![stream], fps: 10.0, once };
    let shown = Material {
        base_color_texture: Some(texture(0)),
        sequence: Some(Arc::new(sequence)),
        ..unlit(Vec4::ONE)
    };
    let mut scene = Scene::ortho(1.0);
    scene.at(&asset(vec![quad(1.0, 1.0)], vec![shown], vec![image(4, 4, |_, _| gray(0))]), 0.0, 0.0, 0.0);
    scene
}

fn frames(
    renderer: &mut dyn Renderer,
    scene: &mut Scene,
    looks: impl IntoIterator<Item = usize>,
    once: bool,
) {
    let resources = scene.resources();
    renderer.load(resources.clone()).unwrap();
    for frame in looks {
        scene.snapshot.time = Time::from_secs(frame as f64 * 0.1 + 0.05);
        let plan = Plan::new(&resources, &scene.stage, &scene.snapshot, &PlanOptions::new([8, 8], 1));
        assert_eq!((plan.draws.len(), plan.material_overrides.len()), (1, 0));
        renderer.submit(plan).unwrap();
        let drawn = renderer.collect(None).unwrap();
        let expected = if once { frame.min(COUNT - 1) } else { frame % COUNT };
        assert_eq!(pixel(&drawn, 3, 3), gray(expected), "frame {frame}");
    }
}

#[test]
fn each_frame_shows_its_image_in_any_order() {
    for once in [false, true] {
        let grays = Arc::new(Grays::default());
        frames(&mut CpuRenderer::new(&[]), &mut scene(&grays, once), [0, 1, 2, 39, 40, 45, 7, 7, 100], once);
        // Only visible images are loaded, and not the first one, whose pixels belong to the material.
        assert!(grays.made.load(Ordering::Relaxed) <= 8);
    }
}

#[test]
fn a_device_keeps_only_the_images_of_recent_frames() {
    let Some(mut gpu) = VulkanRenderer::new(GpuOptions { validation: true, ..GpuOptions::default() }).ok()
    else {
        println!("SKIP 1: no Vulkan");
        return;
    };
    let grays = Arc::new(Grays::default());
    let mut scene = scene(&grays, false);
    frames(&mut gpu, &mut scene, 0..COUNT, false);
    let [_, textures, materials] = gpu.resource_counts();
    assert!((2..=11).contains(&textures) && materials <= 11, "{textures} textures, {materials} materials");
    assert_eq!(grays.made.load(Ordering::Relaxed), COUNT - 1);
    // Dropped images are loaded again.
    frames(&mut gpu, &mut scene, [3, 4, 3, 38], false);
    assert_eq!(grays.made.load(Ordering::Relaxed), COUNT - 1 + 2);
}

#[test]
fn an_image_that_cannot_be_loaded_is_an_error_with_its_name() {
    let grays = Arc::new(Grays { broken: true, ..Grays::default() });
    let mut scene = scene(&grays, false);
    scene.snapshot.time = Time::from_secs((COUNT - 2) as f64 * 0.1 + 0.05);
    let (resources, plan) = scene.plan(&PlanOptions::new([8, 8], 1));
    let mut cpu = CpuRenderer::new(&[]);
    cpu.load(resources).unwrap();
    cpu.submit(plan).unwrap();
    let error = cpu.collect(None).unwrap_err().to_string();
    assert!(error.contains("grey_38.png"), "{error}");
}

/// Three patterns whose channels have an effect in every texture slot.
#[derive(Debug)]
struct Patterns;

fn pattern(index: usize) -> Arc<Image> {
    image(8, 8, |x, y| {
        let on = (x / 2 + y / (index as u32 + 1)).is_multiple_of(2);
        // As a normal it is tilted; the channels also give roughness, metalness and opacity.
        if on { [190, 90, 210, 230] } else { [70 + 40 * index as u8, 150, 250, 60] }
    })
}

impl ImageSource for Patterns {
    fn image(&self, index: usize) -> Result<Arc<Image>, ImageSourceError> {
        Ok(pattern(index))
    }
}

/// A lit plate with an image in these slots: at its time in a sequence, or (`alone`) as a plain texture.
fn plate(slots: &[TextureSlot], index: usize, alone: bool) -> Scene {
    let slot_texture = |slot| slots.contains(&slot).then(|| texture(0));
    let streams = slots.iter().map(|slot| ImageStream {
        slot: *slot,
        pictures: Arc::new(Patterns),
        hashes: (0..3).map(|i| [i as u8 + 100; 32]).collect(),
    });
    let sequence = ImageSequence { streams: streams.collect(), fps: 10.0, once: false };
    let material = Material {
        base_color: Vec4::new(0.8, 0.7, 0.6, 1.0),
        metallic: 0.6,
        roughness: 0.7,
        emissive: Vec3::splat(0.3),
        base_color_texture: slot_texture(TextureSlot::BaseColor),
        metallic_roughness_texture: slot_texture(TextureSlot::MetallicRoughness),
        normal_texture: slot_texture(TextureSlot::Normal),
        occlusion_texture: slot_texture(TextureSlot::Occlusion),
        emissive_texture: slot_texture(TextureSlot::Emissive),
        specular_texture: slot_texture(TextureSlot::Specular),
        specular_color_texture: slot_texture(TextureSlot::SpecularColor),
        sequence: (!alone).then(|| Arc::new(sequence)),
        ..Material::default()
    };
    let mut shape = quad(1.0, 1.0);
    shape.tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); shape.positions.len()];
    let mut scene = Scene::ortho(2.0);
    scene.sun(Vec3::new(-0.3, -0.2, -1.0), Vec3::ONE, 1.0);
    scene.snapshot.ambient_up = Vec3::splat(0.4);
    scene.snapshot.ambient_down = Vec3::splat(0.4);
    scene.snapshot.time = Time::from_secs(index as f64 * 0.1 + 0.05);
    let first = pattern(if alone { index } else { 0 });
    scene.at(&asset(vec![shape], vec![material], vec![first]), 0.0, 0.0, 0.0);
    scene
}

#[test]
fn every_texture_slot_shows_the_image_of_its_sequence() {
    use TextureSlot::*;
    let options = PlanOptions::new([32, 32], 1);
    let mut renderers: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new(&[]))];
    match vulkan(GpuOptions::default()) {
        Some(device) => renderers.push(Box::new(device)),
        None => println!("SKIP 7: no Vulkan"),
    }
    let alone = [BaseColor, MetallicRoughness, Normal, Occlusion, Emissive, Specular, SpecularColor];
    let sets = alone.iter().map(std::slice::from_ref).chain([&alone[..]]);
    for slots in sets {
        for renderer in &mut renderers {
            let mut drawn =
                |index, single| draw_with(&mut **renderer, &plate(slots, index, single), &options);
            let truth: Vec<_> = (0..3).map(|i| drawn(i, true)).collect();
            assert!(truth[1].rgba != truth[2].rgba, "{slots:?}: the comparison sees another image");
            for index in [2, 0, 1] {
                assert!(drawn(index, false).rgba == truth[index].rgba, "{slots:?} {index}");
            }
        }
    }
}
