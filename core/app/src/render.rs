//! `choreo render`: from the command line to files, with everything that can be refused refused before the first frame.

use crate::args::RenderArgs;
use crate::device;
use crate::failure::{Failure, print_json};
use crate::output::{Part, Target, export_failure};
use crate::pipeline::{Encode, Pipeline, PlanAt};
use crate::progress::Progress;
use crate::scene::{self, Scene};
use crate::{interrupt, provenance, ranges, registry};
use choreo_motion::Time;
use choreo_plugin::{ExportOptions, Exporter, Frame, Registry, VideoInfo};
use choreo_render::{Catalog, Plan, PlanOptions};
use choreo_stage::{Evaluator, Settings};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Pictures being encoded take at most about this much memory, however large each is.
const PICTURE_BYTES: usize = 256 << 20;

/// What is to be made, checked.
struct Job<'r> {
    scene: Scene,
    target: Target,
    exporter: &'r Arc<dyn Exporter>,
    frames: Vec<(i64, Time)>,
    settings: Settings,
    samples: Option<u32>,
    options: ExportOptions,
    notes: Vec<String>,
}

pub fn run(args: RenderArgs) -> Result<(), Failure> {
    let start = Instant::now();
    let jobs = args.jobs.as_deref().map(ranges::jobs).transpose()?;
    let target = Target::parse(&args.output)?;
    let registry = registry::registry();
    target.exporter(&registry)?;
    // The driver takes as long to start as the script and its assets: side by side.
    let starting = device::start(args.device, jobs, registry.effects());
    let prepared = prepare(&args, target, &registry);
    let started = starting.wait();
    let job = prepared?;
    let summary = draw(&args, &job, &registry, started?, jobs)?;
    let secs = start.elapsed().as_secs_f64();
    report(&args, &job, &summary, secs)
}

fn prepare<'r>(args: &RenderArgs, target: Target, registry: &'r Registry) -> Result<Job<'r>, Failure> {
    let exporter = target.exporter(registry)?;
    let mut options = ExportOptions::default();
    for text in &args.export {
        let (name, value) = ranges::name_value("--export", text)?;
        let value = exporter.manifest().parse_option(name, value);
        let value = value.map_err(|e| Failure::Usage(format!("--export {text}: {e}")))?;
        options.0.insert(name.to_string(), value);
    }
    let size = args.size.as_deref().map(ranges::size).transpose()?;
    let fps = args.fps.as_deref().map(ranges::fps).transpose()?;
    let at = args.at.as_deref().map(ranges::at).transpose()?;
    let samples = args.samples.as_deref().map(ranges::samples).transpose()?;

    let mut scene = scene::open(&args.scene, registry)?;
    let mut settings = scene.stage.settings.clone();
    settings.size = size.unwrap_or(settings.size);
    // The stage too: a camera that frames what it sees does so for the shape of this picture.
    Arc::make_mut(&mut scene.stage).settings.size = settings.size;
    settings.fps = fps.unwrap_or(settings.fps);
    let total = settings.fps.frames_in(settings.length).max(1);
    let mut notes = Vec::new();
    let range = args.frames.as_deref().map(|f| ranges::frames(f, total)).transpose()?;
    let one_picture = exporter.one_frame_per_file() && !matches!(target, Target::Numbered { .. });
    let frames: Vec<(i64, Time)> = match (at, range) {
        (Some(at), _) => vec![(0, at)],
        (None, Some(range)) if one_picture && range.end - range.start > 1 => {
            notes.push(format!(
                "{} holds one picture: frame {} is drawn; for all of them type -o {}",
                target.shown(),
                range.start,
                numbered(&args.output)
            ));
            vec![(range.start, settings.fps.time_of(range.start))]
        }
        (None, None) if one_picture && total > 1 && scene.is_script => {
            return Err(Failure::Usage(format!(
                "{} holds one picture and the scene has {total} frames; type --at 0 for one of them, or -o {} for all",
                target.shown(),
                numbered(&args.output)
            )));
        }
        (None, None) if one_picture => vec![(0, Time::ZERO)],
        (None, range) => range.unwrap_or(0..total).map(|f| (f, settings.fps.time_of(f))).collect(),
    };
    Ok(Job { scene, target, exporter, frames, settings, samples, options, notes })
}

/// `out.png` → `out/%04d.png`.
fn numbered(output: &str) -> String {
    match output.rsplit_once('.') {
        Some((stem, extension)) => format!("{stem}/%04d.{extension}"),
        None => format!("{output}/%04d.png"),
    }
}

struct Summary {
    device: String,
    samples: u32,
}

fn draw(
    args: &RenderArgs,
    job: &Job,
    registry: &Registry,
    started: device::Started,
    jobs: Option<usize>,
) -> Result<Summary, Failure> {
    let mut renderer = started.renderer;
    let samples =
        job.samples.or(job.settings.samples).unwrap_or_else(|| device::default_samples(renderer.device()));
    let info = VideoInfo {
        width: job.settings.size[0],
        height: job.settings.size[1],
        fps: job.settings.fps,
        frames: job.frames.len() as u64,
        provenance: provenance::of(&job.scene, &job.settings, samples, renderer.device()),
        options: job.options.clone(),
    };
    if !args.quiet {
        let said = job.scene.printed.iter().chain(&job.scene.warnings).chain(&job.notes).cloned();
        for line in said.chain(job.exporter.notes(&info)).chain(started.note) {
            eprintln!("{line}");
        }
    }
    let made = job.target.prepare()?;
    let shown = job.target.shown();
    let mut video = match &job.target {
        Target::Numbered { .. } => None,
        target if job.exporter.one_frame_per_file() => {
            // Only opened to see whether it can be.
            drop(Part::create(&target.file(0))?);
            None
        }
        Target::Stdout => {
            let out = Box::new(std::io::BufWriter::with_capacity(1 << 16, std::io::stdout()));
            Some((None, job.exporter.begin(&info, out).map_err(|e| export_failure(&shown, e))?))
        }
        target => {
            let part = Part::create(&target.file(0))?;
            let sink = job.exporter.begin(&info, part.writer()?).map_err(|e| export_failure(&shown, e))?;
            Some((Some(part), sink))
        }
    };

    interrupt::watch(true);
    let result = (|| {
        let catalog = Arc::new(Catalog::new(&job.scene.stage));
        renderer.load(catalog.clone()).map_err(crate::pipeline::render_failure)?;
        let mut evaluator = Evaluator::new(job.scene.stage.clone());
        let options =
            PlanOptions { effects: registry.effects(), ..PlanOptions::new(job.settings.size, samples) };
        let plan: PlanAt = Box::new(move |time| {
            let snapshot = evaluator.at(time).map_err(|e| Failure::input(e.to_string()))?;
            Ok(Plan::new(&catalog, evaluator.stage(), &snapshot, &options))
        });
        let progress = Progress::new(job.frames.len() as u64, args.quiet || args.json);
        let encoders: Vec<Encode> = match &mut video {
            Some((_, sink)) => {
                let shown = &shown;
                vec![Box::new(move |_, frame| sink.frame(frame).map_err(|e| export_failure(shown, e)))]
            }
            None => {
                let bytes = 4 * info.width as usize * info.height as usize;
                let workers =
                    jobs.unwrap_or_else(device::cores).min(job.frames.len()).min(PICTURE_BYTES / bytes);
                let workers = workers.clamp(1, 16);
                let info = &info;
                (0..workers)
                    .map(|_| -> Encode { Box::new(move |number, frame| picture(job, info, number, frame)) })
                    .collect()
            }
        };
        let frames = job.frames.clone();
        let drawn = Pipeline { frames, plan, renderer: &mut *renderer, encoders, progress: &progress }.run();
        progress.clear();
        drawn?;
        if let Some((part, sink)) = video {
            sink.finish().map_err(|e| export_failure(&shown, e))?;
            part.map_or(Ok(()), Part::commit)?;
        }
        Ok(())
    })();
    let device = renderer.device().name.clone();
    // The driver is shut down before the program may end.
    drop(renderer);
    if result.is_err() {
        // Folders made for nothing; those that hold something stay.
        made.iter().rev().for_each(|folder| drop(std::fs::remove_dir(folder)));
    }
    interrupt::watch(false);
    result.map(|()| Summary { device, samples })
}

/// One picture to its own file.
fn picture(job: &Job, info: &VideoInfo, number: i64, frame: &Frame) -> Result<(), Failure> {
    let place: PathBuf = job.target.file(number);
    let shown = place.display().to_string();
    let part = Part::create(&place)?;
    let failed = |e| export_failure(&shown, e);
    let mut sink = job.exporter.begin(info, part.writer()?).map_err(failed)?;
    sink.frame(frame).map_err(failed)?;
    sink.finish().map_err(failed)?;
    part.commit()
}

fn report(args: &RenderArgs, job: &Job, summary: &Summary, secs: f64) -> Result<(), Failure> {
    let frames = job.frames.len();
    if args.json {
        let value = serde_json::json!({
            "ok": true,
            "output": job.target.shown(),
            "frames": frames,
            "size": job.settings.size,
            "fps": job.settings.fps.as_fps(),
            "samples": summary.samples,
            "device": summary.device,
            "seconds": secs,
            "warnings": job.scene.warnings,
        });
        if job.target == Target::Stdout {
            eprintln!("{value}");
            return Ok(());
        }
        return print_json(&value);
    }
    if !args.quiet {
        let plural = if frames == 1 { "frame" } else { "frames" };
        eprintln!(
            "{frames} {plural} in {secs:.1} s ({:.0} a second) on {}: {}",
            frames as f64 / secs,
            summary.device,
            job.target.shown()
        );
    }
    Ok(())
}
