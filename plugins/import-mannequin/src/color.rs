//! Colors as people write them.

use choreo_asset::linear_from_srgb_f32;
use glam::Vec3;

/// sRGB, chosen to look well together under a warm key light.
const NAMED: [(&str, u32); 14] = [
    ("ivory", 0xe9e2d3),
    ("white", 0xf4f4f4),
    ("grey", 0x8b9096),
    ("graphite", 0x2c3036),
    ("black", 0x17181a),
    ("coral", 0xf2694b),
    ("red", 0xc8352f),
    ("amber", 0xf2a93b),
    ("lime", 0x9bc53d),
    ("green", 0x3f8f5b),
    ("teal", 0x1d9a94),
    ("aqua", 0x8fe8ff),
    ("blue", 0x3b6fd4),
    ("violet", 0x7d5bc4),
];

pub fn names() -> String {
    NAMED.map(|(name, _)| name).join(", ")
}

/// "#rrggbb" or a name, as linear RGB.
pub fn linear(text: &str) -> Option<Vec3> {
    let code = match text.strip_prefix('#') {
        Some(hex) if hex.len() == 6 && hex.bytes().all(|b| b.is_ascii_hexdigit()) => {
            u32::from_str_radix(hex, 16).ok()?
        }
        Some(_) => return None,
        None => NAMED.iter().find(|(name, _)| name.eq_ignore_ascii_case(text))?.1,
    };
    let channel = |shift: u32| linear_from_srgb_f32(((code >> shift) & 255) as f32 / 255.0);
    Some(Vec3::new(channel(16), channel(8), channel(0)))
}
