//! Toon shading: MToon (VRMC_materials_mtoon 1.0). CPU reference of toon.wgsl and of its part of scene.wgsl.

use super::sky::EnvironmentLight;
use crate::lanes::{F4, V3};
use crate::plan::{Plan, PlanLight};
use choreo_asset::Toon;

/// Surface of a toon material at four pixels.
pub(crate) struct ToonSurface<'a> {
    pub toon: &'a Toon,
    pub base: V3,
    /// Shade color with its texture and the actor's tint.
    pub shade: V3,
    /// Shading shift with its texture.
    pub shift: F4,
    /// Matcap color times its texture; zero without one.
    pub matcap: V3,
    /// Mask from the rim's texture.
    pub rim_mask: V3,
}

impl ToonSurface<'_> {
    /// Lit color without emission. `relative`: camera-relative position; `n` and `v`: unit vectors; `share`: unshadowed share of a
    /// light, from the direction to it.
    pub(super) fn toon_lit(
        &self,
        plan: &Plan,
        environment: &EnvironmentLight,
        relative: V3,
        [n, v]: [V3; 2],
        share: impl Fn(&PlanLight, V3) -> F4,
    ) -> V3 {
        let t = self.toon;
        // The sum of all light, for the rim.
        let mut total_light =
            environment.diffuse(n).mix(environment.mean_diffuse(), F4::splat(t.gi_equalization));
        let mut color = self.base * total_light;
        for light in &plan.lights {
            let (l, strength) = light.incoming(relative);
            let arriving = V3::splat(light.color) * strength;
            color = color + self.shade.mix(self.base, self.lit_share(n.dot(l)) * share(light, l)) * arriving;
            total_light = total_light + arriving;
        }
        let one = V3 { x: F4::ONE, y: F4::ONE, z: F4::ONE };
        let rim = (self.rim_light(n, v) + self.matcap) * self.rim_mask;
        color + rim * one.mix(total_light, F4::splat(t.rim_lighting_mix))
    }

    /// Share of the lit color (§"Lighting"): linearstep(−1 + toony, 1 − toony, NL + shift).
    fn lit_share(&self, nl: F4) -> F4 {
        let half = 1.0 - self.toon.shading_toony;
        let width = (2.0 * half).max(1e-4);
        ((nl + self.shift + half) / F4::splat(width)).clamp(0.0, 1.0)
    }

    /// Parametric rim light (§"Rim Lighting").
    fn rim_light(&self, n: V3, v: V3) -> V3 {
        let t = self.toon;
        let edge = (F4::ONE - n.dot(v) + t.rim_lift).clamp(0.0, 1.0);
        let power = t.rim_fresnel_power.max(1e-5);
        V3::splat(t.rim_color) * edge.map(|e| libm::powf(e.max(1e-20), power))
    }
}

/// Texture coordinates of the matcap (§"MatCap"); v points down in glTF's textures.
pub(crate) fn matcap_uv(n: V3, v: V3) -> [F4; 2] {
    let x = V3 { x: v.z, y: F4::ZERO, z: -v.x }.unit();
    let y = v.cross(x);
    [x.dot(n) * 0.495 + 0.5, y.dot(n) * -0.495 + 0.5]
}
