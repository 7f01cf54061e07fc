//! Numbers of texts against `str::parse`.

use choreo_plugin::{TextNumber, TextNumbers};

const WORDS: &str = "0 7 -7 +7 007 4294967295 4294967296 -2147483648 1.5 -0.0 1e-45 3.4028236e38 inf nan 1_0 0x10 . 12345678901 \
                     0.1 16777217 999999999 1000000000 1e400 5e-324";

/// All numbers of one type up to the first other word, and the position of that word.
fn read_all<T: TextNumber>(text: &[u8]) -> (Vec<T>, usize) {
    let mut numbers = TextNumbers::new(text, 0);
    let mut out = Vec::new();
    loop {
        match numbers.next() {
            // Each number takes at least one byte.
            Ok(number) if out.len() < text.len() => out.push(number),
            Ok(_) => panic!("numbers without end"),
            Err(place) => return (out, place),
        }
    }
}

fn check_against_parse<T: TextNumber + std::str::FromStr>(bits: impl Fn(T) -> u64) {
    for word in WORDS.split_whitespace() {
        let (read, place) = read_all::<T>(format!(" \t{word}\r\n").as_bytes());
        let parsed = word.parse::<T>().ok();
        assert_eq!(read.first().map(|v| bits(*v)), parsed.map(&bits), "{word}");
        assert_eq!(place, if parsed.is_some() { word.len() + 4 } else { 2 }, "{word}");
    }
}

#[test]
fn numbers_equal_those_of_str_parse() {
    check_against_parse::<f32>(|v| u64::from(v.to_bits()));
    check_against_parse::<f64>(f64::to_bits);
    check_against_parse::<i32>(|v| v as u64);
    check_against_parse::<u32>(u64::from);
}

#[test]
fn positions_are_right_across_blocks_types_and_long_words() {
    let text: String = (0..5000).map(|i| format!("{i} {}.5\n", i + 1)).collect();
    let mut numbers = TextNumbers::new(text.as_bytes(), 0);
    for i in 0..5000u32 {
        assert_eq!((numbers.next::<u32>(), numbers.next::<f64>()), (Ok(i), Ok(f64::from(i) + 1.5)));
    }
    assert_eq!(numbers.next::<u32>(), Err(text.len()));
    let many = "12 ".repeat(3000 + 1);
    assert_eq!(read_all::<u32>(many.as_bytes()), (vec![12; 3000 + 1], many.len()));
    let long = format!("1 {}", "0".repeat(2000));
    assert_eq!(read_all::<u32>(long.as_bytes()).1, 2);
    assert_eq!(read_all::<f32>(b"1 \xff 2"), (vec![1.0], 2));
    assert_eq!(TextNumbers::new(b"1", 9).next::<u32>(), Err(1));
}
