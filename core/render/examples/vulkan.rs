//! One glTF file on Vulkan, timed: `cargo run --release -p choreo-render --example vulkan -- FILE [--clip N] [--time S]
//! [--grid N] [--size WxH] [--samples N] [--frames N] [--cache DIR] [--shaders DIR] [--plain] [--empty] [--validation] [-o OUT.png]`

use choreo_motion::Time;
use choreo_plugin::{Exporter, Files, ImportOptions, Importer, Needs, Source, VideoInfo};
use choreo_render::{GpuOptions, Plan, PlanOptions, Renderer, SceneResources, VulkanRenderer};
use choreo_stage::{Camera, Cue, Placement, Rig, Stage, StageLight};
use glam::Vec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

struct Folder(PathBuf);

impl Files for Folder {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        std::fs::read(self.0.join(relative)).map(Arc::new).map_err(|e| e.to_string())
    }
}

/// CPU time of the whole process, all threads.
fn cpu_secs() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    let ticks = |i: usize| fields.get(i).and_then(|f| f.parse::<f64>().ok()).unwrap_or(f64::NAN);
    (ticks(11) + ticks(12)) / 100.0
}

fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM")).unwrap_or("");
    line.split_whitespace().nth(1).and_then(|v| v.parse::<f64>().ok()).unwrap_or(f64::NAN) / 1024.0
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let start = Instant::now();
    let args: Vec<String> = std::env::args().skip(1).collect();
    let option = |name: &str| args.iter().position(|a| a == name).and_then(|i| args.get(i + 1)).cloned();
    let number = |name: &str, default: f64| option(name).and_then(|v| v.parse().ok()).unwrap_or(default);
    let file = args.first().ok_or("usage: vulkan FILE …")?;
    let size = option("--size").unwrap_or("1280x720".into());
    let (w, h) = size.split_once('x').ok_or("--size WxH")?;
    let size = [w.parse()?, h.parse()?];
    let (samples, frames) = (number("--samples", 1.0) as u32, number("--frames", 1.0) as i64);

    let source = Source { name: file.clone(), bytes: Arc::new(std::fs::read(file)?) };
    let folder = Folder(Path::new(file).parent().unwrap_or(Path::new(".")).into());
    let importer = import_gltf::GltfImporter::new();
    let asset = Arc::new(importer.import(&source, &folder, Needs::ALL, &ImportOptions::default())?);
    let mut stage = Stage::default();
    let grid = number("--grid", 1.0) as i64;
    for i in 0..grid * grid {
        let actor = stage.cast(&format!("actor{i}"), asset.clone());
        stage.actors[actor].file_lights = true;
        stage.actors[actor].transform = Placement::at((i % grid) as f64 * 2.0, 0.0, (i / grid) as f64 * -2.0);
        if let Some(clip) = asset.clips.get(number("--clip", 0.0) as usize) {
            let cue = Cue { speed: 1.0 + 0.02 * i as f64, ..Cue::new(clip.clone()) };
            stage.play(actor, cue);
        }
    }
    if !asset.cameras.is_empty() && args.iter().any(|a| a == "--file-camera") {
        let camera = asset.cameras[0].projection;
        stage.shoot(Camera { projection: camera, ..Camera::new("file", Rig::File { actor: 0, camera: 0 }) });
    } else {
        let rig = Rig::Frame { azimuth: number("--azimuth", 0.0), elevation: number("--elevation", 0.1) };
        stage.shoot(Camera::new("frame", rig));
    }
    if asset.lights.is_empty() {
        stage.lights.push(StageLight::sun("sun", Vec3::new(-0.5, -1.0, -0.8), 1.0));
    }
    // The camera stays: framing looks at every posed vertex, which is not what is measured here.
    let camera = stage.at(Time::from_secs(number("--time", 0.0)))?.camera;
    let (_, rotation, position) = camera.world_from_view.to_scale_rotation_translation();
    stage.cameras = vec![Camera {
        projection: camera.projection,
        ..Camera::new("fixed", Rig::Fixed { position, rotation, look_at: None })
    }];
    if args.iter().any(|a| a == "--plain") {
        stage.settings.background = choreo_stage::Background::Color(glam::Vec4::new(0.3, 0.3, 0.4, 1.0));
    }
    if args.iter().any(|a| a == "--empty") {
        stage.actors.iter_mut().for_each(|a| a.visible = false);
    }
    println!("import and stage   {:7.1} ms", start.elapsed().as_secs_f64() * 1e3);

    let at = Instant::now();
    let mut renderer = VulkanRenderer::new(GpuOptions {
        validation: args.iter().any(|a| a == "--validation"),
        cache_dir: option("--cache").map(PathBuf::from),
        shader_dir: option("--shaders").map(PathBuf::from),
        ..GpuOptions::default()
    })?;
    println!("instance, device   {:7.1} ms  {}", at.elapsed().as_secs_f64() * 1e3, renderer.device().name);
    let at = Instant::now();
    let resources = Arc::new(SceneResources::new(&stage));
    renderer.load(resources.clone())?;
    println!("scene resources    {:7.1} ms", at.elapsed().as_secs_f64() * 1e3);
    let options = PlanOptions::new(size, samples);
    let first_time = number("--time", 0.0);
    let plan_at = |frame: i64| -> Result<Plan, Box<dyn std::error::Error>> {
        let time = Time::from_secs(first_time + frame as f64 / 30.0);
        Ok(Plan::new(&resources, &stage, &stage.at(time)?, &options))
    };
    let at = Instant::now();
    let plan = plan_at(0)?;
    let (planned, at) = (at.elapsed(), Instant::now());
    renderer.submit(plan)?;
    let (submitted, at) = (at.elapsed(), Instant::now());
    let mut frame = renderer.collect(None)?;
    println!("first plan         {:7.1} ms", planned.as_secs_f64() * 1e3);
    println!("first submit       {:7.1} ms (pipelines, textures)", submitted.as_secs_f64() * 1e3);
    println!("first collect      {:7.1} ms (draw)", at.elapsed().as_secs_f64() * 1e3);
    println!("first picture      {:7.1} ms after start", start.elapsed().as_secs_f64() * 1e3);
    if args.iter().any(|a| a == "--print") {
        println!("{}", renderer.last_recording().map(|r| r.to_string()).unwrap_or_default());
        println!("{:?}", renderer.last_recording().map(|r| r.counts()));
    }

    let (wall, cpu) = (Instant::now(), cpu_secs());
    let mut planning = Duration::ZERO;
    let mut in_flight = 0;
    for i in 1..frames {
        if in_flight == renderer.frames_in_flight() {
            frame = renderer.collect(Some(frame))?;
            in_flight -= 1;
        }
        let at = Instant::now();
        let plan = plan_at(i)?;
        planning += at.elapsed();
        renderer.submit(plan)?;
        in_flight += 1;
    }
    for _ in 0..in_flight {
        frame = renderer.collect(Some(frame))?;
    }
    if frames > 1 {
        let n = (frames - 1) as f64;
        println!(
            "{n} frames: {:.2} ms wall, {:.2} ms CPU a frame, of it {:.2} ms stage and plan; {:.1} frames/s",
            wall.elapsed().as_secs_f64() * 1e3 / n,
            (cpu_secs() - cpu) * 1e3 / n,
            planning.as_secs_f64() * 1e3 / n,
            n / wall.elapsed().as_secs_f64()
        );
    }
    println!("peak memory {:.0} MB", peak_mb());
    if let Some(out) = option("-o") {
        let info = VideoInfo {
            width: frame.width,
            height: frame.height,
            fps: stage.settings.fps,
            frames: 1,
            provenance: Vec::new(),
            options: Default::default(),
        };
        let mut sink = export_png::PngExporter.begin(&info, Box::new(std::fs::File::create(out)?))?;
        sink.frame(&frame)?;
        sink.finish()?;
    }
    Ok(())
}
