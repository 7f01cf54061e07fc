//! `choreo join`: joins the segments that several machines made of a film into the file that one machine would have written.

use crate::args::JoinArgs;
use crate::args::values;
use crate::commands::export;
use crate::failure::{Failure, output_failure, print_json, print_message, write_failure};
use crate::output::budget::Budget;
use crate::output::image_files::FrameRangeClaim;
use crate::output::provenance;
use crate::output::segment::{
    CoverageError, FilmWriter, JoinError, JoinedFrames, RecordAddress, SEGMENT_EXTENSION, Segment,
    format_ranges, select_records,
};
use crate::output::target::{Target, export_failure};
use crate::process::machine;
use crate::scene::inputs::Inputs;
use crate::terminal::{counted, progress::Progress};
use choreo_files::{PartFile, containing_folder};
use choreo_plugin::{Exporter, Registry, VideoInfo};
use serde_json::json;
use std::collections::BTreeMap;
use std::io::{Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Time between two scans of the folder.
const SCAN_INTERVAL: Duration = Duration::from_millis(500);

/// Largest number of names read from one folder.
const MAX_NAMES_PER_FOLDER: usize = 1_000_000;

pub(crate) fn run(args: &JoinArgs, plugins: &Registry, software: &str) -> Result<(), Failure> {
    let start = Instant::now();
    let target = Target::parse(&args.output)?;
    if target == Target::Stdout {
        return Err(Failure::Usage("join writes files; name one with -o".into()));
    }
    let exporter = target.exporter(plugins)?;
    let limits = values::parse_limits(&args.limit)?;
    let GatheredFilm { segments, damaged, record_addresses, info, files } =
        gather_film_with_wait(args, &target, exporter.as_ref(), software)?;
    let inputs = Inputs::new(files.iter().cloned());
    let joining = FilmJoin {
        target: &target,
        exporter: exporter.as_ref(),
        info: &info,
        segments: &segments,
        record_addresses: &record_addresses,
        inputs: &inputs,
        budget: Budget::new(limits.output),
        progress: Progress::new(record_addresses.len() as u64, args.quiet || args.json),
    };
    let joined = if exporter.one_frame_per_file() { joining.write_images() } else { joining.write_film() };
    joining.progress.clear();
    let JoinedFrames { copied, encoded } = joined?;
    let secs = start.elapsed().as_secs_f64();
    if args.json {
        return print_json(&json!({
            "ok": true,
            "output": target.display_name(),
            "frames": info.frames,
            "segments": segments.len(),
            "copied": copied,
            "encoded": encoded,
            "damaged": damaged,
            "seconds": secs,
            "provenance": info.provenance.into_iter().collect::<BTreeMap<_, _>>(),
        }));
    }
    if !args.quiet {
        let (frames, count) = (counted(info.frames, "frame"), counted(segments.len() as u64, "segment"));
        print_message(format_args!(
            "{frames} of {count} joined in {secs:.1} s, {copied} copied and {encoded} encoded: {}",
            target.display_name()
        ));
    }
    Ok(())
}

/// Segments of one film, after the check that they hold all of its frames.
struct GatheredFilm {
    segments: Vec<Segment>,
    /// Descriptions of the damage found in segments; each includes the segment's name.
    damaged: Vec<String>,
    record_addresses: Vec<RecordAddress>,
    info: VideoInfo,
    files: Vec<PathBuf>,
}

/// Reason why the film cannot be gathered.
enum GatherError {
    /// Frames are missing or damaged: on a shared file system they may still arrive.
    Missing(Failure),
    Failure(Failure),
}

impl From<Failure> for GatherError {
    fn from(failure: Failure) -> GatherError {
        GatherError::Failure(failure)
    }
}

/// Gathers the film from its segments, and waits up to `--wait` seconds for missing frames, measured by this process alone.
fn gather_film_with_wait(
    args: &JoinArgs,
    target: &Target,
    exporter: &dyn Exporter,
    software: &str,
) -> Result<GatheredFilm, Failure> {
    let (start, max_wait) = (Instant::now(), Duration::from_secs(args.wait.into()));
    loop {
        let lengths_before = segment_file_lengths(&args.segments);
        let mut damaged = Vec::new();
        let failure = match gather_film(args, target, exporter, software, &mut damaged) {
            Err(GatherError::Missing(failure)) if start.elapsed() < max_wait => failure,
            result => {
                // Printed even with --quiet: a machine or a disk may be failing.
                damaged.iter().for_each(|what| print_message(format_args!("warning: {what}")));
                return result.map(|gathered| GatheredFilm { damaged, ..gathered }).map_err(
                    |error| match error {
                        GatherError::Missing(failure) | GatherError::Failure(failure) => failure,
                    },
                );
            }
        };
        drop(failure);
        // Segments that have not changed are not read again.
        while segment_file_lengths(&args.segments) == lengths_before && start.elapsed() < max_wait {
            std::thread::sleep(SCAN_INTERVAL);
        }
    }
}

/// Segment files with their lengths in bytes.
fn segment_file_lengths(given: &[PathBuf]) -> Vec<(PathBuf, u64)> {
    let files = segment_files(given).unwrap_or_default();
    files
        .into_iter()
        .map(|file| (file.metadata().map_or(0, |metadata| metadata.len()), file))
        .map(|(n, f)| (f, n))
        .collect()
}

fn gather_film(
    args: &JoinArgs,
    target: &Target,
    exporter: &dyn Exporter,
    software: &str,
    damaged: &mut Vec<String>,
) -> Result<GatheredFilm, GatherError> {
    let files = segment_files(&args.segments).map_err(GatherError::Missing)?;
    let segments = open_segments(&files, args.quiet, damaged).map_err(GatherError::Missing)?;
    let film = check_same_film(&segments, damaged, exporter, software)?;
    let options = export::parse_export_options(&film.film.options, exporter.manifest())?;
    let info = film.film.info(options);
    if exporter.one_frame_per_file() && !matches!(target, Target::Numbered { .. }) && info.frames > 1 {
        let what = format!(
            "{} holds one image, but the film has {} frames; write frames/%04d.png",
            target.display_name(),
            info.frames
        );
        return Err(Failure::Usage(what).into());
    }
    let piece = exporter.piece(&info).or(exporter.one_frame_per_file().then_some(std::num::NonZeroU64::MIN));
    let record_addresses = select_records(&segments, piece).map_err(|error| match error {
        CoverageError::Missing(_) => {
            GatherError::Missing(coverage_failure(error, &segments, damaged, target))
        }
        _ => GatherError::Failure(coverage_failure(error, &segments, damaged, target)),
    })?;
    Ok(GatheredFilm { segments, damaged: Vec::new(), record_addresses, info, files })
}

/// Segment files: those that the arguments name, and those in folders that the arguments name.
fn segment_files(given: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    for path in given {
        let failed = |e: std::io::Error| {
            Failure::input(format!("{}: cannot read: {}", path.display(), choreo_files::describe_error(&e)))
        };
        if !path.metadata().map_err(failed)?.is_dir() {
            files.push(path.clone());
            continue;
        }
        let names =
            choreo_files::Folder::open(path).and_then(|f| f.names(MAX_NAMES_PER_FOLDER)).map_err(failed)?;
        let found = names.iter().map(|name| path.join(name));
        files.extend(found.filter(|file| file.extension().is_some_and(|e| e == SEGMENT_EXTENSION)));
    }
    if files.is_empty() {
        let named: Vec<String> = given.iter().map(|path| path.display().to_string()).collect();
        return Err(Failure::input(format!("{}: there is no .{SEGMENT_EXTENSION} file", named.join(", "))));
    }
    Ok(files)
}

/// Opens the segments. Descriptions of damage, each with the segment's name, are added to `damaged`.
fn open_segments(files: &[PathBuf], quiet: bool, damaged: &mut Vec<String>) -> Result<Vec<Segment>, Failure> {
    let progress = Progress::new(files.len() as u64, quiet);
    let mut segments = Vec::new();
    for file in files {
        match Segment::open(file) {
            Ok(segment) => {
                let shown = file.display();
                damaged.extend(segment.damage.iter().map(|what| format!("{shown}: damaged: {what}")));
                segments.push(segment);
            }
            Err(fault) => damaged.push(format!("{}: {fault}", file.display())),
        }
        progress.step();
    }
    progress.clear();
    match segments.is_empty() {
        true => Err(Failure::input("no segment can be read")),
        false => Ok(segments),
    }
}

/// First segment, after checking that all belong to the same film and that this program can finish it.
fn check_same_film<'s>(
    segments: &'s [Segment],
    damaged: &[String],
    exporter: &dyn Exporter,
    software: &str,
) -> Result<&'s Segment, Failure> {
    let Some(first) = segments.first() else { return Err(Failure::input(damaged.join("\n"))) };
    let identity = first.film.identity();
    let mut faults = Vec::new();
    for other in &segments[1..] {
        let differences = provenance::differences(&identity, &other.film.identity());
        if !differences.is_empty() {
            let lines = differences
                .iter()
                .map(|(keyword, there, here)| format!("\n    {keyword}: {here}, there {there}"));
            let lines: String = lines.collect();
            let (path, there) = (other.path.display(), first.path.display());
            faults.push(format!("{path}: it belongs to another film than {there}{lines}"));
        }
    }
    let made_by = first.film.provenance.iter().find(|(keyword, _)| keyword == "Software");
    let made_by = made_by.map_or("", |(_, made_by)| made_by.as_str());
    let path = first.path.display();
    if made_by != software {
        faults.push(format!(
            "{path}: {made_by} made it, but this program is {software}; join with the same version"
        ));
    }
    let format = exporter.manifest().to_string();
    if first.film.format != format {
        faults.push(format!(
            "{path}: it belongs to a film in the format {}, but -o names {format}",
            first.film.format
        ));
    }
    match faults.is_empty() {
        true => Ok(first),
        false => Err(Failure::Input(faults.into_iter().map(crate::failure::Problem::Text).collect())),
    }
}

fn coverage_failure(
    error: CoverageError,
    segments: &[Segment],
    damaged: &[String],
    target: &Target,
) -> Failure {
    let path = |segment: usize| segments[segment].path.display();
    let shown = target.display_name();
    Failure::input(match error {
        CoverageError::Missing(missing) => {
            let frames = segments.first().map_or(0, |segment| segment.film.frames);
            let hint = match damaged.is_empty() {
                true => "render them with choreo render --segment --frames",
                false => "render again what is damaged, or add segments that hold these frames",
            };
            format!(
                "{shown}: of {frames} frames these are missing: {}\n    hint: {hint}",
                format_ranges(&missing)
            )
        }
        CoverageError::Differ { frame, segments: [a, b] } => format!(
            "{shown}: frame {frame} differs between {} and {}\n    hint: one of the machines renders \
             differently; render the frames again on one that is trusted, and join without the other segment",
            path(a),
            path(b)
        ),
        CoverageError::Misplaced { segment, frame } => {
            format!(
                "{}: the piece that begins at frame {frame} does not fit the pieces of the film's format\n    \
                 hint: render this segment again",
                path(segment)
            )
        }
    })
}

/// One film that is being joined: its parts, and where it is written.
struct FilmJoin<'a> {
    target: &'a Target,
    exporter: &'a dyn Exporter,
    info: &'a VideoInfo,
    segments: &'a [Segment],
    record_addresses: &'a [RecordAddress],
    inputs: &'a Inputs,
    budget: Budget,
    progress: Progress,
}

impl FilmJoin<'_> {
    fn join_failure(&self, shown: &str, error: JoinError) -> Failure {
        match error {
            JoinError::Export(error) => export_failure(shown, error),
            JoinError::Segment(number, fault) => {
                Failure::input(format!("{}: {fault}", self.segments[number].path.display()))
            }
        }
    }

    /// Writes the film to one file.
    fn write_film(&self) -> Result<JoinedFrames, Failure> {
        let path = self.target.frame_path(0);
        self.inputs.check_output(&path)?;
        let shown = path.display().to_string();
        let failed = |e: std::io::Error| output_failure(&shown, &e);
        let folder = containing_folder(&path);
        // The folder may not exist yet: the job of a farm starts with nothing but its segments.
        std::fs::create_dir_all(folder).map_err(failed)?;
        let part = PartFile::create_shared(&path, &machine::id()).map_err(|e| write_failure(&shown, e))?;
        // If the head is known only at the end, the body is first written to an unnamed file on the same disk.
        let mut body = match self.exporter.head_comes_last() {
            true => Some(tempfile::tempfile_in(folder).map_err(failed)?),
            false => None,
        };
        let out: Box<dyn Write + Send> = match &body {
            Some(body) => {
                Box::new(std::io::BufWriter::with_capacity(1 << 16, body.try_clone().map_err(failed)?))
            }
            None => Box::new(part.writer().map_err(failed)?),
        };
        let join_failed = |error| self.join_failure(&shown, error);
        let mut film = FilmWriter::begin(self.exporter, self.info, self.budget.counting_writer(out))
            .map_err(join_failed)?;
        for &(segment, place) in self.record_addresses {
            let opened = &self.segments[segment];
            film.add_record(segment, opened, &opened.records[place]).map_err(join_failed)?;
            self.progress.step();
        }
        let (head, counts) = film.finish().map_err(join_failed)?;
        if let Some(body) = &mut body {
            let mut result = part.writer().map_err(failed)?;
            let joined = result
                .write_all(&head)
                .and_then(|()| body.seek(SeekFrom::Start(0)))
                .and_then(|_| std::io::copy(body, &mut result))
                .and_then(|_| result.flush());
            joined.map_err(failed)?;
        }
        part.commit().map_err(|e| write_failure(&shown, e))?;
        Ok(counts)
    }

    /// Writes the film as one image per file.
    fn write_images(&self) -> Result<JoinedFrames, Failure> {
        let last = i64::try_from(self.info.frames).unwrap_or(i64::MAX) - 1;
        let names = (0..=last).map(|number| self.target.frame_path(number));
        names.clone().try_for_each(|name| self.inputs.check_output(&name))?;
        self.target.check_and_create_folders()?;
        let _claim = FrameRangeClaim::take(self.target, 0, last)?;
        for (&(segment, place), name) in self.record_addresses.iter().zip(names) {
            let shown = name.display().to_string();
            let opened = &self.segments[segment];
            let bytes = opened.read_bytes(&opened.records[place]);
            let bytes =
                bytes.map_err(|fault| self.join_failure(&shown, JoinError::Segment(segment, fault)))?;
            let part =
                PartFile::create_shared(&name, &machine::id()).map_err(|e| write_failure(&shown, e))?;
            let out = part.writer().map_err(|e| output_failure(&shown, &e))?;
            let mut out = self.budget.counting_writer(Box::new(out));
            out.write_all(&bytes).and_then(|()| out.flush()).map_err(|e| output_failure(&shown, &e))?;
            drop(out);
            part.commit().map_err(|e| write_failure(&shown, e))?;
            self.progress.step();
        }
        Ok(JoinedFrames { copied: self.info.frames, encoded: 0 })
    }
}
