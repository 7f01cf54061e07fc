//! Decomposition of transforms of texture coordinates.

use choreo_plugin::glam::{Affine2, Vec2};

/// A transform of texture coordinates as KHR_texture_transform has it: offset · rotation · scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvParts {
    pub offset: Vec2,
    pub rotation: f32,
    pub scale: Vec2,
}

impl UvParts {
    /// Decomposes a transform; shear is lost.
    pub fn of(a: &Affine2) -> UvParts {
        let (x, y) = (a.matrix2.x_axis, a.matrix2.y_axis);
        let rotation = libm::atan2f(-x.y, x.x);
        let (sin, cos) = (libm::sinf(rotation), libm::cosf(rotation));
        let scale = Vec2::new(x.length(), y.dot(Vec2::new(sin, cos)));
        UvParts { offset: a.translation, rotation, scale }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_of_texture_coordinates_are_decomposed() {
        let parts = UvParts { offset: Vec2::new(0.25, -0.5), rotation: 0.7, scale: Vec2::new(2.0, -3.0) };
        let whole = choreo_plugin::stage::uv_transform(parts.offset, parts.rotation, parts.scale);
        let again = UvParts::of(&whole);
        let error = (again.offset - parts.offset).abs() + (again.scale - parts.scale).abs();
        assert!(error.max_element() < 1e-6 && (again.rotation - 0.7).abs() < 1e-6, "{again:?}");
    }
}
