//! Light that spills over around what is bright, as in a lens.

use choreo_plugin::{Effect, Hook, Manifest, Pictures};
use glam::{Vec2, Vec3, Vec4};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("bloom", env!("CARGO_PKG_VERSION"), "light that spills over around what is bright")
        .number("strength", "how much of it is added", 0.3, 0.0..=10.0)
        .number("threshold", "light above which it spills", 0.9, 0.0..=100.0)
        .number("radius", "how far, as a share of the picture's height", 0.03, 0.001..=0.2)
});

/// Taps to each side: three standard deviations.
const TAPS: i32 = 8;
const PASSES: u32 = 4;

#[derive(Clone, Copy, Debug, Default)]
pub struct Bloom;

/// How many times smaller, each way, the picture is in which the light is spread: so much that the taps reach far enough.
/// What is bright is spread over pixels much larger than these, and no finer picture would show.
fn shrink(height: u32, p: &[f32; 8]) -> u32 {
    let mut shrink = 1;
    while p[2] * height as f32 > (TAPS as u32 * shrink) as f32 && shrink < height {
        shrink *= 2;
    }
    shrink
}

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
        PASSES
    }

    fn shrink(&self, _pass_number: u32, size: [u32; 2], p: &[f32; 8]) -> u32 {
        shrink(size[1], p)
    }

    fn wgsl(&self) -> &str {
        include_str!("bloom.wgsl")
    }

    /// What is bright, smaller; a Gaussian across, then one down; larger again and added to the picture.
    fn cpu_picture(&self, pictures: &Pictures, [x, y]: [i32; 2], pass: u32, p: &[f32; 8]) -> Vec4 {
        let Pictures { now: picture, original, .. } = pictures;
        let whole = original.size;
        let shrink = shrink(whole[1], p) as i32;
        if pass == 0 {
            let places =
                (0..shrink * shrink).map(|i| picture.at(x * shrink + i % shrink, y * shrink + i / shrink));
            let sum = places.fold(Vec3::ZERO, |sum, c| sum + bright(c, p[1]));
            return (sum / (shrink * shrink) as f32).extend(1.0);
        }
        if pass + 1 < PASSES {
            let along = if pass == 1 { [1, 0] } else { [0, 1] };
            let sigma = (p[2] * whole[1] as f32 / (3.0 * shrink as f32)).max(0.1);
            let at = |i: i32| picture.at(x + i * along[0], y + i * along[1]).truncate();
            // exp(−i² / 2σ²), each from the one before.
            let mut step = libm::expf(-0.5 / (sigma * sigma));
            let steeper = step * step;
            let (mut sum, mut weight, mut weights) = (at(0), 1.0, 1.0);
            for i in 1..=TAPS {
                weight *= step;
                step *= steeper;
                sum += weight * (at(i) + at(-i));
                weights += 2.0 * weight;
            }
            return (sum / weights).extend(1.0);
        }
        // Between the middles of four pixels of the smaller picture.
        let place = (Vec2::new(x as f32, y as f32) + 0.5) / shrink as f32 - 0.5;
        let corner = place.floor();
        let f = place - corner;
        let at = |dx: i32, dy: i32| picture.at(corner.x as i32 + dx, corner.y as i32 + dy).truncate();
        let above = at(0, 0) * (1.0 - f.x) + at(1, 0) * f.x;
        let below = at(0, 1) * (1.0 - f.x) + at(1, 1) * f.x;
        let here = original.at(x, y);
        (here.truncate() + (above * (1.0 - f.y) + below * f.y) * p[0]).extend(here.w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_plugin::Pixels;

    fn run(rgba: &[Vec4], size: [u32; 2], p: &[f32; 8]) -> Vec<Vec4> {
        let original = Pixels { size, rgba };
        let (mut now, mut now_size) = (rgba.to_vec(), size);
        for pass in 0..PASSES {
            let shrink = if pass + 1 < PASSES { Bloom.shrink(pass, size, p) } else { 1 };
            let [w, h] = size.map(|s| s.div_ceil(shrink));
            let all = (0..h as i32).flat_map(|y| (0..w as i32).map(move |x| [x, y]));
            let pictures = Pictures { now: Pixels { size: now_size, rgba: &now }, original, before: &[] };
            let next = all.map(|at| Bloom.cpu_picture(&pictures, at, pass, p)).collect();
            (now, now_size) = (next, [w, h]);
        }
        now
    }

    const P: [f32; 8] = [0.5, 1.0, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0];

    #[test]
    fn what_is_not_bright_stays_as_it_is() {
        let grey = vec![Vec4::new(0.9, 0.5, 0.2, 1.0); 40 * 30];
        assert_eq!(run(&grey, [40, 30], &P), grey);
    }

    #[test]
    fn spilled_light_is_the_strength_of_what_is_above_the_threshold() {
        // Near enough for full size, and so far that it is spread in a picture four times smaller.
        for (radius, shrink) in [(0.02, 1), (0.2, 4)] {
            let p = [0.5, 1.0, radius, 0.0, 0.0, 0.0, 0.0, 0.0];
            assert_eq!(Bloom.shrink(0, [121, 121], &p), shrink);
            let mut rgba = vec![Vec4::W; 121 * 121];
            rgba[61 * 121 + 61] = Vec4::new(5.0, 2.5, 0.0, 1.0);
            let out = run(&rgba, [121, 121], &p);
            let sum: Vec4 = out.iter().zip(&rgba).map(|(a, b)| *a - *b).sum();
            // Of 5 above 1 is 4, times ½; green half of it.
            assert!((sum.x - 2.0).abs() < 2e-3 && (sum.y - 1.0).abs() < 1e-3 && sum.z == 0.0, "{sum}");
            let at = |x: usize, y: usize| out[y * 121 + x].x;
            assert!((at(64, 61) - at(61, 64)).abs() < 1e-6, "round");
            assert!(at(64, 61) > at(74, 61) && at(64, 61) > 0.0, "less with distance");
        }
    }

    #[test]
    fn a_smaller_picture_spreads_light_as_the_gaussian_itself() {
        let p = [1.0, 0.5, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0];
        let size = [120, 120];
        let bright = |x: i32, y: i32| (40..60).contains(&x) && (50..80).contains(&y);
        let color = |i: i32| if bright(i % 120, i / 120) { Vec4::new(2.5, 2.5, 2.5, 1.0) } else { Vec4::W };
        let rgba: Vec<Vec4> = (0..120 * 120).map(color).collect();
        let out = run(&rgba, size, &p);
        // Of a box, in closed form: differences of the normal distribution; 24 pixels are three standard deviations.
        let share = |x: f64, from: f64, to: f64| {
            let normal = |x: f64| 0.5 * (1.0 + libm::erf(x / (8.0 * std::f64::consts::SQRT_2)));
            normal(to - x) - normal(from - x)
        };
        let mut worst = 0.0f64;
        for (i, (out, before)) in (0..).zip(out.iter().zip(&rgba)) {
            let (x, y) = (f64::from(i % 120) + 0.5, f64::from(i / 120) + 0.5);
            let exact = 2.0 * share(x, 40.0, 60.0) * share(y, 50.0, 80.0);
            worst = worst.max((f64::from(out.x - before.x) - exact).abs());
        }
        println!("{worst:.4} of 2");
        // The taps end at three standard deviations, and four pixels are one.
        assert!(worst < 0.05, "{worst}");
    }
}
