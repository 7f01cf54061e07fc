//! `choreo farm --status`: progress of a job, read from the files that its workers leave in the folder. It needs no server, and uses only
//! durations that the workers measured.

use super::chunks::Chunk;
use super::job::{FarmJob, Film, JOB_FILE, OUTPUT_FOLDER};
use crate::commands::render::sheet;
use crate::drawing::png_frame::{decode_png, encode_png};
use crate::failure::{Failure, print, print_json, write_failure};
use crate::output::segment::{
    PART_EXTENSION, SegmentState, WorkerReport, parse_frame_range, report_name, segment_name,
};
use crate::output::target::export_failure;
use crate::output::video::is_being_made;
use crate::terminal::{counted, page::Page};
use choreo_files::{Folder, write_whole};
use choreo_plugin::Frame;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Largest number of names read from one folder.
const MAX_NAMES_PER_FOLDER: usize = 1_000_000;
/// Size limits in bytes of a report, and of the job's description.
const MAX_REPORT_BYTES: u64 = 1 << 20;
const MAX_JOB_BYTES: u64 = 64 << 20;
/// Largest number of cells on the contact sheet; each shows one chunk of the job.
const MAX_SHEET_CELLS: usize = 48;
/// Longest side in pixels of a thumbnail on the contact sheet.
const MAX_CELL_SIDE: u32 = 1024;
/// Largest number of films that are listed one per line.
const MAX_FILM_LINES: usize = 12;

/// State of a chunk; `None` if no machine has begun it.
type ChunkState = Option<SegmentState>;

struct ChunkStatus {
    film: usize,
    frames: Chunk,
    state: ChunkState,
    /// Number of finished frames.
    done: u64,
    report: Option<WorkerReport>,
}

impl ChunkStatus {
    fn state_name(&self) -> &'static str {
        self.state.map_or("waiting", SegmentState::name)
    }
}

/// Prints the progress of a job. `folder`: folder of the job. `sheet_file`: path of the contact sheet.
pub(super) fn run(folder: &Path, sheet_file: Option<&Path>, as_json: bool) -> Result<(), Failure> {
    let shown = folder.join(JOB_FILE).display().to_string();
    let text = choreo_files::read(&folder.join(JOB_FILE), MAX_JOB_BYTES).map_err(|e| {
        Failure::input(format!(
            "{shown}: cannot read: {e}\n    hint: choreo farm writes it into the folder --to"
        ))
    })?;
    let job = serde_json::from_slice(&text).ok().and_then(|value| FarmJob::read(&value));
    let job =
        job.ok_or_else(|| Failure::input(format!("{shown}: it is not a job that choreo farm has written")))?;
    let mut chunks = Vec::new();
    for (number, film) in job.films.iter().enumerate() {
        chunks.extend(chunk_statuses(folder, number, film)?);
    }
    let progress = JobProgress::of(&job, &chunks, folder);
    if let Some(file) = sheet_file {
        write_sheet(file, &chunks)?;
    }
    match as_json {
        true => print_json(&progress.json(&job, &chunks, folder)),
        false => progress.print(&job, &chunks),
    }
}

/// Chunks that have files, and planned chunks that overlap none of these: engines may choose other chunks than planned.
fn chunk_statuses(folder: &Path, number: usize, film: &Film) -> Result<Vec<ChunkStatus>, Failure> {
    let path = folder.join(film.folder());
    let opened = Folder::open(&path);
    let names = match &opened {
        Ok(opened) => opened.names(MAX_NAMES_PER_FOLDER),
        // The first worker of the row creates the folder.
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(e) => Err(e.kind().into()),
    };
    let names = names.map_err(|e| {
        Failure::input(format!("{}: cannot read: {}", path.display(), choreo_files::describe_error(&e)))
    })?;
    let names: Vec<&str> = names.iter().filter_map(|name| name.to_str()).collect();
    let file_names: BTreeSet<&str> = names.iter().copied().collect();
    let mut found: BTreeMap<Chunk, Vec<&str>> = BTreeMap::new();
    for name in &names {
        if let Some(frames) = parse_frame_range(name) {
            found.entry(frames).or_default().extend(name.ends_with(PART_EXTENSION).then_some(*name));
        }
    }
    let status = |(frames, parts): (&Chunk, &Vec<&str>)| {
        let frames = *frames;
        let (first, last) = frames;
        let name = segment_name(first, last);
        let report = choreo_files::read(&path.join(report_name(first, last)), MAX_REPORT_BYTES).ok();
        let report = report.and_then(|bytes| WorkerReport::read(&bytes));
        let is_held = |folder| parts.iter().any(|part| is_being_made(folder, Path::new(part)));
        let held = || opened.as_ref().is_ok_and(is_held);
        let state = match report.as_ref().map(|report| report.state) {
            _ if file_names.contains(name.as_str()) => Some(SegmentState::Done),
            _ if held() => Some(SegmentState::Running),
            Some(SegmentState::Failed) => Some(SegmentState::Failed),
            // The segment is not visible yet, or was removed.
            Some(SegmentState::Done) => None,
            // The worker has ended without a final report.
            _ => Some(SegmentState::Stopped),
        };
        let length = last - first + 1;
        let done = match state {
            Some(SegmentState::Done) => length,
            None => 0,
            _ => report.as_ref().map_or(0, |report| report.done.min(length)),
        };
        ChunkStatus { film: number, frames, state, done, report }
    };
    let is_begun = |(first, last): &Chunk| found.keys().any(|(a, b)| a <= last && b >= first);
    let waiting = film.chunks.iter().copied().filter(|chunk| !is_begun(chunk));
    let waiting =
        waiting.map(|frames| ChunkStatus { film: number, frames, state: None, done: 0, report: None });
    let mut chunks: Vec<ChunkStatus> = found.iter().map(status).chain(waiting).collect();
    chunks.sort_by_key(|chunk| chunk.frames);
    Ok(chunks)
}

struct JobProgress {
    /// Numbers of chunks by state.
    counts: BTreeMap<&'static str, usize>,
    frames: u64,
    done: u64,
    /// Frames per second of all running workers together; `None` before their first frames.
    rate: Option<f64>,
    /// Whether each film is complete and in place.
    films: Vec<bool>,
}

impl JobProgress {
    fn of(job: &FarmJob, chunks: &[ChunkStatus], folder: &Path) -> JobProgress {
        let mut counts = BTreeMap::new();
        chunks.iter().for_each(|chunk| *counts.entry(chunk.state_name()).or_default() += 1);
        let done_of = |number: usize, film: &Film| {
            let own = chunks.iter().filter(|chunk| chunk.film == number);
            // Chunks may overlap.
            own.map(|chunk| chunk.done).sum::<u64>().min(film.frames)
        };
        let reports = || {
            let running = chunks.iter().filter(|chunk| chunk.state == Some(SegmentState::Running));
            running.filter_map(|chunk| chunk.report.as_ref()).filter(|report| report.made > 0)
        };
        let rate = reports().map(|report| report.made as f64 / report.seconds.max(1e-3)).sum::<f64>();
        let film_path = |film: &Film| folder.join(OUTPUT_FOLDER).join(&film.output);
        JobProgress {
            counts,
            frames: job.films.iter().map(|film| film.frames).sum(),
            done: job.films.iter().enumerate().map(|(number, film)| done_of(number, film)).sum(),
            rate: (rate > 0.0).then_some(rate),
            films: job.films.iter().map(|film| is_film_in_place(&film_path(film))).collect(),
        }
    }

    fn seconds_left(&self) -> Option<f64> {
        Some((self.frames - self.done) as f64 / self.rate?)
    }

    fn json(&self, job: &FarmJob, chunks: &[ChunkStatus], folder: &Path) -> serde_json::Value {
        let chunk = |chunk: &ChunkStatus| {
            let report = chunk.report.as_ref();
            json!({
                "film": job.films[chunk.film].output, "frames": chunk.frames, "state": chunk.state_name(), "done": chunk.done,
                "host": report.map(|report| &report.host), "seconds": report.map(|report| report.seconds),
                "message": report.map(|report| &report.message).filter(|_| chunk.state == Some(SegmentState::Failed)),
            })
        };
        let film = |(film, there): (&Film, &bool)| json!({ "output": film.output, "frames": film.frames, "joined": there });
        json!({
            "ok": true,
            "folder": folder.display().to_string(),
            "frames": self.frames,
            "done": self.done,
            "counts": self.counts,
            "frames_per_second": self.rate,
            "seconds_left": self.seconds_left(),
            "films": job.films.iter().zip(&self.films).map(film).collect::<Vec<_>>(),
            "chunks": chunks.iter().map(chunk).collect::<Vec<_>>(),
        })
    }

    fn print(&self, job: &FarmJob, chunks: &[ChunkStatus]) -> Result<(), Failure> {
        let mut page = Page::default();
        let states = ["done", "running", "failed", "stopped", "waiting"];
        let counts = states.iter().filter_map(|state| Some(format!("{} {state}", self.counts.get(state)?)));
        let number = counted(chunks.len() as u64, "chunk");
        page.line(format_args!("{number}: {}", counts.collect::<Vec<_>>().join(", ")));
        let rate = match (self.rate, self.seconds_left()) {
            (Some(rate), Some(left)) => {
                format!(", {rate:.1} per second, about {} left", format_duration(left))
            }
            _ => String::new(),
        };
        page.line(format_args!("{} of {} frames{rate}", self.done, self.frames));
        for chunk in chunks {
            let Some(report) = &chunk.report else { continue };
            let (first, last) = chunk.frames;
            let film = if job.films.len() > 1 {
                format!("{}: ", job.films[chunk.film].output)
            } else {
                String::new()
            };
            let (done, length) = (chunk.done, last - first + 1);
            let what = match chunk.state {
                Some(SegmentState::Running) => format!("running on {}, {done} of {length}", report.host),
                Some(SegmentState::Failed) => {
                    format!("failed on {}: {}", report.host, report.message.replace('\n', " "))
                }
                Some(SegmentState::Stopped) => {
                    format!("stopped on {}, {done} of {length} are kept", report.host)
                }
                _ => continue,
            };
            page.line(format_args!("{film}frames {first}-{last}: {what}"));
        }
        let count = |word: &str| self.counts.get(word).copied().unwrap_or(0);
        if count("running") == 0 && count("stopped") + count("failed") > 0 {
            page.line(format_args!(
                "no task is running: submit the same job again to continue after the finished frames"
            ));
        }
        if job.films.len() > MAX_FILM_LINES {
            let joined = self.films.iter().filter(|there| **there).count();
            page.line(format_args!("{joined} of {} films are joined", job.films.len()));
        } else {
            let joined = |there| if there { "joined" } else { "not joined yet" };
            let films = job.films.iter().zip(&self.films);
            page.lines(films.map(|(film, there)| format!("{}: {}", film.output, joined(*there))));
        }
        print(page.as_str())
    }
}

/// Whether a film is in place: its file, or the folder of its images with at least one file.
fn is_film_in_place(path: &Path) -> bool {
    let numbered = path.file_name().is_some_and(|name| name.to_string_lossy().contains('%'));
    let folder = path.parent().filter(|_| numbered);
    folder.map_or(path.is_file(), |folder| {
        // A join that is still running has its lock file beside the images.
        let names =
            Folder::open(folder).and_then(|folder| folder.names(MAX_NAMES_PER_FOLDER)).unwrap_or_default();
        !names.is_empty() && names.iter().all(|name| !name.to_string_lossy().ends_with(".part"))
    })
}

/// Formats seconds for people.
fn format_duration(seconds: f64) -> String {
    let whole = seconds.ceil().max(0.0) as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, seconds) => format!("{seconds} s"),
        (0, minutes, seconds) => format!("{minutes} min {seconds} s"),
        (hours, minutes, _) => format!("{hours} h {minutes} min"),
    }
}

/// Writes a contact sheet: a thumbnail of each chunk's first frame, with the state. If there are many chunks, some are left out.
fn write_sheet(file: &Path, chunks: &[ChunkStatus]) -> Result<(), Failure> {
    let shown = file.display().to_string();
    let count = chunks.len().min(MAX_SHEET_CELLS);
    let shown_chunks: Vec<&ChunkStatus> = (0..count).map(|i| &chunks[i * chunks.len() / count]).collect();
    let is_small = |size: [u32; 2]| size.into_iter().all(|side| side <= MAX_CELL_SIDE);
    let thumbnail = |chunk: &&ChunkStatus| decode_png(&chunk.report.as_ref()?.thumbnail, is_small);
    let images: Vec<Option<Frame>> = shown_chunks.iter().map(thumbnail).collect();
    let cell =
        images.iter().flatten().fold([1, 1], |[w, h], image| [w.max(image.width), h.max(image.height)]);
    let [width, height] = if cell == [1, 1] { [192, 108] } else { cell };
    let cells = shown_chunks.iter().zip(images).map(|(chunk, image)| {
        let (first, last) = chunk.frames;
        (format!("{first}-{last}: {}", chunk.state_name()), fit_into_cell(image, [width, height]))
    });
    let sheet = encode_png(&sheet::compose(cells.collect()), png::Compression::Fast);
    let sheet = sheet.map_err(|e| export_failure(&shown, e))?;
    write_whole(file, &sheet).map_err(|e| write_failure(&shown, e))
}

/// Places an image into a cell that may be larger, since films of a batch may differ in size. Without an image the cell is black.
fn fit_into_cell(image: Option<Frame>, [width, height]: [u32; 2]) -> Frame {
    let mut cell = Frame { width, height, rgba: [0, 0, 0, 255].repeat(width as usize * height as usize) };
    let Some(image) = image else { return cell };
    let row_bytes = 4 * image.width as usize;
    for (y, row) in image.rgba.chunks_exact(row_bytes).enumerate() {
        let at = 4 * y * width as usize;
        cell.rgba[at..at + row_bytes].copy_from_slice(row);
    }
    cell
}

#[cfg(test)]
mod tests {
    use super::format_duration;

    #[test]
    fn durations_are_rounded_up() {
        let texts = [0.0, 0.2, 59.0, 59.5, 3599.9, 3600.0, 90_061.0].map(format_duration);
        assert_eq!(texts, ["0 s", "1 s", "59 s", "1 min 0 s", "1 h 0 min", "1 h 0 min", "25 h 1 min"]);
    }
}
