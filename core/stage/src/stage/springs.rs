//! Springs of an actor: hair, skirts, tails.

use crate::stage::described::{FieldType, described};
use choreo_asset::Asset;
use choreo_motion::Time;
use choreo_motion::spring::SpringRig;
use glam::DVec3;
use std::sync::Arc;

described! {
    /// Parameters of spring bones, as a script states them for some joints.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct SpringParameters {
        /// Oscillations per second.
        frequency: f64 = 2.0;
        /// Damping ratio.
        damping: f64 = 0.3;
        /// Multiples of Earth's gravity.
        gravity: f64 = 0.0;
        /// Collision radius around each bone, metres.
        radius: f64 = 0.0;
    }
    fields {
        frequency: frequency, FieldType::Number(0.0, 1000.0, "Hz");
        /// damping ratio; 0 never comes to rest, 1 does not oscillate
        damping: damping, FieldType::Number(0.0, 1000.0, "");
        /// in multiples of Earth's gravity
        gravity: gravity, FieldType::Number(-1000.0, 1000.0, "");
        /// for collisions
        radius: radius, FieldType::Number(0.0, 1000.0, "metres");
    }
}

/// Spring bones of an actor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActorSprings {
    /// The spring bones and their parameters.
    pub rig: SpringRig,
    /// Wind velocity, metres per second, world space.
    pub wind: DVec3,
    /// Time before time 0 at which the simulation begins, with springs at rest.
    pub pre_roll: Time,
}

impl ActorSprings {
    /// The springs of a file; `None` if it has no valid spring chain.
    pub fn of(asset: &Asset) -> Option<Arc<ActorSprings>> {
        if asset.springs.chains.is_empty() {
            return None;
        }
        let rig = SpringRig::from_vrm(&asset.springs, &asset.skeleton).ok()?;
        Some(Arc::new(ActorSprings { rig, ..ActorSprings::default() }))
    }
}
