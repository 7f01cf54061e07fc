//! Writing a film from records: pieces are copied, and images go through the exporter.

use super::shared::SharedWriter;
use super::{PlacedRecord, RecordKind, Segment, SegmentError};
use choreo_plugin::{ExportError, Exporter, Frame, FrameSink, Mark, VideoInfo};
use std::io::{self, Write};

type SharedOutput = SharedWriter<Box<dyn Write + Send>>;

/// A film that is being written.
pub(crate) struct FilmWriter<'a> {
    exporter: &'a dyn Exporter,
    info: &'a VideoInfo,
    out: SharedOutput,
    /// `None` between pieces.
    sink: Option<Box<dyn FrameSink>>,
    /// Exporter states of the pieces written so far.
    states: Vec<Vec<u8>>,
    /// The image written last, with the number of its segment and its offset there.
    last_image: Option<((usize, u64), Frame)>,
    pub counts: JoinedFrames,
}

/// Numbers of frames that were copied from pieces, and of frames that were encoded from images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct JoinedFrames {
    pub copied: u64,
    pub encoded: u64,
}

/// Reason why a film was not written.
#[derive(Debug)]
pub(crate) enum JoinError {
    Export(ExportError),
    Segment(usize, SegmentError),
}

impl From<ExportError> for JoinError {
    fn from(error: ExportError) -> JoinError {
        JoinError::Export(error)
    }
}

impl From<io::Error> for JoinError {
    fn from(error: io::Error) -> JoinError {
        JoinError::Export(error.into())
    }
}

impl<'a> FilmWriter<'a> {
    pub(crate) fn begin(
        exporter: &'a dyn Exporter,
        info: &'a VideoInfo,
        out: Box<dyn Write + Send>,
    ) -> Result<FilmWriter<'a>, JoinError> {
        let out = SharedWriter::new(out);
        let sink = Some(exporter.begin(info, Box::new(out.clone()))?);
        let counts = JoinedFrames::default();
        Ok(FilmWriter { exporter, info, out, sink, states: Vec::new(), last_image: None, counts })
    }

    /// Adds the frames of a record. `number`: number of its segment.
    pub(crate) fn add_record(
        &mut self,
        number: usize,
        segment: &Segment,
        place: &PlacedRecord,
    ) -> Result<(), JoinError> {
        let fault = |fault| JoinError::Segment(number, fault);
        let image = (number, place.offset);
        if let RecordKind::Piece { state } = place.record.kind {
            let mut state_and_bytes = segment.read_bytes(place).map_err(fault)?;
            let bytes = state_and_bytes.split_off(usize::try_from(state).unwrap_or(usize::MAX));
            self.sink = None;
            self.out.write_all(&bytes)?;
            self.states.push(state_and_bytes);
            self.last_image = None;
            self.counts.copied += place.record.frames;
            return Ok(());
        }
        let repeated = self.last_image.as_ref().is_some_and(|(last_image, _)| *last_image == image);
        if !repeated {
            self.last_image = Some((image, segment.decode_frame(place).map_err(fault)?));
        }
        let sink = match &mut self.sink {
            Some(sink) => sink,
            none => none.insert(self.exporter.resume(
                self.info,
                &self.states,
                &mut io::empty(),
                Box::new(self.out.clone()),
            )?),
        };
        if let Some((_, frame)) = &self.last_image {
            if repeated { sink.repeat(frame)? } else { sink.frame(frame)? }
        }
        self.counts.encoded += 1;
        if self.exporter.piece(self.info).is_some()
            && let Mark::Settled(state) = sink.mark()
        {
            self.states.push(state);
        }
        Ok(())
    }

    /// Ends the film. Returns the head, which belongs before everything that was written, and the numbers of frames.
    pub(crate) fn finish(self) -> Result<(Vec<u8>, JoinedFrames), JoinError> {
        let sink = match self.sink {
            Some(sink) => sink,
            None => {
                self.exporter.resume(self.info, &self.states, &mut io::empty(), Box::new(self.out.clone()))?
            }
        };
        let head = sink.finish()?;
        self.out.lock().flush()?;
        Ok((head, self.counts))
    }
}
