//! Text formats, fast: lines with their numbers, words, and numbers as exact as the standard library reads them.

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

    /// For text that starts inside a file: the first line gets `first`.
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
        let end = self.rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(self.rest.len());
        let (line, tail) = self.rest.split_at(end);
        self.rest = match tail {
            [b'\r', b'\n', rest @ ..] | [_, rest @ ..] => rest,
            [] => &[],
        };
        Some((self.number, line))
    }
}

/// Words of a line, apart at spaces and tabs.
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

const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

/// A finite decimal number: `-1.5`, `.5`, `1.`, `1e-007`. Neither "nan" nor "inf".
///
/// Up to 2^53 and 22 places, a quotient or product of two exact numbers is the correctly rounded result (Clinger 1990); the
/// rest goes to the standard library, so that all results are the same as its.
#[inline]
pub fn number(word: &[u8]) -> Option<f64> {
    let (negative, digits) = match word {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, word),
    };
    let mut mantissa = 0u64;
    let mut at = 0;
    let mut take = |at: &mut usize| {
        let from = *at;
        while let Some(d) = digits.get(*at).map(|b| b.wrapping_sub(b'0')).filter(|d| *d < 10) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(d));
            *at += 1;
        }
        *at - from
    };
    let mut count = take(&mut at);
    let mut power = 0i32;
    if digits.get(at) == Some(&b'.') {
        at += 1;
        let places = take(&mut at);
        count += places;
        power = -(places.min(1000) as i32);
    }
    if count == 0 {
        return None;
    }
    if let Some(b'e' | b'E') = digits.get(at) {
        at += 1;
        let down = match digits.get(at) {
            Some(b'-') => true,
            Some(b'+') => false,
            _ => {
                at -= 1;
                false
            }
        };
        at += 1;
        let from = at;
        let mut exponent = 0i32;
        while let Some(d) = digits.get(at).map(|b| b.wrapping_sub(b'0')).filter(|d| *d < 10) {
            exponent = (exponent * 10 + i32::from(d)).min(100_000);
            at += 1;
        }
        if at == from {
            return None;
        }
        power += if down { -exponent } else { exponent };
    }
    if at != digits.len() {
        return None;
    }
    if count <= 19 && mantissa <= 1 << 53 && power.unsigned_abs() <= 22 {
        let scale = POWERS[power.unsigned_abs() as usize];
        let value = if power < 0 { mantissa as f64 / scale } else { mantissa as f64 * scale };
        return Some(if negative { -value } else { value });
    }
    std::str::from_utf8(word).ok()?.parse().ok().filter(|v: &f64| v.is_finite())
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

/// The name of a file without folders and extension: what a clip without a name of its own is called.
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
    fn numbers_are_those_of_the_standard_library() {
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
        }
        let refused =
            ["", "-", ".", "e5", "1e", "1e+", "nan", "inf", "1,5", "1.5x", "--1", "1e400", "0x10", "1 2"];
        for text in refused {
            assert_eq!(number(text.as_bytes()), None, "{text}");
        }
        // SplitMix64: as printed, short and long.
        let mut state = 7u64;
        for _ in 0..20_000 {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let z = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let value = (z >> 11) as f64 / (1u64 << (z % 53)) as f64 - 1000.0;
            for text in [format!("{value}"), format!("{value:.6}"), format!("{value:e}")] {
                let want: f64 = text.parse().unwrap();
                assert_eq!(number(text.as_bytes()), Some(want), "{text}");
            }
        }
    }

    #[test]
    fn whole_numbers() {
        assert_eq!(integer(b"-12"), Some(-12));
        assert_eq!(integer(b"9223372036854775807"), Some(i64::MAX));
        for text in ["", "-", "1.0", "9223372036854775808", "1e3"] {
            assert_eq!(integer(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn lines_of_every_system() {
        let lines: Vec<_> = Lines::new(b"a b\r\n\nc\rd").collect();
        assert_eq!(lines, [(1, &b"a b"[..]), (2, b""), (3, b"c"), (4, b"d")]);
        assert_eq!(Lines::from(b"x", 9).next(), Some((9, &b"x"[..])));
        assert_eq!(words(b"  f 1/2\t3 ").collect::<Vec<_>>(), [&b"f"[..], b"1/2", b"3"]);
        assert_eq!((stem("a/b.c/walk.01.bvh"), stem(".obj"), stem("x")), ("walk.01", ".obj", "x"));
        assert_eq!(shown(b"a\x01\xff"), "a\u{fffd}\u{fffd}");
    }
}
