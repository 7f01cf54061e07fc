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
    pub actors: Vec<ActorEdit>,
    pub cameras: Vec<CameraEdit>,
    pub lights: Vec<LightEdit>,
    pub effects: Vec<EffectEdit>,
    pub ambient: Option<(Vec3, Vec3)>,
    pub sky: SkyEdit,
    pub layers_2d: Vec<Layer2dEdit>,
}

#[derive(Clone, Debug, PartialEq)]
pub enum ActorEdit {
    /// Replaces the translation.
    MoveTo {
        actor: usize,
        translation: DVec3,
    },
    /// Adds to the translation.
    MoveBy {
        actor: usize,
        offset: DVec3,
    },
    /// Turns the actor before its own rotation (world axes of the parent).
    Turn {
        actor: usize,
        rotation: DQuat,
    },
    Scale {
        actor: usize,
        factor: DVec3,
    },
    Visible {
        actor: usize,
        visible: bool,
    },
    Tint {
        actor: usize,
        tint: Vec4,
    },
    LineWidth {
        actor: usize,
        width: f32,
    },
    Copies {
        actor: usize,
        count: u32,
    },
    Morph {
        actor: usize,
        instance: u32,
        target: u32,
        weight: f32,
    },
    Expression {
        actor: usize,
        expression: u32,
        weight: f32,
    },
    /// The parent in this frame, whatever parents it has over time.
    Attach {
        actor: usize,
        parent: Parenting,
    },
    /// A joint turned (after its clip) in its own space.
    TurnJoint {
        actor: usize,
        joint: u32,
        rotation: glam::Quat,
    },
    /// Speed of the air about an actor's springs, metres a second, in the world.
    Wind {
        actor: usize,
        wind: DVec3,
    },
}

#[derive(Clone, Debug, PartialEq)]
pub enum CameraEdit {
    /// Replaces the position; a camera that looks at a target still does.
    MoveTo {
        camera: usize,
        position: DVec3,
    },
    LookAt {
        camera: usize,
        target: Target,
    },
    /// Turned by this rotation about world axes, after all else.
    Turn {
        camera: usize,
        rotation: DQuat,
    },
    /// Perspective with this vertical field of view, radians.
    FieldOfView {
        camera: usize,
        yfov: f32,
    },
    /// Orthographic with this height of the image, metres.
    Height {
        camera: usize,
        height: f32,
    },
    /// Planes between which it sees, metres, instead of those that it has.
    Near {
        camera: usize,
        near: f32,
    },
    Far {
        camera: usize,
        far: f32,
    },
    /// Moved by this rig in place of its own, for this frame.
    Rig {
        camera: usize,
        rig: Rig,
    },
    /// Shakes it further, after all else; its times do not count.
    Shake {
        camera: usize,
        shake: CameraShake,
    },
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

#[derive(Clone, Debug, PartialEq)]
pub enum LightEdit {
    Intensity { light: usize, intensity: f32 },
    Color { light: usize, color: Vec3 },
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
