//! A chain of any number of bones with limits: forward kinematics, and inverse kinematics by several solvers.

use super::{Limit, ccd, coordinate_descent, fabrik, least_squares};
use crate::math::rotation::rotation_between;
use glam::{DQuat, DVec3};

/// A bone and the joint that turns it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainBone {
    /// Rotation parent-from-bone, a unit quaternion.
    pub rotation: DQuat,
    /// Rotation at rest, relative to which limits are measured.
    pub rest: DQuat,
    /// Offset from this joint to the next, or to the end, in the bone's space; metres.
    pub offset: DVec3,
    /// How far the joint may turn from rest.
    pub limit: Limit,
}

/// Bones from the root outwards; positions are in the space of `origin`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chain {
    /// Position of the first joint.
    pub origin: DVec3,
    /// Rotation of the first bone's parent.
    pub parent: DQuat,
    /// The bones, from the root outwards.
    pub bones: Vec<ChainBone>,
}

/// Iterative method that turns the bones towards the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solver {
    /// Cyclic coordinate descent: each joint in turn, from the end inwards, points the end at the target (Wang & Chen 1991).
    Ccd,
    /// Forward and backward reaching: positions first, then rotations (Aristidou & Lasenby 2011).
    Fabrik,
    /// Damped least squares on the Jacobian (Wampler 1986; Levenberg–Marquardt damping): all joints share each step as
    /// evenly as can be.
    LeastSquares,
}

/// Result of [`Chain::solve`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainResult {
    /// Distance from the end to the target, metres.
    pub distance: f64,
    /// Number of iterations.
    pub iterations: usize,
}

impl Chain {
    /// Computes the positions of all joints and of the end: one more than bones.
    pub fn positions(&self, out: &mut Vec<DVec3>) {
        out.clear();
        let (mut at, mut rotation) = (self.origin, self.parent);
        out.push(at);
        for bone in &self.bones {
            rotation *= bone.rotation;
            at += rotation * bone.offset;
            out.push(at);
        }
    }

    /// Computes [`Self::positions`] and the rotation of each bone's parent; returns the position of the end.
    pub(super) fn frames(&self, positions: &mut Vec<DVec3>, parents: &mut Vec<DQuat>) -> DVec3 {
        self.positions(positions);
        parents.clear();
        let mut rotation = self.parent;
        for bone in &self.bones {
            parents.push(rotation);
            rotation *= bone.rotation;
        }
        positions.last().copied().unwrap_or(self.origin)
    }

    /// Position of the end.
    pub fn end(&self) -> DVec3 {
        let (mut at, mut rotation) = (self.origin, self.parent);
        for bone in &self.bones {
            rotation *= bone.rotation;
            at += rotation * bone.offset;
        }
        at
    }

    /// Sum of the bones' lengths, metres.
    pub fn reach(&self) -> f64 {
        self.bones.iter().map(|b| b.offset.length()).sum()
    }

    /// Turns the bones so that the end comes within `tolerance` metres of the target, in at most `iterations`. If it does not,
    /// and joints have limits, each joint in turn then moves the end nearer as far as its limit allows. All limits hold
    /// afterwards, also those that were broken before.
    ///
    /// The result is a local optimum: a nearer pose may exist that can only be reached by swinging around a limit. Of 100 chains
    /// of three hinges with random limits, 85 reach the global optimum, the others come within a quarter of their reach of it
    /// (`tests/motion/ik.rs`).
    /// A target that is not finite changes nothing but broken limits.
    pub fn solve(&mut self, target: DVec3, solver: Solver, iterations: usize, tolerance: f64) -> ChainResult {
        for bone in &mut self.bones {
            bone.rotation = bone.limit.clamp(bone.rest, bone.rotation);
        }
        let mut solved = ChainResult { distance: (self.end() - target).length(), iterations: 0 };
        if !target.is_finite() || !solved.distance.is_finite() || self.reach() == 0.0 {
            return solved;
        }
        if self.straighten_towards(target) {
            return ChainResult { distance: (self.end() - target).length(), iterations: 0 };
        }
        let mut best = (solved.distance, self.bones.clone());
        self.bend_if_straight(target);
        let mut scratch = SolverScratch::default();
        for iteration in 1..=iterations {
            if solved.distance <= tolerance {
                break;
            }
            match solver {
                Solver::Ccd => ccd::iterate(self, target, &mut scratch),
                Solver::Fabrik => fabrik::iterate(self, target, &mut scratch),
                Solver::LeastSquares => least_squares::iterate(self, target, &mut scratch),
            }
            solved = ChainResult { distance: (self.end() - target).length(), iterations: iteration };
            if solved.distance < best.0 {
                best.0 = solved.distance;
                best.1.clone_from(&self.bones);
            }
            if scratch.stuck {
                break;
            }
        }
        if best.0 <= solved.distance {
            self.bones = best.1;
            solved.distance = best.0;
        }
        if solved.distance > tolerance && self.bones.iter().any(|b| b.limit != Limit::Free) {
            solved.distance = self.refine_by_coordinate_descent(target, tolerance, &mut scratch);
        }
        solved
    }

    /// Coordinate descent after a solver whose joints are stuck at their limits, as long as sweeps bring the end nearer.
    fn refine_by_coordinate_descent(
        &mut self,
        target: DVec3,
        tolerance: f64,
        scratch: &mut SolverScratch,
    ) -> f64 {
        const MAX_SWEEPS: usize = 64;
        let mut distance = (self.end() - target).length();
        for _ in 0..MAX_SWEEPS {
            coordinate_descent::sweep(self, target, scratch);
            let now = (self.end() - target).length();
            let gained = distance - now;
            distance = now;
            if distance <= tolerance || gained <= 1e-7 * self.reach() {
                break;
            }
        }
        distance
    }

    /// Straightens the chain towards a target out of reach, a pose to which iterations converge ever more slowly. Returns false
    /// if the target is in reach, or if any joint has a limit.
    fn straighten_towards(&mut self, target: DVec3) -> bool {
        let to_target = target - self.origin;
        let free = self.bones.iter().all(|bone| bone.limit == Limit::Free);
        let Some(line) = to_target.try_normalize().filter(|_| free && to_target.length() >= self.reach())
        else {
            return false;
        };
        let mut parent = self.parent;
        for bone in &mut self.bones {
            let turned = parent * bone.rotation;
            // A bone without length has no direction.
            if let Some(along) = (turned * bone.offset).try_normalize() {
                bone.turn(rotation_between(along, line), parent);
            }
            parent = (parent * bone.rotation).normalize();
        }
        true
    }

    /// Bends a straight chain a little if the target lies on its line, always in the same direction: without a bend, no solver
    /// could begin.
    fn bend_if_straight(&mut self, target: DVec3) {
        /// Radians; large enough for a first step, too small to be seen where it is not needed.
        const BEND_ANGLE_RAD: f64 = 1e-3;
        let mut positions = Vec::with_capacity(self.bones.len() + 1);
        self.positions(&mut positions);
        let to_target = target - self.origin;
        let scale = self.reach() * to_target.length().max(self.reach());
        let off_line =
            positions.iter().map(|p| (*p - self.origin).cross(to_target).length()).fold(0.0, f64::max);
        let beyond = to_target.length() >= self.reach() && (self.end() - self.origin).dot(to_target) > 0.0;
        if off_line > 1e-9 * scale || beyond || self.bones.len() < 2 {
            return;
        }
        let line = to_target
            .try_normalize()
            .or_else(|| (self.end() - self.origin).try_normalize())
            .unwrap_or(DVec3::Y);
        let axis = line.any_orthonormal_vector();
        let mut parent = self.parent;
        for (index, bone) in self.bones.iter_mut().enumerate() {
            // The first bone turns out and the others back: a bow.
            let angle = if index == 0 { BEND_ANGLE_RAD } else { -2.0 * BEND_ANGLE_RAD };
            let bent = parent.inverse() * DQuat::from_axis_angle(axis, angle) * parent * bone.rotation;
            bone.rotation = bone.limit.clamp(bone.rest, bent.normalize());
            parent *= bone.rotation;
        }
    }
}

/// Buffers of the solvers, kept between the iterations of one call.
#[derive(Clone, Debug)]
pub(super) struct SolverScratch {
    pub positions: Vec<DVec3>,
    pub goals: Vec<DVec3>,
    pub rotations: Vec<DQuat>,
    pub before: Vec<ChainBone>,
    /// Levenberg–Marquardt damping, as a share of the squared reach.
    pub damping: f64,
    /// Whether further iterations would change nothing.
    pub stuck: bool,
}

impl Default for SolverScratch {
    fn default() -> Self {
        SolverScratch {
            positions: Vec::new(),
            goals: Vec::new(),
            rotations: Vec::new(),
            before: Vec::new(),
            damping: 1e-4,
            stuck: false,
        }
    }
}

impl ChainBone {
    /// Turns the bone by a rotation in the space of the chain; `parent` is chain-from-parent.
    pub(super) fn turn(&mut self, turn: DQuat, parent: DQuat) {
        let local = (parent.inverse() * turn * parent * self.rotation).normalize();
        if local.is_finite() {
            self.rotation = self.limit.clamp(self.rest, local);
        }
    }
}
