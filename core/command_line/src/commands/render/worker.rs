//! Reports about the render of a segment, for `choreo farm --status`. Errors in writing a report are ignored: the segment is what matters.

use crate::drawing::pipeline::Pixels;
use crate::drawing::png_frame::encode_png;
use crate::failure::Failure;
use crate::output::segment::{SegmentState, WorkerReport, downscale_to_thumbnail, report_name};
use crate::process::machine::host_name;
use choreo_files::write_whole;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time between two reports of a running worker.
const REPORT_INTERVAL: Duration = Duration::from_secs(2);

/// The segment that this process renders, if any.
static WORKER: Mutex<Option<Worker>> = Mutex::new(None);

struct Worker {
    path: PathBuf,
    report: WorkerReport,
    start: Instant,
    written: Option<Instant>,
}

fn lock_worker() -> MutexGuard<'static, Option<Worker>> {
    WORKER.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Begins the render of a segment. Nothing is written yet: another process may be making the segment, or have made it.
pub(crate) fn begin_segment(folder: &Path, first: u64, last: u64) {
    let path = folder.join(report_name(first, last));
    let mut worker = lock_worker();
    let start = worker.as_ref().map_or_else(Instant::now, |worker| worker.start);
    let report = WorkerReport {
        state: SegmentState::Running,
        done: 0,
        made: 0,
        seconds: 0.0,
        host: host_name(),
        message: String::new(),
        thumbnail: Vec::new(),
    };
    *worker = Some(Worker { path, report, start, written: None });
}

/// Starts the reports: this process owns the segment. `done`: finished frames from an earlier process.
pub(crate) fn start_reports(done: u64) {
    if let Some(worker) = lock_worker().as_mut() {
        // The thumbnail of a killed worker is kept.
        let before =
            choreo_files::read(&worker.path, 1 << 20).ok().and_then(|bytes| WorkerReport::read(&bytes));
        worker.report.thumbnail =
            before.filter(|_| done > 0).map(|before| before.thumbnail).unwrap_or_default();
        worker.report.done = done;
        worker.write();
    }
}

/// Counts a finished frame of the segment.
pub(crate) fn count_frame(pixels: &Pixels) {
    let mut worker = lock_worker();
    let Some(worker) = worker.as_mut() else { return };
    worker.report.done += 1;
    worker.report.made += 1;
    if worker.report.thumbnail.is_empty()
        && let Pixels::Bytes(frame) = pixels
    {
        let thumbnail = encode_png(&downscale_to_thumbnail(frame), png::Compression::Fast);
        worker.report.thumbnail = thumbnail.unwrap_or_default();
    }
    let first = worker.report.made == 1;
    if first || worker.written.is_none_or(|written| written.elapsed() >= REPORT_INTERVAL) {
        worker.write();
    }
}

/// Writes the final report. A worker that found its segment complete keeps the report of the worker that made it.
pub(crate) fn write_final_report(failure: Option<&Failure>) {
    let Some(mut worker) = lock_worker().take() else { return };
    worker.report.state = match failure {
        None if worker.written.is_none() => return,
        // If the command line is wrong, the folder may be wrong too.
        Some(Failure::Usage(_)) => return,
        None => SegmentState::Done,
        Some(Failure::Interrupted) => SegmentState::Stopped,
        Some(failure) => {
            worker.report.message = failure.message_lines().join("\n");
            let _ = worker.path.parent().map(std::fs::create_dir_all);
            SegmentState::Failed
        }
    };
    worker.write();
}

impl Worker {
    fn write(&mut self) {
        self.report.seconds = self.start.elapsed().as_secs_f64();
        self.written = Some(Instant::now());
        let _ = write_whole(&self.path, &self.report.bytes());
    }
}
