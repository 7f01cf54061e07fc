//! Content hashes (BLAKE3): equal content, equal hash, on every machine. Floats count by their bits, lists by length and content.

use choreo_motion::Time;
use glam::{Affine2, DQuat, DVec3, Mat4, Quat, Vec2, Vec3, Vec4};

/// BLAKE3 of content.
pub type ContentHash = [u8; 32];

/// Vectors that are copied together to be hashed: 64 KiB at most.
const BLOCK: usize = 4096;

/// Feeds a hasher with a length or tag before everything whose extent is not fixed, so that no two contents share a byte stream.
#[derive(Default)]
pub struct Writer(blake3::Hasher);

impl Writer {
    /// Adds bytes, without their number.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.count(bytes.len());
        self.0.update(bytes);
    }
    /// Adds a text with its length.
    pub fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
    }
    /// Adds the number of a variant.
    pub fn tag(&mut self, tag: u8) {
        self.0.update(&[tag]);
    }
    /// Adds a flag.
    pub fn flag(&mut self, flag: bool) {
        self.tag(flag.into());
    }
    /// Adds a number of elements.
    pub fn count(&mut self, n: usize) {
        self.0.update(&(n as u64).to_le_bytes());
    }
    /// Adds a number.
    pub fn u32(&mut self, v: u32) {
        self.0.update(&v.to_le_bytes());
    }
    /// Adds the bits of a number.
    pub fn f32(&mut self, v: f32) {
        self.u32(v.to_bits());
    }
    /// Adds the bits of a number.
    pub fn f64(&mut self, v: f64) {
        self.0.update(&v.to_bits().to_le_bytes());
    }
    /// Adds a time.
    pub fn time(&mut self, t: Time) {
        self.0.update(&t.0.to_le_bytes());
    }
    /// A list of numbers of `word` bytes.
    pub(crate) fn numbers<T: bytemuck::Pod>(&mut self, list: &[T], word: usize) {
        self.count(list.len());
        self.little_endian(list, word);
    }
    /// Plain little-endian numbers in one go; every supported machine is little-endian or takes the loop.
    fn little_endian<T: bytemuck::Pod>(&mut self, list: &[T], word: usize) {
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
    /// Adds a list of numbers with its length.
    pub fn f32s(&mut self, list: &[f32]) {
        self.numbers(list, 4);
    }
    /// A list of vectors, as arrays block by block.
    fn vectors<V: Copy, const N: usize>(&mut self, list: &[V], array: fn(&V) -> [f32; N]) {
        self.count(list.len());
        let mut numbers = Vec::with_capacity(list.len().min(BLOCK));
        for block in list.chunks(BLOCK) {
            numbers.clear();
            numbers.extend(block.iter().map(array));
            self.little_endian(numbers.as_flattened(), 4);
        }
    }
    pub(crate) fn vec2s(&mut self, list: &[Vec2]) {
        self.vectors(list, Vec2::to_array);
    }
    pub(crate) fn vec3s(&mut self, list: &[Vec3]) {
        self.vectors(list, Vec3::to_array);
    }
    pub(crate) fn vec4s(&mut self, list: &[Vec4]) {
        self.vectors(list, Vec4::to_array);
    }
    /// Adds a vector.
    pub fn vec3(&mut self, v: Vec3) {
        v.to_array().into_iter().for_each(|c| self.f32(c));
    }
    /// Adds a vector.
    pub fn vec4(&mut self, v: Vec4) {
        v.to_array().into_iter().for_each(|c| self.f32(c));
    }
    /// Adds a rotation.
    pub fn quat(&mut self, q: Quat) {
        self.vec4(q.into());
    }
    pub(crate) fn mat4(&mut self, m: &Mat4) {
        m.to_cols_array().into_iter().for_each(|c| self.f32(c));
    }
    /// Adds a vector.
    pub fn dvec3(&mut self, v: DVec3) {
        v.to_array().into_iter().for_each(|c| self.f64(c));
    }
    /// Adds a rotation.
    pub fn dquat(&mut self, q: DQuat) {
        q.to_array().into_iter().for_each(|c| self.f64(c));
    }
    pub(crate) fn affine2(&mut self, a: &Affine2) {
        a.to_cols_array().into_iter().for_each(|c| self.f32(c));
    }
    /// Adds a value that may be absent.
    pub fn option<T>(&mut self, value: &Option<T>, write: impl FnOnce(&mut Writer, &T)) {
        self.flag(value.is_some());
        if let Some(value) = value {
            write(self, value);
        }
    }
    /// Adds a list with its length.
    pub fn list<T>(&mut self, list: &[T], mut write: impl FnMut(&mut Writer, &T)) {
        self.count(list.len());
        for item in list {
            write(self, item);
        }
    }
    /// The hash of all that was added.
    pub fn finish(self) -> ContentHash {
        *self.0.finalize().as_bytes()
    }
}

/// The hash of what a function adds.
pub fn hash_of(write: impl FnOnce(&mut Writer)) -> ContentHash {
    let mut w = Writer::default();
    write(&mut w);
    w.finish()
}
