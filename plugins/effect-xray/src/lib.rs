//! Actors of glass: edges glow, what faces the viewer is seen through.

use choreo_plugin::{Effect, Hook, Manifest, Seen, SurfaceNeeds};
use glam::{Vec3, Vec4};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("xray", env!("CARGO_PKG_VERSION"), "surfaces that are seen through but for their edges")
        .number("opacity", "of what faces the viewer", 0.08, 0.0..=1.0)
        .number("power", "how narrow the edges are", 2.0, 0.1..=32.0)
        .color("color", "of the edges", [0.25, 0.75, 1.0])
});

#[derive(Clone, Copy, Debug, Default)]
pub struct Xray;

impl Effect for Xray {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn hook(&self) -> Hook {
        Hook::Surface
    }

    fn surface_needs(&self, _: &[f32; 8]) -> SurfaceNeeds {
        SurfaceNeeds { normals: true, see_through: true, ..SurfaceNeeds::default() }
    }

    fn wgsl(&self) -> &str {
        include_str!("xray.wgsl")
    }

    fn cpu_surface(&self, _: Vec4, seen: &Seen, p: &[f32; 8]) -> Vec4 {
        let edge = (1.0 - seen.facing.abs()).clamp(0.0, 1.0);
        let share = libm::powf(edge.max(1e-6), p[1]);
        Vec3::new(p[2], p[3], p[4]).extend(p[0] + (1.0 - p[0]) * share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_solid_and_the_middle_is_not() {
        let alpha = |facing: f32| {
            let seen = Seen { facing, ..Seen::default() };
            Xray.cpu_surface(Vec4::ONE, &seen, &[0.25, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).w
        };
        assert!((alpha(0.0) - 1.0).abs() < 1e-6 && (alpha(1.0) - 0.25).abs() < 1e-6);
        assert_eq!(alpha(0.5), alpha(-0.5));
        assert!((alpha(0.5) - (0.25 + 0.75 * 0.25)).abs() < 1e-6);
    }
}
