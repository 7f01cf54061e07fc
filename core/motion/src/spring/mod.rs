//! Spring bones (secondary motion): hair, skirts and tails that follow their character.
//!
//! [`SpringRig`] states which joints swing and how, from the parameters of a VRM file ([`parameters`]) or other numbers;
//! [`SpringStep`] advances them by a step of any length and turns the joints. [`bone`] has the equation, why it is stable and
//! where it is exact.
//!
//! A step is exact for its inputs, but the pose is read only once per step. For the same motion at every frame rate, step on a
//! fixed grid of times, and from the last grid point to the frame's time on a copy of the state.

pub mod bone;
pub mod collide;
pub(crate) mod oscillator;
pub mod parameters;
pub mod rig;
mod simulate;
pub mod sphere;

pub use bone::{BoneState, Drive, SpringBone};
use collide::WorldCollider;
pub use oscillator::Response;
pub use parameters::{ColliderShape, SpringChain, SpringCollider, SpringError, SpringJoint, Springs};
pub use rig::{RigBone, SpringRig};
pub use simulate::{SpringScratch, SpringState, SpringStep};
