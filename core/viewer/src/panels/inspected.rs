//! Decides what the inspector shows: the selection, else the stage. While one of its fields is being edited, it keeps the object of that field
//! until the field has taken its text.

use super::{inspector, stage_fields, values};
use crate::app::Viewer;
use crate::state::selection::Selected;
use egui::{Response, Ui};

/// Number of frames for which a field counts as edited after it had the keyboard focus: a field takes its text in the frame after it has lost the
/// focus.
const FOCUS_FRAMES: u64 = 2;

fn focus_frame_id() -> egui::Id {
    egui::Id::new("a field of the inspector is edited")
}

/// Records that a field has the keyboard focus; must be called for each field.
pub(super) fn record_focus(ui: &Ui, field: &Response) {
    if field.has_focus() {
        let now = ui.ctx().cumulative_pass_nr();
        ui.data_mut(|d| d.insert_temp(focus_frame_id(), now));
    }
}

pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer) {
    let id = ui.id().with("inspected");
    let held: Option<u64> = ui.data(|d| d.get_temp(focus_frame_id()));
    let before: Option<Option<Selected>> = ui.data(|d| d.get_temp(id));
    let is_held = held.is_some_and(|frame| ui.ctx().cumulative_pass_nr() <= frame + FOCUS_FRAMES);
    let inspected = before.filter(|_| is_held).unwrap_or_else(|| viewer.selection.clone());
    ui.data_mut(|d| d.insert_temp(id, inspected.clone()));
    let selection = std::mem::replace(&mut viewer.selection, inspected.clone());
    // Fields of different objects have different identities.
    ui.push_id(&inspected, |ui| match (&inspected, &viewer.scene) {
        (None, Some(_)) => stage_fields::show(ui, viewer),
        _ => inspector::show(ui, viewer),
    });
    values::forget_name(ui);
    // A selection made meanwhile takes precedence.
    if viewer.selection == inspected || selection != inspected {
        viewer.selection = selection;
    }
    if viewer.selection != inspected {
        ui.ctx().request_repaint();
    }
}
