//! Dual quaternions: affine maps that are blended without losing volume, one at a time in f64.
//!
//! L. Kavan, S. Collins, J. Žára, C. O'Sullivan, "Geometric Skinning with Approximate Dual Quaternion Blending", ACM
//! Transactions on Graphics 27 (4), 2008: the normalized sum of weighted unit dual quaternions (§4) moves a point about the
//! axis between the motions, while a weighted sum of matrices moves it in a straight line and thins the limb. A dual
//! quaternion has no scale or shear, so skinning has two phases (§4.5): each map is decomposed into a rotation, a translation
//! and a stretch that comes before them; stretches are blended as matrices, rigid motions as dual quaternions.
//!
//! A rotation has two quaternions, q and −q, and only those of one hemisphere can be summed. All are taken in that of the
//! heaviest influence (the first of equals), so that neither the order of influences in a file nor influences without weight
//! matter.

use glam::{DAffine3, DMat3, DQuat, DVec3};

/// Method by which the vertices of a skin follow several joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Skinning {
    /// Linear blend skinning: the weighted sum of the joints' matrices, as in glTF 2.0 §3.7.3.3.
    #[default]
    Linear,
    /// Dual-quaternion skinning: stretches are blended first, then dual quaternions. Twisted limbs keep their volume.
    DualQuaternion,
}

/// Decomposed affine map of one joint: `x ↦ R (S x) + t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StretchedDualQuaternion {
    /// R, a unit quaternion.
    pub real: DQuat,
    /// ½ t R, as quaternions.
    pub dual: DQuat,
    /// S: scale and shear, symmetric; negative where the map mirrors.
    pub stretch: DMat3,
}

impl StretchedDualQuaternion {
    /// Decomposes an affine map. The rotation of a singular map is not unique.
    pub fn of(map: DAffine3) -> StretchedDualQuaternion {
        let (rotation, stretch) = polar_decomposition(map.matrix3);
        let real = DQuat::from_mat3(&rotation).normalize();
        let t = map.translation;
        StretchedDualQuaternion { real, dual: DQuat::from_xyzw(t.x, t.y, t.z, 0.0) * real * 0.5, stretch }
    }

    /// The rigid motion: R and t without S.
    pub fn rigid(&self) -> DAffine3 {
        DAffine3 { matrix3: DMat3::from_quat(self.real), translation: translation(self.real, self.dual) }
    }

    /// Blended map of a vertex that several joints influence, from (map, weight); zero if no weight is above 0.
    pub fn blend<'a>(
        influences: impl Iterator<Item = (&'a StretchedDualQuaternion, f64)> + Clone,
    ) -> DAffine3 {
        let mut pivot: Option<(&StretchedDualQuaternion, f64)> = None;
        for (carrier, weight) in influences.clone() {
            if weight > pivot.map_or(0.0, |(_, heaviest)| heaviest) {
                pivot = Some((carrier, weight));
            }
        }
        let Some((pivot, _)) = pivot else {
            return DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO };
        };
        let (mut real, mut dual) = (pivot.real * 0.0, pivot.real * 0.0);
        let mut stretch = DMat3::ZERO;
        for (carrier, weight) in influences {
            let signed = if carrier.real.dot(pivot.real) < 0.0 { -weight } else { weight };
            real += carrier.real * signed;
            dual += carrier.dual * signed;
            stretch += carrier.stretch * weight;
        }
        let length = real.length();
        // Negative weights can cancel others.
        if length < 1e-30 {
            return DAffine3 { matrix3: stretch, translation: DVec3::ZERO };
        }
        let (real, dual) = (real / length, dual / length);
        DAffine3 { matrix3: DMat3::from_quat(real) * stretch, translation: translation(real, dual) }
    }
}

/// Translation t from a unit real part and the dual part ½ t R; a component of the dual part along the real part has no effect
/// (Kavan 2008, §3).
fn translation(real: DQuat, dual: DQuat) -> DVec3 {
    (dual * real.conjugate()).xyz() * 2.0
}

/// Polar decomposition into a rotation and a symmetric stretch. The stretch is negative if the matrix mirrors, so that all joints
/// of a mirrored character are mirrored alike.
fn polar_decomposition(m: DMat3) -> (DMat3, DMat3) {
    let largest = m.to_cols_array().into_iter().fold(0.0f64, |a, v| a.max(v.abs()));
    if !largest.is_finite() || largest < 1e-150 {
        return (DMat3::IDENTITY, m);
    }
    let mirrored = m.determinant() < 0.0;
    let scaled = m * (if mirrored { -1.0 } else { 1.0 } / largest);
    let rotation = nearest_rotation(scaled);
    let stretch = rotation.transpose() * m;
    (rotation, (stretch + stretch.transpose()) * 0.5)
}

/// Rotation R of the polar decomposition m = R·S, from the eigenvectors of mᵀm.
fn nearest_rotation(m: DMat3) -> DMat3 {
    let square = m.transpose() * m;
    let [xx, yy, zz] = [square.x_axis.x, square.y_axis.y, square.z_axis.z];
    let off = square.y_axis.x.abs().max(square.z_axis.x.abs()).max(square.z_axis.y.abs());
    // The usual case is a rotation with a uniform scale.
    if off <= 1e-13 * xx && (xx - yy).abs() <= 1e-13 * xx && (xx - zz).abs() <= 1e-13 * xx {
        return m * (1.0 / xx.sqrt());
    }
    let (values, vectors) = symmetric_eigenvectors(square);
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
    let (v0, v1) = (vectors.col(order[0]), vectors.col(order[1]));
    let v2 = v0.cross(v1);
    let u0 = (m * v0).normalize_or(v0);
    let along = m * v1;
    let perpendicular = along - u0 * u0.dot(along);
    let u1 =
        if perpendicular.length() > 1e-9 { perpendicular.normalize() } else { u0.any_orthonormal_vector() };
    let u2 = u0.cross(u1);
    DMat3::from_cols(u0, u1, u2) * DMat3::from_cols(v0, v1, v2).transpose()
}

/// Eigenvalues and eigenvectors of a symmetric matrix by Jacobi's rotations (Golub and Van Loan, "Matrix Computations", §8.5).
fn symmetric_eigenvectors(mut a: DMat3) -> ([f64; 3], DMat3) {
    let mut vectors = DMat3::IDENTITY;
    // Quadratic convergence: six sweeps are exact to f64, more cost nothing once the matrix is diagonal.
    for _ in 0..10 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = a.col(q)[p];
            if off.abs() <= 1e-300 {
                continue;
            }
            let theta = (a.col(q)[q] - a.col(p)[p]) / (2.0 * off);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(p)[p] = c;
            turn.col_mut(q)[q] = c;
            turn.col_mut(q)[p] = s;
            turn.col_mut(p)[q] = -s;
            a = turn.transpose() * a * turn;
            vectors *= turn;
        }
    }
    ([a.x_axis.x, a.y_axis.y, a.z_axis.z], vectors)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_near(a: DAffine3, b: DAffine3) -> bool {
        a.abs_diff_eq(b, 1e-12)
    }

    #[test]
    fn blending_one_joint_gives_its_map() {
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -2.0) / 3.0, 2.2);
        for scale in [DVec3::ONE, DVec3::splat(0.01), DVec3::new(1.0, 2.0, 0.5), DVec3::new(-1.0, 1.0, 1.0)] {
            let shear = DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::new(0.4, 1.0, 0.1), DVec3::Z));
            let map =
                DAffine3::from_scale_rotation_translation(scale, turn, DVec3::new(3.0, -1.0, 2.0)) * shear;
            let carrier = StretchedDualQuaternion::of(map);
            assert!(is_near(StretchedDualQuaternion::blend([(&carrier, 1.0)].into_iter()), map), "{scale}");
            assert!((DMat3::from_quat(carrier.real).determinant() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn singular_maps_are_unchanged_by_blending() {
        for columns in [
            [DVec3::ZERO; 3],
            [DVec3::X * 1e-9, DVec3::ZERO, DVec3::ZERO],
            [DVec3::Y, DVec3::Z * 2.0, DVec3::ZERO],
        ] {
            let map = DAffine3 {
                matrix3: DMat3::from_cols_array_2d(&columns.map(|c| c.to_array())),
                translation: DVec3::X,
            };
            let got = StretchedDualQuaternion::blend([(&StretchedDualQuaternion::of(map), 1.0)].into_iter());
            assert!(is_near(got, map), "{got} {map}");
        }
    }

    /// Half of a turn by an angle is the turn by half the angle about the same axis, wherever that is: the closed form.
    #[test]
    fn equal_weights_give_half_the_rotation_about_the_same_axis() {
        let pivot = DVec3::new(0.3, 1.4, 0.0);
        let about = |angle: f64| {
            DAffine3::from_translation(pivot)
                * DAffine3::from_rotation_x(angle)
                * DAffine3::from_translation(-pivot)
        };
        for degrees in [0.0f64, 10.0, 90.0, 179.0, -120.0] {
            let angle = degrees.to_radians();
            let (a, b) = (StretchedDualQuaternion::of(about(0.0)), StretchedDualQuaternion::of(about(angle)));
            let got = StretchedDualQuaternion::blend([(&a, 0.5), (&b, 0.5)].into_iter());
            assert!(is_near(got, about(angle / 2.0)), "{degrees}");
            // The other quaternion of the same rotation gives the same.
            let b = StretchedDualQuaternion { real: -b.real, dual: -b.dual, ..b };
            assert!(
                is_near(
                    StretchedDualQuaternion::blend([(&b, 0.5), (&a, 0.5)].into_iter()),
                    about(angle / 2.0)
                ),
                "{degrees}"
            );
            // Linear blending thins a limb: the determinant of the mean of two turns is (1 + cos) / 2.
            let linear = (about(0.0).matrix3 + about(angle).matrix3) * 0.5;
            assert!((linear.determinant() - (1.0 + angle.cos()) / 2.0).abs() < 1e-12);
            assert!((got.matrix3.determinant() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn maps_without_rotation_blend_like_matrices() {
        let a = DAffine3::from_scale(DVec3::new(2.0, 1.0, 1.0));
        let b = DAffine3 { translation: DVec3::Y, ..DAffine3::from_scale(DVec3::splat(0.5)) };
        let got = StretchedDualQuaternion::blend(
            [(&StretchedDualQuaternion::of(a), 0.25), (&StretchedDualQuaternion::of(b), 0.75)].into_iter(),
        );
        let want = DAffine3 { matrix3: a.matrix3 * 0.25 + b.matrix3 * 0.75, translation: DVec3::Y * 0.75 };
        assert!(is_near(got, want), "{got}");
    }
}
