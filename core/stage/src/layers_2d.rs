//! Flat things over and under the scene: words, pictures, panels, letterboxes; in painter's order.

use crate::snapshot::FlatState;
use crate::stage::Stage;
use crate::stage::channel::Property;
use crate::stage::channel::keyed;
use crate::stage::layers_2d::FlatEdit;
use choreo_motion::Time;
use glam::DVec2;

pub(crate) fn evaluate(stage: &Stage, edits: &[FlatEdit], time: Time, out: &mut Vec<FlatState>) {
    out.clear();
    for (index, flat) in stage.flats.iter().enumerate() {
        let key = |property| keyed(&flat.channels, property, time);
        let (mut at, mut words) =
            (key(Property::Translation).map_or(flat.at, |v| DVec2::new(v[0], v[1])), None);
        let mut opacity = key(Property::Opacity).map_or(flat.opacity, |v| v[0]);
        let scale = key(Property::Scale).map_or(flat.scale, |v| v[0]);
        for edit in edits {
            match edit {
                FlatEdit::At { flat, at: to } if *flat == index => at = *to,
                FlatEdit::Opacity { flat, opacity: to } if *flat == index => opacity = *to,
                FlatEdit::Words { flat, words: now } if *flat == index => words = Some(now.clone()),
                _ => {}
            }
        }
        // Splines overshoot.
        let opacity = (opacity * flat.presence(time)).clamp(0.0, 1.0) as f32;
        if opacity > 0.0 && scale > 0.0 && at.is_finite() && scale.is_finite() {
            out.push(FlatState { flat: index, at, opacity, scale, words });
        }
    }
}
