//! Filters of decompressed attributes: unit vectors, rotations, floats and colors from fewer bits.

use super::Filter;

pub(super) fn apply(filter: Filter, stride: usize, bytes: &mut [u8]) {
    match (filter, stride) {
        (Filter::None, _) => {}
        (Filter::Octahedral, 4) => {
            map_quads_u8(bytes, |v| decode_octahedral(v.map(|c| f32::from(c as i8)), 127.0))
        }
        (Filter::Octahedral, _) => {
            map_quads_u16(bytes, |v| decode_octahedral(v.map(|c| f32::from(c as i16)), 32767.0))
        }
        (Filter::Quaternion, _) => map_quads_u16(bytes, |v| decode_quaternion(v.map(|c| c as i16))),
        (Filter::Exponential, _) => {
            for number in bytes.as_chunks_mut::<4>().0 {
                *number = decode_exponential(u32::from_le_bytes(*number)).to_le_bytes();
            }
        }
        (Filter::Color, 4) => map_quads_u8(bytes, |[y, co, cg, a]| {
            decode_ycocg(i32::from(y), [co, cg].map(|c| i32::from(c as i8)), i32::from(a), 255.0)
        }),
        (Filter::Color, _) => map_quads_u16(bytes, |[y, co, cg, a]| {
            decode_ycocg(i32::from(y), [co, cg].map(|c| i32::from(c as i16)), i32::from(a), 65535.0)
        }),
    }
}

fn map_quads_u8(bytes: &mut [u8], f: impl Fn([u8; 4]) -> [i32; 4]) {
    for quad in bytes.as_chunks_mut::<4>().0 {
        *quad = f(*quad).map(|c| c as u8);
    }
}

fn map_quads_u16(bytes: &mut [u8], f: impl Fn([u16; 4]) -> [i32; 4]) {
    for quad in bytes.as_chunks_mut::<8>().0 {
        let [a, b, c, d, e, g, h, i] = *quad;
        let [x, y, z, w] =
            f([[a, b], [c, d], [e, g], [h, i]].map(u16::from_le_bytes)).map(|c| (c as u16).to_le_bytes());
        *quad = [x[0], x[1], y[0], y[1], z[0], z[1], w[0], w[1]];
    }
}

/// Rounds to the nearest integer, halves away from zero. Values out of range saturate, and NaN becomes 0 (`as`).
fn rounded(v: f32) -> i32 {
    (v + if v >= 0.0 { 0.5 } else { -0.5 }) as i32
}

/// Octahedral normal: x, y on the octahedron |x| + |y| + |z| = one. The fourth component stays.
fn decode_octahedral([x, y, one, w]: [f32; 4], max: f32) -> [i32; 4] {
    let z = one - x.abs() - y.abs();
    // The lower half was folded outwards.
    let fold = z.min(0.0);
    let x = x + if x >= 0.0 { fold } else { -fold };
    let y = y + if y >= 0.0 { fold } else { -fold };
    let scale = max / (x * x + y * y + z * z).sqrt();
    // A vector of length zero has no direction: its NaN components become 0.
    [rounded(x * scale), rounded(y * scale), rounded(z * scale), w as i32]
}

/// Quaternion from its three smaller components, in units of 1/√2 over the upper bits of the fourth value. The lower two bits
/// give the index of the omitted component.
fn decode_quaternion([x, y, z, scale_and_place]: [i16; 4]) -> [i32; 4] {
    let one = f32::from(scale_and_place | 3);
    let [x, y, z] = [x, y, z].map(f32::from);
    let missing = (one * one * 2.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let scale = 32767.0 * std::f32::consts::FRAC_1_SQRT_2 / one;
    let mut out = [0; 4];
    let place = (scale_and_place & 3) as usize;
    for (i, v) in [missing, x, y, z].into_iter().enumerate() {
        out[(place + i) & 3] = rounded(v * scale);
    }
    out
}

/// Float m · 2^e from a signed 24-bit mantissa and a signed 8-bit exponent.
fn decode_exponential(bits: u32) -> f32 {
    let mantissa = (bits << 8) as i32 >> 8;
    libm::ldexp(f64::from(mantissa), bits as i32 >> 24) as f32
}

/// Color from YCoCg. The highest set bit of alpha gives the number of bits in use.
fn decode_ycocg(y: i32, [co, cg]: [i32; 2], a: i32, max: f32) -> [i32; 4] {
    let mut ones = a;
    for shift in [1, 2, 4, 8] {
        ones |= ones >> shift;
    }
    let alpha = (a << 1 & ones) | (a & 1);
    let scale = max / ones as f32;
    [y + co - cg, y + cg, y - co - cg, alpha].map(|c| (c as f32 * scale + 0.5) as i32)
}
