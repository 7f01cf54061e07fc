//! Draws the frames of a job into its output.

use crate::args::RenderArgs;
use crate::commands::render::worker;
use crate::commands::render::{Job, sheet};
use crate::drawing::device;
use crate::drawing::pipeline::{Encode, FrameCounts, Pipeline, Pixels, PlanAt, SceneKey, render_failure};
use crate::failure::{Failure, print_message, write_failure};
use crate::output::image_files::{self, FrameRangeClaim};
use crate::output::journal::Identity;
use crate::output::provenance;
use crate::output::segment::Segment;
use crate::output::target::Target;
use crate::output::video::VideoWriter;
use crate::process::kept_frames;
use crate::process::{interrupt, threads};
use crate::terminal::progress::Progress;
use choreo_files::PartFile;
use choreo_motion::Time;
use choreo_plugin::{FrameWish, VideoInfo};
use choreo_render::plan::frame_key::scene_key;
use choreo_render::plan::motion_blur::plan_at;
use choreo_render::{PlanOptions, Renderer, SceneResources};
use choreo_stage::Evaluator;
use std::sync::Arc;
use std::time::Instant;

/// Approximate limit in bytes on images that are being encoded at the same time.
const MAX_ENCODING_BYTES: usize = 256 << 20;

/// Approximate size of a pixel in bytes.
fn pixel_bytes(wish: FrameWish) -> usize {
    match wish {
        FrameWish::Bytes => 4,
        _ => 32,
    }
}

/// Result of a render, with the device that drew it.
pub(super) struct DrawResult {
    pub device: String,
    pub samples: u32,
    /// Reason for the choice of the device; `None` if it was named.
    pub reason: Option<String>,
    /// Frames drawn in this run; others existed already.
    pub counts: FrameCounts,
    /// Number of frames that the device timed, and seconds that it was busy; `None` unless requested and supported.
    pub device_time: Option<(u64, f64)>,
    /// Number of frames that the CPU renderer drew, and seconds of each of its stages; `None` unless requested.
    pub stage_times: Option<(u64, Vec<(&'static str, f64)>)>,
    pub provenance: Vec<(String, String)>,
}

/// Draws the frames of a job and writes them to its output. `jobs`: largest number of threads that encode images.
pub(super) fn draw_job(
    args: &RenderArgs,
    job: &Job,
    started: device::StartedRenderer,
    jobs: Option<usize>,
) -> Result<DrawResult, Failure> {
    let (renderer, time) = (started.renderer, started.time);
    let samples =
        job.samples.or(job.settings.samples).unwrap_or_else(|| device::default_samples(renderer.device()));
    let info = VideoInfo {
        width: job.settings.size[0],
        height: job.settings.size[1],
        fps: job.settings.fps,
        frames: job.frames.len() as u64,
        provenance: provenance::of_render(
            &job.scene,
            &job.settings,
            samples,
            &job.options,
            renderer.device(),
        ),
        options: job.options.clone(),
    };
    let print_unless_quiet = |line: &str| {
        // Warnings contain this word; it follows the place, if there is one.
        if !args.quiet || line.contains("warning: ") {
            print_message(line);
        }
    };
    let printed = job.scene.printed.iter().flat_map(|text| text.lines()).map(str::to_string);
    let messages = printed.chain(job.scene.warnings.iter().chain(&job.notes).cloned());
    messages.chain(job.exporter.notes(&info)).chain(started.note).for_each(|line| print_unless_quiet(&line));
    let device = renderer.device().name.clone();
    let drawing = Drawing { args, job, info: &info, samples, jobs };
    let created_folders = job.target.check_and_create_folders()?;
    interrupt::set_polled(true);
    let result = drawing.run(renderer, &print_unless_quiet);
    if result.is_err() {
        // Removes folders that were created for nothing; folders that contain something stay.
        created_folders.iter().rev().for_each(|folder| drop(std::fs::remove_dir(folder)));
    }
    interrupt::set_polled(false);
    let device_time = time.map(|t| t.total()).filter(|(frames, _)| *frames > 0);
    let stage_times = started.stages.map(|stages| stages.total()).filter(|(frames, _)| *frames > 0);
    let stage_times = stage_times.map(|(frames, secs)| (frames, secs.to_vec()));
    let (reason, provenance) = (started.reason, info.provenance);
    result.map(|counts| DrawResult { device, samples, reason, counts, device_time, stage_times, provenance })
}

/// One run over the frames of a job.
struct Drawing<'a> {
    args: &'a RenderArgs,
    job: &'a Job,
    info: &'a VideoInfo,
    samples: u32,
    jobs: Option<usize>,
}

impl Drawing<'_> {
    /// Draws and writes all frames. The driver has shut down when this function returns, since the program may end then.
    fn run(
        &self,
        renderer: Box<dyn Renderer>,
        print_unless_quiet: &dyn Fn(&str),
    ) -> Result<FrameCounts, Failure> {
        let job = self.job;
        let is_made = || {
            let segment = job.segment.as_ref();
            segment.is_some_and(|segment| Segment::is_complete(&job.target.frame_path(0), segment, self.info))
        };
        if self.args.sheet {
            return self.draw_sheet(renderer, print_unless_quiet);
        }
        if job.exporter.one_frame_per_file() {
            return self.draw_images(renderer, print_unless_quiet);
        }
        let (video, resumed) = match &job.target {
            Target::Stdout => (Some(VideoWriter::to_stdout(&*job.exporter, self.info)?), Default::default()),
            target => {
                let identity = self.render_identity();
                VideoWriter::to_file(
                    &target.frame_path(0),
                    &*job.exporter,
                    self.info,
                    &identity,
                    self.args,
                    is_made,
                )?
            }
        };
        resumed.note.iter().for_each(|line| print_unless_quiet(line));
        let Some(mut video) = video else { return Ok(FrameCounts::default()) };
        worker::start_reports(resumed.finished_frames as u64);
        let encode: Vec<Encode> = vec![Box::new(|_, image, repeated| {
            video.add_frame(&image.pixels, repeated)?;
            worker::count_frame(&image.pixels);
            Ok(())
        })];
        let drawn = match self.draw_frames(
            renderer,
            &job.frames[resumed.finished_frames..],
            encode,
            print_unless_quiet,
        ) {
            Ok(drawn) => video.finish().map(|()| drawn),
            Err(failure) => {
                // A failed script would fail again at the same frame. After a failure outside the script, the render can be resumed.
                let is_resumable =
                    matches!(failure, Failure::Output(_) | Failure::Device(_) | Failure::Interrupted);
                video.end_after_failure(is_resumable);
                Err(failure)
            }
        };
        // Printed even with --quiet: the user must know about the kept frames.
        kept_frames::take_message().iter().for_each(print_message);
        match drawn {
            // Another machine was faster and has removed this part folder; locks do not reach across machines.
            Err(Failure::Output(_)) if self.args.resume && is_made() => Ok(FrameCounts::default()),
            drawn => drawn,
        }
    }

    fn draw_sheet(
        &self,
        renderer: Box<dyn Renderer>,
        print_unless_quiet: &dyn Fn(&str),
    ) -> Result<FrameCounts, Failure> {
        let job = self.job;
        let place = job.target.frame_path(0);
        // The file is created before drawing, so that an error is found early.
        let part = PartFile::create(&place).map_err(|e| write_failure(&place.display().to_string(), e))?;
        let mut drawn = Vec::new();
        let keep: Encode = Box::new(|frame, image, _| {
            // Jobs with sheets of floats are refused before drawing.
            if let Pixels::Bytes(pixels) = &image.pixels {
                drawn.push((sheet::caption(frame), pixels.clone()));
            }
            Ok(())
        });
        let counts = self.draw_frames(renderer, &job.frames, vec![keep], print_unless_quiet)?;
        let sheet = sheet::compose(drawn);
        let info = VideoInfo { width: sheet.width, height: sheet.height, frames: 1, ..self.info.clone() };
        image_files::write_image_to(&place, Ok(part), &*job.exporter, &info, &Pixels::Bytes(sheet))?;
        Ok(counts)
    }

    fn draw_images(
        &self,
        renderer: Box<dyn Renderer>,
        print_unless_quiet: &dyn Fn(&str),
    ) -> Result<FrameCounts, Failure> {
        let (job, info) = (self.job, self.info);
        let numbers = job.frames.first().zip(job.frames.last());
        let _claim = match numbers {
            Some((first, last)) => FrameRangeClaim::take(&job.target, first.0, last.0)?,
            None => None,
        };
        let frames = match self.args.resume {
            true => image_files::missing_frames(&job.target, info, &job.frames)?,
            false => job.frames.clone(),
        };
        let mut open = match &job.target {
            // The file is created before drawing, so that an error is found early.
            Target::File(place) if !frames.is_empty() => {
                let part = PartFile::create(place);
                Some(part.map_err(|e| write_failure(&place.display().to_string(), e))?)
            }
            _ => None,
        };
        let pixels = info.width as usize * info.height as usize;
        let bytes = pixel_bytes(job.wish) * pixels;
        let workers =
            self.jobs.unwrap_or_else(threads::cores).min(frames.len()).min(MAX_ENCODING_BYTES / bytes);
        let mut encode = || -> Encode {
            let mut open = open.take();
            Box::new(move |frame, image, _| {
                image_files::write_image(&job.target, open.take(), &*job.exporter, info, frame, image)
            })
        };
        self.draw_frames(
            renderer,
            &frames,
            (0..workers.clamp(1, 16)).map(|_| encode()).collect(),
            print_unless_quiet,
        )
    }

    fn draw_frames(
        &self,
        mut renderer: Box<dyn Renderer>,
        frames: &[(i64, Time)],
        encoders: Vec<Encode>,
        print_unless_quiet: &dyn Fn(&str),
    ) -> Result<FrameCounts, Failure> {
        if frames.is_empty() {
            return Ok(FrameCounts::default());
        }
        let resources = Arc::new(SceneResources::new(&self.job.scene.stage));
        let failed = render_failure;
        let effects = self.job.scene.registry.effects();
        renderer.set_effects(effects).map_err(failed)?;
        renderer.load(resources.clone()).map_err(failed)?;
        let size = self.job.settings.size;
        let aspect = f64::from(size[0]) / f64::from(size[1].max(1));
        let mut evaluator = Evaluator::new(self.job.scene.stage.clone()).for_images(aspect);
        let options = PlanOptions { effects, wish: self.job.wish, ..PlanOptions::new(size, self.samples) };
        let loaded = resources.clone();
        let scene_key: SceneKey = Box::new(move |plan| scene_key(plan, &loaded, effects));
        let (started, limit) = (Instant::now(), self.job.scene.limits.render_seconds);
        let plan: PlanAt = Box::new(move |time| {
            if started.elapsed().as_secs_f64() > limit {
                let hint = choreo_script::raise_hint("render_seconds", format!("{limit} s"));
                return Err(Failure::input(format!("the render takes too long\n    hint: {hint}")));
            }
            let planned = plan_at(&resources, &mut evaluator, time, &options, None);
            planned.map(|(_, plan)| plan).map_err(|e| Failure::input(e.to_string()))
        });
        let progress = match self.args.progress_lines {
            true => Progress::json_lines(frames.len() as u64),
            false => Progress::new(frames.len() as u64, self.args.quiet || self.args.json),
        };
        let frames = frames.to_vec();
        let renderer_of_frames = &mut *renderer;
        let pipeline =
            Pipeline { frames, plan, scene_key, renderer: renderer_of_frames, encoders, progress: &progress };
        let counts = pipeline.run();
        progress.clear();
        renderer.take_notes().iter().for_each(|line| print_unless_quiet(line));
        counts
    }

    /// Identity of a render, which a stopped render must share to be resumed: provenance, range of frames, format.
    fn render_identity(&self) -> Identity {
        let mut identity = self.info.provenance.clone();
        let manifest = self.job.exporter.manifest();
        identity.push(("format".into(), format!("{} {}", manifest.name, manifest.version)));
        let numbers = self.job.frames.first().zip(self.job.frames.last());
        let frames = numbers.map_or(String::new(), |((first, time), (last, _))| match first == last {
            true => format!("{first} at {} s", time.as_secs()),
            false if last - first + 1 == self.job.frames.len() as i64 => format!("{first}..={last}"),
            false => self.args.frames.clone().unwrap_or_default(),
        });
        identity.push(("frames".into(), frames));
        identity
    }
}
