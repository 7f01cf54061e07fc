//! Shading formulas, four pixels at once. CPU reference of brdf.wgsl.
//!
//! Reflected radiance = f · E · NL, with the illuminance E in lux. `PlanLight::color` is E / π, and the functions here return
//! π · f: a white diffuse surface that faces a directional light of π lux has the radiance 1.

use crate::lanes::{F4, V3};
use glam::Vec3;

/// Parameters of the metallic-roughness BRDF at four pixels.
pub(super) struct Surface {
    pub diffuse: V3,
    pub f0: V3,
    pub f90: F4,
    pub roughness: F4,
    /// The direction in which highlights are stretched.
    pub anisotropy: Option<Anisotropy>,
    /// Reflectance of the thin film at this angle, and the share of the surface that the film covers.
    pub film: Option<(V3, F4)>,
}

/// Unit directions along and across the stretch of highlights, and the GGX alpha in each.
#[derive(Clone, Copy)]
pub(crate) struct Anisotropy {
    pub along: V3,
    pub across: V3,
    pub alpha_along: F4,
    pub alpha_across: F4,
}

impl Anisotropy {
    /// GGX and Smith's visibility with one alpha along the stretch and one across it (KHR_materials_anisotropy, "Implementation"), times π.
    fn specular_lobe(&self, h: V3, v: V3, l: V3, [nh, nv, nl]: [F4; 3]) -> F4 {
        let (at, ab) = (self.alpha_along, self.alpha_across);
        let length = |x: F4, y: F4, z: F4| (x * x + y * y + z * z).sqrt();
        let (x, y) = (ab * self.along.dot(h), at * self.across.dot(h));
        let a2 = at * ab;
        let z = a2 * nh;
        let w = a2 / (x * x + y * y + z * z);
        let smith = nl * length(at * self.along.dot(v), ab * self.across.dot(v), nv)
            + nv * length(at * self.along.dot(l), ab * self.across.dot(l), nl);
        a2 * w * w * 0.5 / smith
    }
}

/// glTF 2.0 Appendix B.3 with KHR_materials_specular: c_diff = base · (1 − metallic),
/// F0 = mix(min(0.04 · specular_color, 1) · specular, base, metallic), F90 = mix(specular, 1, metallic).
/// Roughness below 0.045 would make highlights smaller than f32 resolves.
pub(crate) fn surface_of(base: V3, metallic: F4, roughness: F4, specular: F4, specular_color: V3) -> Surface {
    let tint = specular_color * F4::splat(0.04);
    let tint = V3 { x: tint.x.min(F4::ONE), y: tint.y.min(F4::ONE), z: tint.z.min(F4::ONE) };
    Surface {
        diffuse: base * (F4::ONE - metallic),
        f0: (tint * specular).mix(base, metallic),
        f90: specular.mix(F4::ONE, metallic),
        roughness: roughness.max(F4::splat(0.045)),
        anisotropy: None,
        film: None,
    }
}

/// c_diff · (1 − max F) + F · V · D (times π). D: GGX (Walter 2007, eq. 33) with α = roughness². V: Smith's
/// height-correlated G / (4 NL NV) (Heitz 2014, eq. 99). F: Schlick 1994. glTF 2.0 Appendix B.3.
pub(crate) fn reflect_light(s: &Surface, n: V3, v: V3, l: V3, nv: F4, nl: F4) -> V3 {
    let h = (l + v).unit();
    let nh = n.dot(h).clamp(0.0, 1.0);
    let vh = v.dot(h).clamp(0.0, 1.0);
    let lobe = match &s.anisotropy {
        Some(anisotropy) => anisotropy.specular_lobe(h, v, l, [nh, nv, nl]),
        None => {
            let alpha = s.roughness * s.roughness;
            let a2 = alpha * alpha;
            let d = nh * nh * (a2 - F4::ONE) + F4::ONE;
            let distribution = a2 / (d * d);
            let rest = F4::ONE - a2;
            let smith = nl * (nv * nv * rest + a2).sqrt() + nv * (nl * nl * rest + a2).sqrt();
            F4::splat(0.5) / smith * distribution
        }
    };
    let x = F4::ONE - vh;
    let x2 = x * x;
    let pow5 = x2 * x2 * x;
    let f90 = V3 { x: s.f90, y: s.f90, z: s.f90 };
    let mut fresnel = s.f0 + (f90 - s.f0) * pow5;
    if let Some((film, share)) = s.film {
        fresnel = fresnel.mix(film, share);
    }
    let share = F4::ONE - fresnel.max_component();
    s.diffuse * share + fresnel * lobe
}

/// The environment's BRDF, second half of the split sum: Karis, "Physically Based Shading on Mobile", 2014.
/// Karis' fit has F90 = 1. Here, F90 scales the second term, so that a surface with `specular` 0 reflects nothing.
pub(crate) fn ambient_specular(f0: V3, f90: F4, roughness: F4, nv: F4) -> V3 {
    let x = F4::ONE - roughness;
    let y = roughness * -0.0275 + 0.0425;
    let z = roughness * -0.572 + 1.04;
    let w = roughness * 0.022 - 0.04;
    let a = (x * x).min((nv * -9.28).map(libm::exp2f)) * x + y;
    let (scale, bias) = (a * -1.04 + z, f90 * (a * 1.04 + w));
    f0 * scale + V3 { x: bias, y: bias, z: bias }
}

/// Lambert + Blinn–Phong: base + specular · (s + 8)/8 · NH^s (times π), normalized as in Akenine-Möller et al., Real-Time
/// Rendering, 3rd ed., eq. 7.48. The caller multiplies by NL. Phong's highlight (`blinn` false) is RV^s with R the mirrored light
/// direction, normalized by (s + 2) / 2 (Lafortune & Willems 1994).
pub(crate) fn reflect_light_phong(base: V3, [specular, n, v, l]: [V3; 4], shininess: f32, blinn: bool) -> V3 {
    if !blinn {
        let rv = (n * (n.dot(l) * 2.0) - l).dot(v).clamp(0.0, 1.0);
        let power = rv.map(|x| libm::powf(x, shininess));
        return base + specular * (power * ((shininess + 2.0) * 0.5));
    }
    let nh = n.dot((l + v).unit()).clamp(0.0, 1.0);
    let power = nh.map(|x| libm::powf(x, shininess));
    base + specular * (power * ((shininess + 8.0) * 0.125))
}

/// Hemisphere light: mix(down, up, n.y · ½ + ½).
pub(super) fn ambient(up: Vec3, down: Vec3, n: V3) -> V3 {
    V3::splat(down).mix(V3::splat(up), n.y * 0.5 + 0.5)
}
