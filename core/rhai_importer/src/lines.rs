//! The lines of a text file as byte ranges: a line becomes a script value only when the script reads it.

use crate::budget::{Refused, Share, refuse};
use crate::bytes::Bytes;
use crate::engine::MOST_IN_ARRAY;
use crate::numbers::{self, Numbers};
use rhai::{Array, Dynamic, Engine, ImmutableString};
use std::ops::Range;
use std::sync::Arc;

/// Byte range of each line in the file, without its line break, and the share of the budget that the list takes.
#[derive(Debug)]
struct Places {
    places: Vec<Range<usize>>,
    _share: Share,
}

/// Lines of a UTF-8 text in order. Copies share the byte ranges.
#[derive(Clone, Debug)]
pub struct Lines {
    bytes: Bytes,
    places: Arc<Places>,
    /// The part of `places` that this value covers.
    range: Range<usize>,
}

impl Lines {
    /// The lines of a text, without a byte order mark before them.
    pub fn of(bytes: &Bytes) -> Result<Lines, Refused> {
        let text = bytes.text()?;
        let start = text.as_ptr() as usize;
        let lines = text.strip_prefix('\u{feff}').unwrap_or(text).lines();
        let place = |line: &str| {
            let at = line.as_ptr() as usize - start;
            at..at + line.len()
        };
        Self::new(bytes, lines.map(place))
    }

    fn new(bytes: &Bytes, lines: impl Iterator<Item = Range<usize>>) -> Result<Lines, Refused> {
        const BYTES_PER_LINE: usize = size_of::<Range<usize>>();
        let mut share = bytes.budget.share(0)?;
        let mut places = Vec::new();
        for place in lines {
            if places.len() == places.capacity() {
                // The vector doubles its capacity.
                let more = places.len().max(64);
                share.grow(BYTES_PER_LINE * more)?;
                places.reserve_exact(more);
            }
            places.push(place);
        }
        let range = 0..places.len();
        Ok(Lines { bytes: bytes.clone(), places: Arc::new(Places { places, _share: share }), range })
    }

    fn places(&self) -> &[Range<usize>] {
        &self.places.places[self.range.clone()]
    }

    fn texts(&self) -> Result<impl Iterator<Item = &str>, Refused> {
        let text = self.bytes.text()?;
        Ok(self.places().iter().map(move |place| &text[place.clone()]))
    }

    fn at(&self, index: i64) -> Result<ImmutableString, Refused> {
        let place = usize::try_from(index).ok().and_then(|i| self.places().get(i));
        let place = place.ok_or_else(|| {
            refuse(format!("there is no line {index} in {} lines, counted from 0", self.range.len()))
        })?;
        // The whole text has been checked to be UTF-8.
        Ok(String::from_utf8_lossy(&self.bytes.slice()[place.clone()]).as_ref().into())
    }

    fn part(&self, start: i64, count: i64) -> Result<Lines, Refused> {
        let range = usize::try_from(start).ok().zip(usize::try_from(count).ok());
        let range = range.and_then(|(s, c)| Some(s..s.checked_add(c)?)).filter(|r| r.end <= self.range.len());
        let range = range.ok_or_else(|| {
            refuse(format!("part({start}, {count}) is outside of {} lines", self.range.len()))
        })?;
        let range = self.range.start + range.start..self.range.start + range.end;
        Ok(Lines { range, ..self.clone() })
    }

    /// The lines that are neither blank nor begin with this text (comments).
    fn data_lines(&self, comment: &str) -> Result<Lines, Refused> {
        let is_data = |line: &str| {
            let line = line.trim_start();
            !line.is_empty() && (comment.is_empty() || !line.starts_with(comment))
        };
        let both = self.texts()?.zip(self.places());
        Lines::new(&self.bytes, both.filter(|(line, _)| is_data(line)).map(|(_, place)| place.clone()))
    }

    /// All numbers of the lines in one array, in the order of the lines.
    fn numbers(&self) -> Result<Numbers, Refused> {
        match (self.places().first(), self.places().last()) {
            // Adjacent lines are parsed as one text.
            (Some(first), Some(last)) if self.is_whole() => {
                numbers::parse(&self.bytes.text()?[first.start..last.end], &self.bytes.budget)
            }
            _ => {
                let mut all = numbers::parse("", &self.bytes.budget)?;
                for line in self.texts()? {
                    all.append(&numbers::parse(line, &self.bytes.budget)?)?;
                }
                Ok(all)
            }
        }
    }

    /// Whether nothing but line breaks lies between the lines.
    fn is_whole(&self) -> bool {
        self.places().windows(2).all(|pair| pair[1].start <= pair[0].end + 2)
    }

    fn array(&self) -> Result<Array, Refused> {
        if self.range.len() > MOST_IN_ARRAY {
            return Err(refuse(format!(
                "array(): {} lines, at most {MOST_IN_ARRAY} fit a script's array; loop over the lines instead",
                self.range.len()
            )));
        }
        let bytes: usize = self.places().iter().map(|place| place.len() + 32).sum();
        self.bytes.budget.take(bytes)?;
        Ok(self.texts()?.map(|line| Dynamic::from(ImmutableString::from(line))).collect())
    }
}

impl IntoIterator for Lines {
    type Item = ImmutableString;
    type IntoIter = Iter;

    fn into_iter(self) -> Iter {
        Iter { lines: self, next: 0 }
    }
}

/// The lines in order, one script value at a time.
pub struct Iter {
    lines: Lines,
    next: i64,
}

impl Iterator for Iter {
    type Item = ImmutableString;

    fn next(&mut self) -> Option<ImmutableString> {
        let line = self.lines.at(self.next).ok();
        self.next += 1;
        line
    }
}

pub fn register(engine: &mut Engine) {
    engine.register_type_with_name::<Lines>("Lines");
    engine.register_iterator::<Lines>();
    engine.register_fn("len", |lines: &mut Lines| lines.range.len() as i64);
    engine.register_get("len", |lines: &mut Lines| lines.range.len() as i64);
    engine.register_indexer_get(|lines: &mut Lines, index: i64| lines.at(index));
    engine.register_fn("part", |lines: &mut Lines, start: i64, count: i64| lines.part(start, count));
    engine.register_fn("without", |lines: &mut Lines, comment: &str| lines.data_lines(comment));
    engine.register_fn("numbers", |lines: &mut Lines| lines.numbers());
    engine.register_fn("array", |lines: &mut Lines| lines.array());
}
