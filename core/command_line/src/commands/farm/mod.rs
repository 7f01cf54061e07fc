//! `choreo farm`: a job that renders a film, or one film for each row of a table, on many machines, for an existing engine: the packed
//! scene, a step that renders segments, and a step that joins them.

mod chunks;
mod job;
mod measure;
mod openjd;
mod pack_rows;
mod preview;
mod slurm;
mod status;

use crate::App;
use crate::args::{Cli, Command, Engine, FarmArgs, PackArgs, RenderArgs};
use crate::commands::{pack, render};
use crate::failure::{Failure, output_failure, print_json, print_message, write_failure};
use crate::output::target::Target;
use crate::process::scratch;
use crate::project_file;
use crate::scene;
use crate::scene::opening::ReopenState;
use crate::scene::pack::Unpacked;
use crate::scene::rows::{self, ParameterRow};
use crate::terminal::counted;
use choreo_files::write_whole_beneath;
use choreo_plugin::VideoInfo;
use chunks::{FilmCost, chunks_of_equal_cost, chunks_of_length, nearest_multiple_of_piece};
use clap::FromArgMatches;
use job::{FarmJob, Film, JOB_FILE, OUTPUT_FOLDER, ROWS_FILE, SCENE_FILE, SEGMENTS_FOLDER};
use pack_rows::RowFailure;
use serde_json::json;
use std::ffi::OsString;
use std::num::NonZeroU64;
use std::path::{Component, Path, PathBuf};
use std::time::Instant;

/// A job that the command line asks for.
struct JobRequest<'a> {
    args: &'a FarmArgs,
    output: &'a str,
    engine: Engine,
    job_folder: &'a Path,
    rows: Option<Vec<ParameterRow>>,
}

impl<'a> JobRequest<'a> {
    fn new(args: &'a FarmArgs) -> Result<JobRequest<'a>, Failure> {
        let missing = || Failure::Usage("farm needs -o, --for and --to, or --status".into());
        let output = args.output.as_deref().ok_or_else(missing)?;
        let job_folder = args.to.as_deref().ok_or_else(missing)?;
        let engine = args.engine.ok_or_else(missing)?;
        check_film_path(output)?;
        let rows = args.set_from.as_deref().map(rows::read_table).transpose()?;
        Ok(JobRequest { args, output, engine, job_folder, rows })
    }

    /// Arguments of the pack command for the job's scene.
    fn pack_args(&self) -> PackArgs {
        PackArgs {
            scene: self.args.scene.clone(),
            output: self.job_folder.join(SCENE_FILE),
            quiet: true,
            json: false,
        }
    }
}

/// Prints the progress of the job in a folder.
pub(crate) fn status(folder: &Path, args: &FarmArgs) -> Result<(), Failure> {
    status::run(folder, args.sheet.as_deref(), args.json)
}

/// Writes a job. `options`: text of the project's `choreo.toml`.
pub(crate) fn run(args: &FarmArgs, app: &App, options: String) -> Result<(), Failure> {
    let request = JobRequest::new(args)?;
    let segments = request.job_folder.join(SEGMENTS_FOLDER);
    if segments.read_dir().is_ok_and(|mut entries| entries.next().is_some()) {
        let (to, segments) = (request.job_folder.display(), segments.display());
        let what = format!(
            "--to {to}: a job has already run there: {segments} is not empty; name another folder, or \
             remove it"
        );
        return Err(Failure::Output(what));
    }
    let outputs = request.rows.as_deref().map(|rows| rows::output_paths(rows, request.output)).transpose()?;
    let failed = |e: std::io::Error| output_failure(&request.job_folder.display().to_string(), &e);
    for folder in [SEGMENTS_FOLDER, OUTPUT_FOLDER] {
        std::fs::create_dir_all(request.job_folder.join(folder)).map_err(failed)?;
    }
    let mut failures = match &request.rows {
        None => pack::write_pack(&request.pack_args(), &app.registry, options).map(|_| Vec::new())?,
        Some(rows) => pack_rows::pack_all_rows(&request.pack_args(), rows, &app.registry, options)?,
    };
    let (films, cost) = match outputs {
        None => film_and_preview(&request, app)?,
        Some(outputs) => films_of_rows(&request, &outputs, app, &mut failures)?,
    };
    let farm_job = FarmJob { films, pattern: request.rows.is_some().then(|| request.output.to_string()) };
    let mut files = match request.engine {
        Engine::Openjd => openjd::job_files(&farm_job)?,
        Engine::Slurm => slurm::job_files(&farm_job)?,
    };
    let pretty = |value: &serde_json::Value| crate::terminal::json::pretty(value) + "\n";
    files.extend(request.rows.iter().map(|rows| (ROWS_FILE, pretty(&rows::to_json(rows)))));
    files.push((JOB_FILE, pretty(&farm_job.json())));
    for (name, text) in &files {
        let shown = request.job_folder.join(name).display().to_string();
        write_whole_beneath(request.job_folder, Path::new(name), text.as_bytes())
            .map_err(|e| write_failure(&shown, e))?;
    }
    report_job(&request, &farm_job, &files, cost.as_ref(), &failures)?;
    pack_rows::check_row_failures(&failures, request.rows.as_deref().unwrap_or_default().len())
}

/// The film, preceded by its preview if one is requested, and the measured cost.
fn film_and_preview(request: &JobRequest, app: &App) -> Result<(Vec<Film>, Option<FilmCost>), Failure> {
    let every = request.args.preview.as_deref().map(preview::parse_every).transpose()?;
    let options = request.args.render_options();
    let start = Instant::now();
    let args = render_args(request, &options, app)?;
    let job = open_job(&args, app, None)?;
    let cost = measured_cost(request, &args, &job, start)?;
    let film = |segments: &str, output: String, options, job: &render::Job, cost: Option<&FilmCost>| {
        let (frames, chunks) =
            (job.frames.len() as u64, divide_into_chunks(request, job, cost, slurm::MAX_ARRAY_TASKS));
        Film { output, segments: segments.into(), row: None, options, frames, chunks }
    };
    let mut films = Vec::new();
    if let Some(every) = every {
        let options = preview::preview_options(&options, &job, every);
        let small = open_job(&render_args(request, &options, app)?, app, None)?;
        let output = format!("{}/{}", preview::PREVIEW_FOLDER, request.output);
        let cost = cost.as_ref().map(|cost| preview::preview_cost(cost, every));
        films.push(film(preview::PREVIEW_FOLDER, output, options, &small, cost.as_ref()));
    }
    films.push(film("", request.output.to_string(), options, &job, cost.as_ref()));
    Ok((films, cost))
}

/// Films of a batch, without those of rows that fail, and the measured cost of the first film.
fn films_of_rows(
    request: &JobRequest,
    outputs: &[String],
    app: &App,
    failures: &mut Vec<RowFailure>,
) -> Result<(Vec<Film>, Option<FilmCost>), Failure> {
    let rows = request.rows.as_deref().unwrap_or_default();
    let options = request.args.render_options();
    let start = Instant::now();
    let (reopen_state, all) = (ReopenState::default(), render_args(request, &options, app)?);
    let (mut films, mut measured) = (Vec::new(), None);
    let most = (slurm::MAX_ARRAY_TASKS / rows.len() as u64).max(1);
    for (row, output) in rows.iter().zip(outputs) {
        if failures.iter().any(|(number, _)| *number == row.number) {
            continue;
        }
        let args = RenderArgs { scene: row.scene_args(&all.scene), output: output.clone(), ..all.clone() };
        let job = match open_job(&args, app, Some(&reopen_state)) {
            Ok(job) => job,
            Err(failure) => {
                failures.push((row.number, failure));
                continue;
            }
        };
        // The films of all rows are assumed to cost the same.
        if films.is_empty() {
            measured = measured_cost(request, &args, &job, start)?;
        }
        reopen_state.release_unused_assets(job.scene.limits.memory);
        films.push(Film {
            output: output.clone(),
            segments: row.number.to_string(),
            row: Some(row.number),
            options: options.clone(),
            frames: job.frames.len() as u64,
            chunks: divide_into_chunks(request, &job, measured.as_ref(), most),
        });
    }
    match films.is_empty() {
        true => {
            pack_rows::check_row_failures(failures, rows.len())?;
            Err(Failure::input("there are no rows"))
        }
        false => Ok((films, measured)),
    }
}

/// Cost of the film's frames; it is measured unless the length of chunks is given. `start`: when opening the scene began.
fn measured_cost(
    request: &JobRequest,
    render_args: &RenderArgs,
    job: &render::Job,
    start: Instant,
) -> Result<Option<FilmCost>, Failure> {
    match request.args.chunk {
        None => measure::measure_cost(render_args, job, start).map(Some),
        Some(length) => {
            let piece = piece_frames(job);
            if length % piece > 0 && !request.args.quiet && !request.args.json {
                print_message(format_args!(
                    "chunks of {length} frames do not match the film's groups of {piece}: join must encode \
                     them again; chunks of {} are copied",
                    nearest_multiple_of_piece(length.max(piece), piece)
                ));
            }
            Ok(None)
        }
    }
}

/// Number of frames in a piece of the film; 1 if the format has no pieces.
fn piece_frames(job: &render::Job) -> u64 {
    job.exporter.piece(&video_info(job, job.frames.len() as u64)).map_or(1, NonZeroU64::get)
}

/// Chunks of a film. Measured chunks are at most `most`; a given length of chunks may give more.
fn divide_into_chunks(
    request: &JobRequest,
    job: &render::Job,
    cost: Option<&FilmCost>,
    most: u64,
) -> Vec<chunks::Chunk> {
    let frames = job.frames.len() as u64;
    let piece = piece_frames(job);
    let chunks = match (request.args.chunk, cost) {
        (Some(length), _) => chunks_of_length(frames, length),
        (None, Some(cost)) => chunks_of_equal_cost(frames, piece, cost, most),
        (None, None) => vec![(0, frames - 1)],
    };
    if request.engine == Engine::Slurm || request.rows.is_some() {
        return chunks;
    }
    // Open Job Description needs chunks of one length.
    let length = request
        .args
        .chunk
        .unwrap_or_else(|| nearest_multiple_of_piece(frames.div_ceil(chunks.len() as u64), piece));
    let most = openjd::MAX_CHUNK_FRAMES;
    let most = if most >= piece { most - most % piece } else { most };
    chunks_of_length(frames, if length > openjd::MAX_CHUNK_FRAMES { most } else { length })
}

/// Properties of the film that determine its pieces.
fn video_info(job: &render::Job, frames: u64) -> VideoInfo {
    let [width, height] = job.settings.size;
    let (fps, options) = (job.settings.fps, job.options.clone());
    VideoInfo { width, height, fps, frames, provenance: Vec::new(), options }
}

/// Checks the path of the film in the job: it must be relative and without `..`, since the job runs on other machines.
fn check_film_path(output: &str) -> Result<(), Failure> {
    let plain = |part: Component| matches!(part, Component::Normal(_));
    if Target::parse(output)? == Target::Stdout || !Path::new(output).components().all(plain) {
        let what = format!(
            "-o {output}: the film is written to the folder {OUTPUT_FOLDER} of the job; write a name, as film.mp4"
        );
        return Err(Failure::Usage(what));
    }
    Ok(())
}

/// Arguments of a render of the packed scene, which is unpacked in the same way as on a machine of the farm.
fn render_args(request: &JobRequest, options: &[String], app: &App) -> Result<RenderArgs, Failure> {
    let scene: PathBuf = request.job_folder.join(SCENE_FILE);
    let mut words: Vec<OsString> = vec![app.name.into(), "render".into(), scene.into(), "-o".into()];
    words.push(request.output.into());
    words.extend(options.iter().map(OsString::from));
    let words = project_file::with_project_options(&words, app)?;
    let parsed = <Cli as clap::CommandFactory>::command().try_get_matches_from(words);
    let cli = parsed.and_then(|matches| Cli::from_arg_matches(&matches));
    let Command::Render(mut render_args) = cli.map_err(|e| Failure::Usage(e.to_string()))?.command else {
        return Err(Failure::Internal("the arguments of the render were parsed as another command".into()));
    };
    render_args.scene.software = app.software();
    render_args.quiet = true;
    scratch::keep_until_exit(Unpacked::replace_input(&mut render_args.scene)?);
    Ok(render_args)
}

/// Opens the render in the same way as a machine of the farm.
fn open_job(
    args: &RenderArgs,
    app: &App,
    reopen_state: Option<&ReopenState>,
) -> Result<render::Job, Failure> {
    let registry = scene::registry_with_plugin_files(&args.scene, &app.registry)?;
    // The job makes the folder of a film of numbered images.
    render::prepare_job(args, Target::parse(&args.output)?, &registry, reopen_state)
}

impl FarmArgs {
    /// Options of `choreo render` on each machine, without input, output and frames. The device is named, so that all machines draw the
    /// same images or fail.
    fn render_options(&self) -> Vec<String> {
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

fn report_job(
    request: &JobRequest,
    job: &FarmJob,
    files: &[(&str, String)],
    cost: Option<&FilmCost>,
    failures: &[RowFailure],
) -> Result<(), Failure> {
    let frames: u64 = job.films.iter().map(|film| film.frames).sum();
    let count: usize = job.films.iter().map(|film| film.chunks.len()).sum();
    let to = request.job_folder.display();
    let of_cost = job.films.last().zip(cost);
    let frame_seconds = of_cost.map(|(film, cost)| cost.total_secs(film.frames) / film.frames as f64);
    if request.args.json {
        let film =
            |film: &Film| json!({ "output": film.output, "frames": film.frames, "chunks": film.chunks });
        let row = |(row, failure): &RowFailure| json!({ "row": row, "errors": failure.json()["errors"] });
        return print_json(&json!({
            "ok": failures.is_empty(),
            "folder": to.to_string(),
            "files": files.iter().map(|(name, _)| *name).chain([SCENE_FILE]).collect::<Vec<_>>(),
            "frames": frames,
            "chunks": job.films.last().map(|film| &film.chunks),
            "films": job.films.iter().map(film).collect::<Vec<_>>(),
            "failed_rows": failures.iter().map(row).collect::<Vec<_>>(),
            "start_seconds": cost.map(|cost| cost.start_secs),
            "frame_seconds": frame_seconds,
        }));
    }
    pack_rows::print_row_failures(failures);
    if request.args.quiet {
        return Ok(());
    }
    let (frames_text, chunks_text) = (counted(frames, "frame"), counted(count as u64, "chunk"));
    let films = if job.films.len() > 1 { format!(" of {} films", job.films.len()) } else { String::new() };
    print_message(format_args!("{frames_text}{films} in {chunks_text}: {to}"));
    if let Some((cost, frame)) = cost.zip(frame_seconds) {
        print_message(format_args!(
            "measured on this machine: {:.1} s to start, {frame:.3} s a frame, {:.1} s for all frames on one machine",
            cost.start_secs,
            cost.start_secs + frame * frames as f64
        ));
    }
    let run = match request.engine {
        Engine::Openjd => openjd::run_command(request.job_folder, job),
        Engine::Slurm => slurm::submit_command(request.job_folder),
    };
    print_message(format_args!("run it: {run}"));
    Ok(())
}
