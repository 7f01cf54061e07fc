//! Modifier keys and positions of mouse gestures.

use egui::{Event, Modifiers, Pos2, Response, Ui, Vec2};

/// Ctrl, Shift and Alt when a mouse button was released in this frame, else at the end of the frame. A key released right after the button, within
/// the same frame, still counts.
pub(super) fn modifiers(ui: &Ui) -> Modifiers {
    ui.input(|i| {
        let released = i.events.iter().rev().find_map(|event| match event {
            Event::PointerButton { pressed: false, modifiers, .. } => Some(*modifiers),
            _ => None,
        });
        released.unwrap_or(i.modifiers)
    })
}

/// Whether a click or a box adds to the selection: with Ctrl or Shift.
pub(super) fn adds_to_selection(ui: &Ui) -> bool {
    let modifiers = modifiers(ui);
    modifiers.command || modifiers.shift
}

/// Position of a point (`anchor`) during a drag: it moves as far as the pointer has since the press. A press without movement is a click and drags
/// nothing.
pub(super) fn dragged_position(ui: &Ui, response: &Response, anchor: Pos2) -> Option<Pos2> {
    let id = response.id.with("grabbed");
    if response.drag_started()
        && let Some(origin) = ui.input(|i| i.pointer.press_origin())
    {
        ui.data_mut(|d| d.insert_temp(id, origin - anchor));
    }
    let is_held = response.dragged() || response.drag_stopped();
    let moves = is_held && ui.input(|i| i.pointer.is_decidedly_dragging());
    let pointer = response.interact_pointer_pos().filter(|_| moves)?;
    let grab_offset: Vec2 = ui.data(|d| d.get_temp(id)).unwrap_or_default();
    Some(pointer - grab_offset)
}
