//! Text field that renames an actor, a camera, a light or a title, at its row.

use super::sequencer;
use crate::app::Viewer;
use crate::editing::EditError;
use crate::state::selection::Selected;
use egui::text::{CCursor, CCursorRange};
use egui::{Area, Frame, Key, Order, Pos2, TextEdit, Ui};

/// Object being renamed, and the text typed so far.
#[derive(Default)]
pub(super) struct NameField {
    what: Option<Selected>,
    text: String,
    position: Pos2,
    needs_focus: bool,
}

/// Opens the field for the selection.
pub(super) fn start_rename(viewer: &mut Viewer) {
    let what = viewer.selection.clone().filter(|what| viewer.name_of(what).is_some());
    match what {
        Some(what) => viewer.to_rename = Some(what),
        None => viewer.edit(|_| {
            let why = "select an actor, a camera, a light or a title: those have names of their own";
            Err(EditError::refused(why))
        }),
    }
}

pub(super) fn show(field: &mut NameField, ui: &Ui, viewer: &mut Viewer) {
    if let Some(what) = viewer.to_rename.take() {
        let row = sequencer::object_row_rect(ui, viewer, &what).map(|row| row.left_bottom());
        let pointer = || ui.input(|i| i.pointer.latest_pos());
        let at = row.or_else(pointer).unwrap_or_else(|| ui.ctx().content_rect().center());
        let text = viewer.name_of(&what).unwrap_or_default();
        *field = NameField { what: Some(what), text, position: at, needs_focus: true };
    }
    let Some(what) = field.what.clone() else { return };
    let area = Area::new(egui::Id::new("rename")).order(Order::Foreground).fixed_pos(field.position);
    let shown = area.constrain(true).show(ui.ctx(), |ui| {
        Frame::popup(ui.style())
            .show(ui, |ui| {
                ui.weak("Enter: rename it everywhere in the script");
                let mut output = TextEdit::singleline(&mut field.text).desired_width(220.0).show(ui);
                let response = output.response.response;
                response
                    .widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::TextEdit, true, "new name"));
                if std::mem::take(&mut field.needs_focus) {
                    response.request_focus();
                    let all = CCursorRange::two(CCursor::new(0), CCursor::new(field.text.chars().count()));
                    output.state.cursor.set_char_range(Some(all));
                    output.state.store(ui.ctx(), response.id);
                }
                response
            })
            .inner
    });
    if !shown.inner.lost_focus() {
        return;
    }
    let is_confirmed = ui.input(|i| i.key_pressed(Key::Enter));
    let NameField { text, .. } = std::mem::take(field);
    if is_confirmed {
        viewer.edit(|v| v.rename(&what, &text));
    }
}
