//! Parses the numbers of a text. A plugin in WebAssembly lets the program parse them, many at a time, at native speed.

use crate::guest;

/// Largest number of numbers that are read at a time.
pub(crate) const BLOCK: usize = 1024;

/// Longest word that can be a number, in bytes.
const MAX_WORD_BYTES: usize = 1024;

/// A type of numbers in texts: `f32`, `f64`, `i32` or `u32`.
///
/// ```
/// use choreo_plugin::{TextNumber, TextNumbers};
/// fn three<T: TextNumber>(text: &str) -> Result<[T; 3], usize> {
///     let mut numbers = TextNumbers::new(text.as_bytes(), 0);
///     Ok([numbers.next()?, numbers.next()?, numbers.next()?])
/// }
/// assert_eq!((three::<f32>("1 2.5 -3"), three::<u32>("1 2 x")), (Ok([1.0, 2.5, -3.0]), Err(4)));
/// ```
pub trait TextNumber: Copy + private::Number {}

mod private {
    pub trait Number: Sized {
        /// The number of the type in [`super::read_block`].
        const KIND: u32;

        fn from_bits(bits: u64) -> Self;
    }
}

macro_rules! numbers {
    ($($kind:literal $type:ident, $from:expr;)*) => {$(
        impl TextNumber for $type {}
        impl private::Number for $type {
            const KIND: u32 = $kind;

            fn from_bits(bits: u64) -> $type {
                $from(bits)
            }
        }
    )*};
}
numbers! {
    0 f32, |bits| f32::from_bits(bits as u32);
    1 f64, f64::from_bits;
    2 i32, |bits| bits as u32 as i32;
    3 u32, |bits| bits as u32;
}

/// The bits of a number of a kind, as [`str::parse`] reads it.
fn bits_of(kind: u32, word: &[u8]) -> Option<u64> {
    if word.len() > MAX_WORD_BYTES {
        return None;
    }
    // Most whole numbers are short.
    if kind >= 2 && (1..=9).contains(&word.len()) && word.iter().all(u8::is_ascii_digit) {
        return Some(word.iter().fold(0, |sum, digit| 10 * sum + u64::from(digit - b'0')));
    }
    let word = std::str::from_utf8(word).ok()?;
    match kind {
        0 => word.parse().ok().map(|value: f32| u64::from(value.to_bits())),
        1 => word.parse().ok().map(f64::to_bits),
        2 => word.parse().ok().map(|value: i32| u64::from(value as u32)),
        _ => word.parse().ok().map(|value: u32| u64::from(value)),
    }
}

/// Start and end of the next word; both at the end of the text where there is none.
fn next_word(text: &[u8], at: usize) -> (usize, usize) {
    let rest = &text[at..];
    let start = at + rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
    let word = &text[start..text.len().min(start + MAX_WORD_BYTES + 1)];
    (start, start + word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len()))
}

/// Reads numbers of one type until a word is no number, the text ends, or the lists are full. Returns how many. `ends`: the byte behind
/// each number.
#[doc(hidden)]
pub fn read_block(kind: u32, text: &[u8], values: &mut [u64], ends: &mut [u32]) -> usize {
    let mut at = 0;
    for (count, (value, end)) in values.iter_mut().zip(ends.iter_mut()).enumerate() {
        let (start, after) = next_word(text, at);
        let (Some(bits), Ok(after_u32)) = (bits_of(kind, &text[start..after]), u32::try_from(after)) else {
            return count;
        };
        (*value, *end, at) = (bits, after_u32, after);
    }
    values.len().min(ends.len())
}

/// Reads the numbers of a text that are separated by white space, as [`str::parse`] does.
///
/// ```
/// use choreo_plugin::TextNumbers;
/// let mut numbers = TextNumbers::new(b"3 0.5 -1e3\n7 eight", 0);
/// assert_eq!((numbers.next::<u32>(), numbers.next::<f32>(), numbers.next::<f32>()), (Ok(3), Ok(0.5), Ok(-1000.0)));
/// assert_eq!((numbers.next::<u32>(), numbers.at()), (Ok(7), 12));
/// // The error is the place of the word that is no number, or the end of the text.
/// assert_eq!(numbers.next::<u32>(), Err(13));
/// ```
pub struct TextNumbers<'t> {
    text: &'t [u8],
    at: usize,
    /// Numbers that were read ahead, and where each ends, from `base` on.
    values: Vec<u64>,
    ends: Vec<u32>,
    base: usize,
    /// Index of the next of these numbers, and how many there are.
    next: usize,
    count: usize,
    kind: u32,
    /// Numbers to be read at a time: few where types change often.
    ahead: usize,
}

impl<'t> TextNumbers<'t> {
    /// Reads the numbers of a text from the byte `at` on.
    pub fn new(text: &'t [u8], at: usize) -> TextNumbers<'t> {
        let (values, ends) = (vec![0; BLOCK], vec![0; BLOCK]);
        let at = at.min(text.len());
        TextNumbers { text, at, values, ends, base: 0, next: 0, count: 0, kind: 0, ahead: 16 }
    }

    /// The byte behind the last number.
    pub fn at(&self) -> usize {
        self.at
    }

    /// The next number.
    ///
    /// # Errors
    /// The byte at which a word begins that is no such number, or the end of the text.
    #[expect(clippy::should_implement_trait, reason = "each call may ask for another type")]
    pub fn next<T: TextNumber>(&mut self) -> Result<T, usize> {
        if self.next == self.count || self.kind != T::KIND {
            self.read_ahead(T::KIND)?;
        }
        let bits = self.values[self.next];
        self.at = self.base + self.ends[self.next] as usize;
        self.next += 1;
        Ok(T::from_bits(bits))
    }

    #[cold]
    fn read_ahead(&mut self, kind: u32) -> Result<(), usize> {
        let used_up = self.next == self.count;
        self.ahead = if used_up { (4 * self.ahead).min(BLOCK) } else { self.next.max(1) };
        (self.base, self.kind, self.next) = (self.at, kind, 0);
        let text = &self.text[self.at..];
        let (values, ends) = (&mut self.values[..self.ahead], &mut self.ends[..self.ahead]);
        self.count = guest::numbers(kind, text, values, ends).min(self.ahead);
        match self.count {
            0 => Err(next_word(self.text, self.at).0),
            _ => Ok(()),
        }
    }
}
