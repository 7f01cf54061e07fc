//! Compression in crate files: integer lists as coded differences, and bytes by LZ4 (pxr/usd/usd/integerCoding.cpp,
//! pxr/base/tf/fastCompression.cpp).

use std::collections::BTreeMap;

/// Codes the differences between neighboring integers: the most frequent one needs only its 2-bit code, every other one 1, 2 or 4
/// bytes more.
pub(super) fn encode_differences(list: &[i32]) -> Vec<u8> {
    if list.is_empty() {
        return Vec::new();
    }
    let mut before = 0i32;
    let differences: Vec<i32> =
        list.iter().map(|v| v.wrapping_sub(std::mem::replace(&mut before, *v))).collect();
    let mut counts: BTreeMap<i32, usize> = BTreeMap::new();
    differences.iter().for_each(|d| *counts.entry(*d).or_default() += 1);
    let common = counts.iter().max_by_key(|(_, count)| **count).map_or(0, |(d, _)| *d);
    let (mut codes, mut numbers) = (vec![0u8; differences.len().div_ceil(4)], Vec::new());
    for (index, difference) in differences.iter().enumerate() {
        let code = match *difference {
            d if d == common => 0,
            d if i8::try_from(d).is_ok() => {
                numbers.extend((d as i8).to_le_bytes());
                1
            }
            d if i16::try_from(d).is_ok() => {
                numbers.extend((d as i16).to_le_bytes());
                2
            }
            d => {
                numbers.extend(d.to_le_bytes());
                3
            }
        };
        codes[index / 4] |= code << (2 * (index % 4));
    }
    let mut out = common.to_le_bytes().to_vec();
    out.append(&mut codes);
    out.append(&mut numbers);
    out
}

/// Compresses bytes as a single LZ4 chunk. The leading 0 means that no further chunks follow.
pub(super) fn compress(bytes: &[u8]) -> Vec<u8> {
    let mut out = vec![0];
    out.extend(lz4_flex::block::compress(bytes));
    out
}
