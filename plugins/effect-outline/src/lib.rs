//! A line around actors, as wide in the picture wherever they stand.

use choreo_plugin::{Effect, Hook, Manifest, Shell};
use glam::Vec3;
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("outline", env!("CARGO_PKG_VERSION"), "a line around actors, as wide wherever they stand")
        .number("width", "pixels of the picture", 2.0, 0.0..=64.0)
        .color("color", "of the line", [0.0; 3])
        .number("light", "0: the color as it is, 1: times what the surface shows", 0.0, 0.0..=1.0)
});

#[derive(Clone, Copy, Debug, Default)]
pub struct Outline;

impl Effect for Outline {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn hook(&self) -> Hook {
        Hook::Shell
    }

    fn shell(&self, p: &[f32; 8]) -> Option<Shell> {
        Some(Shell { width: p[0], color: Vec3::new(p[1], p[2], p[3]), lighting_mix: p[4] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_come_in_the_order_of_the_manifest() {
        let names: Vec<&str> = MANIFEST.options.iter().map(|o| o.name.as_str()).collect();
        assert_eq!(names, ["width", "color_r", "color_g", "color_b", "light"]);
        let shell = Outline.shell(&[3.0, 0.25, 0.5, 0.75, 1.0, 0.0, 0.0, 0.0]).unwrap();
        let expected = Shell { width: 3.0, color: Vec3::new(0.25, 0.5, 0.75), lighting_mix: 1.0 };
        assert_eq!(shell, expected);
        assert!(Outline.hook().of_actors());
    }
}
