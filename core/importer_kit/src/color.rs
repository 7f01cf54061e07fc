//! Conversion of colors of files to linear.

/// Linear value of one channel of an sRGB color, 0 to 1, computed in f64.
pub fn linear_from_srgb(v: f32) -> f32 {
    choreo_asset::linear_from_srgb(f64::from(v)) as f32
}
