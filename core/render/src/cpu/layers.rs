//! Formulas of clearcoat, sheen and transmission, four pixels at once. Results are multiplied by π, as in brdf.rs. CPU reference of layers.wgsl.

use crate::lanes::{F4, V3};
use glam::Vec3;

/// Schlick's Fresnel of a coat of index 1.5, F0 = 0.04, by the angle to the viewer (KHR_materials_clearcoat, "Layering").
pub(crate) fn coat_fresnel(nv: F4) -> F4 {
    let x = F4::ONE - nv;
    let x2 = x * x;
    x2 * x2 * x * 0.96 + F4::splat(0.04)
}

/// GGX distribution times Smith's visibility, as in `brdf::reflect_light`, without Fresnel.
pub(crate) fn coat_lobe(roughness: F4, n: V3, v: V3, l: V3, nv: F4, nl: F4) -> F4 {
    let nh = n.dot((l + v).unit()).clamp(0.0, 1.0);
    let alpha = roughness * roughness;
    let a2 = alpha * alpha;
    let rest = F4::ONE - a2;
    let d = nh * nh * (a2 - F4::ONE) + F4::ONE;
    let smith = nl * (nv * nv * rest + a2).sqrt() + nv * (nl * nl * rest + a2).sqrt();
    a2 * 0.5 / (d * d * smith)
}

/// "Charlie" distribution (Estevez & Kulla, "Production Friendly Microfacet Sheen BRDF", 2017, eq. 2, α = roughness²) times
/// Neubelt's visibility 1 / (4 (NL + NV − NL·NV)), as in KHR_materials_sheen.
pub(crate) fn sheen_lobe(roughness: F4, n: V3, v: V3, l: V3, nv: F4, nl: F4) -> F4 {
    let nh = n.dot((l + v).unit()).clamp(0.0, 1.0);
    let inverse = F4::ONE / (roughness * roughness);
    let sine = (F4::ONE - nh * nh).max(F4::splat(1e-6));
    let half = inverse * 0.5;
    let power = F4(std::array::from_fn(|i| libm::powf(sine.0[i], half.0[i])));
    (inverse + F4::splat(2.0)) * power * 0.125 / (nl + nv - nl * nv)
}

/// Directional albedo: the lobe's integral over the hemisphere, at most 1, in place of the table that the extension suggests.
/// Fitted to the integral for roughness 0.07 to 1; off by 0.07 at worst, at grazing angles (`tests/cpu/layers.rs`).
pub(super) fn sheen_albedo(roughness: F4, nv: F4) -> F4 {
    let r = roughness;
    let height =
        (F4::splat(0.01213) - r * 0.81006 + F4::splat(0.18394) / (r + F4::splat(0.1))).map(libm::expf);
    let power = F4::splat(0.95739) + r * 4.27803 - r * r * 2.72933 + F4::splat(0.90085) / r;
    let width = F4::splat(0.98406) - r * 0.81087 + r * r * 0.12174;
    let base = F4::ONE - width * nv;
    let raised = F4(std::array::from_fn(|i| libm::powf(base.0[i], power.0[i])));
    (height * raised).clamp(0.0, 1.0)
}

/// Share of the light that passes a volume, per color channel: Beer–Lambert (KHR_materials_volume, "Attenuation").
pub(crate) fn volume_transmittance(extinction: Vec3, depth: F4) -> V3 {
    let channel = |e: f32| (depth * -e).map(libm::expf);
    V3 { x: channel(extinction.x), y: channel(extinction.y), z: channel(extinction.z) }
}
