//! The icon of a light, a camera or a target of inverse kinematics, while it is dragged in a viewport.

use crate::state::selection::Selected;
use glam::DVec3;

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum IconOf {
    Light(usize),
    Camera(String),
    /// A point that a joint of an actor reaches for: the actor, and the number of the constraint.
    Reach(String, usize),
}

impl IconOf {
    /// The object that a click on the icon selects.
    pub fn selected(&self) -> Selected {
        match self {
            IconOf::Light(index) => Selected::Light(*index),
            IconOf::Camera(name) => Selected::Camera(name.clone()),
            IconOf::Reach(actor, _) => Selected::Actor(actor.clone()),
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct DraggedIcon {
    /// Number of the viewport in which it is dragged.
    pub view: usize,
    pub what: IconOf,
    /// Place at which it was, and at which it is by now.
    pub from: DVec3,
    pub to: DVec3,
    /// Place of the world at which the mouse took it: as far away as the icon, also beside it.
    pub taken_at: DVec3,
}
