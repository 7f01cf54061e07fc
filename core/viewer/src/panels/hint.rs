//! Tooltips that are hidden while a mouse button is down, until the mouse has moved away from the place of the release, and while a text is
//! displayed at the mouse, so that they do not cover what is dragged.

use egui::{Context, Id, Pos2, Response, WidgetText};

/// Distance that the mouse must move until tooltips appear again, points.
const MIN_POINTER_MOVE: f32 = 6.0;

pub(super) trait Hint {
    /// Shows a tooltip while the mouse rests on the widget.
    fn hint(self, text: impl Into<WidgetText>) -> Response;
}

impl Hint for Response {
    fn hint(self, text: impl Into<WidgetText>) -> Response {
        match are_hints_hidden(&self.ctx) {
            true => self,
            false => self.on_hover_text(text),
        }
    }
}

/// Hides tooltips, or allows them again.
pub(super) fn set_hints_hidden(context: &Context, hidden: bool) {
    context.data_mut(|d| d.insert_temp(hidden_flag_id(), hidden));
}

/// Records the mouse position while a button is down or at its release; called once per frame before all tooltips.
pub(super) fn track_pointer(context: &Context) {
    let (at, is_pressed) =
        context.input(|i| (i.pointer.latest_pos(), i.pointer.any_down() || i.pointer.any_released()));
    let has_left = |from: Pos2| at.is_none_or(|at| at.distance(from) > MIN_POINTER_MOVE);
    context.data_mut(|d| {
        if let (true, Some(at)) = (is_pressed, at) {
            d.insert_temp(last_press_id(), at);
        } else if d.get_temp(last_press_id()).is_some_and(has_left) {
            d.remove::<Pos2>(last_press_id());
        }
    });
}

fn are_hints_hidden(context: &Context) -> bool {
    context.data(|d| {
        d.get_temp(hidden_flag_id()).unwrap_or(false) || d.get_temp::<Pos2>(last_press_id()).is_some()
    })
}

fn hidden_flag_id() -> Id {
    Id::new("hints are held")
}

fn last_press_id() -> Id {
    Id::new("where a button was used")
}
