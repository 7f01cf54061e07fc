//! Springs of an actor: hair, skirts, tails.

use choreo_asset::Asset;
use choreo_motion::Time;
use choreo_motion::spring::SpringRig;
use glam::DVec3;
use std::sync::Arc;

/// Spring bones of an actor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActorSprings {
    /// The bones that swing, and their parameters.
    pub rig: SpringRig,
    /// Speed of the air, metres a second, in the world.
    pub wind: DVec3,
    /// How long before time 0 the motion begins, at rest.
    pub pre_roll: Time,
}

impl ActorSprings {
    /// The springs of a file; `None` where it has none, or none that can swing.
    pub fn of(asset: &Asset) -> Option<Arc<ActorSprings>> {
        if asset.springs.chains.is_empty() {
            return None;
        }
        let rig = SpringRig::from_vrm(&asset.springs, &asset.skeleton).ok()?;
        Some(Arc::new(ActorSprings { rig, ..ActorSprings::default() }))
    }
}
