//! Changes that callbacks make for one frame.

use crate::stage::actor::{Placement, Target};
use crate::stage::camera::{Camera, Rig};
use crate::stage::camera_moves::CameraShake;
use crate::stage::effects::EffectEdit;
use crate::stage::layers_2d::Layer2dEdit;
use crate::stage::parenting::Parenting;
use crate::stage::sky::SkyEdit;
use glam::{DQuat, DVec3, Vec3, Vec4};

/// The changes that a callback may make for one frame, each with the index of its actor, camera, light or 2D layer.
#[derive(Clone, Debug, Default)]
pub struct FrameEdits {
    /// Changes of actors, in the order in which they are made.
    pub actors: Vec<(usize, ActorEdit)>,
    /// Changes of cameras.
    pub cameras: Vec<(usize, CameraEdit)>,
    /// Changes of lights.
    pub lights: Vec<(usize, LightEdit)>,
    /// Parameters of effects.
    pub effects: Vec<EffectEdit>,
    /// Ambient light from above and from below, in place of that of the settings.
    pub ambient: Option<(Vec3, Vec3)>,
    /// Change of the sky.
    pub sky: SkyEdit,
    /// Changes of 2D layers.
    pub layers_2d: Vec<(usize, Layer2dEdit)>,
}

/// Change of an actor for one frame.
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
#[derive(Clone, Debug, PartialEq)]
pub enum ActorEdit {
    /// Replaces the translation.
    MoveTo(DVec3),
    /// Adds to the translation.
    MoveBy(DVec3),
    /// Rotates the actor about the axes of its parent, after its own rotation.
    Turn(DQuat),
    /// Multiplies the scale.
    Scale(DVec3),
    /// Shows or hides the actor.
    Visible(bool),
    /// Replaces the factor of base colors, linear RGBA.
    Tint(Vec4),
    /// Replaces the width of the actor's lines and points.
    LineWidth(f32),
    /// Sets the number of copies of the actor's meshes.
    Copies(u32),
    /// Sets the weight of a target of a mesh instance.
    Morph { instance: u32, target: u32, weight: f32 },
    /// Sets the weight of an expression, by its index in `Asset::expressions`.
    Expression { expression: u32, weight: f32 },
    /// Replaces all parents of the actor in this frame.
    Attach(Parenting),
    /// Rotates a joint in its own space, after its clip.
    TurnJoint { joint: u32, rotation: glam::Quat },
    /// Replaces the wind at the actor's springs, metres per second, world space.
    Wind(DVec3),
}

/// Change of a camera for one frame.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraEdit {
    /// Replaces the position; a camera that looks at a target still does.
    MoveTo(DVec3),
    /// Turns the camera to a target.
    LookAt(Target),
    /// Rotates the camera about world axes, after its looks and the changes before this one.
    Turn(DQuat),
    /// Makes the projection perspective, with this vertical field of view, radians.
    FieldOfView(f32),
    /// Makes the projection orthographic, with this height of the image, metres.
    Height(f32),
    /// Replaces the near clipping plane, metres.
    Near(f32),
    /// Replaces the far clipping plane, metres.
    Far(f32),
    /// Replaces the rig.
    Rig(Rig),
    /// Adds a shake, after all other changes; its start, end and fade do not apply.
    Shake(CameraShake),
}

/// Change of a light for one frame.
#[derive(Clone, Debug, PartialEq)]
pub enum LightEdit {
    /// Replaces the intensity, lux or candela.
    Intensity(f32),
    /// Replaces the color, linear RGB.
    Color(Vec3),
    /// Replaces the position, metres.
    MoveTo(DVec3),
}

/// The edits of one actor, camera, light or 2D layer, in order.
pub(crate) fn edits_for_index<E>(
    edits: &[(usize, E)],
    index: usize,
) -> impl DoubleEndedIterator<Item = &E> + Clone {
    edits.iter().filter(move |(of, _)| *of == index).map(|(_, edit)| edit)
}

impl FrameEdits {
    /// The rig that callbacks give a camera for this frame, if they do.
    pub(crate) fn rig(&self, index: usize) -> Option<&Rig> {
        edits_for_index(&self.cameras, index).rev().find_map(|edit| match edit {
            CameraEdit::Rig(rig) => Some(rig),
            _ => None,
        })
    }

    /// The rig of a camera in this frame.
    pub(crate) fn rig_of<'a>(&'a self, index: usize, camera: &'a Camera) -> &'a Rig {
        self.rig(index).unwrap_or(&camera.rig)
    }
}

impl ActorEdit {
    /// Applies a change of position, rotation or scale to a placement; other changes do nothing here.
    pub(crate) fn apply_to_placement(&self, placement: &mut Placement) {
        match *self {
            ActorEdit::MoveTo(translation) => placement.translation = translation,
            ActorEdit::MoveBy(offset) => placement.translation += offset,
            ActorEdit::Turn(rotation) => placement.rotation = (rotation * placement.rotation).normalize(),
            ActorEdit::Scale(factor) => placement.scale *= factor,
            _ => {}
        }
    }
}
