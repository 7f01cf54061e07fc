//! Colors as scripts write them; sRGB to linear; the colors of black-body radiators.

use crate::api_error::ApiError;
use glam::{Vec3, Vec4};

/// Linear value of one sRGB channel, 0 to 1.
pub(crate) fn linear_from_srgb(srgb: f64) -> f32 {
    choreo_asset::linear_from_srgb(srgb) as f32
}

/// Linear RGBA of a CSS name or `#rgb`, `#rrggbb`, `#rrggbbaa`.
pub(crate) fn parse_color(text: &str) -> Result<Vec4, ApiError> {
    choreo_plugin::color::parse(text).map_err(|e| ApiError::new(e.message))
}

/// The range of color temperatures that have a color, in kelvin.
pub const KELVIN_RANGE: (f64, f64) = (1667.0, 25_000.0);

/// Linear sRGB color of a black body, brightest channel 1. Chromaticity of the Planckian locus after Kim et al.,
/// US patent 7 024 034 (2002), valid from 1667 K to 25 000 K; then CIE xyY → XYZ → linear sRGB.
pub(crate) fn black_body_color(t: f64) -> Vec3 {
    let (t1, t2, t3) = (1e3 / t, 1e6 / (t * t), 1e9 / (t * t * t));
    let x = if t <= 4000.0 {
        -0.2661239 * t3 - 0.2343589 * t2 + 0.8776956 * t1 + 0.179910
    } else {
        -3.0258469 * t3 + 2.1070379 * t2 + 0.2226347 * t1 + 0.240390
    };
    let (x2, x3) = (x * x, x * x * x);
    let y = if t <= 2222.0 {
        -1.1063814 * x3 - 1.34811020 * x2 + 2.18555832 * x - 0.20219683
    } else if t <= 4000.0 {
        -0.9549476 * x3 - 1.37418593 * x2 + 2.09137015 * x - 0.16748867
    } else {
        3.0817580 * x3 - 5.87338670 * x2 + 3.75112997 * x - 0.37001483
    };
    let (cx, cy, cz) = (x / y, 1.0, (1.0 - x - y) / y);
    let rgb = [
        3.2404542 * cx - 1.5371385 * cy - 0.4985314 * cz,
        -0.9692660 * cx + 1.8760108 * cy + 0.0415560 * cz,
        0.0556434 * cx - 0.2040259 * cy + 1.0572252 * cz,
    ];
    let brightest = rgb.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    Vec3::from_array(rgb.map(|c| (c.max(0.0) / brightest) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_decoding_meets_values_of_the_standard() {
        assert_eq!(linear_from_srgb(0.0), 0.0);
        assert_eq!(linear_from_srgb(1.0), 1.0);
        // 0.5 → 0.21404114 (IEC 61966-2-1).
        assert!((linear_from_srgb(0.5) - 0.214_041_14).abs() < 1e-7);
    }

    #[test]
    fn black_bodies_are_red_at_1900_k_and_blue_at_12000_k() {
        let (candle, white, sky) =
            (black_body_color(1900.0), black_body_color(6500.0), black_body_color(12000.0));
        assert!(candle.x == 1.0 && candle.z < 0.1);
        // A black body of 6500 K has the chromaticity (0.3135, 0.3237), converted here by the matrix of IEC 61966-2-1.
        assert!(white.abs_diff_eq(Vec3::new(1.0, 0.944, 0.993), 0.005), "{white}");
        assert!(sky.z == 1.0 && sky.x < 0.75);
    }
}
