//! Compares the Vulkan renderer with its reference, the CPU renderer, on every sample file and every example script, with the validation layer on.
//! `cargo test -p choreo --test cpu_reference -- --nocapture` prints the table.

mod common;
#[path = "common/long_time_limits.rs"]
mod long_time_limits;

use choreo_asset::*;
use choreo_image_diff::{Comparison, compare};
use choreo_motion::Time;
use choreo_plugin::{Frame, ImportScope, Registry};
use choreo_render::{
    CpuRenderer, GpuOptions, Plan, PlanOptions, RenderError, Renderer, SceneResources, VulkanRenderer,
};
use choreo_script::{Limits, Loader, run_file};
use choreo_stage::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const SIZE: [u32; 2] = [320, 180];
/// 8-bit steps that a channel of a pixel may differ by without counting.
const TOLERANCE: u8 = 2;

/// How far the renderers may be apart.
#[derive(Clone, Copy)]
struct Bounds {
    mean: f64,
    share_beyond: f64,
}

/// Differences that a driver may have. At edges, it rounds vertices to its own fixed-point grid, so single pixels of an outline change
/// sides. In textures, it weights texels with 8 bits and approximates mipmap levels. In the mean, the sRGB encoder of
/// lavapipe is one step too high for more than half of the codes from 64 to 87, which dark floors have.
const BOUNDS: Bounds = Bounds { mean: 0.2, share_beyond: 0.003 };

/// Bounds for images with many hard edges inside enlarged textures: each of them shows the 8-bit weights of texels, and an alpha cutoff
/// turns the difference into a sample more or less.
const TEXTURE_BOUNDS: Bounds = Bounds { mean: 0.2, share_beyond: 0.01 };
const SCENES_WITH_TEXTURE_BOUNDS: [&str; 3] =
    ["35_moving_textures.rhai", "39_leaves_and_panes.rhai", "AlphaBlendModeTest.glb"];

impl Bounds {
    /// The bounds of an image by the name of its scene.
    fn of(what: &str) -> Bounds {
        if SCENES_WITH_TEXTURE_BOUNDS.iter().any(|name| what.starts_with(name)) {
            TEXTURE_BOUNDS
        } else {
            BOUNDS
        }
    }

    fn hold(self, c: &Comparison) -> bool {
        c.mean <= self.mean && c.share_beyond <= self.share_beyond
    }
}

struct RendererPair {
    vulkan: VulkanRenderer,
    cpu: CpuRenderer,
    registry: Registry,
}

impl RendererPair {
    /// `None` if there is no Vulkan device, after printing that `cases` cases are skipped.
    fn new(cases: usize) -> Option<RendererPair> {
        let registry = choreo::registry();
        let effects = registry.effects().to_vec();
        let cpu = CpuRenderer::new(&effects);
        match VulkanRenderer::new(GpuOptions { validation: true, effects, ..GpuOptions::default() }) {
            Ok(vulkan) => Some(RendererPair { vulkan, cpu, registry }),
            Err(RenderError::NoVulkan { why }) => {
                println!("SKIP {cases}: {}", why.lines().next().unwrap_or_default());
                None
            }
            Err(e) => panic!("{e}"),
        }
    }

    /// Images of both renderers. A message of the validation layer is an error.
    fn draw(
        &mut self,
        on_vulkan: (&Stage, &Snapshot),
        on_cpu: (&Stage, &Snapshot),
        samples: u32,
    ) -> [Frame; 2] {
        let options = PlanOptions { effects: self.registry.effects(), ..PlanOptions::new(SIZE, samples) };
        let draw = |renderer: &mut dyn Renderer, (stage, snapshot): (&Stage, &Snapshot)| {
            let resources = Arc::new(SceneResources::new(stage));
            renderer.load(resources.clone()).unwrap();
            renderer.submit(Plan::new(&resources, stage, snapshot, &options)).unwrap();
            renderer.collect(None).unwrap()
        };
        [draw(&mut self.vulkan, on_vulkan), draw(&mut self.cpu, on_cpu)]
    }

    fn compare(&mut self, stage: &Stage, time: Time, samples: u32) -> Comparison {
        let snapshot = stage.at(time).unwrap();
        let [vulkan, cpu] = self.draw((stage, &snapshot), (stage, &snapshot), samples);
        // Pixels of the background equal the first pixel of their row.
        let rows = vulkan.rgba.chunks_exact(4 * SIZE[0] as usize);
        let drawn = rows.flat_map(|r| r.chunks_exact(4).filter(|p| *p != &r[..4])).count();
        assert!(drawn > 500, "{drawn} pixels are not background: too few to compare");
        compare(&vulkan, &cpu, TOLERANCE).unwrap()
    }

    fn load(&self, path: &Path) -> Arc<Asset> {
        let name = path.file_name().unwrap().to_str().unwrap();
        let loader =
            Loader::for_file(path, &[], &self.registry, ImportScope::ALL, Limits::default().file).unwrap();
        let loader = Arc::new(loader);
        loader.load(name, &Default::default()).unwrap_or_else(|e| panic!("{name}: {}", e.message))
    }

    fn finish(self) {
        let messages = self.vulkan.validation_messages();
        drop(self.vulkan);
        assert_eq!(
            *messages.lock().unwrap(),
            Vec::<String>::new(),
            "validation messages while the renderer was dropped"
        );
    }
}

/// The stage of `choreo render MODEL`: framed and lit by default, playing its first clip.
fn stage_of(asset: Arc<Asset>) -> (Stage, Time) {
    let mut stage = Stage::default();
    stage.settings.size = SIZE;
    stage.settings.length = stage.settings.fps.time_of(1);
    let clip = asset.clips.first().cloned();
    let actor = stage.cast("model", asset);
    let Some(clip) = clip else { return (stage, Time::ZERO) };
    let middle = Time(clip.duration.0 / 2);
    stage.settings.length = clip.duration.max(stage.settings.length);
    stage.play(actor, Cue { repeat: Repeat::Once, ..Cue::new(clip) });
    (stage, middle)
}

fn files_in(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(files_in(&path, extensions));
        } else if path.extension().is_some_and(|e| extensions.iter().any(|x| e == *x)) {
            files.push(path);
        }
    }
    files.sort();
    files
}

#[derive(Default)]
struct Table {
    rows: usize,
    beyond: Vec<String>,
}

impl Table {
    fn row(&mut self, what: &str, samples: u32, c: &Comparison) {
        if self.rows == 0 {
            println!("{:<44} samples   mean  worst  beyond {TOLERANCE}", "");
        }
        self.rows += 1;
        println!("{what:<44} {samples:>7} {:>6.4} {:>6} {:>7.3} %", c.mean, c.worst, c.share_beyond * 100.0);
        if !Bounds::of(what).hold(c) {
            self.beyond.push(format!("{what}, {samples} samples: {c}"));
        }
    }

    fn finish(self) {
        assert!(
            self.beyond.is_empty(),
            "of {} images {} differ by more than mean {} and {} % of the pixels:\n{}",
            self.rows,
            self.beyond.len(),
            BOUNDS.mean,
            BOUNDS.share_beyond * 100.0,
            self.beyond.join("\n")
        );
    }
}

#[test]
fn vulkan_matches_the_cpu_renderer_on_every_sample_file() {
    let Some(assets) = common::sample_assets_folder() else { return };
    let mut files = files_in(&assets.join("gltf"), &["glb", "gltf"]);
    files.extend(files_in(&assets.join("same-model-3-formats"), &["glb"]));
    let Some(mut renderers) = RendererPair::new(files.len()) else { return };
    let mut table = Table::default();
    for path in files {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let (stage, time) = stage_of(renderers.load(&path));
        for samples in [1, 4] {
            table.row(
                &format!("{name} at {:.2} s", time.as_secs()),
                samples,
                &renderers.compare(&stage, time, samples),
            );
        }
    }
    table.finish();
    renderers.finish();
}

fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts")
}

fn run(script: &Path, registry: &Registry) -> Stage {
    let mut stage = run_file(script, registry, &long_time_limits::script_options()).unwrap().stage;
    stage.settings.size = SIZE;
    stage
}

#[test]
fn vulkan_matches_the_cpu_renderer_on_every_example_script() {
    let files = common::scripts_in(&scripts());
    assert!(files.len() >= 7);
    let Some(mut renderers) = RendererPair::new(files.len()) else { return };
    let mut table = Table::default();
    for path in files {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let stage = run(&path, &renderers.registry);
        for (part, samples) in [(0.31, 1), (0.77, 4)] {
            let time = Time::from_secs(stage.settings.length.as_secs() * part);
            table.row(
                &format!("{name} at {:.2} s", time.as_secs()),
                samples,
                &renderers.compare(&stage, time, samples),
            );
        }
    }
    table.finish();
    renderers.finish();
}

/// Asserts that a fault that only one renderer draws exceeds the bounds, which equal scenes do not exceed.
fn assert_fault_is_found(
    renderers: &mut RendererPair,
    what: &str,
    right: (&Stage, &Snapshot),
    wrong: (&Stage, &Snapshot),
) {
    let [vulkan, equal] = renderers.draw(right, right, 1);
    let none = compare(&vulkan, &equal, TOLERANCE).unwrap();
    assert!(BOUNDS.hold(&none), "{none}");
    for [a, b] in [[right, wrong], [wrong, right]] {
        let [vulkan, cpu] = renderers.draw(a, b, 1);
        let c = compare(&vulkan, &cpu, TOLERANCE).unwrap();
        println!("{what}: {c}");
        assert!(!BOUNDS.hold(&c), "{what} was not found: {c}");
    }
}

#[test]
fn planted_faults_are_found() {
    let Some(mut renderers) = RendererPair::new(3) else { return };
    let stage = run(&scripts().join("01_first_dance.rhai"), &renderers.registry);
    let right = stage.at(Time::from_secs(1.0)).unwrap();
    let changed = |change: &dyn Fn(&mut Snapshot)| {
        let mut wrong = right.clone();
        change(&mut wrong);
        wrong
    };
    let moved = changed(&|s| s.actors[0].world_from_model.translation.x += 0.02);
    assert_fault_is_found(&mut renderers, "an actor 2 cm to the right", (&stage, &right), (&stage, &moved));
    let turned = changed(&|s| {
        let turn = glam::Quat::from_rotation_y(2f32.to_radians());
        s.lights.iter_mut().for_each(|l| l.direction = turn * l.direction);
    });
    assert_fault_is_found(
        &mut renderers,
        "lights turned by two degrees",
        (&stage, &right),
        (&stage, &turned),
    );
    let Some(assets) = common::sample_assets_folder() else { return };
    let asset = renderers.load(&assets.join("gltf/TextureCoordinateTest.glb"));
    let mut upside_down = Asset::clone(&asset);
    for image in &mut upside_down.images {
        let mut rows: Vec<&[u8]> = image.rgba.chunks_exact(4 * image.width as usize).collect();
        rows.reverse();
        *image = Arc::new(Image { rgba: rows.concat(), file: None, ..Image::clone(image) });
    }
    let (right, _) = stage_of(asset);
    let (wrong, _) = stage_of(Arc::new(upside_down));
    let snapshot = right.at(Time::ZERO).unwrap();
    assert_fault_is_found(&mut renderers, "a texture upside down", (&right, &snapshot), (&wrong, &snapshot));
    renderers.finish();
}
