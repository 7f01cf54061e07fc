//! Reading a segment: every byte is compared with its hash, once when the segment is opened and once more when it is used.

use super::{Film, MAGIC, Record, RecordKind, SegmentExporter, parse_line};
use crate::drawing::png_frame::decode_png;
use choreo_files::FileError;
use choreo_plugin::{Frame, VideoInfo};
use serde_json::Value;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Size limit of a line in bytes. Lines of records have a few hundred bytes; the line of the film contains the parameters of the script.
const MAX_LINE_BYTES: u64 = 16 << 20;

/// An open segment.
#[derive(Debug)]
pub(crate) struct Segment {
    pub path: PathBuf,
    pub film: Film,
    /// The intact records.
    pub records: Vec<PlacedRecord>,
    /// Description of the damage after the intact records; `None` if there is none.
    pub damage: Option<String>,
    file: File,
}

/// A record, and the offset of its bytes in the file. A record that repeats the previous image has the offset and the hash of that image.
#[derive(Clone, Debug)]
pub(crate) struct PlacedRecord {
    pub record: Record,
    pub offset: u64,
}

/// Reason why a file cannot be used as a segment; it does not include the file's name.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SegmentError {
    #[error("cannot read: {0}")]
    File(#[from] FileError),
    #[error("it is not a segment that choreo render --segment has written")]
    NotASegment,
    #[error("damaged: {0}")]
    Damaged(&'static str),
}

impl From<io::Error> for SegmentError {
    fn from(error: io::Error) -> SegmentError {
        SegmentError::File(error.into())
    }
}

impl Segment {
    /// Opens a segment and checks all of it. Damage after the head is no error: the records before it are used.
    pub(crate) fn open(path: &Path) -> Result<Segment, SegmentError> {
        let file = choreo_files::open_file(path)?;
        let mut from = CountingReader { inner: BufReader::with_capacity(1 << 16, &file), position: 0 };
        if from.read_line()?.as_deref() != Some(MAGIC) {
            return Err(SegmentError::NotASegment);
        }
        let head = from.read_line()?.and_then(|line| parse_line(&line));
        let film = head.as_ref().and_then(Film::read);
        let film =
            film.ok_or(SegmentError::Damaged("the line that describes its film is missing or wrong"))?;
        let mut records: Vec<PlacedRecord> = Vec::new();
        let damage = loop {
            let Some(line) = from.read_line()? else { break Some("it ends too early") };
            let Some(value) = parse_line(&line) else {
                break Some("a line of the segment file does not match its hash");
            };
            if let Some(frames) = value["end"].as_u64() {
                let counted: u64 = records.iter().map(|place| place.record.frames).sum();
                let at_end = from.inner.fill_buf()?.is_empty();
                break (frames != counted || !at_end).then_some("its end does not match its frames");
            }
            match from.read_record(&value, records.last(), film.frames)? {
                Ok(place) => records.push(place),
                Err(fault) => break Some(fault),
            }
        };
        let damage = damage.map(|what| match records.last() {
            None => format!("{what}, before its first frame"),
            Some(last) => format!("{what}, after frame {}", last.record.first + last.record.frames - 1),
        });
        Ok(Segment { path: path.to_path_buf(), film, records, damage, file })
    }

    /// Whether `path` holds a complete segment with these frames of this film, made by an earlier run of the same command.
    pub(crate) fn is_complete(path: &Path, exporter: &SegmentExporter, info: &VideoInfo) -> bool {
        Segment::open(path).is_ok_and(|made| {
            let next = made.records.iter().try_fold(exporter.first, |next, place| {
                (place.record.first == next).then_some(next + place.record.frames)
            });
            made.damage.is_none()
                && made.film == exporter.film(info)
                && next == Some(exporter.first + info.frames)
        })
    }

    /// Reads the bytes of a record.
    pub(crate) fn read_bytes(&self, place: &PlacedRecord) -> Result<Vec<u8>, SegmentError> {
        let mut file = &self.file;
        file.seek(SeekFrom::Start(place.offset))?;
        let mut bytes = Vec::new();
        file.take(place.record.length).read_to_end(&mut bytes)?;
        match blake3::hash(&bytes) == place.record.hash {
            true => Ok(bytes),
            false => Err(SegmentError::Damaged("it was changed while it was read")),
        }
    }

    /// Reads and decodes the pixels of an image.
    pub(crate) fn decode_frame(&self, place: &PlacedRecord) -> Result<Frame, SegmentError> {
        let bytes = self.read_bytes(place)?;
        decode_png(&bytes, |size| size == self.film.size)
            .ok_or(SegmentError::Damaged("an image is not 8-bit RGBA in the size of the film"))
    }
}

/// A reader that counts the bytes that it has read.
struct CountingReader<R> {
    inner: BufReader<R>,
    position: u64,
}

impl<R: Read> CountingReader<R> {
    /// Reads the next line with its line break; `None` at the end of the file.
    fn read_line(&mut self) -> io::Result<Option<Vec<u8>>> {
        let mut line = Vec::new();
        self.inner.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut line)?;
        self.position += line.len() as u64;
        Ok((!line.is_empty()).then_some(line))
    }

    /// Reads the record that a line describes, and compares the bytes that follow with their hash.
    fn read_record(
        &mut self,
        line: &Value,
        previous: Option<&PlacedRecord>,
        film_frames: u64,
    ) -> io::Result<Result<PlacedRecord, &'static str>> {
        let Some(record) = Record::read(line).filter(|r| r.first + r.frames <= film_frames) else {
            return Ok(Err("a line does not describe a record"));
        };
        if record.kind == RecordKind::Repeat {
            let image = previous.filter(|previous| {
                !matches!(previous.record.kind, RecordKind::Piece { .. })
                    && previous.record.first + 1 == record.first
            });
            let Some(image) = image else { return Ok(Err("a frame repeats a frame that is missing")) };
            let repetition = Record { first: record.first, kind: RecordKind::Repeat, ..image.record.clone() };
            return Ok(Ok(PlacedRecord { record: repetition, offset: image.offset }));
        }
        let offset = self.position;
        let mut hasher = blake3::Hasher::new();
        let mut read = 0;
        while read < record.length {
            let bytes = self.inner.fill_buf()?;
            let of_record = bytes.len().min(usize::try_from(record.length - read).unwrap_or(usize::MAX));
            if of_record == 0 {
                break;
            }
            hasher.update(&bytes[..of_record]);
            self.inner.consume(of_record);
            read += of_record as u64;
        }
        self.position += read;
        Ok(match read == record.length && hasher.finalize() == record.hash {
            true => Ok(PlacedRecord { record, offset }),
            false => Err("its bytes do not match their hash"),
        })
    }
}
