//! Geometric transforms: the placement of a mesh on its node, computed with libm from the file's angles. ufbx would use the sines
//! of the C library.

use crate::convert::vec3;
use crate::local::LocalTransform;
use crate::nodes;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use ufbx::Node;

pub(crate) struct Geometry {
    place: DAffine3,
    /// Matrix of normals, with determinant ±1, so that their lengths are kept as far as possible.
    normals: DMat3,
    /// The transform mirrors, so faces must be reversed.
    pub mirrors: bool,
}

fn f64s(v: &ufbx::Vec3) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

impl Geometry {
    /// The geometric transform of a helper that is no joint; `None` for all other nodes.
    pub(crate) fn of(holder: &Node) -> Option<Geometry> {
        let local = LocalTransform::new(holder).filter(|_| nodes::is_folded(holder))?;
        let place = local.matrix_at_rest();
        let m = place.matrix3;
        let determinant = m.determinant();
        // The cofactor matrix (inverse transpose times determinant), which also exists where the inverse does not.
        let cofactors =
            DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
        let size = libm::cbrt(cofactors.determinant().abs());
        let sign = if determinant < 0.0 { -1.0 } else { 1.0 };
        let factor = if size > 1e-100 && size.is_finite() { sign / size } else { sign };
        Some(Geometry { place, normals: cofactors * factor, mirrors: determinant < 0.0 })
    }

    pub(crate) fn point(&self, p: &ufbx::Vec3) -> Vec3 {
        self.place.transform_point3(f64s(p)).as_vec3()
    }

    pub(crate) fn normal(&self, n: &ufbx::Vec3) -> Vec3 {
        let turned = self.normals * f64s(n);
        let length = turned.length();
        if length > 0.0 && length.is_finite() { (turned / length).as_vec3() } else { vec3(n) }
    }

    pub(crate) fn offset(&self, v: Vec3) -> Vec3 {
        self.place.transform_vector3(v.as_dvec3()).as_vec3()
    }

    pub(crate) fn normal_offset(&self, v: Vec3) -> Vec3 {
        (self.normals * v.as_dvec3()).as_vec3()
    }
}
