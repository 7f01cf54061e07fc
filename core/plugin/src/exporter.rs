//! Frames out: an exporter writes a sequence of frames to one file, a numbered set, or a stream.

use crate::{ExportOptions, Manifest};
use choreo_motion::FrameRate;
use std::io::{Read, Write};
use thiserror::Error;

pub trait Exporter: Send + Sync {
    fn manifest(&self) -> &Manifest;

    /// True for formats of one picture a file (PNG): the program then calls `begin` once a frame, on several
    /// threads at once, and numbers the files.
    fn one_frame_per_file(&self) -> bool;

    /// What this format cannot keep of the video and does about it ("641×480 becomes 642×480: …"), reported to the
    /// user once, before the first frame.
    fn notes(&self, info: &VideoInfo) -> Vec<String> {
        let _ = info;
        Vec::new()
    }

    /// True where the first bytes of the file are known only when all frames are: `finish` then gives them, and the
    /// program puts them before what was written.
    fn head_comes_last(&self) -> bool {
        false
    }

    /// Starts a file. The program gives a writer onto a temporary file and renames it when `finish` succeeded.
    fn begin(&self, info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError>;

    /// Goes on with a file whose making was ended from outside. `so_far` is all that was written until the last
    /// [`Mark::Settled`], `states` what every one of them held, in order and at least one; `out` writes on from there.
    /// The frames that follow must give the bytes that they would have given undisturbed.
    fn resume(
        &self,
        info: &VideoInfo,
        states: &[Vec<u8>],
        so_far: &mut dyn Read,
        out: Box<dyn Write + Send>,
    ) -> Result<Box<dyn FrameSink>, ExportError> {
        let _ = (info, states, so_far, out);
        Err(ExportError::Format(format!("{} cannot go on with a file", self.manifest().name)))
    }
}

pub trait FrameSink: Send {
    fn frame(&mut self, frame: &Frame) -> Result<(), ExportError>;

    /// Writes what is left and flushes. Gives what stands before it in the file: nothing, unless
    /// [`Exporter::head_comes_last`].
    fn finish(self: Box<Self>) -> Result<Vec<u8>, ExportError>;

    /// What has to be kept after each frame, so that the program can be killed and go on from there.
    fn mark(&mut self) -> Mark<'_> {
        Mark::Nothing
    }

    /// A frame once more from what [`Mark::Open`] gave of it, its parts one after the other.
    fn again(&mut self, kept: &[u8]) -> Result<(), ExportError> {
        let _ = kept;
        Err(ExportError::Format("this format keeps no frames".into()))
    }
}

/// State of a file after its last frame.
#[derive(Debug)]
pub enum Mark<'a> {
    /// It cannot be gone on with.
    Nothing,
    /// What is written will not change, and these bytes say what else [`Exporter::resume`] must know: of this mark alone or
    /// since the mark before, as the format likes.
    Settled(Vec<u8>),
    /// The encoder still holds the frames since the last settled mark and cannot be stored. These bytes hold the last
    /// frame as it was given to the encoder, for [`FrameSink::again`]; always of the same length in one file.
    Open([&'a [u8]; 3]),
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
