//! Light from all around: a panorama, turned and dimmed over time.

use crate::stage::channel::Channel;
use choreo_asset::Panorama;
use std::sync::Arc;

/// The sky of a stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Sky {
    pub panorama: Arc<Panorama>,
    /// Radians about +Y, counter-clockwise from above.
    pub turn: f64,
    /// Times the panorama's radiance.
    pub strength: f32,
    /// Seen behind everything, in place of the stage's background.
    pub background: bool,
    /// [`Property::Turn`] and [`Property::Intensity`].
    pub channels: Vec<Channel>,
}

impl Sky {
    pub fn new(panorama: Arc<Panorama>) -> Sky {
        Sky { panorama, turn: 0.0, strength: 1.0, background: false, channels: Vec::new() }
    }
}

/// What a callback says of the sky for one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SkyEdit {
    pub turn: Option<f64>,
    pub strength: Option<f32>,
}
