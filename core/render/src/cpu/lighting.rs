//! Direct lighting of a surface, and lighting effects, which replace the result of its reflection model. CPU reference of
//! `light_effects` in scene.wgsl.

use super::shade::{Fragment, Shaded};
use crate::effect_faults::{EffectFaults, Fault, FaultPlace, MAGENTA};
use crate::lanes::{F4, Mask, V3};
use crate::plan::{Glass, PlanLight};
use choreo_plugin::{Effect, LightSample};
use glam::Vec3;
use std::cell::Cell;

/// Four points of a lit surface.
#[derive(Clone, Copy)]
pub(crate) struct SurfacePoint {
    /// Camera-relative position in metres.
    pub relative: V3,
    /// Normal without the normal map. `n` includes the map.
    pub geometric_n: V3,
    pub n: V3,
    /// Unit direction to the viewer.
    pub v: V3,
    pub base: V3,
    /// Pixels in which the surface is visible.
    pub visible: Mask,
}

impl Fragment<'_> {
    /// Lights that may reach any of four points: the lights of their cluster, or all lights if the points lie in several clusters.
    pub(super) fn lights_reaching(&self, relative: V3) -> impl Iterator<Item = &PlanLight> {
        let (plan, all) = (self.plan, &self.plan.lights);
        // A lighting effect may also use lights that do not reach the point, so it gets all of them.
        let clusters =
            plan.light_clusters.as_ref().filter(|_| self.lighting.is_empty()).and_then(|clusters| {
                let at = |i: usize| Vec3::new(relative.x.0[i], relative.y.0[i], relative.z.0[i]);
                let list = |i| clusters.of(at(i), &plan.view.clip_from_relative, plan.size);
                let first = list(0);
                (1..4).all(|i| std::ptr::eq(first, list(i))).then_some((clusters.unlimited(), first))
            });
        let (first, cluster_lights) = clusters.unwrap_or((all.len(), &[]));
        all[..first].iter().chain(cluster_lights.iter().map(|i| &all[*i as usize]))
    }

    /// Adds the contributions of all lights: by the lighting effects if the surface has any, else by [`Fragment::add_lights`].
    #[inline(always)]
    pub(crate) fn add_lights_or_effects(
        &self,
        point: &SurfacePoint,
        color: &mut V3,
        reflect: impl Fn(V3, F4) -> V3,
    ) {
        match self.lighting.is_empty() {
            true => self.add_lights(point, [point.geometric_n, point.n], color, reflect),
            false => self.add_lights_by_effects(point, color, reflect),
        }
    }

    /// Adds the contribution of each light, after the lighting effects have changed it.
    fn add_lights_by_effects(&self, point: &SurfacePoint, color: &mut V3, reflect: impl Fn(V3, F4) -> V3) {
        for light in &self.plan.lights {
            let (l, strength) = light.incoming(point.relative);
            let cosine = point.n.dot(l);
            let nl = cosine.clamp(0.0, 1.0);
            let share = self.unshadowed_share(light, [point.relative, point.geometric_n, l], point.visible);
            let arriving = V3::splat(light.color) * strength;
            let lit = reflect(l, nl) * arriving * (nl * share);
            let sample = |i: usize| {
                let lane = |v: &V3| Vec3::new(v.x.0[i], v.y.0[i], v.z.0[i]);
                LightSample {
                    cosine: cosine.0[i],
                    share: share.0[i],
                    color: lane(&arriving),
                    base: lane(&point.base),
                    normal: lane(&point.n),
                    viewer: lane(&point.v),
                    light: lane(&l),
                    // The division by NL in V is meaningless for light from behind the surface.
                    lit: if nl.0[i] > 0.0 { lane(&lit) } else { Vec3::ZERO },
                }
            };
            let mut samples: [LightSample; 4] = std::array::from_fn(sample);
            for ((effect, parameters), number) in self.lighting.iter().zip(self.surface.len() as u8..) {
                if let Effect::Lighting(effect) = effect {
                    effect.lights(&mut samples, parameters);
                    replace_faults(&mut samples, number);
                }
            }
            let [x, y, z] = [0, 1, 2].map(|c| F4(samples.map(|sample| sample.lit[c])));
            *color = *color + V3 { x, y, z };
        }
    }
}

thread_local! {
    /// Faults of lighting effects at the four pixels that this thread shades. CPU reference of `effect_light_failed` in
    /// effect_faults.wgsl.
    static QUAD_FAULTS: Cell<[Option<(u8, Fault)>; 4]> = const { Cell::new([None; 4]) };
}

/// Replaces results that are not finite by magenta, and stores the faults in [`QUAD_FAULTS`].
fn replace_faults(samples: &mut [LightSample; 4], effect: u8) {
    for (i, sample) in samples.iter_mut().enumerate() {
        if let Some(fault) = Fault::of(sample.lit.extend(0.0)) {
            let mut faults = QUAD_FAULTS.get();
            faults[i] = faults[i].or(Some((effect, fault)));
            QUAD_FAULTS.set(faults);
            sample.lit = MAGENTA.truncate();
        }
    }
}

impl Fragment<'_> {
    /// Colors the pixels magenta in which a lighting effect returned a value that is not finite.
    pub(crate) fn mark_light_faults(&self, shaded: &mut Shaded) {
        shaded.faults = QUAD_FAULTS.take();
        if self.glass == Glass::Filter {
            return;
        }
        for i in (0..4).filter(|i| shaded.faults[*i].is_some()) {
            // The light of glass is premultiplied by its alpha.
            let share = if self.glass == Glass::Light { shaded.rgba[3].0[i] } else { 1.0 };
            for (out, c) in shaded.rgba.iter_mut().zip(MAGENTA.truncate().to_array()) {
                out.0[i] = c * share;
            }
        }
    }

    /// Records the fault of a visible pixel.
    pub(crate) fn record_fault(&self, faults: &EffectFaults, (effect, fault): (u8, Fault), pixel: [i32; 2]) {
        if let Some((effect, _)) = self.surface.iter().chain(&self.lighting).nth(effect as usize) {
            faults.record(effect, fault, FaultPlace::pixel(pixel));
        }
    }
}
