//! Pictures that follow each other: the right one at each time, made when it is seen, and few of them held at once.

mod common;

use choreo_motion::Time;
use choreo_render::*;
use choreo_stage::*;
use common::*;
use glam::Vec4;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const COUNT: usize = 40;

/// Each of a grey of its own; the last but one cannot be made.
#[derive(Debug, Default)]
struct Greys {
    made: AtomicUsize,
    broken: bool,
}

fn grey(i: usize) -> [u8; 4] {
    [5 + 6 * i as u8; 3].iter().copied().chain([255]).collect::<Vec<u8>>().try_into().unwrap()
}

impl Pictures for Greys {
    fn picture(&self, index: usize) -> Result<Arc<Image>, String> {
        self.made.fetch_add(1, Ordering::Relaxed);
        if self.broken && index == COUNT - 2 {
            return Err("\"grey_38.png\": its data ends early".into());
        }
        Ok(image(4, 4, |_, _| grey(index)))
    }
}

fn scene(greys: &Arc<Greys>, once: bool) -> Scene {
    let hashes = (0..COUNT).map(|i| [i as u8; 32]).collect();
    let sequence = Sequence { pictures: greys.clone(), hashes, fps: 10.0, once };
    let shown = Material {
        base_color_texture: Some(texture(0)),
        sequence: Some(Arc::new(sequence)),
        ..unlit(Vec4::ONE)
    };
    let mut scene = Scene::ortho(1.0);
    scene.at(&asset(vec![quad(1.0, 1.0)], vec![shown], vec![image(4, 4, |_, _| grey(0))]), 0.0, 0.0, 0.0);
    scene
}

fn frames(
    renderer: &mut dyn Renderer,
    scene: &mut Scene,
    looks: impl IntoIterator<Item = usize>,
    once: bool,
) {
    let catalog = scene.catalog();
    renderer.load(catalog.clone()).unwrap();
    for frame in looks {
        scene.snapshot.time = Time::from_secs(frame as f64 * 0.1 + 0.05);
        let plan = Plan::new(&catalog, &scene.stage, &scene.snapshot, &PlanOptions::new([8, 8], 1));
        assert_eq!((plan.draws.len(), plan.materials.len()), (1, 0));
        renderer.submit(plan).unwrap();
        let drawn = renderer.collect(None).unwrap();
        let expected = if once { frame.min(COUNT - 1) } else { frame % COUNT };
        assert_eq!(pixel(&drawn, 3, 3), grey(expected), "frame {frame}");
    }
}

#[test]
fn each_frame_shows_its_picture_whatever_the_order() {
    for once in [false, true] {
        let greys = Arc::new(Greys::default());
        frames(&mut CpuRenderer::new(&[]), &mut scene(&greys, once), [0, 1, 2, 39, 40, 45, 7, 7, 100], once);
        // None that was not seen, and no first one, whose pixels are the material's own.
        assert!(greys.made.load(Ordering::Relaxed) <= 8);
    }
}

#[test]
fn a_device_holds_those_of_the_last_frames_alone() {
    let Some(mut gpu) = VulkanRenderer::new(GpuOptions { validation: true, ..GpuOptions::default() }).ok()
    else {
        println!("SKIP 1: no Vulkan");
        return;
    };
    let greys = Arc::new(Greys::default());
    let mut scene = scene(&greys, false);
    frames(&mut gpu, &mut scene, 0..COUNT, false);
    let [_, textures, materials] = gpu.resource_counts();
    assert!((2..=11).contains(&textures) && materials <= 11, "{textures} textures, {materials} materials");
    assert_eq!(greys.made.load(Ordering::Relaxed), COUNT - 1);
    // What was let go is made again.
    frames(&mut gpu, &mut scene, [3, 4, 3, 38], false);
    assert_eq!(greys.made.load(Ordering::Relaxed), COUNT - 1 + 2);
}

#[test]
fn one_that_cannot_be_made_ends_the_frame_with_its_name() {
    let greys = Arc::new(Greys { broken: true, ..Greys::default() });
    let mut scene = scene(&greys, false);
    scene.snapshot.time = Time::from_secs((COUNT - 2) as f64 * 0.1 + 0.05);
    let (catalog, plan) = scene.plan(&PlanOptions::new([8, 8], 1));
    let mut cpu = CpuRenderer::new(&[]);
    cpu.load(catalog).unwrap();
    cpu.submit(plan).unwrap();
    let error = cpu.collect(None).unwrap_err().to_string();
    assert!(error.contains("grey_38.png"), "{error}");
}
