//! Frames out: an exporter writes a sequence of frames to one file, a numbered set, or a stream.

use crate::{ExportOptions, FloatFrame, FrameWish, Manifest, PluginPanic};
use choreo_motion::FrameRate;
use choreo_stage::StageError;
use std::io::{Read, Write};
use std::num::NonZeroU64;

/// Writes frames to a file of one format.
///
/// ```
/// use choreo_plugin::{ExportError, Exporter, Frame, FrameSink, Manifest, VideoInfo};
/// use std::io::Write;
///
/// /// The bytes of the pixels, and nothing else.
/// struct Raw(Manifest);
///
/// impl Exporter for Raw {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
///     fn one_frame_per_file(&self) -> bool {
///         false
///     }
///     fn begin(&self, _: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError> {
///         Ok(Box::new(RawFile(out)))
///     }
/// }
///
/// struct RawFile(Box<dyn Write + Send>);
///
/// impl FrameSink for RawFile {
///     fn frame(&mut self, frame: &Frame) -> Result<(), ExportError> {
///         Ok(self.0.write_all(&frame.rgba)?)
///     }
///     fn finish(mut self: Box<Self>) -> Result<Vec<u8>, ExportError> {
///         self.0.flush()?;
///         Ok(Vec::new())
///     }
/// }
///
/// let raw = Raw(Manifest::new("raw", "1", "pixels without a header").extensions(["raw"]));
/// let fps = choreo_plugin::motion::FrameRate { num: 30, den: 1 };
/// let info = VideoInfo { width: 1, height: 1, fps, frames: 1, provenance: Vec::new(), options: Default::default() };
/// let mut file = raw.begin(&info, Box::new(Vec::new()))?;
/// file.frame(&Frame { width: 1, height: 1, rgba: vec![255; 4] })?;
/// assert!(file.finish()?.is_empty());
/// # Ok::<(), ExportError>(())
/// ```
pub trait Exporter: Send + Sync {
    /// Name, description, extensions and options.
    fn manifest(&self) -> &Manifest;

    /// True for formats of one image per file (PNG): the program then calls `begin` once per frame, on several
    /// threads at once, and numbers the files.
    fn one_frame_per_file(&self) -> bool;

    /// The kind of pixels that the exporter needs with these options. An error is a text for the user about an option.
    fn wish(&self, options: &ExportOptions) -> Result<FrameWish, ExportError> {
        let _ = options;
        Ok(FrameWish::Bytes)
    }

    /// Notes about properties of the video that this format cannot keep, and its remedy ("641×480 becomes 642×480: …"), reported to the
    /// user once, before the first frame.
    fn notes(&self, info: &VideoInfo) -> Vec<String> {
        let _ = info;
        Vec::new()
    }

    /// True if the first bytes of the file are known only after the last frame: `finish` then returns them, and the program puts them
    /// before the bytes that were written.
    fn head_comes_last(&self) -> bool {
        false
    }

    /// Starts a file. The program gives a writer onto a temporary file and renames it when `finish` succeeded.
    fn begin(&self, info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError>;

    /// Copies a file with new provenance, for formats of one image per file. `made` is a whole file of this exporter with the same options.
    /// The copy has the provenance of `info`, and the bytes that encoding the image again would give. Returns false and writes nothing if
    /// the format does not support this.
    fn with_provenance(
        &self,
        info: &VideoInfo,
        made: &[u8],
        out: Box<dyn Write + Send>,
    ) -> Result<bool, ExportError> {
        let _ = (info, made, out);
        Ok(false)
    }

    /// Number of frames of a piece, for formats whose files consist of independently encoded pieces. The frames from `k * n` to
    /// `(k + 1) * n` then have the same bytes whatever precedes them, so that several machines can encode them. The mark is
    /// [`Mark::Settled`] at the end of each piece and [`Mark::Open`] within it. `None` if each frame depends on all frames before it.
    fn piece(&self, info: &VideoInfo) -> Option<NonZeroU64> {
        let _ = info;
        None
    }

    /// Continues a file whose export was interrupted. `so_far` is all that was written until the last [`Mark::Settled`]; `states` are the
    /// states of all settled marks, in order; `out` continues the file from there. The frames that follow must give the bytes of an
    /// uninterrupted export. Formats of pieces ([`Exporter::piece`]) also get the states of pieces that other machines encoded, or none if
    /// a piece is encoded alone; `so_far` is empty then.
    fn resume(
        &self,
        info: &VideoInfo,
        states: &[Vec<u8>],
        so_far: &mut dyn Read,
        out: Box<dyn Write + Send>,
    ) -> Result<Box<dyn FrameSink>, ExportError> {
        let _ = (info, states, so_far, out);
        Err(ExportError::Format(format!("{} cannot continue a partial file", self.manifest().name)))
    }
}

/// A file that is being written; see [`Exporter`].
///
/// ```
/// use choreo_plugin::*;
/// use choreo_plugin::motion::FrameRate;
/// use std::io::{Read, Write};
/// use std::num::NonZeroU64;
///
/// /// Depth in floats, of any number of frames: each is a piece of its own, so that several machines can make them.
/// struct Depths(Manifest);
///
/// impl Exporter for Depths {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
///     fn one_frame_per_file(&self) -> bool {
///         false
///     }
///     fn wish(&self, _: &ExportOptions) -> Result<FrameWish, ExportError> {
///         Ok(FrameWish::Scene(Passes { depth: true, ..Passes::default() }))
///     }
///     fn notes(&self, info: &VideoInfo) -> Vec<String> {
///         vec![format!("{} frames a second are not in the file", info.fps.num)]
///     }
///     fn head_comes_last(&self) -> bool {
///         true
///     }
///     fn begin(&self, _: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError> {
///         Ok(Box::new(File { out, frames: 0 }))
///     }
///     fn with_provenance(&self, _: &VideoInfo, _: &[u8], _: Box<dyn Write + Send>) -> Result<bool, ExportError> {
///         Ok(false)
///     }
///     fn piece(&self, _: &VideoInfo) -> Option<NonZeroU64> {
///         NonZeroU64::new(1)
///     }
///     fn resume(
///         &self,
///         _: &VideoInfo,
///         states: &[Vec<u8>],
///         _: &mut dyn Read,
///         out: Box<dyn Write + Send>,
///     ) -> Result<Box<dyn FrameSink>, ExportError> {
///         Ok(Box::new(File { out, frames: states.len() as u32 }))
///     }
/// }
///
/// struct File {
///     out: Box<dyn Write + Send>,
///     frames: u32,
/// }
///
/// impl FrameSink for File {
///     fn frame(&mut self, _: &Frame) -> Result<(), ExportError> {
///         Err(ExportError::Format("depths are floats".into()))
///     }
///     fn float_frame(&mut self, frame: &FloatFrame) -> Result<(), ExportError> {
///         self.frames += 1;
///         Ok(frame.depth.iter().try_for_each(|depth| self.out.write_all(&depth.to_le_bytes()))?)
///     }
///     fn mark(&mut self) -> Mark<'_> {
///         Mark::Settled(Vec::new())
///     }
///     fn again(&mut self, _: &[u8]) -> Result<(), ExportError> {
///         Err(ExportError::Format("no frame stays in the encoder".into()))
///     }
///     /// The file begins with the number of frames.
///     fn finish(self: Box<Self>) -> Result<Vec<u8>, ExportError> {
///         Ok(self.frames.to_le_bytes().to_vec())
///     }
/// }
///
/// let depths = Depths(Manifest::new("depths", "1", "depths as floats").extensions(["depths"]));
/// let fps = FrameRate { num: 30, den: 1 };
/// let info = VideoInfo { width: 1, height: 1, fps, frames: 2, provenance: Vec::new(), options: Default::default() };
/// assert!(depths.wish(&info.options)? != FrameWish::Bytes && depths.head_comes_last() && depths.notes(&info).len() == 1);
/// let mut file = depths.resume(&info, &[Vec::new()], &mut std::io::empty(), Box::new(Vec::new()))?;
/// file.float_frame(&FloatFrame { depth: vec![2.5], ..FloatFrame::new([1, 1]) })?;
/// assert!(matches!(file.mark(), Mark::Settled(state) if state.is_empty()));
/// assert_eq!(file.finish()?, 2u32.to_le_bytes());
/// # Ok::<(), ExportError>(())
/// ```
pub trait FrameSink: Send {
    /// Writes the next frame.
    fn frame(&mut self, frame: &Frame) -> Result<(), ExportError>;

    /// Writes the next frame of an exporter whose [`Exporter::wish`] is not [`FrameWish::Bytes`].
    fn float_frame(&mut self, frame: &FloatFrame) -> Result<(), ExportError> {
        let _ = frame;
        Err(ExportError::Format("this format cannot store floats".into()))
    }

    /// Writes a frame with the same pixels as the frame before. The bytes are those of [`FrameSink::frame`], made at less cost where the
    /// format allows it.
    fn repeat(&mut self, frame: &Frame) -> Result<(), ExportError> {
        self.frame(frame)
    }

    /// Writes the rest of the file and flushes. Returns the first bytes of the file if [`Exporter::head_comes_last`], else nothing.
    fn finish(self: Box<Self>) -> Result<Vec<u8>, ExportError>;

    /// The state that must be stored after each frame, so that a killed program can resume the file.
    fn mark(&mut self) -> Mark<'_> {
        Mark::Nothing
    }

    /// Replays a frame after [`Exporter::resume`]. `kept` holds the parts that [`Mark::Open`] returned for the frame, one after the other.
    fn again(&mut self, kept: &[u8]) -> Result<(), ExportError> {
        let _ = kept;
        Err(ExportError::Format("this format keeps no frames".into()))
    }
}

/// State of a file after its last frame.
#[derive(Debug)]
pub enum Mark<'a> {
    /// The file cannot be resumed.
    Nothing,
    /// The bytes written so far are final. The value holds the other state that [`Exporter::resume`] needs: the whole state, or its change
    /// since the mark before, as the format chooses.
    Settled(Vec<u8>),
    /// The encoder still holds the frames since the last settled mark, and its state cannot be stored. These bytes hold the last frame as
    /// it was given to the encoder, for [`FrameSink::again`]; their length is the same for all frames of a file.
    Open([&'a [u8]; 3]),
}

/// The properties of a video that an exporter knows before its first frame.
///
/// ```
/// use choreo_plugin::VideoInfo;
/// use choreo_plugin::motion::FrameRate;
/// let fps = FrameRate { num: 30_000, den: 1_001 };
/// let info = VideoInfo { width: 1920, height: 1080, fps, frames: 300, provenance: vec![], options: Default::default() };
/// # assert_eq!(info.frames, 300);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct VideoInfo {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Frames per second.
    pub fps: FrameRate,
    /// Number of frames.
    pub frames: u64,
    /// The provenance, as (keyword, text): written as metadata where the format has a place for it.
    pub provenance: Vec<(String, String)>,
    /// Option values by name, checked against the exporter's manifest ([`Manifest::option`]).
    pub options: ExportOptions,
}

/// Premultiplied, sRGB-encoded RGBA, 8 bits a channel, rows from the top, no padding. Light is multiplied by alpha before it is encoded;
/// [`Frame::straight`] divides.
///
/// ```
/// use choreo_plugin::Frame;
/// let red = Frame { width: 2, height: 1, rgba: [255, 0, 0, 255].repeat(2) };
/// assert_eq!(red.rgba.len() as u32, 4 * red.width * red.height);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Four bytes per pixel.
    pub rgba: Vec<u8>,
}

/// Why a file could not be written.
///
/// ```
/// use choreo_plugin::ExportError;
/// let full = std::io::Error::other("the disk is full");
/// assert_eq!(ExportError::from(full).to_string(), "cannot write: the disk is full");
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub enum ExportError {
    /// The writer failed.
    Io(std::io::Error),
    /// The format cannot hold the frames.
    Format(String),
    /// The stage cannot be evaluated at a time.
    Stage(StageError),
    /// The exporter has panicked.
    Panic(PluginPanic),
}

impl std::fmt::Display for ExportError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            ExportError::Io(error) => write!(f, "cannot write: {error}"),
            ExportError::Format(text) => f.write_str(text),
            ExportError::Stage(error) => error.fmt(f),
            ExportError::Panic(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for ExportError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            ExportError::Io(error) => Some(error),
            ExportError::Format(_) | ExportError::Stage(_) | ExportError::Panic(_) => None,
        }
    }
}

impl From<std::io::Error> for ExportError {
    fn from(error: std::io::Error) -> ExportError {
        ExportError::Io(error)
    }
}

impl From<StageError> for ExportError {
    fn from(error: StageError) -> ExportError {
        ExportError::Stage(error)
    }
}

impl From<PluginPanic> for ExportError {
    fn from(error: PluginPanic) -> ExportError {
        ExportError::Panic(error)
    }
}
