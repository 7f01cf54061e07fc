//! Commands for the selected bars: the menu of the right mouse button, and their keys.

use super::bars::Act;
use super::key_menu;
use crate::app::Viewer;
use crate::editing::EditError;
use crate::state::selection::Selected;
use crate::state::timeline::Bar;
use egui::{Button, Event, Response, Ui};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    Split,
    Duplicate,
    Copy,
    Cut,
    /// The row of the selection, at the playhead.
    Paste,
    Disable,
    Delete,
    GoToLine,
}

/// Commands, their names, and their keys: those of an action, or of the clipboard.
const COMMANDS: [(Command, &str, &str); 8] = [
    (Command::Split, "Split at the playhead", "split"),
    (Command::Duplicate, "Duplicate", "duplicate"),
    (Command::Copy, "Copy", "Ctrl C"),
    (Command::Cut, "Cut", "Ctrl X"),
    (Command::Paste, "Paste at the playhead", "Ctrl V"),
    (Command::Disable, "Disable, enable", "disable"),
    (Command::Delete, "Delete", "delete"),
    (Command::GoToLine, "Go to its line", ""),
];

/// The menu of a bar.
pub fn show(response: &Response, viewer: &Viewer, bar: &Bar) -> Option<Act> {
    let mut act = None;
    if response.secondary_clicked() && !viewer.is_selected(&bar.what) {
        act = Some(Act::Select(bar.what.clone(), false));
    }
    response.context_menu(|ui| {
        for (command, name, key) in COMMANDS {
            // Bars of cameras, effects and titles are no clips.
            let can = bar.strip.is_some()
                || matches!(command, Command::Paste | Command::Delete | Command::GoToLine);
            let button = Button::new(name).shortcut_text(super::shown_keys(viewer, key));
            if ui.add_enabled(can, button).clicked() {
                act = Some(Act::Run(command));
                ui.close();
            }
        }
    });
    act
}

/// Copies, cuts and pastes, as the clipboard is asked.
pub fn clipboard(ui: &Ui, viewer: &mut Viewer) {
    key_menu::clipboard(ui, viewer);
    for event in ui.input(|i| i.events.clone()) {
        match event {
            Event::Copy if !viewer.selected_bars().is_empty() => run(ui, viewer, Command::Copy),
            Event::Cut if !viewer.selected_bars().is_empty() => run(ui, viewer, Command::Cut),
            Event::Paste(text) => paste(viewer, &text),
            _ => {}
        }
    }
}

fn paste(viewer: &mut Viewer, text: &str) {
    if key_menu::are_keys(text) {
        return key_menu::paste(viewer, text);
    }
    let Some(name) = viewer.paste_target() else { return };
    let secs = viewer.playhead.time().as_secs();
    viewer.edit(|v| v.paste_cues(&name, text, secs));
}

/// Does a command to the selected bars.
pub fn run(ui: &Ui, viewer: &mut Viewer, command: Command) {
    let all = viewer.selected_bars();
    let at = viewer.playhead.time().as_secs();
    match command {
        Command::Split => viewer.edit(|v| v.split_cues(&all, at)),
        Command::Duplicate => viewer.edit(|v| match all.as_slice() {
            [one] => v.duplicate_cue(one),
            [] => Err(EditError::refused("select a clip or a key; Add puts another actor on stage")),
            _ => Err(EditError::refused("one clip is duplicated at a time; copy and paste several")),
        }),
        Command::Copy | Command::Cut => match viewer.copy_cues(&all) {
            Ok(text) => {
                viewer.copied.clone_from(&text);
                ui.ctx().copy_text(text);
                if command == Command::Cut {
                    viewer.edit(|v| v.delete_cues(&all));
                }
            }
            Err(error) => viewer.edit(|_| Err(error)),
        },
        Command::Paste => {
            let copied = viewer.copied.clone();
            paste(viewer, &copied);
        }
        Command::Disable => viewer.edit(|v| v.toggle_cues(&all)),
        Command::Delete => {
            let is_cue = |what: &Selected| matches!(what, Selected::Cue { .. });
            let one = all.first().or(viewer.selection.as_ref()).filter(|what| !is_cue(what)).cloned();
            viewer.edit(|v| match one {
                Some(what) => v.delete_object(&what),
                None => v.delete_cues(&all),
            });
        }
        Command::GoToLine => {
            let line = viewer.selection.as_ref().and_then(|what| super::script::line_of(viewer, what));
            viewer.go_to = line.or(viewer.go_to);
        }
    }
}
