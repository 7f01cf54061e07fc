//! Progress report of a worker: a small file beside its segment, which `choreo farm --status` reads. No server is needed.
//!
//! A report is a line of JSON with its hash, as in a segment, and the bytes of a thumbnail. Seconds are measured by the worker's own timer,
//! so that the clocks of machines may differ.

use super::{SEGMENT_EXTENSION, encode_line, parse_line};
use choreo_plugin::Frame;
use serde::{Deserialize, Serialize};
use serde_json::json;

/// File extension of reports.
const REPORT_EXTENSION: &str = "report";

/// Extension of the folders of unfinished segments.
pub(crate) const PART_EXTENSION: &str = ".part";

/// Longer side of a thumbnail in pixels.
const MAX_THUMBNAIL_SIDE: u32 = 192;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum SegmentState {
    Running,
    Done,
    Failed,
    /// The worker was ended by a signal; its finished frames are kept.
    Stopped,
}

impl SegmentState {
    pub(crate) fn name(self) -> &'static str {
        match self {
            SegmentState::Running => "running",
            SegmentState::Done => "done",
            SegmentState::Failed => "failed",
            SegmentState::Stopped => "stopped",
        }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct WorkerReport {
    pub state: SegmentState,
    /// Finished frames of the segment, including frames that killed workers finished.
    pub done: u64,
    /// Frames that this worker has made, and seconds since its start.
    pub made: u64,
    pub seconds: f64,
    /// Name of the machine.
    pub host: String,
    /// The last message of a worker that failed.
    pub message: String,
    /// Thumbnail of the latest frame as a PNG; empty before the first frame.
    #[serde(skip)]
    pub thumbnail: Vec<u8>,
}

impl WorkerReport {
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut report = json!(self);
        report["report"] = json!(1);
        [encode_line(&report), self.thumbnail.clone()].concat()
    }

    /// Parses a report; `None` if it is truncated or no report.
    pub(crate) fn read(bytes: &[u8]) -> Option<WorkerReport> {
        let end = bytes.iter().position(|byte| *byte == b'\n')? + 1;
        let report = WorkerReport::deserialize(parse_line(&bytes[..end])?)
            .ok()
            .filter(|report| report.seconds >= 0.0)?;
        Some(WorkerReport { thumbnail: bytes[end..].to_vec(), ..report })
    }
}

/// Name of a segment's files, without the extension.
pub(crate) fn file_stem(first: u64, last: u64) -> String {
    format!("{first:07}-{last:07}")
}

pub(crate) fn segment_name(first: u64, last: u64) -> String {
    format!("{}.{SEGMENT_EXTENSION}", file_stem(first, last))
}

pub(crate) fn report_name(first: u64, last: u64) -> String {
    format!("{}.{REPORT_EXTENSION}", file_stem(first, last))
}

/// Frame range (first, last) in the name of a file in a folder of segments. The file is a segment, a report, or the part folder of a
/// machine, `FRAMES.segment.MACHINE.part`.
pub(crate) fn parse_frame_range(name: &str) -> Option<(u64, u64)> {
    let (file_stem, ending) = name.split_once('.')?;
    let (first, last) = file_stem.split_once('-')?;
    let frames = (first.parse().ok()?, last.parse().ok()?);
    let is_complete = [SEGMENT_EXTENSION, REPORT_EXTENSION].contains(&ending);
    let is_part_folder =
        ending.strip_prefix(SEGMENT_EXTENSION).is_some_and(|rest| rest.ends_with(PART_EXTENSION));
    ((is_complete || is_part_folder) && frames.0 <= frames.1).then_some(frames)
}

/// Downscales a frame with a box filter: each pixel is the mean of a block.
pub(crate) fn downscale_to_thumbnail(frame: &Frame) -> Frame {
    let block = frame.width.max(frame.height).div_ceil(MAX_THUMBNAIL_SIDE).max(1);
    let [width, height] = [frame.width, frame.height].map(|side| (side / block).max(1));
    let mut rgba = Vec::with_capacity(4 * width as usize * height as usize);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let inside = |from: u32, side: u32| from * block..((from + 1) * block).min(side);
        let mut sum = [0u32; 4];
        let mut count = 0;
        for row in inside(y, frame.height) {
            for column in inside(x, frame.width) {
                let at = 4 * (row as usize * frame.width as usize + column as usize);
                sum.iter_mut().zip(&frame.rgba[at..at + 4]).for_each(|(sum, byte)| *sum += u32::from(*byte));
                count += 1;
            }
        }
        rgba.extend(sum.map(|sum| (sum / count.max(1)) as u8));
    }
    Frame { width, height, rgba }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_is_read_back_equal_and_refused_if_damaged() {
        let report = WorkerReport {
            state: SegmentState::Failed,
            done: 7,
            made: 3,
            seconds: 1.5,
            host: "n1".into(),
            message: "a \"quote\"\nand a line".into(),
            thumbnail: vec![1, b'\n', 3],
        };
        let bytes = report.bytes();
        assert_eq!(WorkerReport::read(&bytes), Some(report));
        let line = bytes.len() - 3;
        for cut in 0..line {
            assert_eq!(WorkerReport::read(&bytes[..cut]), None, "cut at {cut}");
        }
        for bit in 0..line - 1 {
            let mut bent = bytes.clone();
            bent[bit] ^= 4;
            assert_eq!(WorkerReport::read(&bent), None, "bent at {bit}");
        }
    }

    #[test]
    fn frame_ranges_are_parsed_from_file_names() {
        for name in
            ["0000000-0000023.segment", "0000000-0000023.segment.1a2b3c4d.part", "0000000-0000023.report"]
        {
            assert_eq!(parse_frame_range(name), Some((0, 23)), "{name}");
        }
        for name in ["0000024-0000023.segment", "1-2.png", "a-2.segment", ".0000000-0000023.report.7.0.part"]
        {
            assert_eq!(parse_frame_range(name), None, "{name}");
        }
        assert_eq!(
            (segment_name(0, 23), report_name(7, 7)),
            ("0000000-0000023.segment".into(), "0000007-0000007.report".into())
        );
    }

    #[test]
    fn thumbnail_pixels_are_means_of_blocks() {
        let pixel = |x: u32, y: u32| [x as u8, y as u8, 7, 255];
        let rgba = (0..200u32).flat_map(|y| (0..400).flat_map(move |x| pixel(x / 3 % 4 * 10, y))).collect();
        let small = downscale_to_thumbnail(&Frame { width: 400, height: 200, rgba });
        assert_eq!([small.width, small.height], [133, 66]);
        assert_eq!(&small.rgba[4 * (2 * 133 + 5)..][..4], [10, 7, 7, 255]);
        let one = Frame { width: 1, height: 1, rgba: vec![1, 2, 3, 4] };
        assert_eq!(downscale_to_thumbnail(&one), one);
    }
}
