//! Limits of a joint's rotation from its rest pose.

use crate::input_error::InputError;
use crate::math::rotation::rotation_fraction;
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

/// Limit of a joint's rotation. Angles are in radians; axes are unit vectors in the joint's own space at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
pub enum Limit {
    /// The joint turns freely.
    #[default]
    Free,
    /// A ball joint: `axis` (usually along the bone) tilts by at most `swing`, and the joint turns about it by `twist.0`..=`twist.1`.
    /// (Swing after twist; Dobrowolski, "Swing-twist decomposition in Clifford algebra", 2015.)
    SwingTwist { axis: DVec3, swing: f64, twist: (f64, f64) },
    /// Turns about one axis only, by `angle.0`..=`angle.1`.
    Hinge { axis: DVec3, angle: (f64, f64) },
}

impl Limit {
    /// Names the first field that does not fit.
    pub fn check(&self) -> Result<(), InputError> {
        let (axis, (low, high)) = match self {
            Limit::Free => return Ok(()),
            Limit::SwingTwist { axis, swing, twist } => {
                InputError::check_value((0.0..=PI).contains(swing), "Limit.swing", swing, "0..=π")?;
                (axis, twist)
            }
            Limit::Hinge { axis, angle } => (axis, angle),
        };
        let length = axis.length();
        let unit = (length - 1.0).abs() <= 1e-6;
        InputError::check_value(unit, "Limit.axis", format!("of length {length}"), "of length 1")?;
        let within = (-PI..=*high).contains(low) && *high <= PI;
        InputError::check_value(within, "Limit", format!("{low} to {high}"), "an interval of -π..=π")
    }

    /// The nearest allowed rotation, with swing and twist clamped separately. `rest` and `local` are parent-from-joint, unit.
    pub fn clamp(&self, rest: DQuat, local: DQuat) -> DQuat {
        match *self {
            Limit::Free => local,
            Limit::SwingTwist { axis, swing, twist } => {
                let (tilt, turn) = swing_and_twist(rest.inverse() * local, axis);
                let clamped_turn = turn.clamp(twist.0, twist.1);
                let angle = angle_of(tilt);
                if angle <= swing && clamped_turn == turn {
                    return local;
                }
                let tilt = if angle <= swing { tilt } else { rotation_fraction(tilt, swing / angle) };
                (rest * tilt * DQuat::from_axis_angle(axis, clamped_turn)).normalize()
            }
            Limit::Hinge { axis, angle } => {
                let (_, turn) = swing_and_twist(rest.inverse() * local, axis);
                (rest * DQuat::from_axis_angle(axis, turn.clamp(angle.0, angle.1))).normalize()
            }
        }
    }

    /// Angle by which a rotation exceeds the limit, radians.
    pub fn excess(&self, rest: DQuat, local: DQuat) -> f64 {
        angle_of(local.inverse() * self.clamp(rest, local))
    }
}

/// Swing–twist decomposition: a swing of the axis, and the angle of the twist about it that comes before, −π..=π.
pub(super) fn swing_and_twist(q: DQuat, axis: DVec3) -> (DQuat, f64) {
    let along = q.xyz().dot(axis);
    let size = (along * along + q.w * q.w).sqrt();
    if size < 1e-12 {
        // The axis is reversed: any twist is as good.
        return (q, 0.0);
    }
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let turn = 2.0 * libm::atan2(along * sign, q.w * sign);
    (q * DQuat::from_axis_angle(axis, turn).inverse(), turn)
}

/// Angle of a rotation, radians, 0..=π.
pub(crate) fn angle_of(q: DQuat) -> f64 {
    2.0 * libm::atan2(q.xyz().length(), q.w.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn degrees(axis: DVec3, angle: f64) -> DQuat {
        DQuat::from_axis_angle(axis.normalize(), angle.to_radians())
    }

    #[test]
    fn rotations_within_the_limit_stay_and_others_are_clamped_to_it() {
        let rest = degrees(DVec3::new(1.0, 2.0, 3.0), 70.0);
        let limit = Limit::SwingTwist { axis: DVec3::Y, swing: 30f64.to_radians(), twist: (-0.2, 0.1) };
        assert_eq!(limit.check(), Ok(()));
        let within = rest * degrees(DVec3::X, 20.0) * degrees(DVec3::Y, 3.0);
        assert_eq!(limit.clamp(rest, within), within);
        let beyond = rest * degrees(DVec3::new(1.0, 0.0, 1.0), 80.0) * degrees(DVec3::Y, -60.0);
        let clamped = limit.clamp(rest, beyond);
        let (tilt, turn) = swing_and_twist(rest.inverse() * clamped, DVec3::Y);
        assert!((angle_of(tilt).to_degrees() - 30.0).abs() < 1e-9 && (turn + 0.2).abs() < 1e-9);
        // The direction of the tilt is unchanged.
        let way = tilt.xyz().normalize();
        assert!(way.abs_diff_eq(DVec3::new(1.0, 0.0, 1.0).normalize(), 1e-9), "{way}");
        assert!(limit.excess(rest, clamped) < 1e-7 && limit.excess(rest, beyond) > 0.5);
    }

    #[test]
    fn a_hinge_rotates_about_its_axis_only() {
        let limit = Limit::Hinge { axis: DVec3::X, angle: (0.0, 2.0) };
        let q = DQuat::from_rotation_x(1.0) * DQuat::from_rotation_y(0.3);
        let clamped = limit.clamp(DQuat::IDENTITY, q);
        assert!(clamped.y.abs() < 1e-12 && clamped.z.abs() < 1e-12);
        assert!((angle_of(limit.clamp(DQuat::IDENTITY, DQuat::from_rotation_x(3.0))) - 2.0).abs() < 1e-9);
        assert!(angle_of(limit.clamp(DQuat::IDENTITY, DQuat::from_rotation_x(-1.0))) < 1e-9);
        // The same rotation by the other quaternion.
        assert!(limit.clamp(DQuat::IDENTITY, -q).dot(clamped).abs() > 1.0 - 1e-12);
    }

    #[test]
    fn check_names_the_invalid_field() {
        let error = |limit: Limit| limit.check().unwrap_err().to_string();
        assert_eq!(
            error(Limit::Hinge { axis: DVec3::ONE * 0.5, angle: (0.0, 1.0) }),
            "`Limit.axis` is of length 0.8660254037844386, must be of length 1"
        );
        assert_eq!(
            error(Limit::Hinge { axis: DVec3::X, angle: (1.0, 0.0) }),
            "`Limit` is 1 to 0, must be an interval of -π..=π"
        );
        let twist = (0.0, 0.0);
        assert_eq!(
            error(Limit::SwingTwist { axis: DVec3::X, swing: f64::NAN, twist }),
            "`Limit.swing` is NaN, must be 0..=π"
        );
    }
}
