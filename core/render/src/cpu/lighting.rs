//! The lights of a surface, and effects that decide what light does on it, in place of its own model. CPU reference of
//! `light_effects` in scene.wgsl.

use super::shade::Fragment;
use crate::lanes::{F4, V3};
use crate::plan::PlanLight;
use choreo_plugin::LightSample;
use glam::Vec3;

/// Four points of a surface that lights fall on.
#[derive(Clone, Copy)]
pub(crate) struct SurfacePoint {
    /// Camera-relative.
    pub relative: V3,
    /// Normal without the normal map; the other is with it.
    pub own_n: V3,
    pub n: V3,
    /// Unit, to the viewer.
    pub v: V3,
    pub base: V3,
}

impl Fragment<'_> {
    /// The lights that may reach one of four places: where they lie in cells of different lists, all.
    pub fn reaching(&self, relative: V3) -> impl Iterator<Item = &PlanLight> {
        let (plan, all) = (self.plan, &self.plan.lights);
        // An effect on light may make something of lamps that do not reach.
        let lists = plan.light_clusters.as_ref().filter(|_| self.lighting.is_empty()).and_then(|lists| {
            let at = |i: usize| Vec3::new(relative.x.0[i], relative.y.0[i], relative.z.0[i]);
            let list = |i| lists.of(at(i), &plan.view.clip_from_relative, plan.size);
            let first = list(0);
            (1..4).all(|i| std::ptr::eq(first, list(i))).then_some((lists.unlimited(), first))
        });
        let (first, listed) = lists.unwrap_or((all.len(), &[]));
        all[..first].iter().chain(listed.iter().map(|i| &all[*i as usize]))
    }

    /// Like [`Fragment::lights`], but by the lighting effects if there are any.
    #[inline(always)]
    pub(crate) fn all_lights(&self, on: &SurfacePoint, color: &mut V3, reflect: impl Fn(V3, F4) -> V3) {
        match self.lighting.is_empty() {
            true => self.lights(on.relative, [on.own_n, on.n], color, reflect),
            false => self.lights_by_effects(on, color, reflect),
        }
    }

    /// Each light's part handed to the effects.
    fn lights_by_effects(&self, on: &SurfacePoint, color: &mut V3, reflect: impl Fn(V3, F4) -> V3) {
        for light in &self.plan.lights {
            let (l, strength) = light.incoming(on.relative);
            let cosine = on.n.dot(l);
            let nl = cosine.clamp(0.0, 1.0);
            let share = self.share(light, on.relative, on.own_n, l);
            let arriving = V3::splat(light.color) * strength;
            let lit = reflect(l, nl) * arriving * (nl * share);
            let sample = |i: usize| {
                let lane = |v: &V3| Vec3::new(v.x.0[i], v.y.0[i], v.z.0[i]);
                LightSample {
                    cosine: cosine.0[i],
                    share: share.0[i],
                    color: lane(&arriving),
                    base: lane(&on.base),
                    normal: lane(&on.n),
                    viewer: lane(&on.v),
                    light: lane(&l),
                    // Where the light is behind the surface the division by NL in V means nothing.
                    lit: if nl.0[i] > 0.0 { lane(&lit) } else { Vec3::ZERO },
                }
            };
            let mut samples: [LightSample; 4] = std::array::from_fn(sample);
            for (effect, parameters) in &self.lighting {
                if let Some(function) = effect.function() {
                    function.lights(&mut samples, parameters);
                }
            }
            let [x, y, z] = [0, 1, 2].map(|c| F4(samples.map(|sample| sample.lit[c])));
            *color = *color + V3 { x, y, z };
        }
    }
}
