//! Row of one keyed property, below the row with the keys of all properties. Its diamonds are selected, moved and deleted independently.

use super::hint::Hint;
use super::marks::{self, MarkAct};
use super::sequencer::{add_dropped_clip, allocate_row, draw_row_name, run_mark};
use crate::app::Viewer;
use crate::state::events::Event;
use crate::state::timeline::RowNumber;
use egui::{Rect, Sense, Ui, vec2};

/// Additional indentation of its name, points.
const INDENT: f32 = 24.0;

/// Draws the row, and performs the user's actions. A click on its name selects all of its keys.
pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer, number: RowNumber, ruler: Rect) {
    let (label, lane) = allocate_row(ui, number, ruler);
    let Some(row) = viewer.timeline.row(number) else { return };
    let row_name = viewer.timeline.row_name(number);
    let response = ui.interact(label, ui.id().with(("row", number)), Sense::click());
    response
        .widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Label, true, format!("row {row_name}")));
    let place = Rect::from_min_max(label.min + vec2(INDENT, 0.0), label.max);
    draw_row_name(ui, &row.label, place, ui.visuals().weak_text_color());
    let keys = response
        .hint(format!("{row_name}\na click selects its keys"))
        .clicked()
        .then(|| row.events.iter().flat_map(Event::key_refs).collect());
    let mark_act = marks::show_events(ui, viewer, row, number, lane);
    add_dropped_clip(ui, viewer, number, lane);
    if let Some(MarkAct::Click(event, _)) = &mark_act {
        viewer.playhead.seek(event.at);
    }
    if let Some(keys) = keys {
        viewer.select_keys(keys);
    }
    if let Some(mark_act) = mark_act {
        run_mark(ui, viewer, mark_act);
    }
}
