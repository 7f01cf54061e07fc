//! Fast parsing of text formats: lines with their numbers, words, and numbers as exact as the standard library reads them.

use memchr::memchr2;

/// Lines of a file with their numbers from 1. They end at LF, CR LF or CR.
#[derive(Clone, Debug)]
pub struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> Lines<'a> {
    pub fn new(bytes: &'a [u8]) -> Lines<'a> {
        Lines { rest: bytes, number: 0 }
    }

    /// Bytes that are not read yet.
    pub fn left(&self) -> usize {
        self.rest.len()
    }

    /// Lines of a text that starts inside a file: the first line gets the number `first`.
    pub fn from(bytes: &'a [u8], first: usize) -> Lines<'a> {
        Lines { rest: bytes, number: first.saturating_sub(1) }
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<(usize, &'a [u8])> {
        if self.rest.is_empty() {
            return None;
        }
        self.number += 1;
        let end = memchr2(b'\n', b'\r', self.rest).unwrap_or(self.rest.len());
        let (line, tail) = self.rest.split_at(end);
        self.rest = match tail {
            [b'\r', b'\n', rest @ ..] | [_, rest @ ..] => rest,
            [] => &[],
        };
        Some((self.number, line))
    }
}

/// Words of a line, separated by spaces and tabs.
pub fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = line;
    std::iter::from_fn(move || next_word(&mut rest))
}

/// Takes the next word off a line.
#[inline]
pub fn next_word<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let start = rest.iter().position(|b| !is_space(*b))?;
    let word = &rest[start..];
    let end = word.iter().position(|b| is_space(*b)).unwrap_or(word.len());
    let (word, tail) = word.split_at(end);
    *rest = tail;
    Some(word)
}

#[inline]
fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | 0x0b | 0x0c)
}

/// Powers of ten that f64 holds exactly. A `const` would be copied for every number, because the index is not known in advance.
static POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

/// A finite decimal number: `-1.5`, `.5`, `1.`, `1e-007`. Neither "nan" nor "inf".
///
/// Up to 2^53 and 22 places, the quotient or product of two exact numbers is the correctly rounded result (Clinger 1990). All other numbers
/// go to the standard library, so that every result equals that of the library.
#[inline]
pub fn number(word: &[u8]) -> Option<f64> {
    let decimal = Decimal::parse_prefix(word).filter(|d| d.length == word.len())?;
    decimal.value(word)
}

/// Takes the next number off a text whose numbers are separated by white space of any kind, line ends included; faster than word by word.
/// `Err` is a word that is no number.
#[inline(always)]
pub fn next_number<'a>(rest: &mut &'a [u8]) -> Option<Result<f64, &'a [u8]>> {
    skip_white(rest)?;
    let text = *rest;
    if let Some(decimal) = Decimal::parse_prefix(text)
        && text.get(decimal.length).is_none_or(|b| is_white(*b))
    {
        let (word, tail) = text.split_at(decimal.length);
        *rest = tail;
        return Some(decimal.value(word).ok_or(word));
    }
    Some(Err(white_word(rest)))
}

/// Takes the next whole number off text, as [`next_number`] does.
#[inline(always)]
pub fn next_integer<'a>(rest: &mut &'a [u8]) -> Option<Result<i64, &'a [u8]>> {
    skip_white(rest)?;
    let text = *rest;
    let (mut at, mut value) = (0, 0);
    let count = digits(text, &mut at, &mut value);
    if (1..=18).contains(&count) && text.get(at).is_none_or(|b| is_white(*b)) {
        *rest = &text[at..];
        return Some(Ok(value as i64));
    }
    let word = white_word(rest);
    Some(integer(word).ok_or(word))
}

#[inline]
fn is_white(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t'..=b'\r')
}

/// Moves to the next word; `None` where there is none.
#[inline]
fn skip_white(rest: &mut &[u8]) -> Option<()> {
    // Mostly there is one space.
    if let [b' ', tail @ ..] = *rest {
        *rest = tail;
    }
    if rest.first().is_none_or(|b| is_white(*b)) {
        let start = rest.iter().position(|b| !is_white(*b))?;
        *rest = &rest[start..];
    }
    Some(())
}

#[cold]
fn white_word<'a>(rest: &mut &'a [u8]) -> &'a [u8] {
    let end = rest.iter().position(|b| is_white(*b)).unwrap_or(rest.len());
    let (word, tail) = rest.split_at(end);
    *rest = tail;
    word
}

/// A decimal number at the beginning of a text.
struct Decimal {
    negative: bool,
    /// Digits without the point; wrapped around if there are more than 19.
    mantissa: u64,
    digits: usize,
    /// Power of ten.
    power: i32,
    /// Length of the number in bytes.
    length: usize,
}

impl Decimal {
    #[inline(always)]
    fn parse_prefix(text: &[u8]) -> Option<Decimal> {
        let (negative, mut at) = match text.first() {
            Some(b'-') => (true, 1),
            Some(b'+') => (false, 1),
            _ => (false, 0),
        };
        let mut mantissa = 0;
        let mut count = digits(text, &mut at, &mut mantissa);
        let mut power = 0i32;
        if text.get(at) == Some(&b'.') {
            at += 1;
            let places = digits(text, &mut at, &mut mantissa);
            count += places;
            power = -(places.min(1000) as i32);
        }
        if count == 0 {
            return None;
        }
        if let Some(b'e' | b'E') = text.get(at) {
            let (down, from) = match text.get(at + 1) {
                Some(b'-') => (true, at + 2),
                Some(b'+') => (false, at + 2),
                _ => (false, at + 1),
            };
            at = from;
            let mut exponent = 0i32;
            while let Some(d) = text.get(at).map(|b| b.wrapping_sub(b'0')).filter(|d| *d < 10) {
                exponent = (exponent * 10 + i32::from(d)).min(100_000);
                at += 1;
            }
            if at == from {
                return None;
            }
            power += if down { -exponent } else { exponent };
        }
        Some(Decimal { negative, mantissa, digits: count, power, length: at })
    }

    /// Value of the number, which was read from `word`; `None` beyond the range of f64.
    #[inline(always)]
    fn value(&self, word: &[u8]) -> Option<f64> {
        if self.digits > 19 || self.mantissa > 1 << 53 || self.power.unsigned_abs() > 22 {
            return parse_with_std(word);
        }
        let scale = POWERS[self.power.unsigned_abs() as usize];
        let value = if self.power < 0 { self.mantissa as f64 / scale } else { self.mantissa as f64 * scale };
        Some(if self.negative { -value } else { value })
    }
}

#[cold]
fn parse_with_std(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok().filter(|v: &f64| v.is_finite())
}

/// Appends the digits at a position to a number, and returns how many there are. Eight at a time: the digits of eight bytes are found by
/// one comparison, shifted behind leading zeros, and added up in pairs, pairs of pairs, and fours (Lemire 2022, "Number parsing at a
/// gigabyte per second", section 3).
#[inline(always)]
fn digits(text: &[u8], at: &mut usize, value: &mut u64) -> usize {
    const ZEROS: u64 = 0x3030_3030_3030_3030;
    static TENS: [u64; 9] = [1, 10, 100, 1000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];
    let from = *at;
    while let Some(eight) = text.get(*at..).and_then(|t| t.first_chunk::<8>()) {
        let bytes = u64::from_le_bytes(*eight) ^ ZEROS;
        // The lowest byte above nine gets its highest bit set; carries of the sum reach only later bytes.
        let others = (bytes.wrapping_add(0x7676_7676_7676_7676) | bytes) & 0x8080_8080_8080_8080;
        let count = others.trailing_zeros() / 8;
        if count == 0 {
            return *at - from;
        }
        let ones = bytes << (64 - 8 * count);
        let twos = ones.wrapping_mul(10).wrapping_add(ones >> 8);
        let mask = 0x0000_00FF_0000_00FF;
        let low = (twos & mask).wrapping_mul(100 + (1_000_000 << 32));
        let high = ((twos >> 16) & mask).wrapping_mul(1 + (10_000 << 32));
        let number = low.wrapping_add(high) >> 32;
        *value = value.wrapping_mul(TENS[count as usize]).wrapping_add(number);
        *at += count as usize;
        if count < 8 {
            return *at - from;
        }
    }
    while let Some(digit) = text.get(*at).map(|b| b.wrapping_sub(b'0')).filter(|d| *d < 10) {
        *value = value.wrapping_mul(10).wrapping_add(digit.into());
        *at += 1;
    }
    *at - from
}

/// A whole number.
#[inline]
pub fn integer(word: &[u8]) -> Option<i64> {
    let (negative, digits) = match word {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, word),
    };
    if digits.is_empty() {
        return None;
    }
    let value = digits.iter().try_fold(0i64, |value, b| {
        let digit = b.wrapping_sub(b'0');
        if digit > 9 { None } else { value.checked_mul(10)?.checked_add(digit.into()) }
    })?;
    Some(if negative { -value } else { value })
}

/// `1 channel`, `2 channels`, `2 vertices`.
pub fn count(number: usize, noun: &str) -> String {
    match (number, noun.strip_suffix("ex")) {
        (1, _) => format!("1 {noun}"),
        (_, Some(stem)) => format!("{number} {stem}ices"),
        (_, None) => format!("{number} {noun}s"),
    }
}

/// Bytes of a file as they can stand in a message: short, without control characters.
pub fn shown(bytes: &[u8]) -> String {
    const MOST: usize = 40;
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(MOST * 4)]);
    let mut out: String =
        text.chars().take(MOST).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if bytes.len() > out.len() {
        out.push('…');
    }
    out
}

/// Bytes of a text with `%20` and the like decoded; invalid encodings stay as they are.
pub fn percent_decoded(text: &str) -> Vec<u8> {
    let hex = |b: u8| char::from(b).to_digit(16).map(|d| d as u8);
    let mut rest = text.as_bytes();
    let mut out = Vec::with_capacity(rest.len());
    while let Some((byte, after)) = rest.split_first() {
        rest = after;
        out.push(match after {
            [high, low, after @ ..] if *byte == b'%' => match (hex(*high), hex(*low)) {
                (Some(high), Some(low)) => {
                    rest = after;
                    high << 4 | low
                }
                _ => *byte,
            },
            _ => *byte,
        });
    }
    out
}

/// File name without folders and extension: the name of a clip that has no name of its own.
pub fn stem(file: &str) -> &str {
    let name = file.rsplit(['/', '\\']).next().unwrap_or(file);
    match name.rsplit_once('.') {
        Some((stem, _)) if !stem.is_empty() => stem,
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_equal_those_of_the_standard_library() {
        let texts = [
            "0",
            "-0",
            "1",
            "-1.5",
            "+2.25",
            ".5",
            "1.",
            "1e3",
            "1E-7",
            "-9.23872e-007",
            "0.1",
            "123456.789",
            "9007199254740993",
            "9007199254740992",
            "123456789012345678901234567890",
            "1e-300",
            "1e22",
            "1e23",
            "0.000000000000000000000000000001",
            "3.4028235e38",
            "4.35",
            "2.2250738585072014e-308",
            "-00012.50",
        ];
        for text in texts {
            let want: f64 = text.parse().unwrap();
            assert_eq!(number(text.as_bytes()).map(f64::to_bits), Some(want.to_bits()), "{text}");
            // Within a longer text, where eight bytes can always be looked at.
            let longer = format!("\n\t {text}\r\n0123456789");
            let mut rest = longer.as_bytes();
            let read = next_number(&mut rest).unwrap().map(f64::to_bits);
            assert_eq!((read, rest), (Ok(want.to_bits()), &b"\r\n0123456789"[..]), "{text}");
        }
        let refused =
            ["", "-", ".", "e5", "1e", "1e+", "nan", "inf", "1,5", "1.5x", "--1", "1e400", "0x10", "1 2"];
        for text in refused {
            assert_eq!(number(text.as_bytes()), None, "{text}");
            let longer = format!(" {text} 8");
            let mut rest = longer.as_bytes();
            let first = text.split(' ').next().unwrap_or_default();
            match first {
                "" | "1" => assert!(next_number(&mut rest).unwrap().is_ok()),
                word => assert_eq!(next_number(&mut rest), Some(Err(word.as_bytes())), "{text}"),
            }
        }
        assert_eq!(next_number(&mut &b" \r\n"[..]), None);
        // SplitMix64: as printed, short and long.
        let mut state = 7u64;
        for _ in 0..20_000 {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let z = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let value = (z >> 11) as f64 / (1u64 << (z % 53)) as f64 - 1000.0;
            for text in [format!("{value}"), format!("{value:.6}"), format!("{value:e}")] {
                let want: f64 = text.parse().unwrap();
                assert_eq!(number(text.as_bytes()), Some(want), "{text}");
                let longer = format!("{text} 00000000");
                assert_eq!(next_number(&mut longer.as_bytes()), Some(Ok(want)), "{text}");
            }
        }
    }

    #[test]
    fn integers_equal_those_of_the_standard_library() {
        assert_eq!(integer(b"-12"), Some(-12));
        assert_eq!(integer(b"9223372036854775807"), Some(i64::MAX));
        for text in ["", "-", "1.0", "9223372036854775808", "1e3"] {
            assert_eq!(integer(text.as_bytes()), None, "{text}");
        }
        let mut rest = &b"0 7\n12345678 123456789 -5 9223372036854775807 1.5 x"[..];
        let mut read = Vec::new();
        while let Some(value) = next_integer(&mut rest) {
            read.push(value.ok());
        }
        let want =
            [Some(0), Some(7), Some(12_345_678), Some(123_456_789), Some(-5), Some(i64::MAX), None, None];
        assert_eq!(read, want);
        for digit in 0..=255u8 {
            let text = [b'1', b'2', b'3', digit, b'4', b'5', b'6', b'7', b'8', b' '];
            let (mut at, mut value) = (0, 0);
            let want = if digit.is_ascii_digit() { 9 } else { 3 };
            assert_eq!(digits(&text, &mut at, &mut value), want, "byte {digit}");
        }
    }

    #[test]
    fn lines_end_at_lf_crlf_or_cr() {
        let lines: Vec<_> = Lines::new(b"a b\r\n\nc\rd").collect();
        assert_eq!(lines, [(1, &b"a b"[..]), (2, b""), (3, b"c"), (4, b"d")]);
        assert_eq!(Lines::from(b"x", 9).next(), Some((9, &b"x"[..])));
        assert_eq!(words(b"  f 1/2\t3 ").collect::<Vec<_>>(), [&b"f"[..], b"1/2", b"3"]);
        assert_eq!((stem("a/b.c/walk.01.bvh"), stem(".obj"), stem("x")), ("walk.01", ".obj", "x"));
        assert_eq!(shown(b"a\x01\xff"), "a\u{fffd}\u{fffd}");
        assert_eq!([0, 1, 2].map(|n| count(n, "face")), ["0 faces", "1 face", "2 faces"]);
    }
}
