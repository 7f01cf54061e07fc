//! Writing a segment, as an exporter that wraps the exporter of the film. Segments are therefore resumed and renamed into place like videos.

use super::shared::SharedWriter;
use super::{Film, MAGIC, Record, RecordKind, encode_line, segment_name};
use crate::drawing::png_frame::encode_png;
use crate::output::provenance;
use choreo_plugin::{
    ExportError, ExportOptions, Exporter, FloatFrame, Frame, FrameSink, FrameWish, Manifest, Mark, VideoInfo,
};
use serde_json::json;
use std::io::{self, Read, Write};
use std::num::NonZeroU64;
use std::sync::Arc;

/// Exporter of a segment, which wraps the exporter of the film.
pub(crate) struct SegmentExporter {
    /// Exporter of the film.
    pub inner: Arc<dyn Exporter>,
    /// Number of the segment's first frame, and number of frames in the whole film.
    pub first: u64,
    pub film_frames: u64,
    /// Options of `inner` as typed.
    pub options: Vec<String>,
}

impl SegmentExporter {
    /// Describes the film of a segment with these properties.
    pub(crate) fn film(&self, info: &VideoInfo) -> Film {
        Film::new(info, self.film_frames, &self.options, self.inner.manifest())
    }

    /// Name of the segment's file, if it has `frames` frames.
    pub(crate) fn file_name(&self, frames: u64) -> String {
        segment_name(self.first, self.first + frames - 1)
    }

    fn sink(&self, info: &VideoInfo, done: u64, out: Box<dyn Write + Send>) -> Box<dyn FrameSink> {
        let film = VideoInfo { frames: self.film_frames, ..info.clone() };
        let (piece, images) = (self.inner.piece(&film), self.inner.one_frame_per_file());
        Box::new(SegmentSink {
            inner: self.inner.clone(),
            piece_frames: piece.or(images.then_some(NonZeroU64::MIN)),
            one_image_per_file: images,
            film,
            end: self.first + info.frames,
            next: self.first + done,
            done,
            repeatable: false,
            open_piece: None,
            out,
        })
    }
}

impl Exporter for SegmentExporter {
    fn manifest(&self) -> &Manifest {
        self.inner.manifest()
    }

    fn one_frame_per_file(&self) -> bool {
        false
    }

    fn wish(&self, options: &ExportOptions) -> Result<FrameWish, ExportError> {
        self.inner.wish(options)
    }

    fn notes(&self, info: &VideoInfo) -> Vec<String> {
        self.inner.notes(info)
    }

    fn begin(
        &self,
        info: &VideoInfo,
        mut out: Box<dyn Write + Send>,
    ) -> Result<Box<dyn FrameSink>, ExportError> {
        out.write_all(MAGIC)?;
        out.write_all(&encode_line(&self.film(info).json()))?;
        Ok(self.sink(info, 0, out))
    }

    fn resume(
        &self,
        info: &VideoInfo,
        states: &[Vec<u8>],
        _: &mut dyn Read,
        out: Box<dyn Write + Send>,
    ) -> Result<Box<dyn FrameSink>, ExportError> {
        let cut = || {
            ExportError::Format(
                "the saved state of the segment is incomplete; render it without --resume".into(),
            )
        };
        let done = states.last().and_then(|state| state.as_slice().try_into().ok()).ok_or_else(cut)?;
        Ok(self.sink(info, u64::from_le_bytes(done), out))
    }
}

struct SegmentSink {
    inner: Arc<dyn Exporter>,
    /// Number of frames in a piece; `None` if frames of the film depend on earlier frames.
    piece_frames: Option<NonZeroU64>,
    /// Whether each piece is a complete file.
    one_image_per_file: bool,
    film: VideoInfo,
    /// Numbers of the frame after the last one of the segment, and of the next frame.
    end: u64,
    next: u64,
    /// Number of frames in complete records.
    done: u64,
    /// Whether the previous record is an image written in this run.
    repeatable: bool,
    open_piece: Option<OpenPiece>,
    out: Box<dyn Write + Send>,
}

/// A piece that is being made.
struct OpenPiece {
    sink: Box<dyn FrameSink>,
    bytes: SharedWriter<Vec<u8>>,
    first: u64,
}

/// A frame in one of the forms that a sink accepts.
enum FrameInput<'a> {
    Frame(&'a Frame),
    Repeat(&'a Frame),
    Float(&'a FloatFrame),
    Kept(&'a [u8]),
}

impl SegmentSink {
    /// Returns the piece that the next frame belongs to, if the segment contains all of that piece; begins it at its first frame.
    fn current_piece(&mut self) -> Result<Option<&mut OpenPiece>, ExportError> {
        let Some(length) = self.piece_frames.map(NonZeroU64::get) else { return Ok(None) };
        let whole = self.next.is_multiple_of(length) && self.end - self.next >= length;
        if self.open_piece.is_none() && whole {
            let bytes = SharedWriter::new(Vec::new());
            let out = Box::new(bytes.clone());
            let sink = match self.one_image_per_file {
                true => {
                    let time = self.film.fps.time_of(i64::try_from(self.next).unwrap_or(i64::MAX));
                    let provenance = provenance::with_time(&self.film.provenance, time);
                    self.inner.begin(&VideoInfo { provenance, ..self.film.clone() }, out)?
                }
                false => self.inner.resume(&self.film, &[], &mut io::empty(), out)?,
            };
            self.open_piece = Some(OpenPiece { sink, bytes, first: self.next });
        }
        Ok(self.open_piece.as_mut())
    }

    fn add_frame(&mut self, input: FrameInput<'_>) -> Result<(), ExportError> {
        let (next, repeatable) = (self.next, self.repeatable);
        if let Some(piece) = self.current_piece()? {
            match input {
                FrameInput::Repeat(frame) if piece.first < next => piece.sink.repeat(frame)?,
                FrameInput::Frame(frame) | FrameInput::Repeat(frame) => piece.sink.frame(frame)?,
                FrameInput::Float(frame) => piece.sink.float_frame(frame)?,
                FrameInput::Kept(kept) => piece.sink.again(kept)?,
            }
            self.next += 1;
            return self.close_piece();
        }
        let (kind, bytes) = match input {
            FrameInput::Repeat(_) if repeatable => (RecordKind::Repeat, Vec::new()),
            // Speed matters more than size: the PNG is decoded once and then deleted.
            FrameInput::Frame(frame) | FrameInput::Repeat(frame) => {
                (RecordKind::Image, encode_png(frame, png::Compression::Fast)?)
            }
            FrameInput::Float(_) | FrameInput::Kept(_) => {
                return Err(ExportError::Format(
                    "a segment cannot store a frame of floats or a half-encoded frame as an image".into(),
                ));
            }
        };
        self.write_record(kind, next, 1, &bytes)?;
        self.repeatable = true;
        self.next += 1;
        Ok(())
    }

    /// Writes the piece if it has all of its frames.
    fn close_piece(&mut self) -> Result<(), ExportError> {
        let frames = self.piece_frames.map_or(1, NonZeroU64::get);
        let Some(mut piece) = self.open_piece.take_if(|piece| self.next - piece.first == frames) else {
            return Ok(());
        };
        let (mut state, bytes) = match self.one_image_per_file {
            true => {
                let head = piece.sink.finish()?;
                (Vec::new(), [head, std::mem::take(&mut *piece.bytes.lock())].concat())
            }
            false => match piece.sink.mark() {
                Mark::Settled(state) => (state, std::mem::take(&mut *piece.bytes.lock())),
                _ => {
                    return Err(ExportError::Format(
                        "the exporter did not complete a piece at its last frame".into(),
                    ));
                }
            },
        };
        let kind = RecordKind::Piece { state: state.len() as u64 };
        state.extend(bytes);
        self.write_record(kind, piece.first, frames, &state)?;
        self.repeatable = false;
        Ok(())
    }

    fn write_record(
        &mut self,
        kind: RecordKind,
        first: u64,
        frames: u64,
        bytes: &[u8],
    ) -> Result<(), ExportError> {
        let (hash, length) = (blake3::hash(bytes), bytes.len() as u64);
        self.out.write_all(&encode_line(&Record { kind, first, frames, hash, length }.json()))?;
        self.out.write_all(bytes)?;
        self.done += frames;
        Ok(())
    }
}

impl FrameSink for SegmentSink {
    fn frame(&mut self, frame: &Frame) -> Result<(), ExportError> {
        self.add_frame(FrameInput::Frame(frame))
    }

    fn float_frame(&mut self, frame: &FloatFrame) -> Result<(), ExportError> {
        self.add_frame(FrameInput::Float(frame))
    }

    fn repeat(&mut self, frame: &Frame) -> Result<(), ExportError> {
        self.add_frame(FrameInput::Repeat(frame))
    }

    fn again(&mut self, kept: &[u8]) -> Result<(), ExportError> {
        self.add_frame(FrameInput::Kept(kept))
    }

    fn mark(&mut self) -> Mark<'_> {
        match self.open_piece.as_mut().map(|piece| piece.sink.mark()) {
            Some(Mark::Open(parts)) => Mark::Open(parts),
            Some(_) => Mark::Nothing,
            None => Mark::Settled(self.done.to_le_bytes().to_vec()),
        }
    }

    fn finish(mut self: Box<Self>) -> Result<Vec<u8>, ExportError> {
        self.out.write_all(&encode_line(&json!({ "end": self.done })))?;
        self.out.flush()?;
        Ok(Vec::new())
    }
}
