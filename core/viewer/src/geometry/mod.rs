//! Geometry between the screen and the world: projection, ray casts against the scene, drags of gizmos.

pub mod gizmo;
pub mod picking;
pub mod projection;
pub mod rig;

/// Rounds a dragged value to a decimal digit that is at most two pixels wide and not below a thousandth. `pixel`: change of the value per pixel.
pub(crate) fn round_to_pixel(value: f64, pixel: f64) -> f64 {
    let digits = (-libm::log10(2.0 * pixel)).ceil().clamp(0.0, 3.0);
    let parts = libm::pow(10.0, digits);
    (value * parts).round() / parts
}

#[cfg(test)]
mod tests {
    use super::round_to_pixel;

    #[test]
    fn a_dragged_value_is_rounded_to_pixel_resolution() {
        for (value, pixel, expected) in [
            (122.443, 1.0, 122.0),
            (119.089, 0.77, 119.0),
            (0.988, 0.014, 0.99),
            (1.502, 0.0094, 1.5),
            (0.98765, 1e-5, 0.988),
            (1234.5, 40.0, 1235.0),
        ] {
            assert_eq!(round_to_pixel(value, pixel), expected, "{value}, {pixel}");
        }
    }
}
