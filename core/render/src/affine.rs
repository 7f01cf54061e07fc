//! Affine transforms in the layout that shaders read.

use choreo_asset::widen;
use glam::{Affine3A, DAffine3, DVec4, Vec3, Vec4};

/// An affine transform as the three rows of a 3×4 matrix: `dot(row.xyz, p) + row.w`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Affine3x4(pub [Vec4; 3]);

impl Affine3x4 {
    /// Converts a transform. Each element is rounded once, from f64 to f32.
    pub fn from_affine(a: DAffine3) -> Affine3x4 {
        let m = a.matrix3;
        let row = |i: usize| DVec4::new(m.x_axis[i], m.y_axis[i], m.z_axis[i], a.translation[i]).as_vec4();
        Affine3x4([row(0), row(1), row(2)])
    }

    pub fn from_affine3a(a: Affine3A) -> Affine3x4 {
        Affine3x4::from_affine(to_f64(a))
    }

    pub(crate) fn transform_point(&self, p: Vec3) -> Vec3 {
        let p = p.extend(1.0);
        Vec3::new(self.0[0].dot(p), self.0[1].dot(p), self.0[2].dot(p))
    }

    pub(crate) fn transform_vector(&self, v: Vec3) -> Vec3 {
        let v = v.extend(0.0);
        Vec3::new(self.0[0].dot(v), self.0[1].dot(v), self.0[2].dot(v))
    }

    /// The transform that applies `stretch`, which has no translation, before this transform.
    pub(crate) fn compose_linear(&self, stretch: &Affine3x4) -> Affine3x4 {
        let [a, b, c] = stretch.0;
        let row = |r: Vec4| (a * r.x + b * r.y + c * r.z).truncate().extend(r.w);
        Affine3x4(self.0.map(row))
    }

    /// The transform that applies this transform, then `outer`.
    pub(crate) fn followed_by(&self, outer: &Affine3x4) -> Affine3x4 {
        let [a, b, c] = self.0;
        Affine3x4(outer.0.map(|r| a * r.x + b * r.y + c * r.z + Vec4::new(0.0, 0.0, 0.0, r.w)))
    }

    /// Determinant of the 3×3 part; negative where the transform mirrors.
    pub(crate) fn determinant(&self) -> f32 {
        let [a, b, c] = self.0.map(|r| r.truncate());
        a.dot(b.cross(c))
    }

    /// Largest scale factor along an axis: the length of the longest column of the 3×3 part.
    pub(crate) fn largest_stretch(&self) -> f32 {
        let square = |axis: usize| self.0.iter().map(|row| row[axis] * row[axis]).sum::<f32>();
        square(0).max(square(1)).max(square(2)).sqrt()
    }
}

/// Widens a transform to f64, exactly.
pub(crate) fn to_f64(a: Affine3A) -> DAffine3 {
    widen(&a)
}
