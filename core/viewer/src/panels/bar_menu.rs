//! Commands for the selected bars: their context menu and keyboard shortcuts.

use super::bars::Act;
use super::headers;
use super::key_menu::{self, KeyAct, KeyCommand};
use super::rename;
use crate::app::Viewer;
use crate::editing::EditError;
use crate::state::selection::Selected;
use crate::state::timeline::{Bar, Row};
use choreo_session::edit::{RowSide, are_keys};
use egui::{Button, Event, Response, Ui};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Command {
    Split,
    Duplicate,
    Copy,
    Cut,
    /// Pastes at the playhead onto the row of the selection.
    Paste,
    Disable,
    Rename,
    /// Moves the row above the previous one of its group.
    RowUp,
    RowDown,
    Delete,
    GoToLine,
}

impl Command {
    /// Whether the command applies to a bar; bars of cameras, effects and titles are not clips.
    fn suits_bar(self, bar: &Bar) -> bool {
        match self {
            Command::Paste | Command::Delete | Command::GoToLine => true,
            Command::Rename => matches!(bar.what, Selected::Camera(_) | Selected::Title(_)),
            Command::Duplicate => true,
            Command::RowUp | Command::RowDown => false,
            _ => bar.strip.is_some(),
        }
    }

    /// Side that a row is moved to by this command.
    pub(super) fn row_side(self) -> Option<RowSide> {
        match self {
            Command::RowUp => Some(RowSide::Above),
            Command::RowDown => Some(RowSide::Below),
            _ => None,
        }
    }

    /// Whether the command applies to the object of a row.
    pub(super) fn suits_row(self, viewer: &Viewer, what: &Selected) -> bool {
        match self {
            Command::Paste => matches!(what, Selected::Actor(_)),
            Command::Rename => viewer.name_of(what).is_some(),
            Command::Duplicate => *what != Selected::Sky,
            Command::RowUp | Command::RowDown => matches!(what, Selected::Actor(_) | Selected::Light(_)),
            command => matches!(command, Command::Delete | Command::GoToLine),
        }
    }
}

/// Commands, their labels, and the actions that define their shortcuts.
const COMMANDS: [(Command, &str, &str); 11] = [
    (Command::Split, "Split at the playhead", "split"),
    (Command::Duplicate, "Duplicate", "duplicate"),
    (Command::Copy, "Copy", "copy"),
    (Command::Cut, "Cut", "cut"),
    (Command::Paste, "Paste at the playhead", "paste"),
    (Command::Disable, "Disable, enable", "disable"),
    (Command::Rename, "Rename", "rename"),
    (Command::RowUp, "Move row up", "row_up"),
    (Command::RowDown, "Move row down", "row_down"),
    (Command::Delete, "Delete", "delete"),
    (Command::GoToLine, "Go to its line", ""),
];

/// Context menu of a bar.
pub(super) fn show(response: &Response, viewer: &Viewer, bar: &Bar) -> Option<Act> {
    let mut act = None;
    if response.secondary_clicked() && !viewer.is_bar_selected(bar) {
        act = Some(Act::Select(bar.clone(), false));
    }
    response.context_menu(|ui| {
        let chosen = show_entries(ui, viewer, |command| command.suits_bar(bar));
        act = chosen.map(Act::RunCommand).or(act.take());
    });
    act
}

/// Menu entries of the commands that `suits` accepts.
pub(super) fn show_entries(ui: &mut Ui, viewer: &Viewer, suits: impl Fn(Command) -> bool) -> Option<Command> {
    let mut chosen = None;
    for (command, name, key) in COMMANDS.into_iter().filter(|(command, ..)| suits(*command)) {
        if ui.add(Button::new(name).shortcut_text(super::actions::shortcut_text(viewer, key))).clicked() {
            chosen = Some(command);
            ui.close();
        }
    }
    chosen
}

/// Copies, cuts or pastes the selected clips or keys.
pub(super) fn run_clipboard(ui: &Ui, viewer: &mut Viewer, command: Command) {
    let are_keys = viewer.has_only_keys_selected();
    match command {
        Command::Copy if are_keys => key_menu::run(ui, viewer, KeyAct::RunCommand(KeyCommand::Copy)),
        Command::Cut if are_keys => key_menu::run(ui, viewer, KeyAct::RunCommand(KeyCommand::Cut)),
        _ => run(ui, viewer, command),
    }
}

/// Handles the system's copy, cut and paste events.
pub(super) fn handle_clipboard_events(ui: &Ui, viewer: &mut Viewer) {
    key_menu::handle_clipboard_events(ui, viewer);
    for event in ui.input(|i| i.events.clone()) {
        match event {
            Event::Copy if !viewer.selected_bars().is_empty() => run(ui, viewer, Command::Copy),
            Event::Cut if !viewer.selected_bars().is_empty() => run(ui, viewer, Command::Cut),
            Event::Paste(text) => paste_text(viewer, &text),
            _ => {}
        }
    }
}

fn paste_text(viewer: &mut Viewer, text: &str) {
    if are_keys(text) {
        return key_menu::paste_keys(viewer, text);
    }
    let Some(name) = viewer.paste_target() else { return };
    let secs = viewer.playhead.time().as_secs();
    viewer.edit(|v| v.paste_cues(&name, text, secs));
}

/// Performs a command on the selected bars.
pub(super) fn run(ui: &Ui, viewer: &mut Viewer, command: Command) {
    let changes = !matches!(command, Command::Copy | Command::Paste | Command::Rename | Command::GoToLine);
    if changes && headers::refuses_locked(viewer) {
        return;
    }
    let all = viewer.selected_bars();
    let at = viewer.playhead.time().as_secs();
    match command {
        Command::Split => viewer.edit(|v| v.split_cues(&all, at)),
        Command::Duplicate => {
            let chosen = viewer.selection.clone();
            viewer.edit(|v| match (all.as_slice(), chosen) {
                ([one @ Selected::Cue { .. }], _) => v.duplicate_cue(one),
                ([one], _) => v.duplicate_object(one),
                ([], Some(what)) => v.duplicate_object(&what),
                ([], None) => Err(EditError::refused("first select what to duplicate")),
                _ => Err(EditError::refused(
                    "only one clip can be duplicated at a time; copy and paste several",
                )),
            });
        }
        Command::Copy | Command::Cut if all.is_empty() => {
            viewer.edit(|_| Err(EditError::refused("select a clip or a key")));
        }
        Command::Copy | Command::Cut => match viewer.copy_cues(&all) {
            Ok(text) => {
                viewer.copied_clips.clone_from(&text);
                ui.ctx().copy_text(text);
                if command == Command::Cut {
                    viewer.edit(|v| v.delete_cues(&all));
                }
            }
            Err(error) => viewer.edit(|_| Err(error)),
        },
        Command::Paste => {
            let copied = viewer.copied_clips.clone();
            paste_text(viewer, &copied);
        }
        Command::Rename => rename::start_rename(viewer),
        Command::RowUp | Command::RowDown => {
            let is_selected = |row: &Row| row.what.is_some() && row.what == viewer.selection;
            let row = viewer.timeline.rows.iter().position(is_selected);
            let Some(side) = command.row_side() else { return };
            viewer.edit(|v| match row {
                Some(row) => v.shift_row(row, side),
                None => Err(EditError::refused("select the actor or the light whose row is to be moved")),
            });
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
            viewer.script_scroll_line = line.or(viewer.script_scroll_line);
        }
    }
}
