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
        .flag("sky", "its color is the stage's background or sky, so that things fade into it", true)
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

    /// The sky has the background's own colour: nothing to change.
    fn of_background(&self, p: &[f32; 8]) -> bool {
        p[4] <= 0.5
    }

    /// Beer–Lambert: exp(−∫ density ds), summed in closed form along the way to the viewer (as Wenzel, "Real-time
    /// Atmospheric Effects in Games", SIGGRAPH 2006 course, but with as much fog everywhere below the height).
    fn cpu_surface(&self, color: Vec4, seen: &Seen, p: &[f32; 8]) -> Vec4 {
        let metres = (seen.distance - p[1]).max(0.0);
        let from = seen.viewer.y + (seen.world.y - seen.viewer.y) * (p[1] / seen.distance.max(1e-6)).min(1.0);
        let left = libm::expf(-p[0] * metres * mean_density(from - p[2], seen.world.y - p[2], p[3]));
        let fog = if p[4] > 0.5 { seen.background } else { Vec3::new(p[5], p[6], p[7]) };
        (fog + (color.truncate() - fog) * left).extend(color.w)
    }
}

/// Mean along a straight way between two heights above the one from which the fog thins.
fn mean_density(from: f32, to: f32, falloff: f32) -> f32 {
    let rise = to - from;
    // Their difference would be rounding only.
    if rise.abs() * falloff < 0.02 {
        return libm::expf(-falloff * ((from + to) * 0.5).max(0.0));
    }
    let up_to = |y: f32| match y > 0.0 {
        true => (1.0 - libm::expf(-falloff * y)) / falloff,
        false => y,
    };
    (up_to(to) - up_to(from)) / rise
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_plugin::BACKGROUND_DISTANCE;

    /// Looked at from `eye` metres up.
    fn after(metres: f32, eye: f32, height: f32, p: [f32; 8]) -> f32 {
        let seen =
            Seen { distance: metres, world: Vec3::Y * height, viewer: Vec3::Y * eye, ..Seen::default() };
        Fog.cpu_surface(Vec4::ONE, &seen, &p).x
    }

    #[test]
    fn light_is_lost_by_the_metre_and_fog_thins_with_height() {
        let p = [0.1, 2.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(after(2.0, 0.0, 0.0, p), 1.0, "what is nearer than start is clear");
        assert!((after(12.0, 0.0, 0.0, p) - libm::expf(-1.0)).abs() < 1e-6, "ten metres of a tenth");
        assert_eq!(after(12.0, 0.5, 0.5, p), after(12.0, 1.0, 1.0, p), "as thick up to the height");
        // Two metres above it the density is e⁻¹ of that below.
        assert!((after(12.0, 3.0, 3.0, p) - libm::expf(-libm::expf(-1.0))).abs() < 1e-6);
        assert!(after(1e9, 0.0, 0.0, p) == 0.0);
    }

    #[test]
    fn along_slopes_it_is_the_sum_of_small_steps() {
        for (eye, height, metres, start, thins, falloff) in [
            (1.6, 0.0, 20.0, 0.0, 0.0, 0.5),
            (0.2, 9.0, 15.0, 3.0, 1.0, 0.8),
            (30.0, -2.0, 60.0, 5.0, 2.0, 0.3),
            (2.0, 2.01, 8.0, 0.0, 0.0, 2.0),
            (1.0, 4.0, 10.0, 0.0, 0.0, 0.0),
        ] {
            let p = [0.1, start, thins, falloff, 0.0, 0.0, 0.0, 0.0];
            let steps = 200_000;
            let mut depth = 0.0;
            for i in 0..steps {
                let along = (f64::from(i) + 0.5) / f64::from(steps);
                let at = f64::from(start) + (f64::from(metres) - f64::from(start)) * along;
                let y = f64::from(eye) + (f64::from(height) - f64::from(eye)) * at / f64::from(metres);
                let density = 0.1 * libm::exp(-f64::from(falloff) * (y - f64::from(thins)).max(0.0));
                depth += density * (f64::from(metres) - f64::from(start)) / f64::from(steps);
            }
            let got = f64::from(after(metres, eye, height, p));
            assert!((got - libm::exp(-depth)).abs() < 2e-4, "{got} for {}", libm::exp(-depth));
        }
    }

    #[test]
    fn the_sky_is_clear_above_and_lost_at_the_horizon() {
        let p = [0.1, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0];
        let sky = |up: f32| after(BACKGROUND_DISTANCE, 0.0, up * BACKGROUND_DISTANCE, p);
        // Straight up: density / falloff metres of it in all.
        assert!((sky(1.0) - libm::expf(-0.2)).abs() < 1e-5);
        assert!((sky(0.25) - libm::expf(-0.8)).abs() < 1e-5);
        assert!(sky(0.0) == 0.0 && sky(-0.5) == 0.0);
        assert!(Fog.of_background(&p) && !Fog.of_background(&[0.1, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]));
    }

    #[test]
    fn far_things_become_the_sky() {
        let seen = Seen { distance: 1e6, background: Vec3::new(0.1, 0.2, 0.3), ..Seen::default() };
        let p = [0.1, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
        assert_eq!(Fog.cpu_surface(Vec4::ONE, &seen, &p), Vec4::new(0.1, 0.2, 0.3, 1.0));
    }
}
