//! Rigid motions that keep +Y up: a rotation about the vertical, then a translation.

use glam::{DQuat, DVec3};

/// `a_from_b`: rotation by `yaw` about +Y, then translation. In f64, hours of accumulation are exact to less than a micrometre.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Planar {
    /// Translation, metres.
    pub translation: DVec3,
    /// Rotation about +Y, radians, counter-clockwise from above, any number of turns.
    pub yaw: f64,
}

impl Planar {
    /// The identity.
    pub const IDENTITY: Planar = Planar { translation: DVec3::ZERO, yaw: 0.0 };

    /// Rotation about +Y.
    pub fn rotation(self) -> DQuat {
        DQuat::from_rotation_y(self.yaw)
    }

    /// Composition: first `other`, then this motion.
    pub fn compose(self, other: Planar) -> Planar {
        let rotated = rotate_about_y(other.translation, self.yaw);
        Planar { translation: self.translation + rotated, yaw: self.yaw + other.yaw }
    }

    /// The inverse motion.
    pub fn inverse(self) -> Planar {
        Planar { translation: rotate_about_y(-self.translation, -self.yaw), yaw: -self.yaw }
    }

    /// This motion, repeated `times` times, in closed form: the steps of a circle sum to a chord, Σ R(iθ) = R((k − 1)θ/2)
    /// sin(kθ/2) / sin(θ/2).
    /// Nothing is accumulated, so the millionth loop is as exact as the first.
    pub fn power(self, times: i64) -> Planar {
        let k = times as f64;
        let half = wrapped(self.yaw) / 2.0;
        let sine = libm::sin(half);
        let chord = if sine == 0.0 { k } else { libm::sin(wrapped(k * half)) / sine };
        let mut translation = rotate_about_y(self.translation * chord, (k - 1.0) * half);
        translation.y = self.translation.y * k;
        Planar { translation, yaw: self.yaw * k }
    }

    /// Logarithm: the constant velocity (linear, angular) in the moving frame that yields this motion in a second, turning the
    /// shorter way.
    pub fn velocity(self) -> (DVec3, f64) {
        let yaw = wrapped(self.yaw);
        let half = yaw / 2.0;
        // The chord of an arc with this angle is shorter by sin(θ/2) / (θ/2), and turned by θ/2.
        let chord = if half.abs() < 1e-9 { 1.0 } else { libm::sin(half) / half };
        let mut step = rotate_about_y(self.translation, -half) / chord;
        step.y = self.translation.y;
        (step, yaw)
    }

    /// Exponential: the motion of one second at a constant velocity (linear, angular) in the moving frame.
    pub fn from_velocity((step, yaw): (DVec3, f64)) -> Planar {
        let half = yaw / 2.0;
        let chord = if half.abs() < 1e-9 { 1.0 } else { libm::sin(half) / half };
        let mut translation = rotate_about_y(step * chord, half);
        translation.y = step.y;
        Planar { translation, yaw }
    }
}

/// Rotates a vector about +Y by an angle in radians.
fn rotate_about_y(v: DVec3, angle: f64) -> DVec3 {
    if angle == 0.0 {
        return v;
    }
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    DVec3::new(cos * v.x + sin * v.z, v.y, cos * v.z - sin * v.x)
}

/// The equivalent angle from −π to π.
pub fn wrapped(angle: f64) -> f64 {
    const TURN: f64 = std::f64::consts::TAU;
    let rest = angle % TURN;
    if rest > TURN / 2.0 {
        rest - TURN
    } else if rest < -TURN / 2.0 {
        rest + TURN
    } else {
        rest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(a: Planar, b: Planar, tolerance: f64) {
        assert!(a.translation.abs_diff_eq(b.translation, tolerance), "{a:?} {b:?}");
        assert!(wrapped(a.yaw - b.yaw).abs() < tolerance, "{a:?} {b:?}");
    }

    #[test]
    fn a_power_equals_the_product_of_its_steps() {
        for yaw in [0.0, 1e-12, -1e-4, 0.3, std::f64::consts::PI, -2.0, 7.0] {
            let step = Planar { translation: DVec3::new(0.4, 0.1, 1.3), yaw };
            let mut product = Planar::IDENTITY;
            for k in 0..40 {
                assert_near(step.power(k), product, 1e-9);
                product = product.compose(step);
            }
            assert_near(step.power(7).compose(step.power(-7)), Planar::IDENTITY, 1e-9);
            assert_near(step.compose(step.inverse()), Planar::IDENTITY, 1e-12);
        }
        let off = Planar { translation: DVec3::Z, yaw: 0.1 }.power(3).translation.z;
        assert!((off - 3.0).abs() > 0.01, "steps added without their turns would have passed: {off}");
    }

    #[test]
    fn a_hundred_hours_of_steps_on_a_circle_return_to_the_start() {
        // 360 steps of one degree are once around; a step a second.
        let step = Planar { translation: DVec3::Z, yaw: std::f64::consts::TAU / 360.0 };
        assert_near(step.power(360_000), Planar::IDENTITY, 1e-7);
        assert_near(
            Planar { translation: DVec3::Z * 1.25, yaw: 0.0 }.power(360_000),
            Planar { translation: DVec3::Z * 450_000.0, yaw: 0.0 },
            0.0001e-4,
        );
    }

    #[test]
    fn from_velocity_inverts_velocity_and_two_half_steps_equal_one() {
        for yaw in [0.0, 1e-12, 0.5, -3.0] {
            let motion = Planar { translation: DVec3::new(0.4, 0.1, 1.3), yaw };
            assert_near(Planar::from_velocity(motion.velocity()), motion, 1e-12);
            let (step, turn) = motion.velocity();
            let half = Planar::from_velocity((step / 2.0, turn / 2.0));
            assert_near(half.compose(half), motion, 1e-12);
        }
    }
}
