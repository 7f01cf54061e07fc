//! One spring bone: a rigid stick that turns about its head and is pulled towards its animated direction.
//!
//! The direction d of the stick is a point of the unit sphere and obeys
//!
//! ```text
//! d'' = K · (tangent vector from d to its target) − κ · d' + (f − A / L) perpendicular to d
//! ```
//!
//! with the stiffness K = (2π · frequency)², the damping κ = 2 · ratio · 2π · frequency, the load f (gravity, and the drag of
//! moving air, an angle/s²), the acceleration A of its head and its length L. The pull grows with the angle, so that a swing
//! in a plane is the linear oscillator at any amplitude.
//!
//! A step solves the equation in the tangent plane at d, where it is linear but for the load, in closed form ([`Response`]) with
//! a target of constant velocity, and follows the solution along the sphere (exponential map). The load's pull towards its own
//! direction is replaced by a spring of the same force at d. Two facts make this stable whatever the step, the stiffness and the
//! damping: the exponential map of a sphere brings no two points farther apart than they are in the tangent plane (Toponogov's
//! comparison, positive curvature), and the load's energy, −f cos φ, is concave in φ², so that the spring that touches it lies
//! above it. Hence kinetic and potential energy together never grow while target, head and load are at rest
//! ([`SpringBone::energy`]). At the end of a step the tangent plane and that spring have more energy than the sphere and the
//! load; without damping the difference is added to the velocity, since otherwise the swing would come to rest.
//!
//! Each bone of a chain is pulled towards its animated direction as the bone before it has turned it, and exerts no force back.
//! Motion that is passed along the chain must not grow: bones of one frequency, each driven at its resonance by the one before, turn
//! a shake of the root into a whip whose end depends on the last digit, and smaller steps do not converge. (Letting each bone
//! also feel how the bone before moves its head multiplies a swing by up to 1 / ζ per bone; tried, and 4 bones did not converge.)
//! Hence two rules for a bone that [`Drive::follows`] another that swings: its head moves as animated, so that only this motion
//! is felt as inertia; and it is damped at least so much that at no frequency it swings farther than the bone that it follows,
//! |K / (K + s − ω² + iωκ)| ≤ 1 where s is the load's part in the stiffness. So the end of a chain swings later and softer than
//! its beginning, and chains of any length converge.

use super::oscillator::Response;
use super::sphere::{exp, log, sinc, tangent};
use glam::DVec3;
use std::f64::consts::PI;

/// Largest change of a head's velocity in one step, metres per second. Beyond it the head was teleported, and the stick goes with
/// it, undisturbed. (At 60 steps per second that is an acceleration of 600 g.)
pub(crate) const TELEPORT_SPEED: f64 = 100.0;

/// Parameters of a bone in the equation of the module.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpringBone {
    /// K, 1/s², 0..=1e18.
    pub stiffness: f64,
    /// κ, 1/s, 0..=1e18.
    pub damping: f64,
}

/// Position and velocity of a bone. Positions and directions are in one space that does not accelerate: the world's, or that
/// of the joint against which inertia is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoneState {
    /// Direction of the stick, unit.
    pub direction: DVec3,
    /// Derivative of `direction`, perpendicular to it, 1/s.
    pub velocity: DVec3,
    /// Position of the head, metres.
    pub head: DVec3,
    /// Velocity of the head over the last step, metres per second.
    pub head_velocity: DVec3,
    /// Animated direction of the bone, unit.
    pub target: DVec3,
}

/// Inputs of a step: the forces on a bone, and where the step ends.
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    /// Position of the head at the end of the step, metres; for a bone that follows another, as animated, without springs.
    pub head: DVec3,
    /// Whether an ancestor of the bone swings, too.
    pub follows: bool,
    /// Animated direction at the end of the step, unit.
    pub target: DVec3,
    /// Length of the stick, metres, > 0.
    pub length: f64,
    /// Gravity, metres/s².
    pub gravity: DVec3,
    /// Angular acceleration that does not depend on the stick's length, 1/s²: VRM's gravity.
    pub pull: DVec3,
    /// Velocity of the air, metres per second.
    pub wind: DVec3,
}

impl SpringBone {
    /// Spring of a `frequency` in Hz and a damping `ratio`: 0 swings forever, 1 comes to rest soonest without overshoot. Values
    /// out of range are clamped.
    pub fn new(frequency: f64, ratio: f64) -> SpringBone {
        let omega = 2.0 * PI * frequency.clamp(0.0, 1e8);
        SpringBone { stiffness: omega * omega, damping: (2.0 * ratio * omega).clamp(0.0, 1e18) }
    }

    /// Rate at which a swing finally decays, 1/s, under a load of `load` 1/s²; 0 if it never decays.
    pub fn decay_rate(&self, load: f64) -> f64 {
        let (half, stiffness) = (0.5 * self.damping, self.stiffness + load);
        let discriminant = half * half - stiffness;
        if discriminant <= 0.0 { half } else { stiffness / (half + discriminant.sqrt()) }
    }

    /// The state at rest, in which target and load are in balance.
    pub fn settled(&self, drive: &Drive) -> BoneState {
        let load = self.load(drive, DVec3::ZERO);
        let strength = load.length();
        let mut direction = drive.target;
        if strength > 0.0 {
            // K θ = f sin(φ − θ) on the arc from the target to the load's direction.
            let towards_load = log(drive.target, load / strength);
            let angle_to_load = towards_load.length();
            let (mut low, mut high) = (0.0, angle_to_load);
            for _ in 0..64 {
                let middle = 0.5 * (low + high);
                if self.stiffness * middle < strength * libm::sin(angle_to_load - middle) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            if angle_to_load > 0.0 {
                direction = exp(drive.target, towards_load * (low / angle_to_load), DVec3::ZERO).0;
            }
        }
        let velocity = DVec3::ZERO;
        BoneState { direction, velocity, head: drive.head, head_velocity: DVec3::ZERO, target: drive.target }
    }

    /// Advances a state by `seconds` ≥ 0. A step of zero length only takes over head and target.
    pub fn step(&self, state: &mut BoneState, drive: &Drive, seconds: f64) {
        // NaN counts as zero.
        if seconds.is_nan() || seconds <= 0.0 {
            (state.head, state.target) = (drive.head, drive.target);
            return;
        }
        let d = state.direction;
        let mut head_velocity = (drive.head - state.head) / seconds;
        let velocity_change = head_velocity - state.head_velocity;
        let mut velocity = state.velocity;
        if velocity_change.length() <= TELEPORT_SPEED {
            // The change of the head's velocity acts as an impulse between two steps of constant velocity. It is limited to half
            // a turn per step: more would be the same as less in the other direction.
            velocity -= tangent(d, velocity_change / drive.length).clamp_length_max(PI / seconds);
        } else {
            head_velocity = DVec3::ZERO;
        }
        let load = self.load(drive, head_velocity);
        let strength = load.length();
        let (mut softening, mut towards_load) = (0.0, DVec3::ZERO);
        if strength > 0.0 {
            let to_load = log(d, load / strength);
            softening = strength * sinc(to_load.length());
            towards_load = to_load * softening;
        }
        let (target, next_target) = (log(d, state.target), log(d, drive.target));
        let stiffness = self.stiffness + softening;
        let damping = if drive.follows {
            self.damping.max(min_chain_damping(self.stiffness, softening))
        } else {
            self.damping
        };
        let response = Response::new(stiffness, damping, seconds);
        let steady = target * self.stiffness + towards_load;
        let ramp = (next_target - target) * (self.stiffness / seconds);
        let displacement = velocity * response.impulse + steady * response.load + ramp * response.ramp;
        let after = velocity * response.impulse_rate + steady * response.impulse + ramp * response.load;
        (state.direction, state.velocity) = exp(d, displacement, after);
        if damping == 0.0 {
            let bend_angle = log(state.direction, drive.target).length();
            let mut excess = self.stiffness
                * zero_if_rounding_error(
                    0.5 * ((next_target - displacement).length_squared() - bend_angle * bend_angle),
                );
            if strength > 0.0 {
                excess += strength
                    * load_energy_excess([
                        log(d, load / strength),
                        displacement,
                        log(state.direction, load / strength),
                    ]);
            }
            if let Some(along) = state.velocity.try_normalize() {
                state.velocity = along * (state.velocity.length_squared() + 2.0 * excess).sqrt();
            }
        }
        // A bone gets no faster than it would be from half a turn away; otherwise undamped bones of a chain would speed each
        // other up.
        state.velocity = state.velocity.clamp_length_max((PI / seconds).max(PI * stiffness.sqrt()));
        state.head = drive.head;
        state.head_velocity = head_velocity;
        state.target = drive.target;
    }

    /// Kinetic and potential energy per unit of inertia, 1/s²: ½ d'² + ½ K φ² + f (1 − cos).
    pub fn energy(&self, state: &BoneState, drive: &Drive) -> f64 {
        let load = self.load(drive, DVec3::ZERO);
        let bent = log(state.direction, state.target).length();
        0.5 * state.velocity.length_squared() + 0.5 * self.stiffness * bent * bent + load.length()
            - load.dot(state.direction)
    }

    /// Load on the stick, 1/s²: gravity of both kinds, and drag of the air.
    fn load(&self, drive: &Drive, head_velocity: DVec3) -> DVec3 {
        let load = drive.pull + (drive.gravity + (drive.wind - head_velocity) * self.damping) / drive.length;
        load.clamp_length_max(1e18)
    }
}

/// Excess energy, at the end of a step, of the spring that stands for a load of strength 1. Arguments, as tangent vectors: from
/// the start of the step to the load's direction, the step itself, and from its end to the load's direction.
fn load_energy_excess([before, step, after]: [DVec3; 3]) -> f64 {
    let (from, to) = (before.length(), after.length());
    // 1 − cos φ at both ends, and the spring that touches this curve at the first.
    let height = |angle: f64| 2.0 * libm::sin(0.5 * angle) * libm::sin(0.5 * angle);
    let spring = 0.5 * sinc(from) * ((before - step).length_squared() - from * from);
    zero_if_rounding_error(spring + height(from) - height(to))
}

/// The energy, or zero if it is only a rounding error.
fn zero_if_rounding_error(energy: f64) -> f64 {
    if energy > 1e-14 { energy } else { 0.0 }
}

/// The smallest damping, 1/s, with which an oscillator of stiffness K + s amplifies no motion of the target that K pulls to: the
/// smallest κ with κ²(K + s) − κ⁴/4 ≥ K², whose left side is the smallest squared denominator of the module's fraction; √(2K)
/// without a load.
fn min_chain_damping(stiffness: f64, softening: f64) -> f64 {
    let whole = stiffness + softening;
    // (K + s) − √((K + s)² − K²), written so that nothing cancels.
    let root = (softening * (softening + 2.0 * stiffness)).sqrt();
    if whole > 0.0 { (2.0 * stiffness * (stiffness / (whole + root))).sqrt() } else { 0.0 }
}
