//! Content as an unambiguous stream of bytes.

use super::ContentHash;
use crate::*;
use choreo_motion::{Interpolation, Time};
use glam::{Affine2, DQuat, DVec3, Mat4, Quat, Vec2, Vec3, Vec4};

/// Feeds a hasher with a length or tag before everything whose extent is not fixed, so that no two contents share a byte stream.
#[derive(Default)]
pub(super) struct Writer(blake3::Hasher);

impl Writer {
    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        self.count(bytes.len());
        self.0.update(bytes);
    }
    pub(super) fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
    }
    pub(super) fn tag(&mut self, tag: u8) {
        self.0.update(&[tag]);
    }
    pub(super) fn flag(&mut self, flag: bool) {
        self.tag(flag.into());
    }
    pub(super) fn count(&mut self, n: usize) {
        self.0.update(&(n as u64).to_le_bytes());
    }
    pub(super) fn u32(&mut self, v: u32) {
        self.0.update(&v.to_le_bytes());
    }
    pub(super) fn f32(&mut self, v: f32) {
        self.u32(v.to_bits());
    }
    pub(super) fn f64(&mut self, v: f64) {
        self.0.update(&v.to_bits().to_le_bytes());
    }
    pub(super) fn time(&mut self, t: Time) {
        self.0.update(&t.0.to_le_bytes());
    }
    /// Plain little-endian numbers in one go; every supported machine is little-endian or takes the loop.
    pub(super) fn pods<T: bytemuck::Pod>(&mut self, list: &[T], word: usize) {
        self.count(list.len());
        let bytes: &[u8] = bytemuck::cast_slice(list);
        if cfg!(target_endian = "little") {
            self.0.update(bytes);
        } else {
            for chunk in bytes.chunks(word) {
                let mut chunk = chunk.to_vec();
                chunk.reverse();
                self.0.update(&chunk);
            }
        }
    }
    pub(super) fn f32s(&mut self, list: &[f32]) {
        self.pods(list, 4);
    }
    pub(super) fn vec2s(&mut self, list: &[Vec2]) {
        self.pods(list, 4);
    }
    pub(super) fn vec3s(&mut self, list: &[Vec3]) {
        self.pods(list, 4);
    }
    pub(super) fn vec4s(&mut self, list: &[Vec4]) {
        self.pods(list, 4);
    }
    pub(super) fn vec3(&mut self, v: Vec3) {
        v.to_array().into_iter().for_each(|c| self.f32(c));
    }
    pub(super) fn vec4(&mut self, v: Vec4) {
        v.to_array().into_iter().for_each(|c| self.f32(c));
    }
    pub(super) fn quat(&mut self, q: Quat) {
        self.vec4(q.into());
    }
    pub(super) fn mat4(&mut self, m: &Mat4) {
        m.to_cols_array().into_iter().for_each(|c| self.f32(c));
    }
    pub(super) fn dvec3(&mut self, v: DVec3) {
        v.to_array().into_iter().for_each(|c| self.f64(c));
    }
    pub(super) fn dquat(&mut self, q: DQuat) {
        q.to_array().into_iter().for_each(|c| self.f64(c));
    }
    pub(super) fn affine2(&mut self, a: &Affine2) {
        a.to_cols_array().into_iter().for_each(|c| self.f32(c));
    }
    pub(super) fn option<T>(&mut self, value: &Option<T>, write: impl FnOnce(&mut Writer, &T)) {
        self.flag(value.is_some());
        if let Some(value) = value {
            write(self, value);
        }
    }
    pub(super) fn list<T>(&mut self, list: &[T], mut write: impl FnMut(&mut Writer, &T)) {
        self.count(list.len());
        for item in list {
            write(self, item);
        }
    }
    pub(super) fn finish(self) -> ContentHash {
        *self.0.finalize().as_bytes()
    }
}

pub(super) fn hash_of(write: impl FnOnce(&mut Writer)) -> ContentHash {
    let mut w = Writer::default();
    write(&mut w);
    w.finish()
}

/// What assets and stages both hold.
impl Writer {
    pub(super) fn interpolation(&mut self, interpolation: Interpolation) {
        self.tag(match interpolation {
            Interpolation::Step => 0,
            Interpolation::Linear => 1,
            Interpolation::CubicSpline => 2,
        });
    }

    pub(super) fn projection(&mut self, projection: &Projection) {
        match projection {
            Projection::Perspective { yfov, near, far } => {
                self.tag(0);
                self.f32(*yfov);
                self.f32(*near);
                self.option(far, |w, far| w.f32(*far));
            }
            Projection::Orthographic { height, near, far } => {
                self.tag(1);
                self.f32(*height);
                self.f32(*near);
                self.f32(*far);
            }
        }
    }

    pub(super) fn shadow(&mut self, shadow: &Option<Shadow>) {
        self.option(shadow, |w, Shadow { size, softness }| {
            w.u32(*size);
            w.f32(*softness);
        });
    }

    pub(super) fn light(&mut self, light: &Light) {
        match light.kind {
            LightKind::Directional => self.tag(0),
            LightKind::Point => self.tag(1),
            LightKind::Spot { inner, outer } => {
                self.tag(2);
                self.f32(inner);
                self.f32(outer);
            }
        }
        self.vec3(light.color);
        self.f32(light.intensity);
        self.option(&light.range, |w, range| w.f32(*range));
    }
}
