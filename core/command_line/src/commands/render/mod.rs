//! `choreo render`: from the command line to files. Everything that can be refused is refused before the first frame.

mod batch;
mod draw;
pub(crate) mod sheet;
mod stages;
mod summary;
mod watch;
pub(crate) mod worker;

use crate::args::RenderArgs;
use crate::args::values;
use crate::commands::export;
use crate::drawing::device;
use crate::failure::{Failure, check_limit, output_failure};
use crate::output::budget::BudgetedExporter;
use crate::output::segment::SegmentExporter;
use crate::output::target::Target;
use crate::scene::{
    self, NO_CLIPS_WARNING, OpenedScene,
    opening::{OpenOptions, ReopenState},
};
use choreo_motion::Time;
use choreo_plugin::{ExportOptions, Exporter, FrameWish, Hook, Passes, Registry, ViewOrder};
use choreo_stage::{Repeat, Settings, Stage};
use std::sync::Arc;
use std::time::Instant;

/// A render with checked arguments.
pub(crate) struct Job {
    pub scene: OpenedScene,
    pub target: Target,
    pub exporter: Arc<dyn Exporter>,
    /// Exporter of the segment, wrapped by `exporter`, if the target is a segment.
    pub segment: Option<Arc<SegmentExporter>>,
    pub frames: Vec<(i64, Time)>,
    pub settings: Settings,
    pub samples: Option<u32>,
    pub options: ExportOptions,
    /// Pixel format that the exporter asks for.
    pub wish: FrameWish,
    pub notes: Vec<String>,
}

pub(crate) fn run(args: RenderArgs, plugins: &Registry) -> Result<(), Failure> {
    if let Some(table) = &args.set_from {
        return batch::run(&args, table, plugins);
    }
    if args.watch {
        return watch::run(&args, plugins);
    }
    if args.stages {
        return stages::run(&args, plugins);
    }
    begin_segment_report(&args);
    let start = Instant::now();
    let jobs = args.jobs.as_deref().map(values::parse_jobs).transpose()?;
    let target = Target::parse(&args.output)?;
    let registry = scene::registry_with_plugin_files(&args.scene, plugins)?;
    target.exporter(&registry)?;
    if args.resume && target == Target::Stdout {
        return Err(Failure::Usage("--resume needs a file; standard output cannot be resumed".into()));
    }
    // The driver takes as long to start as the script and its assets: both happen at the same time.
    let starting = device::start_renderer(device_request(&args), registry.effects());
    let prepared = prepare_job(&args, target, &registry, None);
    let started = starting.wait();
    let job = prepared?;
    let drawn = draw::draw_job(&args, &job, started?, jobs)?;
    summary::report(&args, &job, &drawn, start.elapsed().as_secs_f64())
}

/// Begins the report of a segment before its scene is opened, if the frames are already known, so that a scene that cannot be opened is
/// reported too.
fn begin_segment_report(args: &RenderArgs) {
    let named = args.frames.as_deref().filter(|frames| !frames.trim_end().ends_with(".."));
    let frames =
        named.and_then(|frames| values::parse_frames(frames, values::MAX_FRAMES).ok()).unwrap_or_default();
    if let (Some(folder), Some(first), Some(last)) = (&args.segment, frames.first(), frames.last()) {
        worker::begin_segment(folder, first.unsigned_abs(), last.unsigned_abs());
    }
}

fn device_request(args: &RenderArgs) -> device::DeviceRequest {
    device::DeviceRequest {
        device: args.device,
        gpu: args.gpu.clone(),
        timings: args.timings,
        anisotropy: args.anisotropy,
    }
}

/// Opens the scene and checks everything that can be refused before drawing. `reopen_state`: state of earlier renders of the same input.
pub(crate) fn prepare_job(
    args: &RenderArgs,
    target: Target,
    registry: &Registry,
    reopen_state: Option<&ReopenState>,
) -> Result<Job, Failure> {
    let exporter = target.exporter(registry)?;
    let options = export::parse_export_options(&args.export_options(), exporter.manifest())?;
    let wish = check_output_wish(args, &target, &**exporter, &options)?;
    let size = args.size.as_deref().map(values::parse_size).transpose()?;
    let fps = args.fps.as_deref().map(values::parse_fps).transpose()?;
    let at = args.at.as_deref().map(values::parse_at).transpose()?;
    let samples = args.samples.as_deref().map(values::parse_samples).transpose()?;

    let length = args.length.as_deref().map(values::parse_length).transpose()?;

    let opening = OpenOptions { quiet: args.quiet, reopen_state, ..OpenOptions::TO_DRAW };
    let mut scene = scene::open(&args.scene, registry, opening)?;
    if let Some(length) = length {
        loop_clips_for(&mut scene, length)?;
    }
    let mut settings = scene.stage.settings.clone();
    settings.size = match args.sheet {
        true => size.unwrap_or_else(|| sheet::cell_size(settings.size)),
        false => size.unwrap_or(settings.size),
    };
    // The size is set on the stage too, since automatic camera framing depends on the image's aspect ratio.
    Arc::make_mut(&mut scene.stage).settings.size = settings.size;
    settings.fps = fps.unwrap_or(settings.fps);
    let total = settings.fps.frames_in(settings.length).max(1);
    let mut notes = Vec::new();
    let pixels = u64::from(settings.size[0]) * u64::from(settings.size[1]);
    // The limit applies to sizes in scripts. A size on the command line is intended, so the limit applies to it only if it is given too.
    if size.is_none() || args.scene.limit.iter().any(|l| l.trim_start().starts_with("pixels")) {
        check_limit(pixels, "pixels", scene.limits.pixels)?;
    }
    let is_one_image = exporter.one_frame_per_file() && !matches!(target, Target::Numbered { .. });
    let frames: Vec<(i64, Time)> = match at {
        Some(at) => vec![(0, at)],
        None => {
            let (numbers, note) = frame_numbers(args, &target, &scene, total, is_one_image, pixels)?;
            notes.extend(note);
            numbers.into_iter().map(|f| (f, settings.fps.time_of(f))).collect()
        }
    };
    let segment = segment_target(args, &target, exporter, &frames, total)?;
    let (target, segment) = segment.map_or((target, None), |(file, segment)| (file, Some(segment)));
    let exporter = segment.clone().map_or(exporter.clone(), |segment| segment as Arc<dyn Exporter>);
    if target != Target::Stdout {
        frames.iter().try_for_each(|(number, _)| scene.inputs.check_output(&target.frame_path(*number)))?;
    }
    let exporter = Arc::new(BudgetedExporter::new(exporter, scene.limits.output));
    notes.extend(linear_light_note(wish, &scene.stage, registry));
    Ok(Job { scene, target, exporter, segment, frames, settings, samples, options, wish, notes })
}

/// Numbers of the frames to draw if no time is given, and a note if `--frames` names more frames than one file holds. `total`: frames of
/// the scene; `pixels`: pixels of a frame.
fn frame_numbers(
    args: &RenderArgs,
    target: &Target,
    scene: &OpenedScene,
    total: i64,
    is_one_image: bool,
    pixels: u64,
) -> Result<(Vec<i64>, Option<String>), Failure> {
    let chosen = args.frames.as_deref().map(|f| values::parse_frames(f, total)).transpose();
    let chosen = chosen.map_err(|failure| match failure {
        Failure::Usage(text)
            if !scene.is_script && args.length.is_none() && text.ends_with(&format!("0..{total}")) =>
        {
            Failure::Usage(format!("{text}; --length SECS makes it longer and repeats the clip"))
        }
        other => other,
    })?;
    let numbers = match chosen {
        chosen if args.sheet => {
            sheet::check_is_one_image(target, is_one_image)?;
            let frames = chosen.unwrap_or_else(|| sheet::evenly_spread_frames(total));
            check_limit(pixels * frames.len() as u64, "pixels", scene.limits.pixels)?;
            frames
        }
        Some(frames) if is_one_image && frames.len() > 1 => {
            let note = format!(
                "{} holds one image: frame {} is drawn; for all of them type -o {}, or --sheet",
                target.display_name(),
                frames[0],
                numbered_pattern(&args.output)
            );
            return Ok((vec![frames[0]], Some(note)));
        }
        None if is_one_image && total > 1 && scene.is_script => {
            return Err(Failure::Usage(format!(
                "{} holds one image and the scene has {total} frames; type --at 0 for one of them, or -o {} for all",
                target.display_name(),
                numbered_pattern(&args.output)
            )));
        }
        None if is_one_image => vec![0],
        chosen => {
            let count = chosen.as_ref().map_or(total.unsigned_abs(), |frames| frames.len() as u64);
            check_limit(count, "frames", scene.limits.frames)?;
            chosen.unwrap_or_else(|| (0..total).collect())
        }
    };
    Ok((numbers, None))
}

/// Pixel format that the exporter asks for. Fails if `--sheet` or `--stages` cannot provide it.
fn check_output_wish(
    args: &RenderArgs,
    target: &Target,
    exporter: &dyn Exporter,
    options: &ExportOptions,
) -> Result<FrameWish, Failure> {
    let wish = exporter.wish(options).map_err(|error| Failure::Usage(error.to_string()))?;
    let why = if args.sheet { "--sheet" } else { "--stages" };
    match wish {
        FrameWish::Bytes => Ok(wish),
        _ if args.sheet || args.stages => Err(Failure::Usage(format!(
            "{why} writes images of 8 bits per channel, but {} holds images of more bits",
            target.display_name()
        ))),
        _ => Ok(wish),
    }
}

/// Note about effects and 2D layers that are applied after the view transform, which images of linear light leave out.
fn linear_light_note(wish: FrameWish, stage: &Stage, registry: &Registry) -> Option<String> {
    let FrameWish::Scene(Passes { color: true, .. }) = wish else { return None };
    let effects = stage.effects.iter().filter_map(|used| registry.effect(&used.plugin));
    let shown = effects.filter(|effect| {
        matches!(effect.hook(), Hook::Pixel | Hook::Image) && effect.view_order() != ViewOrder::Before
    });
    let mut without: Vec<String> =
        shown.map(|effect| format!("the effect {}", effect.manifest().name)).collect();
    without.extend((!stage.layers_2d.is_empty()).then(|| "2D layers".to_string()));
    let without = match without.is_empty() {
        true => return None,
        false => without.join(", "),
    };
    Some(format!("the output is light before the view transform, without {without}"))
}

/// Target and exporter for `--segment`: a segment in place of the film.
fn segment_target(
    args: &RenderArgs,
    film: &Target,
    exporter: &Arc<dyn Exporter>,
    frames: &[(i64, Time)],
    total: i64,
) -> Result<Option<(Target, Arc<SegmentExporter>)>, Failure> {
    let Some(folder) = &args.segment else { return Ok(None) };
    let one_image = exporter.one_frame_per_file() && !matches!(film, Target::Numbered { .. });
    if *film == Target::Stdout || one_image {
        let what = format!("--segment is for videos and numbered images, not for {}", film.display_name());
        return Err(Failure::Usage(what));
    }
    let count = frames.len() as i64;
    let numbers = frames.first().zip(frames.last()).map(|((first, _), (last, _))| (*first, *last));
    let Some((first, _)) = numbers.filter(|(first, last)| last - first + 1 == count) else {
        return Err(Failure::Usage("--segment takes one range of frames, as --frames 0..120".into()));
    };
    std::fs::create_dir_all(folder).map_err(|e| output_failure(&folder.display().to_string(), &e))?;
    worker::begin_segment(folder, first.unsigned_abs(), (first + count - 1).unsigned_abs());
    let segment = SegmentExporter {
        inner: exporter.clone(),
        first: first.unsigned_abs(),
        film_frames: total.unsigned_abs(),
        options: args.export_options(),
    };
    let file = folder.join(segment.file_name(count.unsigned_abs()));
    Ok(Some((Target::File(file), Arc::new(segment))))
}

/// Applies `--length` by looping the model's clip.
fn loop_clips_for(scene: &mut OpenedScene, length: Time) -> Result<(), Failure> {
    if scene.is_script {
        let what = "--length is for model files; in a script, write stage(#{ length: 4.0 })";
        return Err(Failure::Usage(what.into()));
    }
    let stage = Arc::make_mut(&mut scene.stage);
    stage.settings.length = length;
    let layers = stage.actors.iter_mut().flat_map(|actor| &mut actor.layers);
    layers.flat_map(|layer| &mut layer.cues).for_each(|cue| cue.repeat = Repeat::Loop);
    for warning in &mut scene.warnings {
        if let Some(model) = warning.strip_suffix(NO_CLIPS_WARNING) {
            *warning = format!("{model}no clips: the same frame for {} s", length.as_secs());
        }
    }
    scene.arguments.push(format!("--length {}", length.as_secs()));
    Ok(())
}

/// Suggests a numbered output: `out.png` → `out/%04d.png`.
fn numbered_pattern(output: &str) -> String {
    match output.rsplit_once('.') {
        Some((stem, extension)) => format!("{stem}/%04d.{extension}"),
        None => format!("{output}/%04d.png"),
    }
}
