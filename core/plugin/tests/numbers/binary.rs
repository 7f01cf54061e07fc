//! Numbers of binary files against the bytes that they were written as, at every offset of a file and beyond its end.

use choreo_plugin::{Binary, BinaryNumber};

const FILE: [u8; 37] = {
    let mut file = [0; 37];
    let mut i = 0;
    while i < file.len() {
        file[i] = (i * i * 7 + 200 * i + 3) as u8;
        i += 1;
    }
    file
};

/// Compares every method that reads this type with `le` and `be`, which convert the bytes.
fn check_all_reads<T: BinaryNumber + std::fmt::Debug, const N: usize>(
    bits: impl Fn(T) -> u64,
    le: fn([u8; N]) -> T,
    be: fn([u8; N]) -> T,
) {
    for at in (0..FILE.len() + 9).chain([usize::MAX - 2, usize::MAX]) {
        let bytes = |row: usize, stride: usize| -> Option<[u8; N]> {
            FILE.get(at.checked_add(row * stride)?..)?.first_chunk().copied()
        };
        for (file, of) in [(Binary::little_endian(&FILE), le), (Binary::big_endian(&FILE), be)] {
            let expected = bytes(0, 0).map(|own| bits(of(own)));
            assert_eq!(file.number::<T>(at).ok().map(&bits), expected, "{at}");
            let three: Option<Vec<u64>> = (0..3).map(|i| bytes(i, N).map(|own| bits(of(own)))).collect();
            let as_bits = |list: Vec<T>| list.into_iter().map(&bits).collect::<Vec<u64>>();
            assert_eq!(file.numbers::<T>(at, 3).ok().map(as_bits), three, "{at}");
            assert_eq!(file.array::<T, 3>(at).ok().map(|a| as_bits(a.into())), three, "{at}");
            assert_eq!(file.rows::<T, 3>(at, 1, 3 * N + 1).ok().map(as_bits), three, "{at}");
            let apart: Option<Vec<u64>> = (0..3).map(|i| bytes(i, N + 5).map(|own| bits(of(own)))).collect();
            assert_eq!(file.rows::<T, 1>(at, 3, N + 5).ok().map(as_bits), apart, "{at}");
        }
        if let Err(error) = Binary::little_endian(&FILE).number::<T>(at) {
            assert_eq!(error.to_string(), format!("byte {at}: {N} bytes are needed, the file has 37"));
        }
    }
}

#[test]
fn numbers_match_their_bytes_and_reads_beyond_the_end_are_errors() {
    check_all_reads(u64::from, u8::from_le_bytes, u8::from_be_bytes);
    check_all_reads(|v| v as u64, i8::from_le_bytes, i8::from_be_bytes);
    check_all_reads(u64::from, u16::from_le_bytes, u16::from_be_bytes);
    check_all_reads(|v| v as u64, i16::from_le_bytes, i16::from_be_bytes);
    check_all_reads(u64::from, u32::from_le_bytes, u32::from_be_bytes);
    check_all_reads(|v| v as u64, i32::from_le_bytes, i32::from_be_bytes);
    check_all_reads(|v| v, u64::from_le_bytes, u64::from_be_bytes);
    check_all_reads(|v| v as u64, i64::from_le_bytes, i64::from_be_bytes);
    check_all_reads(|v| u64::from(v.to_bits()), f32::from_le_bytes, f32::from_be_bytes);
    check_all_reads(f64::to_bits, f64::from_le_bytes, f64::from_be_bytes);
}

#[test]
fn invalid_counts_are_errors_without_allocation() {
    let file = Binary::little_endian(&FILE);
    assert!(file.numbers::<f64>(0, usize::MAX).is_err() && file.part(1, usize::MAX).is_err());
    assert!(
        file.rows::<f32, 3>(0, usize::MAX, 12).is_err() && file.rows::<f32, 3>(usize::MAX, 2, 12).is_err()
    );
    let overlapping = file.rows::<f32, 3>(4, 2, 11).unwrap_err().to_string();
    assert_eq!(overlapping, "byte 4: rows of 3 numbers take 12 bytes, more than the stride of 11 bytes");
    assert!(file.rows::<f32, 0>(0, 2, 11).is_err());
    assert_eq!(file.rows::<f32, 3>(99, 0, 12), Ok(Vec::new()));
}

#[test]
fn texts_end_at_a_zero_byte_or_with_their_field() {
    let bytes = b"hips\0junk\xff!";
    let file = Binary::little_endian(bytes);
    let texts = [(0, 9), (0, 3), (4, 2), (5, 6), (11, 0)].map(|(at, field)| file.text(at, field));
    assert_eq!(texts.map(Result::unwrap), ["hips", "hip", "", "junk\u{fffd}!", ""]);
    assert!(file.text(8, 4).is_err() && file.text(12, 0).is_err());
}
