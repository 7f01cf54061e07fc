//! Choice of the record that provides each frame of a film, from segments that may overlap and come in any order.

use super::{RecordKind, Segment};
use choreo_plugin::suggest::list;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::num::NonZeroU64;

/// Address of a record: number of its segment, and number of the record in it.
pub(crate) type RecordAddress = (usize, usize);

/// Reason why segments do not make up a film.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum CoverageError {
    /// Frames that no segment holds, as inclusive ranges.
    Missing(Vec<(u64, u64)>),
    /// Two segments hold different bytes for the same frame.
    Differ { frame: u64, segments: [usize; 2] },
    /// A piece does not begin at a multiple of the piece length of the film's format, or has another length.
    Misplaced { segment: usize, frame: u64 },
}

/// Selects the records that make up the film, in order. Pieces are preferred to images, which must still be encoded.
pub(crate) fn select_records(
    segments: &[Segment],
    piece: Option<NonZeroU64>,
) -> Result<Vec<RecordAddress>, CoverageError> {
    let (mut pieces, mut images) =
        (BTreeMap::<u64, RecordAddress>::new(), BTreeMap::<u64, RecordAddress>::new());
    for (segment, opened) in segments.iter().enumerate() {
        for (number, place) in opened.records.iter().enumerate() {
            let record = &place.record;
            let records_of_kind = match record.kind {
                RecordKind::Piece { .. } => {
                    let fits_format =
                        |n: NonZeroU64| record.first.is_multiple_of(n.get()) && record.frames == n.get();
                    if !piece.is_some_and(fits_format) {
                        return Err(CoverageError::Misplaced { segment, frame: record.first });
                    }
                    &mut pieces
                }
                RecordKind::Image | RecordKind::Repeat => &mut images,
            };
            match records_of_kind.entry(record.first) {
                Entry::Vacant(free) => drop(free.insert((segment, number))),
                Entry::Occupied(other) => {
                    let (of, at) = *other.get();
                    if segments[of].records[at].record.hash != record.hash {
                        return Err(CoverageError::Differ { frame: record.first, segments: [of, segment] });
                    }
                }
            }
        }
    }
    let frames = segments.first().map_or(0, |segment| segment.film.frames);
    let (mut sources, mut missing) = (Vec::new(), Vec::<(u64, u64)>::new());
    let mut next = 0;
    while next < frames {
        if let Some(source) = pieces.get(&next) {
            sources.push(*source);
            next += piece.map_or(1, NonZeroU64::get);
            continue;
        }
        match (images.get(&next), missing.last_mut()) {
            (Some(source), _) => sources.push(*source),
            (None, Some(last)) if last.1 + 1 == next => last.1 = next,
            (None, _) => missing.push((next, next)),
        }
        next += 1;
    }
    if missing.is_empty() { Ok(sources) } else { Err(CoverageError::Missing(missing)) }
}

/// Formats ranges of frames in the syntax of the command line: `0..=47, 60`.
pub(crate) fn format_ranges(ranges: &[(u64, u64)]) -> String {
    let format_range = |(first, last): &(u64, u64)| match first == last {
        true => first.to_string(),
        false => format!("{first}..={last}"),
    };
    let texts: Vec<String> = ranges.iter().map(format_range).collect();
    list(texts.iter().map(String::as_str), 12)
}
