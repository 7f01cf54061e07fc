//! Colors of files, to linear.

/// IEC 61966-2-1, one channel, 0 to 1.
pub fn linear_from_srgb(v: f32) -> f32 {
    let v = f64::from(v);
    let linear = if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) };
    linear as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_middle() {
        assert_eq!((linear_from_srgb(0.0), linear_from_srgb(1.0)), (0.0, 1.0));
        assert!((linear_from_srgb(0.5) - 0.214_041_14).abs() < 1e-7);
    }
}
