//! Light from all around: a panorama, turned and dimmed over time.

use crate::channels::keyed;
use crate::edits::FrameEdits;
use crate::stage::{Channel, Property};
use choreo_asset::Panorama;
use choreo_motion::Time;
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

    pub(crate) fn at(&self, edits: &FrameEdits, time: Time) -> SkyState {
        let key = |property| keyed(&self.channels, property, time).map(|v| v[0]);
        let turn = edits.sky.turn.or(key(Property::Turn)).unwrap_or(self.turn);
        let strength = edits.sky.strength.or(key(Property::Intensity).map(|s| s as f32));
        SkyState {
            panorama: self.panorama.clone(),
            turn,
            // Splines overshoot: nothing shines darkness.
            strength: strength.unwrap_or(self.strength).max(0.0),
            background: self.background,
        }
    }
}

/// A sky at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyState {
    pub panorama: Arc<Panorama>,
    pub turn: f64,
    pub strength: f32,
    pub background: bool,
}

/// What a callback says of the sky for one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SkyEdit {
    pub turn: Option<f64>,
    pub strength: Option<f32>,
}
