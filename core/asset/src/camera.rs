//! Cameras of a file, and projections.

/// How a camera projects; it looks along −Z of its joint, +Y is up.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
pub enum Projection {
    /// `yfov` in radians, full vertical angle; `near` and `far` in metres, no far plane where `far` is `None`.
    Perspective { yfov: f32, near: f32, far: Option<f32> },
    /// `height` in metres, full vertical extent of the view; `near` and `far` in metres.
    Orthographic { height: f32, near: f32, far: f32 },
}

impl Default for Projection {
    fn default() -> Self {
        Projection::Perspective { yfov: 0.7, near: 0.05, far: None }
    }
}

/// A camera of the file: looks along its joint's −Z with +Y up.
#[derive(Clone, Debug, PartialEq)]
pub struct AssetCamera {
    /// Name in the file.
    pub name: String,
    /// Joint that carries the camera.
    pub joint: u32,
    /// Projection with its parameters.
    pub projection: Projection,
}
