//! Conversion of colors of files to linear.

/// Linear value of one channel of an sRGB color, 0 to 1, computed in f64.
pub fn linear_from_srgb(v: f32) -> f32 {
    choreo_asset::linear_from_srgb(f64::from(v)) as f32
}

/// Linear value of one channel of a color of a file, at least 0. `srgb`: whether values up to 1 are sRGB.
pub fn linear_channel(value: f32, srgb: bool) -> f32 {
    let value = value.max(0.0);
    if srgb && value <= 1.0 { linear_from_srgb(value) } else { value }
}
