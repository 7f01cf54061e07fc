//! `choreo farm`: the job that renders a film on many machines, for an engine that is there: the packed scene, a step that renders
//! segments, and a step that joins them.

mod chunks;
mod measure;
mod openjd;
mod slurm;

use crate::App;
use crate::args::{Cli, Command, Engine, FarmArgs, PackArgs, RenderArgs};
use crate::commands::{pack, render};
use crate::failure::{Failure, output_error, print_json, print_message, write_failure};
use crate::output::target::Target;
use crate::process::scratch;
use crate::project_file;
use crate::scene;
use crate::scene::pack::Unpacked;
use choreo_files::write_whole_beneath;
use choreo_plugin::VideoInfo;
use chunks::{Chunk, Cost, aligned, in_chunks_of, of_equal_cost};
use clap::FromArgMatches;
use serde_json::json;
use std::ffi::OsString;
use std::num::NonZeroU64;
use std::path::{Component, Path, PathBuf};
use std::time::Instant;

/// Names in the job's folder.
const SCENE: &str = "film.choreo";
const SEGMENTS: &str = "segments";
const OUTPUT: &str = "output";

/// A job, for any engine.
pub(crate) struct FarmJob {
    /// Path of the film below [`OUTPUT`], with slashes.
    pub film: String,
    /// Options of `choreo render` on each machine.
    pub options: Vec<String>,
    /// Frames of the whole film.
    pub frames: u64,
    pub chunks: Vec<Chunk>,
}

/// `options`: the text of the project's choreo.toml.
pub fn run(args: &FarmArgs, app: &App, options: String) -> Result<(), Failure> {
    let film = film(&args.output)?;
    let segments = args.to.join(SEGMENTS);
    if segments.read_dir().is_ok_and(|mut entries| entries.next().is_some()) {
        let (to, segments) = (args.to.display(), segments.display());
        let what = format!(
            "--to {to}: a job has run there: {segments} is not empty; name another folder, or remove it"
        );
        return Err(Failure::Output(what));
    }
    let failed = |e: std::io::Error| output_error(&args.to.display().to_string(), &e);
    for folder in [SEGMENTS, OUTPUT] {
        std::fs::create_dir_all(args.to.join(folder)).map_err(failed)?;
    }
    let packed =
        PackArgs { scene: args.scene.clone(), output: args.to.join(SCENE), quiet: true, json: false };
    pack::write(&packed, &app.registry, options)?;
    let words = args.options_of_render();
    let start = Instant::now();
    let (render_args, job) = opened(args, &words, app)?;
    let frames = job.frames.len() as u64;
    let (chunks, cost) = chunks(args, &render_args, &job, start)?;
    let farm_job = FarmJob { film, options: words, frames, chunks };
    let files = match args.engine {
        Engine::Openjd => openjd::files(&farm_job)?,
        Engine::Slurm => slurm::files(&farm_job),
    };
    for (name, text) in &files {
        let shown = args.to.join(name).display().to_string();
        write_whole_beneath(&args.to, Path::new(name), text.as_bytes())
            .map_err(|e| write_failure(&shown, e))?;
    }
    report(args, &farm_job, &files, cost.as_ref())
}

/// The chunks of the film, and what was measured for them. `start`: when the scene began to be opened.
fn chunks(
    args: &FarmArgs,
    render_args: &RenderArgs,
    job: &render::Job,
    start: Instant,
) -> Result<(Vec<Chunk>, Option<Cost>), Failure> {
    let frames = job.frames.len() as u64;
    let piece = job.exporter.piece(&info(job, frames)).map_or(1, NonZeroU64::get);
    let (chunks, cost) = match args.chunk {
        Some(length) => (in_chunks_of(frames, length), None),
        None => {
            let cost = measure::cost(render_args, job, start)?;
            (of_equal_cost(frames, piece, &cost, slurm::MOST_TASKS), Some(cost))
        }
    };
    if args.engine == Engine::Slurm {
        return Ok((chunks, cost));
    }
    // There all chunks have one length.
    let length = args.chunk.unwrap_or_else(|| aligned(frames.div_ceil(chunks.len() as u64), piece));
    let most = openjd::MOST_FRAMES;
    let most = if most >= piece { most - most % piece } else { most };
    Ok((in_chunks_of(frames, if length > openjd::MOST_FRAMES { most } else { length }), cost))
}

/// The properties of the film that its pieces depend on.
fn info(job: &render::Job, frames: u64) -> VideoInfo {
    let [width, height] = job.settings.size;
    let (fps, options) = (job.settings.fps, job.options.clone());
    VideoInfo { width, height, fps, frames, provenance: Vec::new(), options }
}

/// The path of the film in the job: names alone, since the job runs on other machines.
fn film(output: &str) -> Result<String, Failure> {
    let plain = |part: Component| matches!(part, Component::Normal(_));
    if Target::parse(output)? == Target::Stdout || !Path::new(output).components().all(plain) {
        let what = format!(
            "-o {output}: the film is written to the folder {OUTPUT} of the job; write a name, as film.mp4"
        );
        return Err(Failure::Usage(what));
    }
    Ok(output.to_string())
}

/// The render of the packed scene, opened as a machine of the farm opens it.
fn opened(args: &FarmArgs, options: &[String], app: &App) -> Result<(RenderArgs, render::Job), Failure> {
    let scene: PathBuf = args.to.join(SCENE);
    let mut words: Vec<OsString> = vec![app.name.into(), "render".into(), scene.into(), "-o".into()];
    words.push(args.output.clone().into());
    words.extend(options.iter().map(OsString::from));
    let words = project_file::extended(&words, app)?;
    let parsed = <Cli as clap::CommandFactory>::command().try_get_matches_from(words);
    let cli = parsed.and_then(|matches| Cli::from_arg_matches(&matches));
    let Command::Render(mut render_args) = cli.map_err(|e| Failure::Usage(e.to_string()))?.command else {
        return Err(Failure::Internal("the words of a render are those of another command".into()));
    };
    render_args.scene.software = app.software();
    render_args.quiet = true;
    scratch::keep(Unpacked::in_place(&mut render_args.scene)?);
    let registry = scene::plugins(&render_args.scene, &app.registry)?;
    // The folder of a numbered film is made by the job.
    let job = render::prepare(&render_args, Target::parse(&args.output)?, &registry, None)?;
    Ok((render_args, job))
}

impl FarmArgs {
    /// The words of `choreo render` on each machine, besides input, output and frames. The device is named, so that all machines draw
    /// alike or fail.
    fn options_of_render(&self) -> Vec<String> {
        let device = clap::ValueEnum::to_possible_value(&self.device);
        let device = device.map(|value| value.get_name().to_string()).unwrap_or_default();
        let named = [("size", &self.size), ("fps", &self.fps), ("samples", &self.samples)];
        let mut words = vec![format!("--device={device}")];
        words.extend(
            named.into_iter().filter_map(|(name, value)| Some(format!("--{name}={}", value.as_ref()?))),
        );
        words.extend(self.export.iter().map(|option| format!("--export={option}")));
        words.extend(self.scene.limit.iter().map(|limit| format!("--limit={limit}")));
        words
    }
}

fn report(
    args: &FarmArgs,
    job: &FarmJob,
    files: &[(&str, String)],
    cost: Option<&Cost>,
) -> Result<(), Failure> {
    let count = job.chunks.len();
    let to = args.to.display();
    if args.json {
        return print_json(&json!({
            "ok": true,
            "folder": to.to_string(),
            "files": files.iter().map(|(name, _)| *name).chain([SCENE]).collect::<Vec<_>>(),
            "frames": job.frames,
            "chunks": job.chunks,
            "start_seconds": cost.map(|cost| cost.start),
            "frame_seconds": cost.map(|cost| cost.total(job.frames) / job.frames as f64),
        }));
    }
    if args.quiet {
        return Ok(());
    }
    let plural = if count == 1 { "chunk" } else { "chunks" };
    print_message(format_args!("{} frames in {count} {plural}: {to}", job.frames));
    if let Some(cost) = cost {
        let (start, total) = (cost.start, cost.total(job.frames));
        print_message(format_args!(
            "measured on this machine: {start:.1} s to start, {:.3} s a frame, {:.1} s for all frames on one machine",
            total / job.frames as f64,
            start + total
        ));
    }
    print_message(format_args!(
        "run it: {}",
        match args.engine {
            Engine::Openjd => openjd::command(&args.to),
            Engine::Slurm => slurm::command(&args.to),
        }
    ));
    Ok(())
}
