//! Modal dialogs: questions over everything else that take all clicks until they are answered.

use egui::accesskit::Role;
use egui::{Align2, Id, Key, Modal, ModalResponse, Modifiers, RichText, TextStyle, Ui, Vec2, WidgetText};

/// Shows a dialog. Returns whether the user left it with Escape.
pub(super) fn show(ui: &Ui, title: &str, content: impl FnOnce(&mut Ui)) -> bool {
    let dialog = show_modal(ui, title, (Align2::CENTER_CENTER, Vec2::ZERO), |ui| {
        // The title is also the accessible name of the dialog.
        let words = WidgetText::from(RichText::new(title).strong());
        let words = words.into_galley(ui, None, f32::INFINITY, TextStyle::Heading);
        let place = ui.allocate_space(words.size()).1;
        ui.painter().galley(place.min, words, ui.visuals().strong_text_color());
        ui.add_space(6.0);
        content(ui);
    });
    let is_first = dialog.is_top_modal && !dialog.any_popup_open;
    is_first && ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Escape))
}

/// Shows content over everything else that takes all clicks. `anchor`: alignment in the window, and offset from there in points.
pub(super) fn show_modal<T>(
    ui: &Ui,
    name: &str,
    (anchor, offset): (Align2, Vec2),
    content: impl FnOnce(&mut Ui) -> T,
) -> ModalResponse<T> {
    let id = Id::new(("dialog", name));
    let area = Modal::default_area(id).anchor(anchor, offset);
    Modal::new(id).area(area).show(ui.ctx(), |ui| {
        ui.ctx().accesskit_node_builder(ui.unique_id(), |node| {
            node.set_role(Role::Dialog);
            node.set_label(name);
            node.set_modal();
        });
        content(ui)
    })
}
