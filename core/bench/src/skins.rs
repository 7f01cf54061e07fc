//! Reference skinning in f64, written independently of the skinning of `choreo_motion`: linear and dual-quaternion blending, and the mean
//! motion of a vertex's joints, against which both are measured.

use glam::{DAffine3, DMat3, DQuat, DVec3};

/// Rigid motion x ↦ R x + t.
#[derive(Clone, Copy, Debug)]
struct Motion {
    turn: DQuat,
    shift: DVec3,
}

/// Transform of a joint in two parts: a symmetric stretch, then a rigid motion.
#[derive(Clone, Copy, Debug)]
pub struct PolarParts {
    motion: Motion,
    stretch: DMat3,
}

impl PolarParts {
    /// Polar decomposition by Newton's method (N. Higham, "Computing the polar decomposition", 1986). A map that mirrors has a negative
    /// stretch. A map without an inverse keeps its matrix as the stretch.
    pub fn of(map: &DAffine3) -> PolarParts {
        let m = map.matrix3;
        let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
        let mut turn = m * sign;
        for _ in 0..60 {
            turn = (turn + turn.inverse().transpose()) * 0.5;
        }
        if !turn.is_finite() {
            turn = DMat3::IDENTITY;
        }
        let motion = Motion { turn: DQuat::from_mat3(&turn).normalize(), shift: map.translation };
        PolarParts { motion, stretch: turn.transpose() * m }
    }
}

/// Number of a joint, and its weight.
type Influence = (usize, f64);

/// Linear blend skinning (glTF 2.0 §3.7.3.3): the weighted sum of the positions to which the joints move the point.
pub fn linear(maps: &[DAffine3], influences: &[Influence], point: DVec3) -> DVec3 {
    let column =
        |of: fn(&DAffine3) -> DVec3| -> DVec3 { influences.iter().map(|(j, w)| of(&maps[*j]) * *w).sum() };
    let [x, y, z] =
        [column(|m| m.matrix3.x_axis), column(|m| m.matrix3.y_axis), column(|m| m.matrix3.z_axis)];
    x * point.x + y * point.y + z * point.z + column(|m| m.translation)
}

/// Dual-quaternion linear blending (Kavan et al. 2008, §4) of the motions, after the weighted sum of the stretches.
pub fn dual(parts: &[PolarParts], influences: &[Influence], point: DVec3) -> DVec3 {
    let stretched = stretched(parts, influences, point);
    blended(parts, influences).map_or(stretched, |motion| motion.turn * stretched + motion.shift)
}

/// Mean of the rigid motions in their group, after the weighted sum of the stretches. The weighted sum of the screws from this mean to all
/// motions is zero; it is found by steps along that sum ("dual quaternion iterative blending" of the same paper, §5).
pub(crate) fn mean_motion(parts: &[PolarParts], influences: &[Influence], point: DVec3) -> DVec3 {
    let stretched = stretched(parts, influences, point);
    let Some(mut mean) = blended(parts, influences) else { return stretched };
    for _ in 0..50 {
        let mut screw = [DVec3::ZERO; 2];
        for (joint, weight) in influences {
            let [turn, shift] = mean.inverse().compose_after(&parts[*joint].motion).logarithm();
            screw = [screw[0] + turn * *weight, screw[1] + shift * *weight];
        }
        mean = mean.compose_after(&Motion::exponential(screw));
        if screw[0].length() + screw[1].length() < 1e-14 {
            break;
        }
    }
    mean.turn * stretched + mean.shift
}

fn stretched(parts: &[PolarParts], influences: &[Influence], point: DVec3) -> DVec3 {
    influences.iter().map(|(joint, weight)| parts[*joint].stretch * point * *weight).sum()
}

/// Normalized weighted sum of dual quaternions, in the hemisphere of the heaviest; `None` if no weight is positive.
fn blended(parts: &[PolarParts], influences: &[Influence]) -> Option<Motion> {
    let heaviest = influences.iter().rev().max_by(|a, b| a.1.total_cmp(&b.1)).filter(|i| i.1 > 0.0)?;
    let pivot = parts[heaviest.0].motion.turn;
    let (mut real, mut dual) = (DQuat::from_array([0.0; 4]), DQuat::from_array([0.0; 4]));
    for (joint, weight) in influences {
        let Motion { turn, shift } = parts[*joint].motion;
        let side = if turn.dot(pivot) < 0.0 { -*weight } else { *weight };
        real += turn * side;
        dual += DQuat::from_vec4(shift.extend(0.0)) * turn * (0.5 * side);
    }
    let length = real.length();
    let (real, dual) = (real * (1.0 / length), dual * (1.0 / length));
    (length > 1e-30).then(|| Motion { turn: real, shift: (dual * real.conjugate()).xyz() * 2.0 })
}

impl Motion {
    fn inverse(&self) -> Motion {
        let turn = self.turn.conjugate();
        Motion { turn, shift: -(turn * self.shift) }
    }

    /// Composition: applies the other motion, then this one.
    fn compose_after(&self, other: &Motion) -> Motion {
        Motion { turn: (self.turn * other.turn).normalize(), shift: self.turn * other.shift + self.shift }
    }

    /// Logarithm of the motion: a rotation vector and a shift, the constant velocities that reach it in one unit of time.
    fn logarithm(&self) -> [DVec3; 2] {
        let q = if self.turn.w < 0.0 { -self.turn } else { self.turn };
        let sine = q.xyz().length();
        let angle = 2.0 * libm::atan2(sine, q.w);
        let turn = if sine > 1e-300 { q.xyz() * (angle / sine) } else { DVec3::ZERO };
        let squared = angle * angle;
        // (1 − (θ/2) cot (θ/2)) / θ², which is 1/12 + θ²/720 near 0.
        let factor = match angle < 1e-4 {
            true => 1.0 / 12.0 + squared / 720.0,
            false => (1.0 - 0.5 * angle * q.w / sine) / squared,
        };
        let across = turn.cross(self.shift);
        [turn, self.shift - across * 0.5 + turn.cross(across) * factor]
    }

    /// Exponential map, the inverse of [`Motion::logarithm`].
    fn exponential([turn, shift]: [DVec3; 2]) -> Motion {
        let angle = turn.length();
        let squared = angle * angle;
        let (first, second) = match angle < 1e-4 {
            true => (0.5 - squared / 24.0, 1.0 / 6.0 - squared / 120.0),
            false => ((1.0 - libm::cos(angle)) / squared, (angle - libm::sin(angle)) / (squared * angle)),
        };
        let across = turn.cross(shift);
        let shift = shift + across * first + turn.cross(across) * second;
        Motion { turn: DQuat::from_scaled_axis(turn), shift }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotation_about(pivot: DVec3, axis: DVec3, degrees: f64) -> DAffine3 {
        DAffine3::from_translation(pivot)
            * DAffine3::from_axis_angle(axis, degrees.to_radians())
            * DAffine3::from_translation(-pivot)
    }

    /// Turns about one axis: the mean turns by the mean angle, a closed form; dual quaternions do so for two equal weights, and the sum of
    /// matrices comes nearer to the axis by the cosine of half of the angle.
    #[test]
    fn means_of_turns_about_one_axis_equal_the_closed_form() {
        let (pivot, axis) = (DVec3::new(0.3, 1.4, 0.0), DVec3::new(0.6, 0.0, 0.8));
        let point = DVec3::new(0.3, 2.4, 0.0);
        for degrees in [0.0, 1e-5, 30.0, 120.0, 170.0] {
            let maps = [0.0, degrees].map(|d| rotation_about(pivot, axis, d));
            let parts = maps.each_ref().map(PolarParts::of);
            let half = rotation_about(pivot, axis, degrees / 2.0).transform_point3(point);
            for method in [dual, mean_motion] {
                let off = method(&parts, &[(0, 0.5), (1, 0.5)], point).distance(half);
                assert!(off < 1e-12, "{degrees}°: {off}");
            }
            let thin = linear(&maps, &[(0, 0.5), (1, 0.5)], point).distance(pivot);
            assert!((thin - libm::cos(degrees.to_radians() / 2.0)).abs() < 1e-12, "{degrees}°: {thin}");
            let share = rotation_about(pivot, axis, degrees * 0.2).transform_point3(point);
            let influences = [(0, 0.8), (1, 0.2)];
            assert!(mean_motion(&parts, &influences, point).distance(share) < 1e-12, "{degrees}°");
            // The comparison can fail: dual quaternions are inexact for unequal weights.
            let off = dual(&parts, &influences, point).distance(share);
            assert!(degrees < 100.0 || off > 1e-3, "{degrees}°: {off}");
        }
    }

    #[test]
    fn a_single_joint_moves_points_by_its_map() {
        for scale in [DVec3::ONE, DVec3::new(1.0, 2.0, 0.5), DVec3::new(-1.0, 1.0, 1.0)] {
            let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -2.0) / 3.0, 2.2);
            let map = DAffine3::from_scale_rotation_translation(scale, turn, DVec3::new(3.0, -1.0, 2.0));
            let (point, one) = (DVec3::new(0.1, 0.2, 0.3), [(0, 1.0)]);
            let exact = map.transform_point3(point);
            let parts = [PolarParts::of(&map)];
            let got =
                [linear(&[map], &one, point), dual(&parts, &one, point), mean_motion(&parts, &one, point)];
            assert!(got.iter().all(|got| got.distance(exact) < 1e-12), "{scale}: {got:?}");
        }
    }
}
