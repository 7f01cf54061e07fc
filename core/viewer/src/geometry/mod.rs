//! Closed forms between the screen and the world: projection, ray casts against the scene, what dragging a gizmo means.

pub mod gizmo;
pub mod picking;
pub mod projection;
pub mod rig;
