//! The modifier keys that a gesture of the mouse has.

use egui::{Event, Modifiers, Ui};

/// Ctrl, Shift and Alt as they were when a button of the mouse was released in this frame, else as they are held at its end. A key that is
/// let go right after the button, within the same frame, still counts for the gesture.
pub(super) fn modifiers(ui: &Ui) -> Modifiers {
    ui.input(|i| {
        let released = i.events.iter().rev().find_map(|event| match event {
            Event::PointerButton { pressed: false, modifiers, .. } => Some(*modifiers),
            _ => None,
        });
        released.unwrap_or(i.modifiers)
    })
}

/// Whether a click or a box adds to what is selected: Ctrl or Shift.
pub(super) fn adds(ui: &Ui) -> bool {
    let modifiers = modifiers(ui);
    modifiers.command || modifiers.shift
}
