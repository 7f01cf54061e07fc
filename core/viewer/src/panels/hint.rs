//! Hints under the mouse, which are away while a button is down: what is dragged is seen.

use egui::{Response, WidgetText};

pub trait Hint {
    /// Shows a text while the mouse rests on it.
    fn hint(self, text: impl Into<WidgetText>) -> Response;
}

impl Hint for Response {
    fn hint(self, text: impl Into<WidgetText>) -> Response {
        match self.ctx.input(|i| i.pointer.any_down()) {
            true => self,
            false => self.on_hover_text(text),
        }
    }
}
