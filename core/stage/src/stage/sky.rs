//! Sky of a stage: image-based lighting by a panorama, turned and dimmed over time.

use crate::stage::channel::Channel;
use crate::stage::described::{FieldType, described};
use choreo_asset::Panorama;
use std::sync::Arc;

described! {
    /// The sky of a stage.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Sky(
        /// The light from each direction.
        panorama: Arc<Panorama>,
    ) {
        /// Rotation about +Y, radians, counter-clockwise seen from above.
        turn: f64 = 0.0;
        /// Factor of the panorama's radiance.
        strength: f32 = 1.0;
        /// Whether the panorama is visible, in place of the stage's background.
        background: bool = false;
        /// Keyed turn and strength (`Property::Turn` and `Property::Intensity`).
        channels: Vec<Channel> = Vec::new();
    }
    fields {
        /// about the vertical axis, counter-clockwise seen from above
        turn: turn, FieldType::Degrees(-1e6, 1e6), keys "turn" Turn;
        strength: strength, FieldType::Number(0.0, 1000.0, ""), keys "strength" Intensity;
        /// true: visible as background
        background: background, FieldType::Flag;
    }
}

/// A change of the sky by a callback, for one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SkyEdit {
    /// Rotation about +Y in radians, in place of the sky's own.
    pub turn: Option<f64>,
    /// Factor of the panorama's radiance, in place of the sky's own.
    pub strength: Option<f32>,
}
