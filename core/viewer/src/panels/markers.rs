//! Markers: lines over all rows of the sequencer, each with a flag that can be dragged.

use super::gesture;
use super::hint::Hint;
use crate::app::Viewer;
use choreo_motion::Time;
use egui::{Rect, Sense, Stroke, Ui, pos2, vec2};

const FONT_SIZE: f32 = 11.5;
/// Number of lines of flags, which are stacked where their names would overlap.
const FLAG_LINES: usize = 4;
/// Largest width of a name, points; longer ones are shown in a tooltip.
const MAX_NAME_WIDTH: f32 = 180.0;

pub(super) fn show(ui: &Ui, viewer: &mut Viewer, area: Rect, ruler: Rect) {
    let lanes = Rect::from_min_max(ruler.min, area.max);
    let painter = ui.painter_at(lanes);
    let visuals = ui.visuals();
    let (color, background_color) = (visuals.warn_fg_color, visuals.panel_fill.gamma_multiply(0.85));
    let x_of = |time: Time| ruler.left() + viewer.visible_span.x_of(time.as_secs(), ruler.width());
    let mut indices_by_time: Vec<usize> = (0..viewer.timeline.markers.len()).collect();
    indices_by_time.sort_by_key(|index| viewer.timeline.markers[*index].1);
    // Right end of the last flag in each line.
    let mut ends = [f32::NEG_INFINITY; FLAG_LINES];
    let mut moved = None;
    for index in indices_by_time {
        let (name, time) = &viewer.timeline.markers[index];
        let x = x_of(*time);
        // The line begins below the ruler, so that its numbers stay readable.
        painter.vline(x, ruler.bottom()..=lanes.bottom(), Stroke::new(1.0, color));
        // A name near the right end is placed before its line.
        let galley =
            super::truncated_text(&painter, name, FONT_SIZE, color, MAX_NAME_WIDTH.min(lanes.width()));
        let size = galley.size();
        let left = (x + 3.0).min(lanes.right() - size.x - 2.0);
        let level = ends.iter().position(|end| *end + 4.0 < left).unwrap_or(0);
        ends[level] = left + size.x;
        // Flags are below the rows, where they cover no bar unless there are many rows.
        let at = pos2(left, lanes.bottom() - (size.y + 2.0) * (level + 1) as f32);
        let flag = Rect::from_min_size(pos2(left - 3.0, at.y), size + vec2(6.0, 2.0)).intersect(lanes);
        if flag.width() <= 0.0 || !(lanes.left()..=lanes.right()).contains(&x) {
            continue;
        }
        let response = ui.interact(flag, ui.id().with(("marker", index)), Sense::drag());
        painter.rect_filled(flag, 2.0, background_color);
        painter.galley(at, galley, color);
        let label = format!("marker {name}");
        response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Slider, true, label.clone()));
        let response = response
            .on_hover_cursor(egui::CursorIcon::ResizeHorizontal)
            .hint(format!("{name}\n{}", viewer.time_text(*time)));
        if let Some(pointer) = gesture::dragged_position(ui, &response, pos2(x, at.y)) {
            let secs = viewer.snapped(viewer.visible_span.secs_at(pointer.x - ruler.left(), ruler.width()));
            painter.vline(
                x_of(Time::from_secs(secs)),
                lanes.y_range(),
                Stroke::new(2.0, visuals.strong_text_color()),
            );
            let is_moved = (secs - time.as_secs()).abs() > 1e-6;
            moved = (response.drag_stopped() && is_moved).then(|| (name.clone(), secs)).or(moved);
        }
    }
    if let Some((name, secs)) = moved {
        viewer.edit(|v| v.set_marker(&name, secs));
    }
}
