//! Hints under the mouse, which are away while a button is down and until the mouse has left the place where it was let go, so that what is
//! dragged is seen, and while a text stands at the mouse.

use egui::{Context, Id, Pos2, Response, WidgetText};

/// Points that the mouse moves before hints come again.
const LEFT: f32 = 6.0;

pub trait Hint {
    /// Shows a text while the mouse rests on it.
    fn hint(self, text: impl Into<WidgetText>) -> Response;
}

impl Hint for Response {
    fn hint(self, text: impl Into<WidgetText>) -> Response {
        match are_held(&self.ctx) {
            true => self,
            false => self.on_hover_text(text),
        }
    }
}

/// Keeps hints away, or lets them come again.
pub(super) fn hold(context: &Context, held: bool) {
    context.data_mut(|d| d.insert_temp(id(), held));
}

/// Notes, once a frame before all hints, where a button is down or was let go last.
pub(super) fn watch(context: &Context) {
    let (at, is_used) =
        context.input(|i| (i.pointer.latest_pos(), i.pointer.any_down() || i.pointer.any_released()));
    let has_left = |from: Pos2| at.is_none_or(|at| at.distance(from) > LEFT);
    context.data_mut(|d| {
        if let (true, Some(at)) = (is_used, at) {
            d.insert_temp(used_id(), at);
        } else if d.get_temp(used_id()).is_some_and(has_left) {
            d.remove::<Pos2>(used_id());
        }
    });
}

fn are_held(context: &Context) -> bool {
    context.data(|d| d.get_temp(id()).unwrap_or(false) || d.get_temp::<Pos2>(used_id()).is_some())
}

fn id() -> Id {
    Id::new("hints are held")
}

fn used_id() -> Id {
    Id::new("where a button was used")
}
