//! Frames out: an exporter writes a sequence of frames to one file, a numbered set, or a stream.

use crate::{ExportOptions, Manifest};
use choreo_motion::FrameRate;
use std::io::Write;
use thiserror::Error;

pub trait Exporter: Send + Sync {
    fn manifest(&self) -> &Manifest;

    /// True for formats of one picture a file (PNG): the program then calls `begin` once a frame, on several
    /// threads at once, and numbers the files.
    fn one_frame_per_file(&self) -> bool;

    /// What this format cannot keep of the video and does about it ("641×480 becomes 642×480: …"), told to the
    /// user once, before the first frame.
    fn notes(&self, info: &VideoInfo) -> Vec<String> {
        let _ = info;
        Vec::new()
    }

    /// Starts a file. The program gives a writer onto a temporary file and renames it when `finish` succeeded.
    fn begin(&self, info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError>;
}

pub trait FrameSink: Send {
    fn frame(&mut self, frame: &Frame) -> Result<(), ExportError>;
    /// Writes what is left and flushes.
    fn finish(self: Box<Self>) -> Result<(), ExportError>;
}

#[derive(Clone, Debug, PartialEq)]
pub struct VideoInfo {
    pub width: u32,
    pub height: u32,
    pub fps: FrameRate,
    pub frames: u64,
    /// How it was made, as (keyword, text): written as metadata where the format has a place for it.
    pub provenance: Vec<(String, String)>,
    /// Option values by name, checked against the exporter's manifest ([`Manifest::option`]).
    pub options: ExportOptions,
}

/// sRGB-encoded RGBA, 8 bits a channel, straight alpha, rows from the top, no padding.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    pub width: u32,
    pub height: u32,
    pub rgba: Vec<u8>,
}

#[derive(Debug, Error)]
pub enum ExportError {
    #[error("cannot write: {0}")]
    Io(#[from] std::io::Error),
    #[error("{0}")]
    Format(String),
}
