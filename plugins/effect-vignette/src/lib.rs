//! Darkens the picture towards its corners.

use choreo_plugin::{Effect, Manifest};
use glam::{Vec2, Vec4};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("vignette", env!("CARGO_PKG_VERSION"), "darkens the picture towards its corners")
        .number("strength", "how much of the light the corners lose, 0 = none, 1 = all", 0.35, 0.0..=1.0)
        .number(
            "radius",
            "where the darkening starts, as a part of the distance from the middle to a corner",
            0.5,
            0.0..=0.99,
        )
});

#[derive(Clone, Copy, Debug, Default)]
pub struct Vignette;

impl Effect for Vignette {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn wgsl(&self) -> &str {
        include_str!("vignette.wgsl")
    }

    fn cpu(&self, color: Vec4, uv: Vec2, p: &[f32; 8]) -> Vec4 {
        let from_middle = (uv * 2.0 - 1.0).length() * std::f32::consts::FRAC_1_SQRT_2;
        let x = ((from_middle - p[1]) / (1.0 - p[1])).clamp(0.0, 1.0);
        let light = 1.0 - p[0] * (x * x * (3.0 - 2.0 * x));
        (color.truncate() * light).extend(color.w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const P: [f32; 8] = [0.5, 0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

    #[test]
    fn middle_is_untouched_corners_lose_the_strength_and_alpha_stays() {
        let white = Vec4::new(1.0, 1.0, 1.0, 0.5);
        assert_eq!(Vignette.cpu(white, Vec2::splat(0.5), &P), white);
        for corner in [Vec2::ZERO, Vec2::ONE, Vec2::X, Vec2::Y] {
            let got = Vignette.cpu(white, corner, &P);
            assert!((got.x - 0.5).abs() < 1e-6 && got.w == 0.5, "{corner}: {got}");
        }
    }

    #[test]
    fn light_falls_steadily_from_the_middle() {
        let mut last = f32::INFINITY;
        for i in 0..=100 {
            let v = Vignette.cpu(Vec4::ONE, Vec2::splat(0.5 + 0.005 * i as f32), &P).x;
            assert!(v <= last);
            last = v;
        }
    }
}
