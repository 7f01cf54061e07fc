//! From a file's write to the new frame, 200 times: `cargo run --release -p choreo-live --example save_to_frame [SCRIPT]`.
//!
//! A copy of the script is written with another number in it; the clock runs from before the write until the painter gives the
//! frame of the new version, less the time that drawing this frame took.

use choreo_live::{Asked, Live, Painted, Painter, Recipe, Version};
use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_render::gpu::{GpuOptions, SteadyRenderer};
use choreo_render::{CpuRenderer, Renderer};
use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

const EDITS: usize = 200;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let first = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/01_first_dance.rhai");
    let source = std::env::args_os().nth(1).map_or(first, PathBuf::from);
    let text = std::fs::read_to_string(&source)?;
    let folder = tempfile::tempdir()?;
    let script = folder.path().join("a.rhai");
    std::fs::write(&script, &text)?;
    let mut registry = Registry::default();
    registry.add_importer(import_mannequin::Mannequin);
    registry.add_importer(import_obj::ObjImporter);

    let (to, versions) = channel::<Version>();
    let _live = Live::start(Recipe::new(&script), &registry, move |v| drop(to.send(v)))?;
    let (to, painted) = channel::<Painted>();
    let start = || -> Result<(Box<dyn Renderer>, Option<String>), String> {
        Ok(match SteadyRenderer::new(GpuOptions::default()) {
            Ok(renderer) => (Box::new(renderer), None),
            Err(_) => (Box::new(CpuRenderer::new(&[])), None),
        })
    };
    let painter = Painter::start(Box::new(start), move |p| drop(to.send(p)))?;
    let mut beyond = Vec::new();
    let mut whole = Vec::new();
    let mut device = String::new();
    for edit in 0..=EDITS {
        let start = Instant::now();
        if edit > 0 {
            std::fs::write(&script, format!("{text}\n// {edit}\n"))?;
        }
        let version = versions.recv_timeout(Duration::from_secs(60))?;
        let scene = version.scene.ok_or_else(|| format!("{:?}", version.problems))?;
        let size = scene.stage.settings.size;
        let time = Time::from_secs(1.0);
        painter.ask(Asked {
            scene,
            time,
            size,
            samples: 4,
            camera: None,
            moving: false,
            ticket: edit as u64,
        });
        let painted = painted.recv_timeout(Duration::from_secs(60))?;
        let all = start.elapsed();
        let picture = painted.result?;
        device = picture.device.name;
        if edit > 0 {
            whole.push(all);
            beyond.push(all.saturating_sub(picture.evaluated_in + picture.planned_in + picture.drawn_in));
        }
    }
    for (name, mut times) in [("write to frame", whole), ("beyond the frame's own time", beyond)] {
        times.sort();
        let millis = |part: usize| times[(times.len() - 1) * part / 100].as_secs_f64() * 1e3;
        println!(
            "{name}: median {:.1} ms, p95 {:.1} ms, worst {:.1} ms",
            millis(50),
            millis(95),
            millis(100)
        );
    }
    println!("{EDITS} edits of {} on {device}", source.display());
    Ok(())
}
