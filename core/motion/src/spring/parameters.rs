//! Parameters of spring bones, as plain data in choreo's convention: metres, seconds, +Y up, right-handed.
//!
//! The parameters are those of VRM: `VRMC_springBone` 1.0 ("VRMC_springBone-1.0/README.md"), its extension
//! `VRMC_springBone_extended_collider` 1.0, and `secondaryAnimation` of VRM 0.x, all brought to the form below.
//!
//! Each [`SpringJoint`] is one rigid stick from the joint's origin to its `tail`. The specification's update, for a step of
//! `dt` seconds, moves the tail, at `x` now and `x₋` one step ago (both in the space of the center, §"Center space"):
//!
//! ```text
//! inertia   = (x − x₋) · (1 − drag_force)
//! stiffness = dt · stiffness · (world rotation of the parent · rest rotation of the joint · direction of the tail)
//! external  = dt · gravity_power · gravity_direction
//! next      = x + inertia + stiffness + external, brought back to the stick's length, pushed out of the colliders
//! ```
//!
//! and turns the joint so that it points at `next` (§"SpringBone Algorithm"). The inertia depends on the step: VRM's authors
//! tune at 60 steps a second.

use glam::Vec3;

/// All springs of a skeleton. Joint indices are those of the skeleton.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Springs {
    /// Shapes that tails cannot enter.
    pub colliders: Vec<SpringCollider>,
    /// The chains of spring joints.
    pub chains: Vec<SpringChain>,
}

/// One strand: joints that swing, each parent before its children. A strand may branch (VRM 0.x swings whole subtrees).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpringChain {
    /// Name in the file; may be empty.
    pub name: String,
    /// The joints of the strand.
    pub joints: Vec<SpringJoint>,
    /// Indices into [`Springs::colliders`], ascending, each once: the file's collider groups, put together.
    pub colliders: Vec<u32>,
    /// Joint in whose space inertia is measured instead of the world's, so that a character that walks does not drag its hair
    /// behind (§"Center space").
    pub center: Option<u32>,
}

/// A stick that swings. Defaults are those of VRM 1.0.
#[derive(Clone, Debug, PartialEq)]
pub struct SpringJoint {
    /// The joint that is turned.
    pub joint: u32,
    /// End of the stick, in the joint's space at rest, metres before the joint's scale. In VRM 1.0 the next joint of the chain;
    /// in 0.x the first child, or 7 cm on in the direction from the parent where there is none.
    pub tail: Vec3,
    /// Radius of the tail against colliders, metres, ≥ 0 (`hitRadius`).
    pub hit_radius: f32,
    /// Pull towards the rest pose, metres per second, ≥ 0 (`stiffness`, 0.x `stiffiness`).
    pub stiffness: f32,
    /// Gravity in metres per second along `gravity_direction` (`gravityPower`; a velocity, not an acceleration).
    pub gravity_power: f32,
    /// Direction of gravity, a unit vector in world space (`gravityDir`).
    pub gravity_direction: Vec3,
    /// Share of the speed that is lost in a step of the specification's update, 0..=1 (`dragForce`).
    pub drag_force: f32,
}

impl Default for SpringJoint {
    fn default() -> Self {
        SpringJoint {
            joint: 0,
            tail: Vec3::ZERO,
            hit_radius: 0.0,
            stiffness: 1.0,
            gravity_power: 0.0,
            gravity_direction: Vec3::NEG_Y,
            drag_force: 0.5,
        }
    }
}

/// A collider that tails cannot enter; it moves with a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct SpringCollider {
    /// Joint that carries the collider.
    pub joint: u32,
    /// The shape, in the joint's space.
    pub shape: ColliderShape,
}

/// Shape of a collider in the joint's space, metres before the joint's scale.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
pub enum ColliderShape {
    /// A ball of `radius` at `offset`; `inside`: tails are kept inside instead of outside (extended collider).
    Sphere { offset: Vec3, radius: f32, inside: bool },
    /// Everything within `radius` of the segment from `offset` to `tail`.
    Capsule { offset: Vec3, tail: Vec3, radius: f32, inside: bool },
    /// Tails stay on the side that the unit `normal` points to (extended collider).
    Plane { offset: Vec3, normal: Vec3 },
}

/// A parameter that a solver cannot work with; `place` is a path like `chains[1].joints[0]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SpringError {
    /// Path of the parameter.
    pub place: String,
    /// The problem.
    pub what: String,
}

crate::error_texts! { SpringError:
    Self { place, what } => "{place}: {what}";
}

impl Springs {
    /// Whether there are no chains and no colliders.
    pub fn is_empty(&self) -> bool {
        self.chains.is_empty() && self.colliders.is_empty()
    }

    /// Checks all values for a skeleton of `joint_count` joints; fails at the first one that is out of its range.
    pub fn check(&self, joint_count: usize) -> Result<(), SpringError> {
        let require = |valid: bool, place: &dyn Fn() -> String, what: String| match valid {
            true => Ok(()),
            false => Err(SpringError { place: place(), what }),
        };
        let joint = |joint: u32, place: &dyn Fn() -> String| {
            let what = format!("joint {joint} does not exist (count: {joint_count})");
            require((joint as usize) < joint_count, place, what)
        };
        for (index, collider) in self.colliders.iter().enumerate() {
            let place = || format!("colliders[{index}]");
            joint(collider.joint, &place)?;
            let what = format!("{:?} must be finite, with radius ≥ 0 and normal of length 1", collider.shape);
            require(collider.shape.is_valid(), &place, what)?;
        }
        for (index, chain) in self.chains.iter().enumerate() {
            let place = || format!("chains[{index}]");
            if let Some(center) = chain.center {
                joint(center, &place)?;
            }
            let known = chain.colliders.iter().all(|c| (*c as usize) < self.colliders.len());
            let ascending = chain.colliders.windows(2).all(|w| w[0] < w[1]);
            require(
                known && ascending,
                &place,
                "its colliders must be ascending indices of existing colliders".into(),
            )?;
            for (number, j) in chain.joints.iter().enumerate() {
                let place = || format!("chains[{index}].joints[{number}]");
                joint(j.joint, &place)?;
                let powers = [j.hit_radius, j.stiffness];
                let in_range = powers.iter().all(|v| v.is_finite() && *v >= 0.0)
                    && j.gravity_power.is_finite()
                    && (0.0..=1.0).contains(&j.drag_force)
                    && j.tail.is_finite()
                    && (j.gravity_direction.length() - 1.0).abs() < 1e-3;
                let what = format!(
                    "{j:?} must be finite, with hit_radius and stiffness ≥ 0, drag_force 0 to 1 \
                     and gravity_direction of length 1"
                );
                require(in_range, &place, what)?;
            }
        }
        Ok(())
    }
}

impl ColliderShape {
    fn is_valid(&self) -> bool {
        match self {
            ColliderShape::Sphere { offset, radius, .. } => {
                offset.is_finite() && radius.is_finite() && *radius >= 0.0
            }
            ColliderShape::Capsule { offset, tail, radius, .. } => {
                offset.is_finite() && tail.is_finite() && radius.is_finite() && *radius >= 0.0
            }
            ColliderShape::Plane { offset, normal } => {
                offset.is_finite() && (normal.length() - 1.0).abs() < 1e-3
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn check_reports_the_path_of_the_invalid_parameter() {
        let sphere = ColliderShape::Sphere { offset: Vec3::ZERO, radius: 0.1, inside: false };
        let good = Springs {
            colliders: vec![SpringCollider { joint: 1, shape: sphere }],
            chains: vec![SpringChain {
                joints: vec![SpringJoint { joint: 2, tail: Vec3::NEG_Y * 0.1, ..SpringJoint::default() }],
                colliders: vec![0],
                center: Some(0),
                name: "hair".into(),
            }],
        };
        assert_eq!(good.check(3), Ok(()));
        let place = |change: &dyn Fn(&mut Springs)| {
            let mut bad = good.clone();
            change(&mut bad);
            bad.check(3).unwrap_err().place
        };
        assert_eq!(place(&|s| s.colliders[0].joint = 3), "colliders[0]");
        assert_eq!(place(&|s| s.chains[0].center = Some(3)), "chains[0]");
        assert_eq!(place(&|s| s.chains[0].colliders = vec![0, 0]), "chains[0]");
        assert_eq!(place(&|s| s.chains[0].joints[0].joint = 9), "chains[0].joints[0]");
        assert_eq!(place(&|s| s.chains[0].joints[0].drag_force = 1.5), "chains[0].joints[0]");
        assert_eq!(place(&|s| s.chains[0].joints[0].stiffness = f32::NAN), "chains[0].joints[0]");
        assert_eq!(place(&|s| s.chains[0].joints[0].gravity_direction = Vec3::ZERO), "chains[0].joints[0]");
    }
}
