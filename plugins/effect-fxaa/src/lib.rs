//! Smooth edges from the finished picture alone.

use choreo_plugin::{Effect, Hook, Manifest, Pictures, Pixels};
use glam::{Vec3, Vec4};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("fxaa", env!("CARGO_PKG_VERSION"), "smooth edges, from the finished picture alone")
        .number(
            "contrast",
            "least difference of brightness, of the brightest, that is an edge",
            0.125,
            0.01..=1.0,
        )
        .number("span", "longest way along an edge, pixels", 3.0, 1.0..=16.0)
});

#[derive(Clone, Copy, Debug, Default)]
pub struct Fxaa;

/// Brightness as the eye has it: the square root stands in for the display's curve.
fn brightness(c: Vec4) -> f32 {
    c.truncate().max(Vec3::ZERO).min(Vec3::ONE).dot(Vec3::new(0.299, 0.587, 0.114)).sqrt()
}

/// Interpolates between the four pixels around a place; pixel centers lie at whole numbers.
fn between(picture: &Pixels, x: f32, y: f32) -> Vec4 {
    let (fx, fy) = (x.floor(), y.floor());
    let (x0, y0) = (fx as i32, fy as i32);
    let (u, v) = (x - fx, y - fy);
    let top = picture.at(x0, y0) * (1.0 - u) + picture.at(x0 + 1, y0) * u;
    let bottom = picture.at(x0, y0 + 1) * (1.0 - u) + picture.at(x0 + 1, y0 + 1) * u;
    top * (1.0 - v) + bottom * v
}

impl Effect for Fxaa {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn hook(&self) -> Hook {
        Hook::Picture
    }

    fn wgsl(&self) -> &str {
        include_str!("fxaa.wgsl")
    }

    /// Timothy Lottes, "FXAA", NVIDIA 2009, in its first, short form: the mean of two or four samples along the edge.
    fn cpu_picture(&self, pictures: &Pictures, [x, y]: [i32; 2], _: u32, p: &[f32; 8]) -> Vec4 {
        let picture = &pictures.now;
        let here = picture.at(x, y);
        let light = |dx: i32, dy: i32| brightness(picture.at(x + dx, y + dy));
        let (nw, ne, sw, se) = (light(-1, -1), light(1, -1), light(-1, 1), light(1, 1));
        let m = brightness(here);
        let low = m.min(nw.min(ne).min(sw.min(se)));
        let high = m.max(nw.max(ne).max(sw.max(se)));
        if high - low < (high * p[0]).max(1.0 / 32.0) {
            return here;
        }
        let (dx, dy) = ((sw + se) - (nw + ne), (nw + sw) - (ne + se));
        let reduce = ((nw + ne + sw + se) * 0.03125).max(1.0 / 128.0);
        let scale = 1.0 / (dx.abs().min(dy.abs()) + reduce);
        let (dx, dy) = ((dx * scale).clamp(-p[1], p[1]), (dy * scale).clamp(-p[1], p[1]));
        let along = |t: f32| between(picture, x as f32 + dx * t, y as f32 + dy * t);
        let near = (along(1.0 / 3.0 - 0.5) + along(2.0 / 3.0 - 0.5)) * 0.5;
        let far = near * 0.5 + (along(-0.5) + along(0.5)) * 0.25;
        let of_far = brightness(far);
        if of_far < low || of_far > high { near } else { far }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN: f32 = 3.0;

    fn run(size: [u32; 2], span: f32, color: impl Fn(i32, i32) -> f32) -> Vec<f32> {
        let p = [0.125, span, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let [w, h] = size.map(|s| s as i32);
        let all = || (0..h).flat_map(move |y| (0..w).map(move |x| (x, y)));
        let rgba: Vec<Vec4> = all().map(|(x, y)| Vec3::splat(color(x, y)).extend(1.0)).collect();
        let picture = Pixels { size, rgba: &rgba };
        let pictures = Pictures { now: picture, original: picture, before: &[] };
        all().map(|(x, y)| Fxaa.cpu_picture(&pictures, [x, y], 0, &p).x).collect()
    }

    #[test]
    fn flat_and_straight_pictures_stay() {
        assert!(run([8, 8], SPAN, |_, _| 0.3).iter().all(|c| *c == 0.3));
        // An upright edge between pixels has no steps to smooth: bright stays bright.
        let upright = run([16, 16], SPAN, |x, _| if x < 8 { 0.0 } else { 1.0 });
        assert!(upright[8 * 16 + 2] == 0.0 && upright[8 * 16 + 13] == 1.0);
    }

    /// Sum of the errors against exact coverage of an edge that rises by so much a pixel: as it is, and smoothed.
    fn errors(slope: f32, span: f32) -> [f32; 2] {
        let (w, h) = (48, 44);
        let line = |x: f32| 8.0 + x * slope;
        let hard = |x: i32, y: i32| f32::from(y as f32 + 0.5 > line(x as f32 + 0.5));
        let smooth = run([w as u32, h as u32], span, hard);
        let mut sums = [0.0; 2];
        for y in 4..h - 4 {
            for x in 8..w - 8 {
                let at = |i: i32| i as f32 / 8.0 + 0.0625;
                let inside = |i: &i32| y as f32 + at(i % 8) > line(x as f32 + at(i / 8));
                let covered = (0..64).filter(inside).count() as f32 / 64.0;
                sums[0] += (hard(x, y) - covered).abs();
                sums[1] += (smooth[(y * w + x) as usize] - covered).abs();
            }
        }
        sums
    }

    /// The table by which the default was chosen: of spans 2, 3, 4, 8 the error left is 0.68, 0.62, 0.68, 0.93 of what it was.
    #[test]
    fn slanted_edges_come_nearer_to_their_coverage_at_every_slope() {
        let slopes = [0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
        let left = |span: f32| {
            let all = slopes.map(|slope| errors(slope, span));
            all.iter().map(|e| e[1]).sum::<f32>() / all.iter().map(|e| e[0]).sum::<f32>()
        };
        for slope in slopes {
            let [before, after] = errors(slope, SPAN);
            assert!(after < before * 0.95, "{slope}: {before} {after}");
        }
        let chosen = left(SPAN);
        println!("error left of spans 2, 3, 4, 8: {:?}", [2.0, 3.0, 4.0, 8.0].map(left));
        assert!(chosen < 0.65 && [1.5, 4.0, 8.0].iter().all(|other| left(*other) > chosen));
    }
}
