//! Light that spills over around what is bright, as in a lens.

use choreo_plugin::{Effect, Hook, Manifest, Pictures};
use glam::{Vec3, Vec4};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("bloom", env!("CARGO_PKG_VERSION"), "light that spills over around what is bright")
        .number("strength", "how much of it is added", 0.3, 0.0..=10.0)
        .number("threshold", "light above which it spills", 0.9, 0.0..=100.0)
        .number("radius", "how far, as a share of the picture's height", 0.03, 0.001..=0.2)
});

/// To each side; the eye does not see the gaps of a wider blur of what is blurred the other way too.
const TAPS: i32 = 16;

#[derive(Clone, Copy, Debug, Default)]
pub struct Bloom;

/// What of a colour is above the threshold, its hue kept.
fn bright(c: Vec4, threshold: f32) -> Vec3 {
    let c = c.truncate().max(Vec3::ZERO).min(Vec3::splat(1000.0));
    let most = c.max_element();
    c * ((most - threshold).max(0.0) / most.max(1e-6))
}

impl Effect for Bloom {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn hook(&self) -> Hook {
        Hook::Picture
    }

    fn passes(&self) -> u32 {
        2
    }

    fn wgsl(&self) -> &str {
        include_str!("bloom.wgsl")
    }

    /// A Gaussian across of what is bright, then one down, added to the picture.
    fn cpu_picture(&self, pictures: &Pictures, [x, y]: [i32; 2], pass: u32, p: &[f32; 8]) -> Vec4 {
        let Pictures { now: picture, original, .. } = pictures;
        // Three standard deviations fit the taps; whole pixels apart.
        let step = (p[2] * picture.size[1] as f32 / TAPS as f32).max(1.0);
        let mut sum = Vec3::ZERO;
        let mut weights = 0.0;
        for i in -TAPS..=TAPS {
            let t = i as f32 * (3.0 / TAPS as f32);
            let weight = libm::expf(-0.5 * t * t);
            let away = (i as f32 * step + 0.5).floor() as i32;
            sum += weight
                * match pass {
                    0 => bright(picture.at(x + away, y), p[1]),
                    _ => picture.at(x, y + away).truncate(),
                };
            weights += weight;
        }
        let blurred = sum / weights;
        if pass == 0 {
            return blurred.extend(1.0);
        }
        let here = original.at(x, y);
        (here.truncate() + blurred * p[0]).extend(here.w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_plugin::Pixels;

    fn run(rgba: &[Vec4], size: [u32; 2], p: &[f32; 8]) -> Vec<Vec4> {
        let all = || (0..size[1] as i32).flat_map(move |y| (0..size[0] as i32).map(move |x| [x, y]));
        let original = Pixels { size, rgba };
        let first = Pictures { now: original, original, before: &[] };
        let across: Vec<Vec4> = all().map(|at| Bloom.cpu_picture(&first, at, 0, p)).collect();
        let second = Pictures { now: Pixels { size, rgba: &across }, ..first };
        all().map(|at| Bloom.cpu_picture(&second, at, 1, p)).collect()
    }

    const P: [f32; 8] = [0.5, 1.0, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0];

    #[test]
    fn what_is_not_bright_stays_as_it_is() {
        let grey = vec![Vec4::new(0.9, 0.5, 0.2, 1.0); 40 * 30];
        assert_eq!(run(&grey, [40, 30], &P), grey);
    }

    #[test]
    fn spilled_light_is_the_strength_of_what_is_above_the_threshold() {
        let mut rgba = vec![Vec4::W; 121 * 121];
        rgba[60 * 121 + 60] = Vec4::new(5.0, 2.5, 0.0, 1.0);
        let out = run(&rgba, [121, 121], &P);
        let sum: Vec4 = out.iter().zip(&rgba).map(|(a, b)| *a - *b).sum();
        // Of 5 above 1 is 4, times ½; green half of it.
        assert!((sum.x - 2.0).abs() < 1e-3 && (sum.y - 1.0).abs() < 1e-3 && sum.z == 0.0, "{sum}");
        let at = |x: usize, y: usize| out[y * 121 + x].x;
        assert!(
            at(63, 60) > at(70, 60) && (at(63, 60) - at(60, 63)).abs() < 1e-6,
            "round, and less with distance"
        );
    }
}
