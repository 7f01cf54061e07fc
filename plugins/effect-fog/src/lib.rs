//! Air that hides what is far, thicker near the ground.

use choreo_plugin::{Effect, Hook, Manifest, Seen};
use glam::{Vec3, Vec4};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("fog", env!("CARGO_PKG_VERSION"), "air that hides what is far, thicker near the ground")
        .number("density", "share of the light lost in a metre, about", 0.08, 0.0..=10.0)
        .number("start", "metres before the camera that are clear", 0.0, 0.0..=1e6)
        .number("height", "metres above which the fog thins", 0.0, -1e4..=1e4)
        .number("falloff", "how fast it thins with height, 1/m; 0: as thick everywhere", 0.0, 0.0..=100.0)
        .flag("sky", "its color is the stage's background, so that things fade into it", true)
        .color("color", "of the fog where sky is false", [0.6, 0.65, 0.7])
});

#[derive(Clone, Copy, Debug, Default)]
pub struct Fog;

impl Effect for Fog {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn hook(&self) -> Hook {
        Hook::Surface
    }

    fn wgsl(&self) -> &str {
        include_str!("fog.wgsl")
    }

    /// Beer–Lambert: exp(−density · metres), the density at the surface's own height.
    fn cpu_surface(&self, color: Vec4, seen: &Seen, p: &[f32; 8]) -> Vec4 {
        let metres = (seen.distance - p[1]).max(0.0);
        let thinned = libm::expf(-p[3] * (seen.world.y - p[2]).max(0.0));
        let left = libm::expf(-p[0] * thinned * metres);
        let fog = if p[4] > 0.5 { seen.background } else { Vec3::new(p[5], p[6], p[7]) };
        (fog + (color.truncate() - fog) * left).extend(color.w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(metres: f32, height: f32, p: [f32; 8]) -> f32 {
        let seen = Seen { distance: metres, world: Vec3::Y * height, ..Seen::default() };
        Fog.cpu_surface(Vec4::ONE, &seen, &p).x
    }

    #[test]
    fn light_is_lost_by_the_metre_and_fog_thins_with_height() {
        let p = [0.1, 2.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(after(2.0, 0.0, p), 1.0, "what is nearer than start is clear");
        assert!((after(12.0, 0.0, p) - libm::expf(-1.0)).abs() < 1e-6, "ten metres of a tenth");
        assert_eq!(after(12.0, 0.5, p), after(12.0, 1.0, p), "as thick up to the height");
        // Two metres above it the density is e⁻¹ of that below.
        assert!((after(12.0, 3.0, p) - libm::expf(-libm::expf(-1.0))).abs() < 1e-6);
        assert!(after(1e9, 0.0, p) == 0.0);
    }

    #[test]
    fn far_things_become_the_sky() {
        let seen = Seen { distance: 1e6, background: Vec3::new(0.1, 0.2, 0.3), ..Seen::default() };
        let p = [0.1, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
        assert_eq!(Fog.cpu_surface(Vec4::ONE, &seen, &p), Vec4::new(0.1, 0.2, 0.3, 1.0));
    }
}
