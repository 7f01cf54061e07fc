//! The sky at a time: image-based lighting by a panorama with animated turn and strength.

use crate::snapshot::SkyState;
use crate::stage::channel::Property;
use crate::stage::channel::keyed_value;
use crate::stage::edits::FrameEdits;
use crate::stage::sky::Sky;
use choreo_motion::Time;

impl Sky {
    /// The sky at a time, with its keys and the edits of callbacks.
    pub(crate) fn at(&self, edits: &FrameEdits, time: Time) -> SkyState {
        let key = |property| keyed_value(&self.channels, property, time).map(|v| v[0]);
        let turn = edits.sky.turn.or(key(Property::Turn)).unwrap_or(self.turn);
        let strength = edits.sky.strength.or(key(Property::Intensity).map(|s| s as f32));
        SkyState {
            panorama: self.panorama.clone(),
            turn,
            // Splines overshoot, so negative values are clamped.
            strength: strength.unwrap_or(self.strength).max(0.0),
            background: self.background,
        }
    }
}
