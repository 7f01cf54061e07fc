//! Prefiltered environment maps, the first half of the split sum (Karis, "Real Shading in Unreal Engine 4", 2013): light of the
//! GGX lobe about a direction, viewed along that direction. Each importance sample is filtered over its solid angle (Křivánek &
//! Colbert, "Real-time Shading with Filtered Importance Sampling", 2008).

use crate::sky::octahedral::{OctahedralMap, direction};
use choreo_asset::Panorama;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Radiance of a panorama in a direction, by bilinear interpolation.
pub fn radiance(panorama: &Panorama, dir: Vec3) -> Vec3 {
    let [width, height] = panorama.size().map(|s| s as f32);
    let u = 0.5 + libm::atan2f(dir.x, -dir.z) / (2.0 * PI);
    let v = libm::acosf(dir.y.clamp(-1.0, 1.0)) / PI;
    let at = Vec2::new(u * width, v * height) - 0.5;
    let (low, t) = (at.floor(), at - at.floor());
    let (x, y) = (low.x as i64, low.y as i64);
    let row = |y| panorama.texel(x, y) * (1.0 - t.x) + panorama.texel(x + 1, y) * t.x;
    row(y) * (1.0 - t.y) + row(y + 1) * t.y
}

/// A panorama as an octahedral map. Each texel is the mean over its area, so that small suns keep their light.
pub fn base(panorama: &Panorama, size: u32) -> OctahedralMap {
    // An octahedral map has half as many texels from pole to pole as its side.
    let each = (2 * panorama.size()[1]).div_ceil(size).clamp(2, 16);
    OctahedralMap::from_fn(size, |x, y, _| {
        let mut sum = Vec3::ZERO;
        for j in 0..each {
            for i in 0..each {
                let at = Vec2::new((x * each + i) as f32, (y * each + j) as f32) + 0.5;
                sum += radiance(panorama, direction(at / (size * each) as f32));
            }
        }
        sum / (each * each) as f32
    })
}

/// The map and its halves down to a side of 4 texels.
pub(crate) fn pyramid(base: OctahedralMap) -> Vec<OctahedralMap> {
    let mut levels = vec![base];
    while let Some(half) = levels.last().filter(|l| l.size > 4).map(OctahedralMap::halved) {
        levels.push(half);
    }
    levels
}

/// One direction of light about +Z, its weight, and the level of the pyramid whose texels have the sample's solid angle.
struct Sample {
    dir: Vec3,
    weight: f32,
    level: f32,
}

/// Importance samples of GGX at normal incidence, at Hammersley points.
fn samples(roughness: f32, count: u32, size: u32) -> Vec<Sample> {
    let alpha = roughness * roughness;
    let texel = 4.0 * PI / (size * size) as f32;
    let mut all = Vec::with_capacity(count as usize);
    for i in 0..count {
        let u = (i as f32 + 0.5) / count as f32;
        let turn = 2.0 * PI * (i.reverse_bits() as f32 * 2.328_306_4e-10);
        // Walter et al. 2007, eq. 35.
        let cos2 = (1.0 - u) / (1.0 + (alpha * alpha - 1.0) * u);
        let (nh, sin) = (cos2.sqrt(), (1.0 - cos2).max(0.0).sqrt());
        let h = Vec3::new(sin * libm::cosf(turn), sin * libm::sinf(turn), nh);
        let dir = 2.0 * nh * h - Vec3::Z;
        if dir.z <= 0.0 {
            continue;
        }
        let d = cos2 * (alpha * alpha - 1.0) + 1.0;
        let density = alpha * alpha / (PI * d * d) / 4.0;
        let solid = 1.0 / (count as f32 * density);
        // One level higher, to blur the steps between samples.
        let level = 0.5 * libm::log2f(solid / texel) + 1.0;
        all.push(Sample { dir, weight: dir.z, level: level.max(0.0) });
    }
    all
}

/// Specular light of a roughness about each direction; the sky itself for roughness 0.
pub(crate) fn level(pyramid: &[OctahedralMap], roughness: f32, size: u32, count: u32) -> OctahedralMap {
    if roughness == 0.0 {
        let same = pyramid.iter().find(|l| l.size == size).cloned();
        return same.unwrap_or_else(|| OctahedralMap::from_fn(size, |_, _, dir| pyramid[0].sample(dir)));
    }
    let samples = samples(roughness, count, pyramid[0].size);
    let all: f32 = samples.iter().map(|s| s.weight).sum();
    OctahedralMap::from_fn(size, |_, _, n| {
        // Any two orthogonal axes (Duff et al., "Building an Orthonormal Basis, Revisited", 2017).
        let sign = if n.z >= 0.0 { 1.0 } else { -1.0 };
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        let across = Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
        let along = Vec3::new(b, sign + n.y * n.y * a, -n.y);
        let sum = samples.iter().fold(Vec3::ZERO, |sum, s| {
            let dir = across * s.dir.x + along * s.dir.y + n * s.dir.z;
            sum + sample(pyramid, dir, s.level) * s.weight
        });
        sum / all
    })
}

/// Interpolates between the two nearest levels.
fn sample(pyramid: &[OctahedralMap], dir: Vec3, level: f32) -> Vec3 {
    let last = pyramid.len() - 1;
    let low = (level as usize).min(last);
    let t = (level - low as f32).clamp(0.0, 1.0);
    if t == 0.0 || low == last {
        return pyramid[low].sample(dir);
    }
    pyramid[low].sample(dir) * (1.0 - t) + pyramid[low + 1].sample(dir) * t
}
