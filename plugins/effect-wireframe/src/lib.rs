//! The edges of triangles as lines of one pixel.

use choreo_plugin::{Effect, Hook, Manifest};
use glam::Vec3;
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("wireframe", env!("CARGO_PKG_VERSION"), "the edges of triangles as lines of one pixel")
        .color("color", "of the lines", [0.02, 0.02, 0.02])
});

#[derive(Clone, Copy, Debug, Default)]
pub struct Wireframe;

impl Effect for Wireframe {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn hook(&self) -> Hook {
        Hook::Shell
    }

    fn edges(&self, p: &[f32; 8]) -> Option<Vec3> {
        Some(Vec3::new(p[0], p[1], p[2]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_the_color_and_no_hull() {
        let p = [0.25, 0.5, 0.75, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(Wireframe.edges(&p), Some(Vec3::new(0.25, 0.5, 0.75)));
        assert_eq!(Wireframe.shell(&p), None);
    }
}
