//! The transfer function of sRGB (IEC 61966-2-1). libm's power gives the same bits on every machine.

/// Decodes an sRGB value to a linear one, 0 to 1.
pub fn linear_from_srgb(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
}

/// [`linear_from_srgb`] in f32: faster, but the last bit may differ.
pub fn linear_from_srgb_f32(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { libm::powf((v + 0.055) / 1.055, 2.4) }
}

/// Encodes a linear value as sRGB, 0 to 1.
pub fn srgb_from_linear(v: f64) -> f64 {
    if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * libm::pow(v, 1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_conversion_matches_known_values_and_its_inverse() {
        assert_eq!((linear_from_srgb(0.0), linear_from_srgb(1.0)), (0.0, 1.0));
        assert!((linear_from_srgb(0.5) - 0.214_041_140_48).abs() < 1e-9);
        assert!((linear_from_srgb_f32(0.5) - 0.214_041_14).abs() < 1e-7);
        assert!((srgb_from_linear(linear_from_srgb(0.3)) - 0.3).abs() < 1e-12);
    }
}
