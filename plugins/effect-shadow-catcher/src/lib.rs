//! A floor of which only the shadows on it are seen.

use choreo_plugin::{Effect, Hook, Manifest, Seen, SurfaceNeeds};
use glam::{Vec3, Vec4};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "shadow_catcher",
        env!("CARGO_PKG_VERSION"),
        "surfaces of which only the shadows on them are seen",
    )
    .number("strength", "1: as dark as on a white matte surface", 1.0, 0.0..=1.0)
    .color("color", "of the shadows", [0.0, 0.0, 0.0])
});

#[derive(Clone, Copy, Debug, Default)]
pub struct ShadowCatcher;

impl Effect for ShadowCatcher {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn hook(&self) -> Hook {
        Hook::Surface
    }

    fn surface_needs(&self, _: &[f32; 8]) -> SurfaceNeeds {
        SurfaceNeeds { normals: true, shadow: true, see_through: true, ..SurfaceNeeds::default() }
    }

    fn wgsl(&self) -> &str {
        include_str!("shadow_catcher.wgsl")
    }

    fn cpu_surface(&self, _: Vec4, seen: &Seen, p: &[f32; 8]) -> Vec4 {
        Vec3::new(p[1], p[2], p[3]).extend(p[0] * seen.shadow)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lit_places_are_not_seen() {
        let p = [0.5, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 0.0];
        let at = |shadow: f32| ShadowCatcher.cpu_surface(Vec4::ONE, &Seen { shadow, ..Seen::default() }, &p);
        assert_eq!(at(0.0).w, 0.0);
        assert_eq!(at(0.8), Vec4::new(0.1, 0.2, 0.3, 0.4));
    }
}
