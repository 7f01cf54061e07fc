//! Cameras of a stage, and the cuts between them.

use crate::stage::actor::Target;
use crate::stage::camera_moves::{CameraLook, CameraShake};
use crate::stage::channel::Channel;
use crate::stage::described::{FieldType, FieldValue, described};
use choreo_asset::Projection;
use choreo_motion::Time;
use glam::{DQuat, DVec3};

/// Rule that places and turns a camera at every time.
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
#[derive(Clone, Debug, PartialEq)]
pub enum Rig {
    /// Stays at `position`; looks at the target, else along −Z of `rotation`.
    Fixed { position: DVec3, rotation: DQuat, look_at: Option<Target> },
    /// Stays at target + offset (world axes) and looks at the target.
    Follow { target: Target, offset: DVec3 },
    /// Circles the target: angles in radians at time 0, radians a second. Azimuth 0 is at +Z (before a glTF
    /// character's face), π/2 at +X; elevation π/2 looks straight down.
    Orbit { target: Target, distance: f64, elevation: f64, azimuth: f64, speed: f64 },
    /// The camera of an actor's file.
    File { actor: usize, camera: u32 },
    /// Stays still and fits everything that is visible at some time of the stage's length, from an azimuth and
    /// elevation in radians, as `Orbit` counts them. Flat ground is left out where there is anything else.
    Frame { azimuth: f64, elevation: f64 },
}

/// A numeric option of a camera rig, as scripts state it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigOption {
    /// Name of the option.
    pub name: &'static str,
    /// Unit of the value.
    pub unit: &'static str,
    /// Default value.
    pub default: f64,
    /// Smallest and largest allowed value.
    pub range: [f64; 2],
}

/// Allowed azimuths in degrees: any finite number.
const AZIMUTHS: [f64; 2] = [f64::MIN, f64::MAX];
/// Allowed elevations in degrees: at ±90 no direction is up in the image.
const ELEVATIONS: [f64; 2] = [-89.0, 89.0];

impl Rig {
    /// Options of `.orbit(target, …)`.
    pub const ORBIT: [RigOption; 4] = [
        RigOption { name: "distance", unit: "m", default: 4.0, range: [0.001, 1e9] },
        RigOption { name: "elevation", unit: "°", default: 15.0, range: ELEVATIONS },
        RigOption { name: "azimuth", unit: "° at 0 s", default: 0.0, range: AZIMUTHS },
        RigOption { name: "speed", unit: "° a second", default: 20.0, range: [-36_000.0, 36_000.0] },
    ];
    /// Options of `.frame(…)`. By default a little from the side, where a character shows its shape, and a little from above.
    pub const FRAME: [RigOption; 2] = [
        RigOption { name: "azimuth", unit: "°", default: 25.0, range: AZIMUTHS },
        RigOption { name: "elevation", unit: "°", default: 10.0, range: ELEVATIONS },
    ];
}

described! {
    /// A camera of the stage. By default a perspective camera, with a vertical field of view of 0.7 rad, that frames everything from the
    /// front.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Camera {
        /// Name in scripts.
        name: String = String::new();
        /// Field of view or height of the image, and the clipping planes.
        projection: Projection = Projection::default();
        /// Whether the near plane in `projection` is set by the script. Otherwise it is moved closer for a near target.
        near_is_set: bool = false;
        /// Whether the field of view or height in `projection` applies to the camera of a file, too.
        lens_is_set: bool = false;
        /// Motion of the camera: its position and direction at every time.
        rig: Rig = Rig::Frame { azimuth: 0.0, elevation: 0.0 };
        /// Keyed properties.
        channels: Vec<Channel> = Vec::new();
        /// Targets that replace the target of the rig over time; sorted by start.
        looks: Vec<CameraLook> = Vec::new();
        /// Shakes on top of rig and looks; they add up.
        shakes: Vec<CameraShake> = Vec::new();
    }
    fields {
        /// vertical field of view
        fov: [get |of: &Camera| match of.projection {
            Projection::Perspective { yfov, .. } => FieldValue::Number(yfov.into()),
            Projection::Orthographic { .. } => FieldValue::Unset,
        }, set |of: &mut Camera, v| if let (Projection::Perspective { yfov, .. }, FieldValue::Number(n)) = (&mut of.projection, v) {
            *yfov = n as f32;
        }], FieldType::Degrees(0.1, 179.0), keys "fov" FieldOfView, lacks no_perspective_reason;
        /// focal length on full-frame film, 24 mm high; stored as the field of view
        focal_length: [get |_: &Camera| FieldValue::Unset, set |of: &mut Camera, v| if let (Projection::Perspective { yfov, .. }, FieldValue::Number(n)) = (&mut of.projection, v) {
            *yfov = Camera::yfov(n) as f32;
        }], FieldType::Number(0.2, 13_000.0, "mm"), keys "focal_length" FocalLength, lacks no_lens_reason;
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
            crate::stage::described::FieldStorage::store(near, v);
            of.near_is_set = true;
        }], FieldType::Number(1e-6, 1e9, "metres");
        /// far clipping plane
        far: [get |of: &Camera| crate::stage::described::FieldStorage::value(&of.far()), set |of: &mut Camera, v| match &mut of.projection {
            Projection::Perspective { far, .. } => crate::stage::described::FieldStorage::store(far, v),
            Projection::Orthographic { far, .. } => crate::stage::described::FieldStorage::store(far, v),
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

fn no_perspective_reason(of: &Camera) -> Option<&'static str> {
    let orthographic = matches!(of.projection, Projection::Orthographic { .. });
    orthographic.then_some("has no perspective, so its fov cannot be keyed")
}

fn no_lens_reason(of: &Camera) -> Option<&'static str> {
    no_perspective_reason(of).map(|_| "has no perspective, so its focal length cannot be keyed")
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

    /// The focal length in millimetres that gives a vertical field of view in radians, on full-frame film.
    pub fn focal_length(yfov: f64) -> f64 {
        FILM_HEIGHT / 2.0 / libm::tan(yfov / 2.0)
    }

    /// The near clipping plane, metres.
    pub fn near(&self) -> f32 {
        let (Projection::Perspective { near, .. } | Projection::Orthographic { near, .. }) = self.projection;
        near
    }

    /// The far clipping plane, metres; `None`: there is no far plane.
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
    /// Stage time of the cut.
    pub at: Time,
    /// Index into `Stage::cameras` of the camera that is active from then on.
    pub camera: usize,
    /// Duration of the dissolve from the camera before, starting at `at`; it ends at the next cut at the latest.
    pub dissolve: Time,
}

impl Cut {
    /// A cut without a dissolve.
    pub fn new(at: Time, camera: usize) -> Cut {
        Cut { at, camera, dissolve: Time::ZERO }
    }
}
