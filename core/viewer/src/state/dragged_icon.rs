//! The icon of a light, a camera or an IK target while it is dragged in a viewport.

use crate::state::selection::Selected;
use glam::DVec3;

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum IconObject {
    Light(usize),
    Camera(String),
    /// A target point of inverse kinematics: name of the actor, and index of the constraint.
    Reach(String, usize),
}

impl IconObject {
    /// The object that a click on the icon selects.
    pub fn selected(&self) -> Selected {
        match self {
            IconObject::Light(index) => Selected::Light(*index),
            IconObject::Camera(name) => Selected::Camera(name.clone()),
            IconObject::Reach(actor, _) => Selected::Actor(actor.clone()),
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct DraggedIcon {
    /// Index of the viewport.
    pub view: usize,
    pub what: IconObject,
    /// World positions of the icon: before the drag, and now.
    pub from: DVec3,
    pub to: DVec3,
    /// World position under the pointer at the start of the drag, in the plane of the icon.
    pub grab_position: DVec3,
}
