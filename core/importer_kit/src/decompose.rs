//! Decomposition of a matrix into translation, rotation and scale, in f64.

use glam::{DMat3, DMat4, DQuat, DVec3};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trs {
    pub translation: DVec3,
    pub rotation: DQuat,
    /// Scale of each axis; x is negative for a matrix that mirrors.
    pub scale: DVec3,
    /// Largest column error of the parts against the matrix, relative to its longest column: the shear that is lost.
    pub error: f64,
}

/// Decomposes a matrix by Gram–Schmidt orthogonalization, x axis first. Columns of length zero (flattened models) get axes that fit the
/// others.
pub fn decompose(m: &DMat4) -> Trs {
    let columns = [m.x_axis, m.y_axis, m.z_axis].map(|c| c.truncate());
    let translation = m.w_axis.truncate();
    let lengths = columns.map(|c| c.length());
    let largest = lengths.iter().fold(0.0, |a: f64, b| a.max(*b));
    if largest == 0.0 || !largest.is_finite() {
        return Trs { translation, rotation: DQuat::IDENTITY, scale: DVec3::ZERO, error: 0.0 };
    }
    let axis = |i: usize| (lengths[i] > largest * 1e-9).then(|| columns[i] * (1.0 / lengths[i]));
    let (ax, ay, az) = (axis(0), axis(1), axis(2));
    let x = ax.unwrap_or_else(|| match (ay, az) {
        (Some(y), Some(z)) => y.cross(z).try_normalize().unwrap_or_else(|| y.any_orthonormal_vector()),
        (Some(y), None) => y.any_orthonormal_vector(),
        (_, Some(z)) => z.any_orthonormal_vector(),
        _ => DVec3::X,
    });
    let y = match (ay, az) {
        (Some(y), _) => (y - x * x.dot(y)).try_normalize().unwrap_or_else(|| x.any_orthonormal_vector()),
        (None, Some(z)) => z.cross(x).try_normalize().unwrap_or_else(|| x.any_orthonormal_vector()),
        _ => x.any_orthonormal_vector(),
    };
    let z = x.cross(y);
    let mut scale = DVec3::from(lengths);
    let mut rotation = DMat3::from_cols(x, y, z);
    if columns[2].dot(z) < 0.0 {
        scale.x = -scale.x;
        rotation = DMat3::from_cols(-x, y, -z);
    }
    let off = (0..3).map(|c| (rotation.col(c) * scale[c] - columns[c]).length_squared()).fold(0.0, f64::max);
    let error = off.sqrt() / largest;
    Trs { translation, rotation: DQuat::from_mat3(&rotation).normalize(), scale, error }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decomposed_parts_recompose_the_matrix() {
        let rotation = DQuat::from_xyzw(0.1, -0.7, 0.3, 0.5).normalize();
        for scale in
            [DVec3::ONE, DVec3::new(2.0, 0.5, 9.0), DVec3::new(-1.0, 2.0, 3.0), DVec3::new(0.0, 1.0, 1.0)]
        {
            let m = DMat4::from_scale_rotation_translation(scale, rotation, DVec3::new(1.0, 2.0, 3.0));
            let p = decompose(&m);
            let back = DMat4::from_scale_rotation_translation(p.scale, p.rotation, p.translation);
            assert!(back.abs_diff_eq(m, 1e-12) && p.error < 1e-12, "{scale}: {back} {m}");
        }
        let mirrored = DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0));
        let p = decompose(&mirrored);
        assert!(
            DMat4::from_scale_rotation_translation(p.scale, p.rotation, p.translation)
                .abs_diff_eq(mirrored, 1e-12)
        );
        let mut sheared = DMat4::IDENTITY;
        sheared.y_axis.x = 0.5;
        assert!(decompose(&sheared).error > 0.1);
        assert_eq!(decompose(&DMat4::ZERO).scale, DVec3::ZERO);
    }
}
