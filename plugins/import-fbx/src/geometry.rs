//! Geometric transforms: where a mesh lies on its node, from the file's angles by libm. ufbx would put them into the mesh with the
//! sines of the C library.

use crate::convert::vec3;
use crate::local::Local;
use crate::nodes;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use ufbx::Node;

pub struct Geometry {
    place: DAffine3,
    /// Map of unit determinant, or its negative: lengths of normals are kept as far as possible.
    normals: DMat3,
    /// Faces turn round with it.
    pub mirrors: bool,
}

fn f64s(v: &ufbx::Vec3) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

impl Geometry {
    /// Geometry of a helper that is no joint; `None` for all other nodes.
    pub fn of(holder: &Node) -> Option<Geometry> {
        let local = Local::new(holder).filter(|_| nodes::is_folded(holder))?;
        let place = local.matrix_at_rest();
        let m = place.matrix3;
        let determinant = m.determinant();
        // The inverse transposed, times the determinant: there where the inverse is not, too.
        let cofactors =
            DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
        let size = libm::cbrt(cofactors.determinant().abs());
        let sign = if determinant < 0.0 { -1.0 } else { 1.0 };
        let factor = if size > 1e-100 && size.is_finite() { sign / size } else { sign };
        Some(Geometry { place, normals: cofactors * factor, mirrors: determinant < 0.0 })
    }

    pub fn point(&self, p: &ufbx::Vec3) -> Vec3 {
        self.place.transform_point3(f64s(p)).as_vec3()
    }

    pub fn normal(&self, n: &ufbx::Vec3) -> Vec3 {
        let turned = self.normals * f64s(n);
        let length = turned.length();
        if length > 0.0 && length.is_finite() { (turned / length).as_vec3() } else { vec3(n) }
    }

    pub fn offset(&self, v: Vec3) -> Vec3 {
        self.place.transform_vector3(v.as_dvec3()).as_vec3()
    }

    pub(crate) fn normal_offset(&self, v: Vec3) -> Vec3 {
        (self.normals * v.as_dvec3()).as_vec3()
    }
}
