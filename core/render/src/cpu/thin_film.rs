//! Thin films (KHR_materials_iridescence). CPU reference of their part of layers.wgsl.

use crate::lanes::{F4, V3};
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// Number of terms of Airy's sum in addition to its mean, as in the shader; `cargo xtask report film` measures others.
pub const AIRY_TERMS: u32 = 2;

/// [`reflectance`], four pixels at once.
pub(crate) fn film_reflectance(ior: f32, nanometres: F4, nv: F4, f0: V3) -> V3 {
    let at = |i: usize| {
        let f0 = Vec3::new(f0.x.0[i], f0.y.0[i], f0.z.0[i]);
        reflectance::<AIRY_TERMS>(ior, nanometres.0[i], nv.0[i], f0)
    };
    let all: [Vec3; 4] = std::array::from_fn(at);
    V3 { x: F4(all.map(|c| c.x)), y: F4(all.map(|c| c.y)), z: F4(all.map(|c| c.z)) }
}

/// Reflectance of a film on a surface with the normal reflectance `f0`, at an angle of incidence with the cosine `nv`: the mean
/// of Airy's sum and `AIRY_TERMS` further terms, weighted by the sensitivity of the eye (Belcour & Barla, "A Practical Extension to
/// Microfacet Theory for the Modeling of Varying Iridescence", 2017). Linear sRGB, not negative.
pub fn reflectance<const AIRY_TERMS: u32>(ior: f32, nanometres: f32, nv: f32, f0: Vec3) -> Vec3 {
    let squared = |v: f32| v * v;
    // The index of refraction fades to that of air as the thickness goes to zero.
    let t = (nanometres / 0.03).clamp(0.0, 1.0);
    let film_presence = t * t * (3.0 - 2.0 * t);
    let eta = 1.0 - film_presence + ior * film_presence;
    let cos2_in_film = 1.0 - squared(1.0 / eta) * (1.0 - nv * nv);
    if cos2_in_film < 0.0 {
        return Vec3::ONE;
    }
    let cos_in_film = cos2_in_film.sqrt();
    let schlick = |f0: f32, cosine: f32| {
        let x = 1.0 - cosine;
        f0 + (1.0 - f0) * (squared(x * x) * x)
    };
    let r12 = schlick(squared((eta - 1.0) / (eta + 1.0)), nv);
    let t121 = 1.0 - r12;
    let root = f0.clamp(Vec3::ZERO, Vec3::splat(0.9999)).to_array().map(f32::sqrt);
    let base = root.map(|r| (1.0 + r) / (1.0 - r));
    let r23 = Vec3::from(base.map(|b| schlick(squared((b - eta) / (b + eta)), cos_in_film)));
    // Reflection at a denser medium shifts the phase by π.
    let phi = Vec3::from(base.map(|b| if b < eta { PI + PI } else { PI }));
    let path = 2e-9 * eta * nanometres * cos_in_film;
    let r123 = (r23 * r12).min(Vec3::splat(0.9999));
    let step = Vec3::from(r123.to_array().map(f32::sqrt));
    let rs = r23 * (t121 * t121) / (Vec3::ONE - r123);
    let mut sum = rs + r12;
    let mut c = rs - t121;
    for order in 1..=AIRY_TERMS {
        c *= step;
        sum += c * 2.0 * film_color(order as f32 * path, phi * order as f32);
    }
    sum.max(Vec3::ZERO)
}

/// Color of one interference term: sensitivity of the eye in Fourier space, as sums of Gaussians (§4 of the paper). `path`:
/// optical path difference in metres; `shift`: phase in radians, per channel.
fn film_color(path: f32, shift: Vec3) -> Vec3 {
    let phase = TAU * path;
    let p2 = phase * phase;
    let lobe = |height: f32, at: f32, width: f32, shift: f32| {
        height * libm::cosf(at * phase + shift) * libm::expf(-p2 * width)
    };
    let x = lobe(0.84659, 1.6810e6, 4.3278e9, shift.x) + lobe(0.153_868_3, 2.2399e6, 4.5282e9, shift.x);
    let y = lobe(1.000_221_9, 1.7953e6, 9.3046e9, shift.y);
    let z = lobe(1.001_122_5, 2.2084e6, 6.6121e9, shift.z);
    Vec3::new(
        3.240_454_2 * x - 1.537_138_5 * y - 0.498_531_4 * z,
        -0.969_266 * x + 1.876_010_8 * y + 0.041_556 * z,
        0.055_643_4 * x - 0.204_025_9 * y + 1.057_225_2 * z,
    )
}

/// Inverse of Schlick's Fresnel: the F0 that gives this reflectance at this angle.
pub(crate) fn film_f0(reflectance: V3, nv: F4) -> V3 {
    let x = F4::ONE - nv;
    let x5 = (x * x * x * x * x).min(F4::splat(0.9999));
    let invert = |c: F4| ((c - x5) / (F4::ONE - x5)).max(F4::ZERO);
    V3 { x: invert(reflectance.x), y: invert(reflectance.y), z: invert(reflectance.z) }
}
