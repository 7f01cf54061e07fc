//! The changes of a callback in one frame.

use crate::stage::actor::{Placement, Target};
use crate::stage::camera::{Camera, Rig};
use crate::stage::camera_moves::CameraShake;
use crate::stage::effects::EffectEdit;
use crate::stage::layers_2d::Layer2dEdit;
use crate::stage::parenting::Parenting;
use crate::stage::sky::SkyEdit;
use glam::{DQuat, DVec3, Vec3, Vec4};

/// The changes that a hook may make for one frame, by index of actor, camera, light and effect.
#[derive(Clone, Debug, Default)]
pub struct FrameEdits {
    /// Changes of actors, in the order in which they are made.
    pub actors: Vec<ActorEdit>,
    /// Changes of cameras.
    pub cameras: Vec<CameraEdit>,
    /// Changes of lights.
    pub lights: Vec<LightEdit>,
    /// Parameters of effects.
    pub effects: Vec<EffectEdit>,
    /// Light from everywhere, from above and from below, in place of that of the settings.
    pub ambient: Option<(Vec3, Vec3)>,
    /// Change of the sky.
    pub sky: SkyEdit,
    /// Changes of 2D layers.
    pub layers_2d: Vec<Layer2dEdit>,
}

/// Change of an actor for one frame, by its index in `Stage::actors`.
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
#[derive(Clone, Debug, PartialEq)]
pub enum ActorEdit {
    /// Replaces the translation.
    MoveTo { actor: usize, translation: DVec3 },
    /// Adds to the translation.
    MoveBy { actor: usize, offset: DVec3 },
    /// Turns the actor before its own rotation (world axes of the parent).
    Turn { actor: usize, rotation: DQuat },
    /// Multiplies the scale.
    Scale { actor: usize, factor: DVec3 },
    /// Shows or hides it.
    Visible { actor: usize, visible: bool },
    /// Replaces the factor of base colors, linear RGBA.
    Tint { actor: usize, tint: Vec4 },
    /// Replaces the width of its lines and points.
    LineWidth { actor: usize, width: f32 },
    /// Sets how many copies of its meshes there are.
    Copies { actor: usize, count: u32 },
    /// Sets the weight of a target of a mesh instance.
    Morph { actor: usize, instance: u32, target: u32, weight: f32 },
    /// Sets the weight of an expression, by its index in `Asset::expressions`.
    Expression { actor: usize, expression: u32, weight: f32 },
    /// The parent in this frame, whatever parents it has over time.
    Attach { actor: usize, parent: Parenting },
    /// A joint turned (after its clip) in its own space.
    TurnJoint { actor: usize, joint: u32, rotation: glam::Quat },
    /// Speed of the air about an actor's springs, metres a second, in the world.
    Wind { actor: usize, wind: DVec3 },
}

/// Change of a camera for one frame, by its index in `Stage::cameras`.
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
#[derive(Clone, Debug, PartialEq)]
pub enum CameraEdit {
    /// Replaces the position; a camera that looks at a target still does.
    MoveTo { camera: usize, position: DVec3 },
    /// Turns it to a target.
    LookAt { camera: usize, target: Target },
    /// Turned by this rotation about world axes, after all else.
    Turn { camera: usize, rotation: DQuat },
    /// Perspective with this vertical field of view, radians.
    FieldOfView { camera: usize, yfov: f32 },
    /// Orthographic with this height of the image, metres.
    Height { camera: usize, height: f32 },
    /// Replaces the near clipping plane, metres.
    Near { camera: usize, near: f32 },
    /// Replaces the far clipping plane, metres.
    Far { camera: usize, far: f32 },
    /// Moved by this rig in place of its own, for this frame.
    Rig { camera: usize, rig: Rig },
    /// Shakes it further, after all else; its times do not count.
    Shake { camera: usize, shake: CameraShake },
}

impl CameraEdit {
    /// The camera that is changed.
    pub fn camera(&self) -> usize {
        match *self {
            CameraEdit::MoveTo { camera, .. }
            | CameraEdit::LookAt { camera, .. }
            | CameraEdit::Turn { camera, .. }
            | CameraEdit::FieldOfView { camera, .. }
            | CameraEdit::Height { camera, .. }
            | CameraEdit::Near { camera, .. }
            | CameraEdit::Far { camera, .. }
            | CameraEdit::Rig { camera, .. }
            | CameraEdit::Shake { camera, .. } => camera,
        }
    }
}

impl FrameEdits {
    /// The rig that callbacks give a camera for this frame, if they do.
    pub(crate) fn rig(&self, index: usize) -> Option<&Rig> {
        self.cameras.iter().rev().find_map(|edit| match edit {
            CameraEdit::Rig { camera, rig } if *camera == index => Some(rig),
            _ => None,
        })
    }

    /// The rig of a camera in this frame.
    pub(crate) fn rig_of<'a>(&'a self, index: usize, camera: &'a Camera) -> &'a Rig {
        self.rig(index).unwrap_or(&camera.rig)
    }
}

/// Change of a light for one frame, by its index in `Stage::lights`.
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
#[derive(Clone, Debug, PartialEq)]
pub enum LightEdit {
    /// Lux or candela.
    Intensity { light: usize, intensity: f32 },
    /// Linear RGB.
    Color { light: usize, color: Vec3 },
    /// Replaces the position, metres.
    MoveTo { light: usize, position: DVec3 },
}

impl ActorEdit {
    /// Moves, turns or scales a placement, if that is what it does.
    pub(crate) fn place(&self, placement: &mut Placement) {
        match *self {
            ActorEdit::MoveTo { translation, .. } => placement.translation = translation,
            ActorEdit::MoveBy { offset, .. } => placement.translation += offset,
            ActorEdit::Turn { rotation, .. } => {
                placement.rotation = (rotation * placement.rotation).normalize();
            }
            ActorEdit::Scale { factor, .. } => placement.scale *= factor,
            _ => {}
        }
    }

    /// The actor that is changed.
    pub fn actor(&self) -> usize {
        match *self {
            ActorEdit::MoveTo { actor, .. }
            | ActorEdit::MoveBy { actor, .. }
            | ActorEdit::Turn { actor, .. }
            | ActorEdit::Scale { actor, .. }
            | ActorEdit::Visible { actor, .. }
            | ActorEdit::Attach { actor, .. }
            | ActorEdit::Tint { actor, .. }
            | ActorEdit::LineWidth { actor, .. }
            | ActorEdit::Copies { actor, .. }
            | ActorEdit::Morph { actor, .. }
            | ActorEdit::Expression { actor, .. }
            | ActorEdit::TurnJoint { actor, .. }
            | ActorEdit::Wind { actor, .. } => actor,
        }
    }
}
