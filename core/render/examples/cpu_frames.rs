//! Draws files with the CPU renderer and prints the frame rate:
//!
//! ```text
//! cargo run --release -p choreo-render --example cpu_frames -- ../shared/assets/gltf/Knight.glb \
//!     [--clip NAME] [--at SECONDS] [--size 1280x720] [--samples 1|4] [--grid N] [--frames N] [--png out.png]
//! ```

use choreo_motion::Time;
use choreo_plugin::{Files, ImportOptions, ImportScope, Importer, Source};
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources};
use choreo_stage::{Camera, Cue, Placement, Rig, Stage};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

struct Folder(PathBuf);

impl Files for Folder {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        std::fs::read(self.0.join(relative)).map(Arc::new).map_err(|e| format!("{relative}: {e}"))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let file = args.next().ok_or("name a glTF file to draw")?;
    let rest: Vec<String> = args.collect();
    let option =
        |name: &str| rest.iter().position(|a| a == name).and_then(|i| rest.get(i + 1)).map(String::as_str);
    let number = |name: &str, default: f64| -> Result<f64, String> {
        option(name).map_or(Ok(default), |v| v.parse().map_err(|_| format!("{name}: {v} is not a number")))
    };
    let (w, h) = option("--size")
        .unwrap_or("1280x720")
        .split_once('x')
        .ok_or("--size must be WIDTHxHEIGHT, such as 1280x720")?;
    let size = [w.parse()?, h.parse()?];
    let (samples, grid) = (number("--samples", 4.0)? as u32, number("--grid", 1.0)? as u32);
    let (frames, at) = (number("--frames", 30.0)? as u32, number("--at", 0.5)?);

    let folder = PathBuf::from(&file).parent().map(PathBuf::from).unwrap_or_default();
    let source = Source { name: file.clone(), bytes: Arc::new(std::fs::read(&file)?) };
    let importer = import_gltf::GltfImporter::new();
    let asset = importer.import(&source, &Folder(folder), ImportScope::ALL, &ImportOptions::default());
    let asset = Arc::new(asset.map_err(|e| e.to_string())?);
    let clip = option("--clip").and_then(|name| asset.clips.iter().find(|c| c.name == name));
    if let (Some(name), None) = (option("--clip"), clip) {
        let names: Vec<&str> = asset.clips.iter().map(|c| c.name.as_str()).collect();
        return Err(format!("the file has no clip {name}; its clips are {names:?}").into());
    }
    let mut stage = Stage::default();
    stage.settings.size = size;
    for i in 0..grid * grid {
        let actor = stage.cast(&format!("actor{i}"), asset.clone());
        let (x, z) = (f64::from(i % grid) * 1.8, f64::from(i / grid) * -1.8);
        stage.actors[actor].transform = Placement::at(x, 0.0, z);
        if let Some(clip) = clip {
            stage.play(actor, Cue::new(clip.clone()));
        }
    }
    if option("--file-camera").is_some() {
        let camera = number("--file-camera", 0.0)? as u32;
        let mut c = Camera::new("file", Rig::File { actor: 0, camera });
        c.projection =
            asset.cameras.get(camera as usize).ok_or("the file has no camera with this number")?.projection;
        stage.shoot(c);
    } else if option("--azimuth").is_some() {
        let (azimuth, elevation) = (number("--azimuth", 0.0)?, number("--elevation", 0.0)?);
        stage.shoot(Camera::new("front", Rig::Frame { azimuth, elevation }));
    }

    let stage = Arc::new(stage);
    let resources = Arc::new(SceneResources::new(&stage));
    let mut renderer = CpuRenderer::new(&[]);
    let start = Instant::now();
    renderer.load(resources.clone())?;
    eprintln!("load {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
    let mut frame = None;
    let mut times = Vec::new();
    for i in 0..frames.max(1) {
        let snapshot =
            stage.at(Time::from_secs(at + f64::from(i) / 30.0 * f64::from(u8::from(frames > 1))))?;
        let start = Instant::now();
        let plan = Plan::new(&resources, &stage, &snapshot, &PlanOptions::new(size, samples));
        renderer.submit(plan)?;
        frame = Some(renderer.collect(frame.take())?);
        times.push(start.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    let median = times[times.len() / 2];
    println!(
        "{file}: {}x{} {samples} samples, {} actors: median {:.2} ms, {:.1} frames/s, {} threads",
        size[0],
        size[1],
        grid * grid,
        median * 1e3,
        1.0 / median,
        rayon::current_num_threads()
    );
    if let (Some(path), Some(frame)) = (option("--png"), frame) {
        image::save_buffer(path, &frame.rgba, frame.width, frame.height, image::ColorType::Rgba8)?;
    }
    Ok(())
}
