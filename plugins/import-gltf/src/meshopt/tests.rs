//! Decodes bytes that meshoptimizer 1.0's encoders wrote, and compares them with the encoded numbers, given as formulas.

use super::*;

fn hex(text: &str) -> Vec<u8> {
    let digits: Vec<u32> = text.chars().filter_map(|c| c.to_digit(16)).collect();
    digits.chunks(2).map(|d| (d[0] << 4 | d[1]) as u8).collect()
}

fn packed(mode: Mode, filter: Filter, count: usize, stride: usize) -> Packed {
    let packed = Packed { mode, filter, count, stride };
    packed.check().unwrap();
    packed
}

/// 40 elements of four 16-bit numbers: a slope, a parabola that overflows, rare jumps, a constant.
fn wave() -> Vec<u8> {
    let element = |i: u32| [i * 100, i * i * 7, if i.is_multiple_of(10) { 60_000 } else { i }, 5];
    (0..40).flat_map(element).flat_map(|v| (v as u16).to_le_bytes()).collect()
}

const WAVE_0: &str =
    "a01f00c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8ffff0000c8c8c8c8c8c8c8c81502
    08822088208822088200001f000e2a46627e9ab6d2eef5d9bda185694d311506223e5a7692aecae6fde1c5a9ffdf0000
    8d7155391d1a36290002222a20222422242242444244444400000000153aaaafaabdaea9aafaaaaf9a958681aaaa0000
    0530000f002c2b2c00f0000f2b2c2b2c00000000000000000000000000000000000000000000000000000000000060ea
    0500";
const WAVE_1: &str =
    "a17ba100c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8c8000e2a4662
    7e9ab6d2ee0a26425e7a96b2ceea06223e5a7692aecae6021e3a56728eaac6e2fe1a36250000055556aaaaff03030303
    3333334400000000153aaaafaabdaea9aafaaaaf9a958681aaaa000005020c2c2b2c30c02b2c2b2c0000000000000000
    0000000000000000000060ea05000100";

#[test]
fn compressed_attributes_are_decoded() {
    let wave_of = packed(Mode::Attributes, Filter::None, 40, 8);
    assert_eq!(wave_of.unpack(&hex(WAVE_0)).unwrap(), wave());
    assert_eq!(wave_of.unpack(&hex(WAVE_1)).unwrap(), wave());
    // Codec version 1, with rotated bits and with widths of one bit.
    let bits: Vec<u8> = (0..20u32)
        .flat_map(|i| [0x3f80_0000 ^ i << 20, (i as f32).to_bits()])
        .flat_map(u32::to_le_bytes)
        .collect();
    let turned =
        "a16a680201317131f13171310f0f001f010301010600070f020ff8f4c4f262e262f0f0183c0f001e0103010000000000
        0000000000000000000000803f000000004252";
    let narrow =
        "a13a3a002020202020202020202020202020202020202004010001000000808040404040202020202020202010101001
        06007f0100000000000000000000000000000000803f000000000001";
    for text in [turned, narrow] {
        assert_eq!(packed(Mode::Attributes, Filter::None, 20, 8).unpack(&hex(text)).unwrap(), bits);
    }
    // A planted fault: one flipped bit of the data gives other numbers.
    let mut other = hex(WAVE_0);
    other[40] ^= 1;
    assert_ne!(wave_of.unpack(&other).unwrap(), wave());
}

/// The decoder takes the stride from a type parameter; a wrong entry in the table would unpack other bytes or none.
#[test]
fn attributes_of_every_stride_are_decoded() {
    fn round_trip<const STRIDE: usize>() {
        let count = 300;
        let vertex = |v: usize| Vertex::<STRIDE>(std::array::from_fn(|b| ((v * v * (b + 3)) >> 4) as u8));
        let vertices: Vec<_> = (0..count).map(vertex).collect();
        let encoded = meshopt::encode_vertex_buffer(&vertices).unwrap();
        let bytes: Vec<u8> = vertices.iter().flat_map(|v| v.0).collect();
        let of = packed(Mode::Attributes, Filter::None, count, STRIDE);
        assert_eq!(of.unpack(&encoded).unwrap(), bytes, "{STRIDE}");
        // The same data read with the stride of its neighbor: an error, never a panic.
        let next = Packed { stride: if STRIDE == 256 { 4 } else { STRIDE + 4 }, ..of };
        assert_ne!(next.unpack(&encoded).ok(), Some(bytes), "{STRIDE}");
    }
    macro_rules! all {
        ($($words:literal)*) => { $(round_trip::<{ $words * 4 }>();)* };
    }
    all!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32
        33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64);
}

#[test]
fn compressed_indices_are_decoded() {
    // A grid of 4 × 3 cells, then two triangles that share nothing with it.
    let mut grid: Vec<u32> = Vec::new();
    for cell in 0..12u32 {
        let a = cell / 4 * 5 + cell % 4;
        grid.extend([a, a + 1, a + 5, a + 1, a + 6, a + 5]);
    }
    grid.extend([19, 0, 7, 3, 3, 3]);
    let version_0 =
        "e0fe1f100f100f100fcf1f160f150f140fcf1f140f140f140fffff0f0a0202020202020202020202020202ff00250eff
        070000007687566778a9866589689801690000";
    let version_1 =
        "e1fe1e100e100e100ece1e160e150e140ece1e140e140e140effff0f0aff00250eff070000007687566778a986658968
        9801690000";
    for text in [version_0, version_1] {
        let of = packed(Mode::Triangles, Filter::None, grid.len(), 4);
        // The encoder may rotate the vertices of a triangle, but never changes its winding.
        let turned = |t: &[u32]| {
            let first = (0..3).min_by_key(|i| t[*i]).unwrap_or(0);
            [t[first], t[(first + 1) % 3], t[(first + 2) % 3]]
        };
        let triangles = |list: &[u32]| list.chunks(3).map(turned).collect::<Vec<_>>();
        let bytes = of.unpack(&hex(text)).unwrap();
        let read: Vec<u32> = bytes.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
        assert_eq!(triangles(&read), triangles(&grid));
        let short = packed(Mode::Triangles, Filter::None, grid.len(), 2).unpack(&hex(text)).unwrap();
        assert_eq!(short, read.iter().flat_map(|i| (*i as u16).to_le_bytes()).collect::<Vec<_>>());
    }
    let sequence: Vec<u8> =
        (0..15u32).map(|i| if i % 2 == 0 { i } else { 1000 + 300 * i }).flat_map(u32::to_le_bytes).collect();
    let text = "d100d12808e11208e11208e11208e11208e11208e1120800000000";
    assert_eq!(packed(Mode::Indices, Filter::None, 15, 4).unpack(&hex(text)).unwrap(), sequence);
}

#[test]
fn filters_are_undone_within_their_precision() {
    let normals: [[f64; 4]; 4] =
        [[0.0, 0.6, 0.8, 1.0], [-0.36, 0.48, -0.8, -1.0], [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, -1.0, 1.0]];
    let rotations: [[f64; 4]; 4] =
        [[0.5, 0.5, 0.5, 0.5], [0.0, 0.6, 0.0, 0.8], [0.48, -0.6, 0.64, 0.0], [-0.8, 0.0, 0.36, 0.48]];
    let colors: [[f64; 4]; 4] =
        [[1.0, 0.5, 0.25, 1.0], [0.0, 0.0, 0.0, 1.0], [0.2, 0.8, 0.4, 0.5], [1.0, 1.0, 1.0, 0.75]];
    let signed16 =
        |b: &[u8]| b.as_chunks().0.iter().map(|b| f64::from(i16::from_le_bytes(*b)) / 32767.0).collect();
    let signed8 = |b: &[u8]| b.iter().map(|b| f64::from(*b as i8) / 127.0).collect();
    let unsigned8 = |b: &[u8]| b.iter().map(|b| f64::from(*b) / 255.0).collect();
    type Case<'a> = (Filter, usize, [[f64; 4]; 4], &'a dyn Fn(&[u8]) -> Vec<f64>, f64, &'a str);
    let cases: [Case; 4] = [
        (
            Filter::Octahedral,
            4,
            normals,
            &signed8,
            0.02,
            "a0013c000000b34d013f0000005ac5fe00013c0000000403000000000000000000000000000000000000000000000000
             0000000000367f7f",
        ),
        (
            Filter::Octahedral,
            8,
            normals,
            &signed16,
            1e-4,
            "a0013c000000eeef013c000000b54b013d0000001634013f0000005ac5fe0000013c0000000403012400000000000000
             00000000000000000000000000000000000000000000db36ff7fff7f",
        ),
        (
            Filter::Quaternion,
            8,
            rotations,
            &signed16,
            1e-4,
            "a00130000000fc0130000000b3013f000000348e19013f000000242bd0013f000000fcc88d013f000000b3d92c013700
             0000060300000000000000000000000000000000000000000000000000825a825a825afc7f",
        ),
        (
            Filter::Color,
            4,
            colors,
            &unsigned8,
            0.012,
            "a1ff00e0e7e600bd3132001e7e7d00007d3e00000000000000000000000000000000000000905ff1ff00",
        ),
    ];
    for (filter, stride, expected, numbers, tolerance, text) in cases {
        let read = numbers(&packed(Mode::Attributes, filter, 4, stride).unpack(&hex(text)).unwrap());
        for (element, expected) in read.chunks(4).zip(&expected) {
            // A quaternion and its negative are the same rotation.
            let dot: f64 = element.iter().zip(expected).map(|(a, b)| a * b).sum();
            let sign = if filter == Filter::Quaternion { dot.signum() } else { 1.0 };
            for (a, b) in element.iter().zip(expected) {
                assert!(
                    (a * sign - b).abs() <= tolerance,
                    "{filter:?} {stride}: {element:?} for {expected:?}"
                );
            }
        }
    }
    let text =
        "a0010f0000008281013f0000000f47c3013f000000440939013f00000012313a00000000000000000000000000000000
        000000000000000000000000000060ea";
    let bytes = packed(Mode::Attributes, Filter::Exponential, 4, 4).unpack(&hex(text)).unwrap();
    let read: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    for (a, b) in read.iter().zip([1.5f32, -1000.25, 3.0e-5, 12345.0]) {
        assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
    }
}

#[test]
fn false_counts_are_errors_before_allocation() {
    let of = |count| Packed { mode: Mode::Attributes, filter: Filter::None, count, stride: 8 };
    let text = of(1 << 40).unpack(&hex(WAVE_0)).unwrap_err().what;
    assert_eq!(text, "1099511627776 elements take 8589934617 bytes or more, but there are 194");
    assert!(of(24).unpack(&hex(WAVE_0)).is_err());
    let longer = [&hex(WAVE_0)[..160], &[0; 3], &hex(WAVE_0)[160..]].concat();
    assert_eq!(of(40).unpack(&longer).unwrap_err().what, "bytes are left over after the last element");
    assert_eq!(
        of(1).unpack(&[0x50; 64]).unwrap_err().what,
        "begins with byte 0x50, but data of this mode begin with 0xa0"
    );
    assert_eq!(of(1).unpack(&[0xa7; 64]).unwrap_err().what, "is of version 7; the newest known is 1");
    let check =
        |mode, filter, count, stride| Packed { mode, filter, count, stride }.check().unwrap_err().what;
    assert_eq!(
        check(Mode::Attributes, Filter::None, 1, 6),
        "has a byteStride of 6; multiples of 4 up to 256 are allowed"
    );
    assert_eq!(
        check(Mode::Attributes, Filter::Octahedral, 1, 12),
        "has a byteStride of 12; this filter needs 4 or 8"
    );
    assert_eq!(check(Mode::Triangles, Filter::None, 4, 2), "has 4 indices, which make no whole triangles");
    assert_eq!(check(Mode::Indices, Filter::Exponential, 4, 4), "has a filter, but no attributes");
}

/// Damages every byte and cuts at every length: each gives an error or other numbers, never a panic.
#[test]
fn damaged_data_do_not_panic() {
    for (mode, count, stride, text) in [
        (Mode::Attributes, 40, 8, WAVE_0),
        (Mode::Attributes, 40, 8, WAVE_1),
        (
            Mode::Triangles,
            78,
            4,
            "e1fe1e100e100e100ece1e160e150e140ece1e140e140e140effff0f0aff00250eff070000007687566778a986658968
             9801690000",
        ),
        (Mode::Indices, 15, 4, "d100d12808e11208e11208e11208e11208e11208e1120800000000"),
    ] {
        let of = packed(mode, Filter::None, count, stride);
        let bytes = hex(text);
        let mut refused = 0;
        for cut in 0..bytes.len() {
            refused += usize::from(of.unpack(&bytes[..cut]).is_err());
        }
        assert_eq!(refused, bytes.len(), "{mode:?}: what is cut off is refused");
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut flipped = bytes.clone();
                flipped[at] ^= 1 << bit;
                if let Ok(read) = of.unpack(&flipped) {
                    assert_eq!(read.len(), count * stride);
                }
            }
        }
    }
}
