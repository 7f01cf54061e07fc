//! Dialogs: questions over everything else, which take all clicks until they are answered.

use egui::accesskit::Role;
use egui::{Id, Key, Modal, Modifiers, RichText, TextStyle, Ui, WidgetText};

/// Shows a dialog; gives whether it is left by Escape.
pub fn show(ui: &Ui, title: &str, content: impl FnOnce(&mut Ui)) -> bool {
    let dialog = Modal::new(Id::new(("dialog", title))).show(ui.ctx(), |ui| {
        ui.ctx().accesskit_node_builder(ui.unique_id(), |node| {
            node.set_role(Role::Dialog);
            node.set_label(title);
            node.set_modal();
        });
        // The dialog itself has the title as its name.
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
