//! Conversion of the values of FBX cameras and lights to those of an asset. A camera has a field of view, given in one of four ways, or the
//! width of an orthographic view. Computed with libm from the numbers of the file, so that every machine gets the same bits; the
//! angles of ufbx come from the C library.

use std::f64::consts::PI;
use ufbx::{ApertureMode, Camera, ProjectionMode};

const RADIANS: f64 = PI / 180.0;
const MM_PER_INCH: f64 = 25.4;

/// How a property of a camera gives its full vertical angle (radians), or the height of its view (metres).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ValueConversion {
    /// Proportional to the value.
    Proportional(f64),
    /// A horizontal angle in degrees, for images with this ratio of width to height.
    HorizontalAngle(f64),
    /// A focal length in millimetres, with this half height of the film in millimetres.
    FocalLength(f64),
}

impl ValueConversion {
    /// The value, and its derivative with respect to the property.
    pub(crate) fn at(self, v: f64) -> (f64, f64) {
        match self {
            ValueConversion::Proportional(factor) => (v * factor, factor),
            ValueConversion::HorizontalAngle(aspect) => {
                let wide = libm::tan(v * (RADIANS * 0.5));
                let high = wide / aspect;
                (2.0 * libm::atan(high), RADIANS * (1.0 + wide * wide) / (aspect * (1.0 + high * high)))
            }
            ValueConversion::FocalLength(half) => {
                (2.0 * libm::atan(half / v), -2.0 * half / (v * v + half * half))
            }
        }
    }

    /// Whether the value is proportional to the property, so that a cubic of one is a cubic of the other.
    pub(crate) fn is_proportional(self) -> bool {
        matches!(self, ValueConversion::Proportional(_))
    }
}

/// The property that the projection depends on, the function of it, and its value at rest.
pub(crate) fn of_camera(camera: &Camera) -> (&'static str, ValueConversion, f64) {
    if camera.projection_mode == ProjectionMode::Orthographic {
        let zoom = camera.element.props.find_prop("OrthoZoom").map_or(1.0, |p| p.value_vec4.x);
        let zoom = if zoom == 0.0 { 1.0 } else { zoom };
        return ("OrthoZoom", ValueConversion::Proportional(camera.orthographic_size.y / zoom), zoom);
    }
    match camera.aperture_mode {
        ApertureMode::Vertical => {
            ("FieldOfView", ValueConversion::Proportional(RADIANS), camera.field_of_view_deg.y)
        }
        ApertureMode::HorizontalAndVertical => {
            ("FieldOfViewY", ValueConversion::Proportional(RADIANS), camera.field_of_view_deg.y)
        }
        ApertureMode::Horizontal => {
            ("FieldOfView", ValueConversion::HorizontalAngle(camera.aspect_ratio), camera.field_of_view_deg.x)
        }
        ApertureMode::FocalLength => {
            let half = camera.aperture_size_inch.y * (0.5 * MM_PER_INCH);
            ("FocalLength", ValueConversion::FocalLength(half), camera.focal_length_mm)
        }
    }
}

/// All properties that may define a camera's field of view. Those that [`of_camera`] does not return have no effect.
pub(crate) const PROJECTION_PROPERTIES: [&str; 5] =
    ["FieldOfView", "FieldOfViewX", "FieldOfViewY", "FocalLength", "OrthoZoom"];

#[cfg(test)]
mod tests {
    use super::*;

    /// An image twice as wide as high, 90° across: atan ½ above and below the axis. 24 mm of film 12 mm away: 90°.
    #[test]
    fn field_of_view_equals_that_of_right_triangles() {
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "{a} {b}");
        near(ValueConversion::HorizontalAngle(2.0).at(90.0).0, 2.0 * 0.463_647_609_000_806_1);
        near(ValueConversion::FocalLength(12.0).at(12.0).0, PI / 2.0);
        near(ValueConversion::Proportional(RADIANS).at(60.0).0, PI / 3.0);
    }

    #[test]
    fn derivatives_equal_differences_of_the_values() {
        for (conversion, v) in [
            (ValueConversion::HorizontalAngle(1.6), 75.0),
            (ValueConversion::FocalLength(12.0), 35.0),
            (ValueConversion::Proportional(0.3), 2.0),
        ] {
            let step = 1e-5;
            let by_steps = (conversion.at(v + step).0 - conversion.at(v - step).0) / (2.0 * step);
            assert!(
                (conversion.at(v).1 - by_steps).abs() < 1e-9,
                "{conversion:?} {} {by_steps}",
                conversion.at(v).1
            );
        }
    }
}
