//! Evaluates 2D layers at a time: the visible ones, in painter's order.

use crate::snapshot::Layer2dState;
use crate::stage::Stage;
use crate::stage::channel::{Property, keyed_value};
use crate::stage::edits::edits_for_index;
use crate::stage::layers_2d::Layer2dEdit;
use choreo_motion::Time;
use glam::DVec2;

/// Fills `out` with the visible 2D layers at a time.
pub(crate) fn evaluate_layers_2d(
    stage: &Stage,
    edits: &[(usize, Layer2dEdit)],
    time: Time,
    out: &mut Vec<Layer2dState>,
) {
    out.clear();
    for (index, layer_2d) in stage.layers_2d.iter().enumerate() {
        let key = |property| keyed_value(&layer_2d.channels, property, time);
        let (mut at, mut words) =
            (key(Property::Translation).map_or(layer_2d.at, |v| DVec2::new(v[0], v[1])), None);
        let mut opacity = key(Property::Opacity).map_or(layer_2d.opacity, |v| v[0]);
        let scale = key(Property::Scale).map_or(layer_2d.scale, |v| v[0]);
        for edit in edits_for_index(edits, index) {
            match edit {
                Layer2dEdit::At(to) => at = *to,
                Layer2dEdit::Opacity(to) => opacity = *to,
                Layer2dEdit::Words(now) => words = Some(now.clone()),
            }
        }
        // Splines overshoot.
        let opacity = (opacity * layer_2d.opacity_factor(time)).clamp(0.0, 1.0) as f32;
        if opacity > 0.0 && scale > 0.0 && at.is_finite() && scale.is_finite() {
            out.push(Layer2dState { layer_2d: index, at, opacity, scale, words });
        }
    }
}
