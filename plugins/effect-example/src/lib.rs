//! Fades a picture to one colour's shades. The effect to copy for a look of your own.

use choreo_plugin::{Effect, Manifest};
use glam::{Vec2, Vec3, Vec4};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("example", env!("CARGO_PKG_VERSION"), "fades to one colour's shades")
        .number("amount", "0 = untouched, 1 = only shades", 1.0, 0.0..=1.0)
        .number("warmth", "-1 = blue, 1 = brown", 0.5, -1.0..=1.0)
});

#[derive(Clone, Copy, Debug, Default)]
pub struct Example;

impl Effect for Example {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn wgsl(&self) -> &str {
        include_str!("example.wgsl")
    }

    fn cpu(&self, color: Vec4, _uv: Vec2, p: &[f32; 8]) -> Vec4 {
        let grey = 0.2126 * color.x + 0.7152 * color.y + 0.0722 * color.z;
        let shade = Vec3::new(grey * (1.0 + 0.2 * p[1]), grey, grey * (1.0 - 0.2 * p[1]));
        (color.truncate() * (1.0 - p[0]) + shade * p[0]).extend(color.w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_wgsl_effect::WgslEffect;

    /// The text that the GPU runs, evaluated: its manifest and its pixels are those of the twin.
    #[test]
    fn the_wgsl_is_its_twin() {
        let wgsl = WgslEffect::from_text("example.wgsl", Example.wgsl()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(wgsl.manifest().options, MANIFEST.options);
        for i in 0..1000u16 {
            let t = f32::from(i) / 999.0;
            let color = Vec4::new(t, 1.0 - t, 3.0 * t * t, 1.0);
            let p = [1.0 - t, 2.0 * t - 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            assert_eq!(wgsl.cpu(color, Vec2::ZERO, &p), Example.cpu(color, Vec2::ZERO, &p), "{t}");
        }
    }

    #[test]
    fn no_amount_changes_nothing_and_grey_stays_as_bright() {
        let none = [0.0; 8];
        let color = Vec4::new(0.1, 0.2, 0.3, 0.5);
        assert_eq!(Example.cpu(color, Vec2::ZERO, &none), color);
        let all = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let white = Example.cpu(Vec4::ONE, Vec2::ZERO, &all);
        assert!(white.abs_diff_eq(Vec4::ONE, 1e-6), "{white}");
    }
}
