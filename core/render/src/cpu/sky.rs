//! Image-based light, four pixels at once, and the sky behind everything. CPU reference of sky.wgsl.

use super::brdf;
use super::view_transform::displayed;
use crate::lanes::{F4, V3};
use crate::plan::{Plan, PlanSky};
use crate::sky::{SkyBackground, SkyMaps};
use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::PI;

/// Ambient light of a surface: the hemisphere light, and a sky's maps if there is one.
#[derive(Clone, Copy)]
pub struct EnvironmentLight<'a> {
    up: Vec3,
    down: Vec3,
    sky: Option<(&'a SkyMaps, &'a PlanSky)>,
}

impl<'a> EnvironmentLight<'a> {
    pub fn new(plan: &'a Plan, maps: Option<&'a SkyMaps>) -> EnvironmentLight<'a> {
        EnvironmentLight { up: plan.ambient_up, down: plan.ambient_down, sky: maps.zip(plan.sky.as_ref()) }
    }

    pub(crate) fn is_dark(&self) -> bool {
        self.up == Vec3::ZERO && self.down == Vec3::ZERO && self.sky.is_none()
    }

    /// Diffuse light on a white surface with this normal.
    pub fn diffuse(&self, n: V3) -> V3 {
        let light = brdf::ambient(self.up, self.down, n);
        let Some((maps, sky)) = self.sky else { return light };
        let n = turned(sky, n);
        let of_sky = polynomial(&maps.harmonics, n);
        let positive = V3 { x: of_sky.x.max(F4::ZERO), y: of_sky.y.max(F4::ZERO), z: of_sky.z.max(F4::ZERO) };
        light + positive * F4::splat(sky.strength)
    }

    /// Environment light reflected along `way` by a surface of this roughness.
    pub fn mirrored(&self, way: V3, roughness: F4) -> V3 {
        let light = brdf::ambient(self.up, self.down, way);
        let Some((maps, sky)) = self.sky else { return light };
        let way = turned(sky, way);
        let lanes: [Vec3; 4] = std::array::from_fn(|i| {
            maps.specular(Vec3::new(way.x.0[i], way.y.0[i], way.z.0[i]), roughness.0[i]) * sky.strength
        });
        let part = |f: fn(&Vec3) -> f32| F4(std::array::from_fn(|i| f(&lanes[i])));
        light + V3 { x: part(|v| v.x), y: part(|v| v.y), z: part(|v| v.z) }
    }

    /// Mean of the diffuse light from above and from below.
    pub fn even(&self) -> V3 {
        let half = F4::splat(0.5);
        (self.diffuse(V3::splat(Vec3::Y)) + self.diffuse(V3::splat(Vec3::NEG_Y))) * half
    }
}

/// Rotates a world direction into the space of the panorama.
fn turned(sky: &PlanSky, way: V3) -> V3 {
    let [c, s] = sky.turn;
    V3 { x: way.x * c - way.z * s, y: way.y, z: way.x * s + way.z * c }
}

/// Color of the sky in a direction, behind a surface.
pub fn behind(plan: &Plan, maps: &SkyMaps, sky: &PlanSky, way: Vec3) -> Vec3 {
    let [c, s] = sky.turn;
    let way = Vec3::new(c * way.x - s * way.z, way.y, s * way.x + c * way.z);
    displayed(plan, maps.specular(way, 0.0) * sky.strength)
}

fn polynomial(h: &[Vec3; 9], V3 { x, y, z }: V3) -> V3 {
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
    pub picture: &'a SkyBackground,
    pub sky: &'a PlanSky,
    plan: &'a Plan,
    rays: [Vec3; 3],
}

impl<'a> SkyBackdrop<'a> {
    pub fn new(picture: &'a SkyBackground, sky: &'a PlanSky, plan: &'a Plan) -> SkyBackdrop<'a> {
        SkyBackdrop { picture, sky, plan, rays: crate::view::rays(&plan.view) }
    }

    /// Color of a pixel, at its center.
    pub fn pixel(&self, x: i32, y: i32) -> Vec4 {
        let size = Vec2::new(self.plan.size[0] as f32, self.plan.size[1] as f32);
        let at = (Vec2::new(x as f32, y as f32) + 0.5) / size * 2.0 - 1.0;
        let [right, down, ahead] = self.rays;
        let way = (right * at.x + down * at.y + ahead).normalize();
        let [c, s] = self.sky.turn;
        let way = Vec3::new(c * way.x - s * way.z, way.y, s * way.x + c * way.z);
        let [width, height] = self.picture.size.map(|s| s as f32);
        let u = 0.5 + libm::atan2f(way.x, -way.z) / (2.0 * PI);
        let v = libm::acosf(way.y.clamp(-1.0, 1.0)) / PI;
        let place = Vec2::new(u * width, v * height) - 0.5;
        let (low, t) = (place.floor(), place - place.floor());
        let (x, y) = (low.x as i64, low.y as i64);
        let row = |y| self.picture.texel(x, y) * (1.0 - t.x) + self.picture.texel(x + 1, y) * t.x;
        displayed(self.plan, (row(y) * (1.0 - t.y) + row(y + 1) * t.y) * self.sky.strength).extend(1.0)
    }
}
