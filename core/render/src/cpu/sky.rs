//! Image-based light, four pixels at once, and the sky as the background. CPU reference of sky.wgsl.

use super::brdf;
use super::view_transform::display_color;
use crate::lanes::{F4, V3};
use crate::plan::{Plan, PlanSky};
use crate::sky::{SkyBackground, SkyMaps};
use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::PI;

/// Ambient light of a surface: the hemisphere light, and a sky's maps if there is one.
#[derive(Clone, Copy)]
pub(super) struct EnvironmentLight<'a> {
    up: Vec3,
    down: Vec3,
    sky: Option<(&'a SkyMaps, &'a PlanSky)>,
}

impl<'a> EnvironmentLight<'a> {
    pub(super) fn new(plan: &'a Plan, maps: Option<&'a SkyMaps>) -> EnvironmentLight<'a> {
        EnvironmentLight { up: plan.ambient_up, down: plan.ambient_down, sky: maps.zip(plan.sky.as_ref()) }
    }

    pub(crate) fn is_dark(&self) -> bool {
        self.up == Vec3::ZERO && self.down == Vec3::ZERO && self.sky.is_none()
    }

    /// Diffuse light on a white surface with this normal.
    pub(super) fn diffuse(&self, n: V3) -> V3 {
        let light = brdf::ambient(self.up, self.down, n);
        let Some((maps, sky)) = self.sky else { return light };
        let n = to_panorama_space(sky, n);
        let sky_light = evaluate_harmonics(&maps.harmonics, n);
        let positive =
            V3 { x: sky_light.x.max(F4::ZERO), y: sky_light.y.max(F4::ZERO), z: sky_light.z.max(F4::ZERO) };
        light + positive * F4::splat(sky.strength)
    }

    /// Environment light that a surface of this roughness reflects, from the mirror direction `direction`.
    pub(super) fn reflected(&self, direction: V3, roughness: F4) -> V3 {
        let light = brdf::ambient(self.up, self.down, direction);
        let Some((maps, sky)) = self.sky else { return light };
        let direction = to_panorama_space(sky, direction);
        let lanes: [Vec3; 4] = std::array::from_fn(|i| {
            maps.specular(Vec3::new(direction.x.0[i], direction.y.0[i], direction.z.0[i]), roughness.0[i])
                * sky.strength
        });
        let channel = |f: fn(&Vec3) -> f32| F4(std::array::from_fn(|i| f(&lanes[i])));
        light + V3 { x: channel(|v| v.x), y: channel(|v| v.y), z: channel(|v| v.z) }
    }

    /// Mean of the diffuse light from above and from below.
    pub(super) fn mean_diffuse(&self) -> V3 {
        let half = F4::splat(0.5);
        (self.diffuse(V3::splat(Vec3::Y)) + self.diffuse(V3::splat(Vec3::NEG_Y))) * half
    }
}

/// Rotates a world direction into the space of the panorama.
fn to_panorama_space(sky: &PlanSky, direction: V3) -> V3 {
    let [c, s] = sky.turn;
    V3 { x: direction.x * c - direction.z * s, y: direction.y, z: direction.x * s + direction.z * c }
}

/// Like [`to_panorama_space`], for one direction.
fn to_panorama(sky: &PlanSky, direction: Vec3) -> Vec3 {
    let [c, s] = sky.turn;
    Vec3::new(c * direction.x - s * direction.z, direction.y, s * direction.x + c * direction.z)
}

/// Display color of the sky in a direction: the background of a surface.
pub(super) fn sky_behind(plan: &Plan, maps: &SkyMaps, sky: &PlanSky, direction: Vec3) -> Vec3 {
    display_color(plan, maps.specular(to_panorama(sky, direction), 0.0) * sky.strength)
}

fn evaluate_harmonics(h: &[Vec3; 9], V3 { x, y, z }: V3) -> V3 {
    let c = |i: usize| V3::splat(h[i]);
    c(0) + c(1) * y
        + c(2) * z
        + c(3) * x
        + c(4) * (x * y)
        + c(5) * (y * z)
        + c(6) * (z * z * 3.0 - F4::ONE)
        + c(7) * (x * z)
        + c(8) * (x * x - y * y)
}

/// The panorama as the background of a frame.
pub(crate) struct SkyBackdrop<'a> {
    pub background: &'a SkyBackground,
    pub sky: &'a PlanSky,
    plan: &'a Plan,
    rays: [Vec3; 3],
}

impl<'a> SkyBackdrop<'a> {
    pub(super) fn new(background: &'a SkyBackground, sky: &'a PlanSky, plan: &'a Plan) -> SkyBackdrop<'a> {
        SkyBackdrop { background, sky, plan, rays: crate::view::ray_basis(&plan.view) }
    }

    /// Color of a pixel, at its center.
    pub(super) fn pixel(&self, x: i32, y: i32) -> Vec4 {
        let size = Vec2::new(self.plan.size[0] as f32, self.plan.size[1] as f32);
        let at = (Vec2::new(x as f32, y as f32) + 0.5) / size * 2.0 - 1.0;
        let [right, down, forward] = self.rays;
        let direction = to_panorama(self.sky, (right * at.x + down * at.y + forward).normalize());
        let [width, height] = self.background.size.map(|s| s as f32);
        let u = 0.5 + libm::atan2f(direction.x, -direction.z) / (2.0 * PI);
        let v = libm::acosf(direction.y.clamp(-1.0, 1.0)) / PI;
        let texel = Vec2::new(u * width, v * height) - 0.5;
        let (low, t) = (texel.floor(), texel - texel.floor());
        let (x, y) = (low.x as i64, low.y as i64);
        let row = |y| self.background.texel(x, y) * (1.0 - t.x) + self.background.texel(x + 1, y) * t.x;
        display_color(self.plan, (row(y) * (1.0 - t.y) + row(y + 1) * t.y) * self.sky.strength).extend(1.0)
    }
}
