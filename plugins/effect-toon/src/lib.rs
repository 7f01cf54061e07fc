//! Light in steps, as drawn cartoons have it, on surfaces of any material.

use choreo_plugin::{Effect, Hook, Manifest, Seen};
use glam::Vec4;
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("toon", env!("CARGO_PKG_VERSION"), "light in steps, as drawn cartoons have it")
        .number("steps", "how many", 3.0, 1.0..=32.0)
        .number("softness", "how much of a step is spent on going to the next", 0.1, 0.0..=1.0)
        .number("white", "light that counts as the brightest step", 1.0, 0.01..=100.0)
});

#[derive(Clone, Copy, Debug, Default)]
pub struct Toon;

impl Effect for Toon {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn hook(&self) -> Hook {
        Hook::Surface
    }

    fn wgsl(&self) -> &str {
        include_str!("toon.wgsl")
    }

    /// The brightest channel goes to the middle of its step, the hue stays.
    fn cpu_surface(&self, color: Vec4, _seen: &Seen, p: &[f32; 8]) -> Vec4 {
        let light = color.x.max(color.y).max(color.z).max(1e-6);
        // Steps are even to the eye, which sees about the square root of light.
        let at = (light / p[2]).min(1.0).sqrt() * p[0];
        let step = at.floor().min(p[0] - 1.0);
        let edge = ((at - step - (1.0 - p[1])) / p[1].max(1e-4)).clamp(0.0, 1.0);
        let up = edge * edge * (3.0 - 2.0 * edge);
        let flat = (step + 0.5 + up).min(p[0] - 0.5).max(0.5) / p[0];
        (color.truncate() * (flat * flat * p[2] / light)).extend(color.w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_brightnesses_as_steps_and_the_same_hue() {
        let p = [4.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let mut seen: Vec<f32> = Vec::new();
        for i in 0..1000 {
            let light = i as f32 / 999.0;
            let got = Toon.cpu_surface(Vec4::new(light, light * 0.5, 0.0, 0.25), &Seen::default(), &p);
            assert!((got.y - got.x * 0.5).abs() < 1e-5 && got.w == 0.25);
            if light > 0.001 && !seen.iter().any(|s| (s - got.x).abs() < 1e-4) {
                seen.push(got.x);
            }
        }
        let expected = [0.125f32, 0.375, 0.625, 0.875].map(|v| v * v);
        assert!(seen.len() == 4 && seen.iter().zip(expected).all(|(s, e)| (s - e).abs() < 1e-4), "{seen:?}");
    }

    #[test]
    fn soft_steps_never_jump() {
        let p = [3.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let mut last = 0.0;
        for i in 1..=2000 {
            let got = Toon.cpu_surface(Vec4::splat(i as f32 / 2000.0), &Seen::default(), &p).x;
            assert!(got >= last - 1e-5 && (i == 1 || got - last < 0.01), "{i}: {last} {got}");
            last = got;
        }
    }
}
