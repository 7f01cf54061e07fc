//! One spring bone: a stick that turns about its head, pulled towards where the animation wants it.
//!
//! The direction d of the stick is a point of the unit sphere and obeys
//!
//! ```text
//! d'' = K · (way from d to its target) − κ · d' + (f − A / L) across d
//! ```
//!
//! with the stiffness K = (2π · frequency)², the damping κ = 2 · ratio · 2π · frequency, the load f (gravity, and the drag of
//! moving air, an angle/s²), the acceleration A of its head and its length L. The pull grows with the angle, so that a swing
//! in a plane is the linear oscillator at any width.
//!
//! A step takes the equation in the tangent plane at d, where it is linear but for the load, solves it in closed form
//! ([`Response`]) with the target moving evenly, and goes that way along the sphere. The load's pull towards its own direction
//! is taken as a spring of the same force here. Two facts make this stable whatever the step, the stiffness and the damping:
//! the exponential map of a sphere brings no two points farther apart than they are in the tangent plane (Toponogov's
//! comparison, positive curvature), and the load's energy, −f cos φ, is concave in φ², so that the spring that touches it
//! lies above it. Hence kinetic and potential energy together never grow while target, head and load are at rest
//! ([`SpringBone::energy`]). At the end of a step the tangent plane and that spring have more energy than the sphere and the load; without
//! damping the difference goes into the velocity, or else the swing would come to rest.
//!
//! In a chain each bone is pulled towards where the bone before it has turned its target, and gives nothing back. What is passed on
//! that way must not grow: bones of one frequency, each driven at its resonance by the one before, make of a shake of the root a whip whose
//! end depends on the last digit, and no finer step shows what it "really" does. (Feeling also how the bone before swings its head about
//! multiplies a swing by up to 1 / ζ a bone; tried, and 4 bones did not converge.) Hence two rules for a bone that [`Drive::follows`]
//! another that swings: its head moves as the body does, so that only that is felt as inertia; and it is damped at least so much that at no
//! frequency it swings farther than what it follows, |K / (K + s − ω² + iωκ)| ≤ 1 where s is the load's part in the stiffness. So the end of a
//! chain comes later and softer than its beginning, and chains of any length converge.

use super::oscillator::Response;
use super::sphere::{exp, log, sinc, tangent};
use glam::DVec3;
use std::f64::consts::PI;

/// Metres a second: a head whose speed changes by more in one step has been put elsewhere, and the stick goes with it,
/// undisturbed. (At 60 steps a second that is an acceleration of 600 g.)
pub(crate) const TELEPORT_SPEED: f64 = 100.0;

/// How a bone swings; the numbers of the equation above.
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
    /// Unit.
    pub direction: DVec3,
    /// Change of `direction`, across it, 1/s.
    pub velocity: DVec3,
    /// Metres.
    pub head: DVec3,
    /// Metres a second, over the last step.
    pub head_velocity: DVec3,
    /// Direction in which the animation wants the bone, unit.
    pub target: DVec3,
}

/// Inputs of a step: the forces on a bone, and where the step ends.
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    /// Place of the head at the end of the step, metres; of a bone that follows another, as the body without swinging has it.
    pub head: DVec3,
    /// Whether a bone that it hangs on swings too.
    pub follows: bool,
    /// Direction that the animation wants at the end of the step, unit.
    pub target: DVec3,
    /// Length of the stick, metres, > 0.
    pub length: f64,
    /// Gravity, metres/s².
    pub gravity: DVec3,
    /// Acceleration of a stick, independent of its length, 1/s²: VRM's gravity.
    pub pull: DVec3,
    /// Speed of the air, metres a second.
    pub wind: DVec3,
}

impl SpringBone {
    /// `frequency` in Hz; `ratio` 0 swings for ever, 1 comes to rest soonest without overshoot. Out of range is brought into it.
    pub fn new(frequency: f64, ratio: f64) -> SpringBone {
        let omega = 2.0 * PI * frequency.clamp(0.0, 1e8);
        SpringBone { stiffness: omega * omega, damping: (2.0 * ratio * omega).clamp(0.0, 1e18) }
    }

    /// Rate in 1/s at which a swing decays in the end, under a load that pulls with `load` in 1/s²: 0 where it never does.
    pub fn decay_rate(&self, load: f64) -> f64 {
        let (half, stiffness) = (0.5 * self.damping, self.stiffness + load);
        let discriminant = half * half - stiffness;
        if discriminant <= 0.0 { half } else { stiffness / (half + discriminant.sqrt()) }
    }

    /// The state at rest: where target and load are in balance.
    pub fn settled(&self, drive: &Drive) -> BoneState {
        let load = self.load(drive, DVec3::ZERO);
        let strength = load.length();
        let mut direction = drive.target;
        if strength > 0.0 {
            // K θ = f sin(φ − θ) on the arc from the target to the load's direction.
            let way = log(drive.target, load / strength);
            let whole = way.length();
            let (mut low, mut high) = (0.0, whole);
            for _ in 0..64 {
                let middle = 0.5 * (low + high);
                if self.stiffness * middle < strength * libm::sin(whole - middle) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            if whole > 0.0 {
                direction = exp(drive.target, way * (low / whole), DVec3::ZERO).0;
            }
        }
        let velocity = DVec3::ZERO;
        BoneState { direction, velocity, head: drive.head, head_velocity: DVec3::ZERO, target: drive.target }
    }

    /// Moves a state on by `seconds` ≥ 0. A step of no time only takes over the target.
    pub fn step(&self, state: &mut BoneState, drive: &Drive, seconds: f64) {
        // NaN is no time either.
        if seconds.is_nan() || seconds <= 0.0 {
            (state.head, state.target) = (drive.head, drive.target);
            return;
        }
        let d = state.direction;
        let mut head_velocity = (drive.head - state.head) / seconds;
        let jolt = head_velocity - state.head_velocity;
        let mut velocity = state.velocity;
        if jolt.length() <= TELEPORT_SPEED {
            // An impulse between two steps of even motion: the average acceleration of both, at the time between them.
            // More than half a turn a step could not be told from less the other way round.
            velocity -= tangent(d, jolt / drive.length).clamp_length_max(PI / seconds);
        } else {
            head_velocity = DVec3::ZERO;
        }
        let load = self.load(drive, head_velocity);
        let strength = load.length();
        let (mut softening, mut towards_load) = (0.0, DVec3::ZERO);
        if strength > 0.0 {
            let way = log(d, load / strength);
            softening = strength * sinc(way.length());
            towards_load = way * softening;
        }
        let (target, next_target) = (log(d, state.target), log(d, drive.target));
        let stiffness = self.stiffness + softening;
        let damping = if drive.follows {
            self.damping.max(passing_on(self.stiffness, softening))
        } else {
            self.damping
        };
        let response = Response::new(stiffness, damping, seconds);
        let steady = target * self.stiffness + towards_load;
        let ramp = (next_target - target) * (self.stiffness / seconds);
        let way = velocity * response.impulse + steady * response.load + ramp * response.ramp;
        let after = velocity * response.impulse_rate + steady * response.impulse + ramp * response.load;
        (state.direction, state.velocity) = exp(d, way, after);
        if damping == 0.0 {
            let bent = log(state.direction, drive.target).length();
            let mut left =
                self.stiffness * rounded_off(0.5 * ((next_target - way).length_squared() - bent * bent));
            if strength > 0.0 {
                left += strength
                    * load_energy_left([log(d, load / strength), way, log(state.direction, load / strength)]);
            }
            if let Some(along) = state.velocity.try_normalize() {
                state.velocity = along * (state.velocity.length_squared() + 2.0 * left).sqrt();
            }
        }
        // No bone can have more than it would have from half a turn away; a chain of undamped ones would feed on each other.
        state.velocity = state.velocity.clamp_length_max((PI / seconds).max(PI * stiffness.sqrt()));
        state.head = drive.head;
        state.head_velocity = head_velocity;
        state.target = drive.target;
    }

    /// Kinetic and potential energy for a unit of inertia, 1/s²: ½ d'² + ½ K φ² + f (1 − cos).
    pub fn energy(&self, state: &BoneState, drive: &Drive) -> f64 {
        let load = self.load(drive, DVec3::ZERO);
        let bent = log(state.direction, state.target).length();
        0.5 * state.velocity.length_squared() + 0.5 * self.stiffness * bent * bent + load.length()
            - load.dot(state.direction)
    }

    /// All that pulls evenly, 1/s².
    fn load(&self, drive: &Drive, head_velocity: DVec3) -> DVec3 {
        let load = drive.pull + (drive.gravity + (drive.wind - head_velocity) * self.damping) / drive.length;
        load.clamp_length_max(1e18)
    }
}

/// Energy that a spring in place of a load of strength 1 has more than the load at the end of a step.
/// The ways from where the step begins to the load's direction and to where it ends, and from there to the load's direction.
fn load_energy_left([before, step, after]: [DVec3; 3]) -> f64 {
    let (from, to) = (before.length(), after.length());
    // 1 − cos φ at both ends, and the spring that touches it at the first.
    let height = |angle: f64| 2.0 * libm::sin(0.5 * angle) * libm::sin(0.5 * angle);
    let spring = 0.5 * sinc(from) * ((before - step).length_squared() - from * from);
    rounded_off(spring + height(from) - height(to))
}

/// Nothing where it is rounding.
fn rounded_off(energy: f64) -> f64 {
    if energy > 1e-14 { energy } else { 0.0 }
}

/// The least damping, 1/s, with which an oscillator of stiffness K + s amplifies no motion of the target that K pulls to: the
/// smallest κ with κ²(K + s) − κ⁴/4 ≥ K², what is under the fraction above at its least; √(2K) without a load.
fn passing_on(stiffness: f64, softening: f64) -> f64 {
    let whole = stiffness + softening;
    // (K + s) − √((K + s)² − K²), written so that nothing cancels.
    let root = (softening * (softening + 2.0 * stiffness)).sqrt();
    if whole > 0.0 { (2.0 * stiffness * (stiffness / (whole + root))).sqrt() } else { 0.0 }
}
