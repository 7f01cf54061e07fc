//! Constraints: what a body does beside its clips. Feet stay where they stand, the spine turns to look, a hand takes hold of a prop,
//! and at last hair and tails swing.
//!
//! In this order, after all actors have been posed and placed: planted feet, aims, looks, reaches, each in the order of the
//! script; then joint limits; springs last of all, once every constraint is done ([`springs`]). Constraints come actor by actor, those
//! first whose hands others reach for ([`order`]), so that a hand on a prop in another's moving hand is on it. In a circle (two
//! who look at each other) each takes the other's place as it was before.

pub(crate) mod check;
mod foot_contacts;
pub(crate) mod foot_lock;
pub(crate) mod gaze;
pub(crate) mod ground;
pub(crate) mod legs;
pub(crate) mod look_at;
pub(crate) mod order;
pub(crate) mod solve;
