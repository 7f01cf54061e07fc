//! Cameras of a file, and projections.

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// `yfov` in radians, full vertical angle; no far plane where `far` is `None`.
    Perspective { yfov: f32, near: f32, far: Option<f32> },
    /// `height` in metres, full vertical extent of the view.
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
    pub name: String,
    pub joint: u32,
    pub projection: Projection,
}
