//! Cameras of a stage, and the cuts between them.

use crate::stage::actor::Target;
use crate::stage::camera_moves::{CameraLook, CameraShake};
use crate::stage::channel::Channel;
use crate::stage::described::{FieldType, FieldValue, described};
use choreo_asset::Projection;
use choreo_motion::Time;
use glam::{DQuat, DVec3};

/// Way in which a camera is placed and turned at every time.
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
#[derive(Clone, Debug, PartialEq)]
pub enum Rig {
    /// Stands at `position`; looks at the target, else along −Z of `rotation`.
    Fixed { position: DVec3, rotation: DQuat, look_at: Option<Target> },
    /// Stands at target + offset (world axes) and looks at the target.
    Follow { target: Target, offset: DVec3 },
    /// Circles the target: angles in radians at time 0, radians a second. Azimuth 0 stands at +Z (before a glTF
    /// character's face), π/2 at +X; elevation π/2 looks straight down.
    Orbit { target: Target, distance: f64, elevation: f64, azimuth: f64, speed: f64 },
    /// The camera of an actor's file.
    File { actor: usize, camera: u32 },
    /// Stands still and fits everything that is visible at some time of the stage's length, from an azimuth and
    /// elevation in radians, as `Orbit` counts them. Flat ground is left out where there is anything else.
    Frame { azimuth: f64, elevation: f64 },
}

/// A number among the options of a motion of cameras, as scripts state it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigOption {
    /// Its name.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The number where none is stated.
    pub default: f64,
    /// The least and the greatest number.
    pub range: [f64; 2],
}

/// Degrees of a turn about the vertical.
const TURNS: [f64; 2] = [f64::MIN, f64::MAX];
/// Degrees above the horizontal: at 90 there is no side that is up.
const ELEVATIONS: [f64; 2] = [-89.0, 89.0];

impl Rig {
    /// Options of `.orbit(target, …)`.
    pub const ORBIT: [RigOption; 4] = [
        RigOption { name: "distance", unit: "m", default: 4.0, range: [0.001, 1e9] },
        RigOption { name: "elevation", unit: "°", default: 15.0, range: ELEVATIONS },
        RigOption { name: "azimuth", unit: "° at 0 s", default: 0.0, range: TURNS },
        RigOption { name: "speed", unit: "° a second", default: 20.0, range: [-36_000.0, 36_000.0] },
    ];
    /// Options of `.frame(…)`. By default a little from the side, where a character shows its shape, and a little from above.
    pub const FRAME: [RigOption; 2] = [
        RigOption { name: "azimuth", unit: "°", default: 25.0, range: TURNS },
        RigOption { name: "elevation", unit: "°", default: 10.0, range: ELEVATIONS },
    ];
}

described! {
    /// A camera of the stage. By default perspective, 0.7 rad high, and it fits everything into the image from the front.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Camera {
        /// Its name in scripts.
        name: String = String::new();
        /// Angle or height of the image, and the clipping planes.
        projection: Projection = Projection::default();
        /// The near plane is as `projection` has it. Otherwise it is brought nearer for a target that is close.
        near_is_set: bool = false;
        /// The angle or height of `projection` counts for the camera of a file, too.
        lens_is_set: bool = false;
        /// Its place and direction.
        rig: Rig = Rig::Frame { azimuth: 0.0, elevation: 0.0 };
        /// Keyed properties.
        channels: Vec<Channel> = Vec::new();
        /// Targets in place of that of its rig; sorted by start.
        looks: Vec<CameraLook> = Vec::new();
        /// Shaking on top of that; all of them add up.
        shakes: Vec<CameraShake> = Vec::new();
    }
    fields {
        /// vertical field of view
        fov: [get |of: &Camera| match of.projection {
            Projection::Perspective { yfov, .. } => FieldValue::Number(yfov.into()),
            Projection::Orthographic { .. } => FieldValue::Unset,
        }, set |of: &mut Camera, v| if let (Projection::Perspective { yfov, .. }, FieldValue::Number(n)) = (&mut of.projection, v) {
            *yfov = n as f32;
        }], FieldType::Degrees(0.1, 179.0), keys "fov" FieldOfView, lacks has_no_perspective;
        /// focal length on full-frame film, 24 mm high; it is held as the field of view
        focal_length: [get |_: &Camera| FieldValue::Unset, set |of: &mut Camera, v| if let (Projection::Perspective { yfov, .. }, FieldValue::Number(n)) = (&mut of.projection, v) {
            *yfov = Camera::yfov(n) as f32;
        }], FieldType::Number(0.2, 13_000.0, "mm"), keys "focal_length" FocalLength, lacks has_no_lens;
        /// height of the image
        height: [get |of: &Camera| match of.projection {
            Projection::Orthographic { height, .. } => FieldValue::Number(height.into()),
            Projection::Perspective { .. } => FieldValue::Unset,
        }, set |of: &mut Camera, v| if let (Projection::Orthographic { height, .. }, FieldValue::Number(n)) = (&mut of.projection, v) {
            *height = n as f32;
        }], FieldType::Number(1e-6, 1e9, "metres");
        /// near clipping plane
        near: [get |of: &Camera| FieldValue::Number(of.near().into()), set |of: &mut Camera, v| {
            let (Projection::Perspective { near, .. } | Projection::Orthographic { near, .. }) = &mut of.projection;
            crate::stage::described::Holds::hold(near, v);
            of.near_is_set = true;
        }], FieldType::Number(1e-6, 1e9, "metres");
        /// far clipping plane
        far: [get |of: &Camera| crate::stage::described::Holds::value(&of.far()), set |of: &mut Camera, v| match &mut of.projection {
            Projection::Perspective { far, .. } => crate::stage::described::Holds::hold(far, v),
            Projection::Orthographic { far, .. } => crate::stage::described::Holds::hold(far, v),
        }], FieldType::Number(1e-5, 1e15, "metres");
        position: [get |of: &Camera| match &of.rig {
            Rig::Fixed { position, .. } => FieldValue::Vector(*position),
            _ => FieldValue::Unset,
        }, set |of: &mut Camera, v| if let (Rig::Fixed { position, .. }, FieldValue::Vector(p)) = (&mut of.rig, v) {
            *position = p;
        }], FieldType::Point, keys "position" Translation, lacks moves_by_itself;
        rotation: [get |of: &Camera| match &of.rig {
            Rig::Fixed { rotation, .. } => FieldValue::Rotation(*rotation),
            _ => FieldValue::Unset,
        }, set |of: &mut Camera, v| if let (Rig::Fixed { rotation, .. }, FieldValue::Rotation(q)) = (&mut of.rig, v) {
            *rotation = q;
        }], FieldType::Rotation, keys "rotation" Rotation, lacks looks_at_its_target;
    }
}

fn has_no_perspective(of: &Camera) -> Option<&'static str> {
    let orthographic = matches!(of.projection, Projection::Orthographic { .. });
    orthographic.then_some("has no perspective, so its fov cannot be keyed")
}

fn has_no_lens(of: &Camera) -> Option<&'static str> {
    has_no_perspective(of).map(|_| "has no perspective, so its focal length cannot be keyed")
}

fn moves_by_itself(of: &Camera) -> Option<&'static str> {
    let placed = matches!(of.rig, Rig::Fixed { .. } | Rig::Follow { .. });
    (!placed).then_some("moves by itself, so its position cannot be keyed")
}

fn looks_at_its_target(of: &Camera) -> Option<&'static str> {
    let free = matches!(of.rig, Rig::Fixed { look_at: None, .. });
    (!free).then_some("looks at its target, so its rotation cannot be keyed")
}

/// Height of full-frame film, millimetres.
const FILM_HEIGHT: f64 = 24.0;

impl Camera {
    /// The vertical field of view in radians of a lens with a focal length in millimetres, on full-frame film.
    pub fn yfov(focal_length: f64) -> f64 {
        2.0 * libm::atan(FILM_HEIGHT / 2.0 / focal_length)
    }

    /// The focal length in millimetres that sees a vertical field of view in radians, on full-frame film.
    pub fn focal_length(yfov: f64) -> f64 {
        FILM_HEIGHT / 2.0 / libm::tan(yfov / 2.0)
    }

    /// The near clipping plane, metres.
    pub fn near(&self) -> f32 {
        let (Projection::Perspective { near, .. } | Projection::Orthographic { near, .. }) = self.projection;
        near
    }

    /// The far clipping plane, metres; `None`: none.
    pub fn far(&self) -> Option<f32> {
        match self.projection {
            Projection::Perspective { far, .. } => far,
            Projection::Orthographic { far, .. } => Some(far),
        }
    }
}

/// Change to another camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// Time at which it happens.
    pub at: Time,
    /// Index into `Stage::cameras` of the camera that is on from then.
    pub camera: usize,
    /// How long the image of the camera before goes over into that of this one, from `at` on, at most until the next cut.
    pub dissolve: Time,
}

impl Cut {
    /// A cut without a dissolve.
    pub fn new(at: Time, camera: usize) -> Cut {
        Cut { at, camera, dissolve: Time::ZERO }
    }
}
