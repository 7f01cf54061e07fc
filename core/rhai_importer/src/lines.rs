//! The lines of a text file as byte ranges: a line becomes a script value only when the script reads it.

use crate::budget::{BudgetShare, NativeError, native_error};
use crate::bytes::Bytes;
use crate::engine::MAX_ARRAY_LEN;
use crate::numbers::{self, Numbers};
use rhai::{Array, Dynamic, Engine, ImmutableString};
use std::ops::Range;
use std::sync::Arc;

/// Byte range of each line in the file, without its line break, and the share of the budget that the list takes.
#[derive(Debug)]
struct LineRanges {
    ranges: Vec<Range<usize>>,
    _share: BudgetShare,
}

/// Lines of a UTF-8 text in order. Copies share the byte ranges.
#[derive(Clone, Debug)]
pub(crate) struct Lines {
    bytes: Bytes,
    ranges: Arc<LineRanges>,
    /// The part of `ranges` that this value covers.
    range: Range<usize>,
}

impl Lines {
    /// The lines of a text, without a byte order mark before them.
    pub(crate) fn of(bytes: &Bytes) -> Result<Lines, NativeError> {
        let text = bytes.text()?;
        let start = text.as_ptr() as usize;
        let lines = text.strip_prefix('\u{feff}').unwrap_or(text).lines();
        let place = |line: &str| {
            let at = line.as_ptr() as usize - start;
            at..at + line.len()
        };
        Self::new(bytes, lines.map(place))
    }

    fn new(bytes: &Bytes, lines: impl Iterator<Item = Range<usize>>) -> Result<Lines, NativeError> {
        const BYTES_PER_LINE: usize = size_of::<Range<usize>>();
        let mut share = bytes.budget.reserve(0)?;
        let mut ranges = Vec::new();
        for place in lines {
            if ranges.len() == ranges.capacity() {
                // The vector doubles its capacity.
                let more = ranges.len().max(64);
                share.grow(BYTES_PER_LINE * more)?;
                ranges.reserve_exact(more);
            }
            ranges.push(place);
        }
        let range = 0..ranges.len();
        Ok(Lines { bytes: bytes.clone(), ranges: Arc::new(LineRanges { ranges, _share: share }), range })
    }

    fn ranges(&self) -> &[Range<usize>] {
        &self.ranges.ranges[self.range.clone()]
    }

    fn line_texts(&self) -> Result<impl Iterator<Item = &str>, NativeError> {
        let text = self.bytes.text()?;
        Ok(self.ranges().iter().map(move |place| &text[place.clone()]))
    }

    fn line_at(&self, index: i64) -> Result<ImmutableString, NativeError> {
        let place = usize::try_from(index).ok().and_then(|i| self.ranges().get(i));
        let place = place.ok_or_else(|| {
            native_error(format!("there is no line {index} in {} lines, counted from 0", self.range.len()))
        })?;
        // The whole text has been checked to be UTF-8.
        Ok(String::from_utf8_lossy(&self.bytes.slice()[place.clone()]).as_ref().into())
    }

    fn part(&self, start: i64, count: i64) -> Result<Lines, NativeError> {
        let range = usize::try_from(start).ok().zip(usize::try_from(count).ok());
        let range = range.and_then(|(s, c)| Some(s..s.checked_add(c)?)).filter(|r| r.end <= self.range.len());
        let range = range.ok_or_else(|| {
            native_error(format!("part({start}, {count}) is outside of {} lines", self.range.len()))
        })?;
        let range = self.range.start + range.start..self.range.start + range.end;
        Ok(Lines { range, ..self.clone() })
    }

    /// The lines that are neither blank nor begin with this text (comments).
    fn data_lines(&self, comment: &str) -> Result<Lines, NativeError> {
        let is_data = |line: &str| {
            let line = line.trim_start();
            !line.is_empty() && (comment.is_empty() || !line.starts_with(comment))
        };
        let both = self.line_texts()?.zip(self.ranges());
        Lines::new(&self.bytes, both.filter(|(line, _)| is_data(line)).map(|(_, place)| place.clone()))
    }

    /// All numbers of the lines in one array, in the order of the lines.
    fn numbers(&self) -> Result<Numbers, NativeError> {
        match (self.ranges().first(), self.ranges().last()) {
            // Adjacent lines are parsed as one text.
            (Some(first), Some(last)) if self.are_adjacent() => {
                numbers::parse_numbers(&self.bytes.text()?[first.start..last.end], &self.bytes.budget)
            }
            _ => {
                let mut all = numbers::parse_numbers("", &self.bytes.budget)?;
                for line in self.line_texts()? {
                    all.append(&numbers::parse_numbers(line, &self.bytes.budget)?)?;
                }
                Ok(all)
            }
        }
    }

    /// Whether nothing but line breaks lies between the lines.
    fn are_adjacent(&self) -> bool {
        self.ranges().windows(2).all(|pair| pair[1].start <= pair[0].end + 2)
    }

    fn array(&self) -> Result<Array, NativeError> {
        if self.range.len() > MAX_ARRAY_LEN {
            return Err(native_error(format!(
                "array(): {} lines, at most {MAX_ARRAY_LEN} fit a script's array; loop over the lines instead",
                self.range.len()
            )));
        }
        let bytes: usize = self.ranges().iter().map(|place| place.len() + 32).sum();
        self.bytes.budget.charge(bytes)?;
        Ok(self.line_texts()?.map(|line| Dynamic::from(ImmutableString::from(line))).collect())
    }
}

impl IntoIterator for Lines {
    type Item = ImmutableString;
    type IntoIter = LinesIter;

    fn into_iter(self) -> LinesIter {
        LinesIter { lines: self, next: 0 }
    }
}

/// The lines in order, one script value at a time.
pub(crate) struct LinesIter {
    lines: Lines,
    next: i64,
}

impl Iterator for LinesIter {
    type Item = ImmutableString;

    fn next(&mut self) -> Option<ImmutableString> {
        let line = self.lines.line_at(self.next).ok();
        self.next += 1;
        line
    }
}

pub(crate) fn register_lines(engine: &mut Engine) {
    engine.register_type_with_name::<Lines>("Lines");
    engine.register_iterator::<Lines>();
    engine.register_fn("len", |lines: &mut Lines| lines.range.len() as i64);
    engine.register_get("len", |lines: &mut Lines| lines.range.len() as i64);
    engine.register_indexer_get(|lines: &mut Lines, index: i64| lines.line_at(index));
    engine.register_fn("part", |lines: &mut Lines, start: i64, count: i64| lines.part(start, count));
    engine.register_fn("without", |lines: &mut Lines, comment: &str| lines.data_lines(comment));
    engine.register_fn("numbers", |lines: &mut Lines| lines.numbers());
    engine.register_fn("array", |lines: &mut Lines| lines.array());
}
