//! Hints under the mouse, which are away while a button is down, so that what is dragged is seen, and while a text stands at the mouse.

use egui::{Context, Id, Response, WidgetText};

pub trait Hint {
    /// Shows a text while the mouse rests on it.
    fn hint(self, text: impl Into<WidgetText>) -> Response;
}

impl Hint for Response {
    fn hint(self, text: impl Into<WidgetText>) -> Response {
        match self.ctx.input(|i| i.pointer.any_down()) || are_held(&self.ctx) {
            true => self,
            false => self.on_hover_text(text),
        }
    }
}

/// Keeps hints away, or lets them come again.
pub(super) fn hold(context: &Context, held: bool) {
    context.data_mut(|d| d.insert_temp(id(), held));
}

fn are_held(context: &Context) -> bool {
    context.data(|d| d.get_temp(id()).unwrap_or(false))
}

fn id() -> Id {
    Id::new("hints are held")
}
