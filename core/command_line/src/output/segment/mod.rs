//! Segments: files with a part of a film's frames, rendered on different machines and joined by `choreo join`.
//!
//! A segment alternates between text and bytes. Each line is the BLAKE3 hash of its JSON, a space and the JSON. The first line is the
//! magic, the second describes the film ([`Film`]), each further line describes a record ([`Record`]) whose bytes follow, and the last line
//! marks the end. Hashes find data that is truncated or corrupt, and only the records before it are used. Frames that an exporter can
//! encode without earlier frames are stored as pieces of the film's own bytes; other frames are stored as images, which `choreo join` gives
//! to the exporter.

mod coverage;
mod film_writer;
mod read;
mod report;
mod shared;
mod write;

pub(crate) use coverage::{CoverageError, RecordAddress, format_ranges, select_records};
pub(crate) use film_writer::{FilmWriter, JoinError, JoinedFrames};
pub(crate) use read::{PlacedRecord, Segment, SegmentError};
pub(crate) use report::{
    PART_EXTENSION, SegmentState, WorkerReport, downscale_to_thumbnail, parse_frame_range, report_name,
    segment_name,
};
pub(crate) use write::SegmentExporter;

use crate::args::values;
use crate::output::journal::Identity;
use choreo_motion::FrameRate;
use choreo_plugin::{ExportOptions, Manifest, VideoInfo};
use serde_json::{Value, json};

/// First line of a segment.
const MAGIC: &[u8] = b"choreo segment 1\n";

/// File extension of segments.
pub(crate) const SEGMENT_EXTENSION: &str = "segment";

/// The film that a segment is a part of: everything that an exporter needs to make it. Equal in all segments of one film.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Film {
    pub size: [u32; 2],
    pub fps: FrameRate,
    /// Frames of the whole film.
    pub frames: u64,
    /// Name and version of the exporter.
    pub format: String,
    /// Exporter options as typed, NAME=VALUE.
    pub options: Vec<String>,
    pub provenance: Identity,
}

impl Film {
    pub(crate) fn new(info: &VideoInfo, frames: u64, options: &[String], manifest: &Manifest) -> Film {
        Film {
            size: [info.width, info.height],
            fps: info.fps,
            frames,
            format: manifest.to_string(),
            options: options.to_vec(),
            provenance: info.provenance.clone(),
        }
    }

    /// Properties of the whole film, for its exporter. `options`: [`Film::options`], parsed.
    pub(crate) fn info(&self, options: ExportOptions) -> VideoInfo {
        VideoInfo {
            width: self.size[0],
            height: self.size[1],
            fps: self.fps,
            frames: self.frames,
            provenance: self.provenance.clone(),
            options,
        }
    }

    /// Identity of the film as (keyword, text), by which two films are compared.
    pub(crate) fn identity(&self) -> Identity {
        let mut identity = self.provenance.clone();
        let [width, height] = self.size;
        let entry = |keyword: &str, text: String| (keyword.to_string(), text);
        identity.push(entry("size", format!("{width}x{height}")));
        identity.push(entry("fps", format!("{}/{}", self.fps.num, self.fps.den)));
        identity.push(entry("frames", self.frames.to_string()));
        identity.push(entry("format", self.format.clone()));
        identity.push(entry("options", self.options.join(", ")));
        identity
    }

    fn json(&self) -> Value {
        json!({
            "size": self.size,
            "fps": [self.fps.num, self.fps.den],
            "frames": self.frames,
            "format": self.format,
            "options": self.options,
            "provenance": self.provenance.iter().map(|(keyword, text)| [keyword, text]).collect::<Vec<_>>(),
        })
    }

    /// Parses a film; `None` if a field is missing or out of range.
    fn read(value: &Value) -> Option<Film> {
        let [width, height] = u32_pair(&value["size"])?;
        let [num, den] = u32_pair(&value["fps"])?;
        let frames =
            value["frames"].as_u64().filter(|frames| (1..=values::MAX_FRAMES as u64).contains(frames))?;
        let size_is_valid = (1..=MAX_SIDE_PIXELS).contains(&width) && (1..=MAX_SIDE_PIXELS).contains(&height);
        if !size_is_valid || num == 0 || den == 0 {
            return None;
        }
        let text = |value: &Value| value.as_str().map(str::to_string);
        let pair = |pair: &Value| Some((text(&pair[0])?, text(&pair[1])?));
        Some(Film {
            size: [width, height],
            fps: FrameRate { num, den },
            frames,
            format: text(&value["format"])?,
            options: value["options"].as_array()?.iter().map(text).collect::<Option<_>>()?,
            provenance: value["provenance"].as_array()?.iter().map(pair).collect::<Option<_>>()?,
        })
    }
}

/// Limit of the command line on width and height in pixels.
const MAX_SIDE_PIXELS: u32 = 16_384;

fn u32_pair(value: &Value) -> Option<[u32; 2]> {
    let number = |value: &Value| u32::try_from(value.as_u64()?).ok();
    Some([number(&value[0])?, number(&value[1])?])
}

/// Consecutive frames of a segment, in the order in which they were made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Record {
    pub kind: RecordKind,
    /// Number of the first frame in the film.
    pub first: u64,
    pub frames: u64,
    /// BLAKE3 of the bytes that follow.
    pub hash: blake3::Hash,
    /// Bytes that follow.
    pub length: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RecordKind {
    /// A PNG of one frame.
    Image,
    /// One frame with the pixels of the previous record, which is an image or another repetition. No bytes follow.
    Repeat,
    /// Bytes of the film itself: the exporter's state of `state` bytes, and then its output. For formats with one image per file, the file.
    Piece { state: u64 },
}

impl Record {
    fn json(&self) -> Value {
        let (kind, state) = match self.kind {
            RecordKind::Image => ("image", 0),
            RecordKind::Repeat => ("repeat", 0),
            RecordKind::Piece { state } => ("piece", state),
        };
        json!({
            "record": kind, "first": self.first, "frames": self.frames, "state": state,
            "bytes": self.length, "blake3": self.hash.to_hex().as_str(),
        })
    }

    fn read(value: &Value) -> Option<Record> {
        let number = |name: &str| value[name].as_u64();
        let (first, frames, state, length) =
            (number("first")?, number("frames")?, number("state")?, number("bytes")?);
        let kind = match value["record"].as_str()? {
            "image" if frames == 1 => RecordKind::Image,
            "repeat" if frames == 1 && length == 0 => RecordKind::Repeat,
            "piece" if frames > 0 && state <= length => RecordKind::Piece { state },
            _ => return None,
        };
        first.checked_add(frames)?;
        let hash = blake3::Hash::from_hex(value["blake3"].as_str()?).ok()?;
        Some(Record { kind, first, frames, hash, length })
    }
}

/// Writes a value as a line with its hash.
fn encode_line(value: &Value) -> Vec<u8> {
    let json = value.to_string();
    format!("{} {json}\n", blake3::hash(json.as_bytes()).to_hex()).into_bytes()
}

/// Parses a line; `None` if its hash is wrong.
fn parse_line(line: &[u8]) -> Option<Value> {
    let (hash, json) = line.strip_suffix(b"\n")?.split_at_checked(64)?;
    let json = json.strip_prefix(b" ")?;
    let hash = blake3::Hash::from_hex(hash).ok()?;
    (hash == blake3::hash(json)).then(|| serde_json::from_slice(json).ok())?
}
