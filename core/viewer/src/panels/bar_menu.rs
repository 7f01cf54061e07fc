//! Commands for the selected bars: the menu of the right mouse button, and their keys.

use super::bars::Act;
use super::key_menu;
use crate::app::Viewer;
use crate::editing::EditError;
use crate::state::selection::Selected;
use crate::state::timeline::Bar;
use egui::{Button, Event, Key, Modifiers, Response, Ui};

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

/// Commands, their names and keys.
const COMMANDS: [(Command, &str, &str); 8] = [
    (Command::Split, "Split at the playhead", "Y"),
    (Command::Duplicate, "Duplicate", "Ctrl D"),
    (Command::Copy, "Copy", "Ctrl C"),
    (Command::Cut, "Cut", "Ctrl X"),
    (Command::Paste, "Paste at the playhead", "Ctrl V"),
    (Command::Disable, "Disable, enable", "M"),
    (Command::Delete, "Delete", "Delete"),
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
            if ui.add(Button::new(name).shortcut_text(key)).clicked() {
                act = Some(Act::Run(command));
                ui.close();
            }
        }
    });
    act
}

/// The commands whose keys were pressed.
pub fn keys(ui: &Ui, viewer: &mut Viewer) {
    key_menu::keyboard(ui, viewer);
    let with = |modifiers, key| ui.input_mut(|i| i.consume_key(modifiers, key));
    let all = [
        (Modifiers::NONE, Key::Y, Command::Split),
        (Modifiers::COMMAND, Key::D, Command::Duplicate),
        (Modifiers::NONE, Key::M, Command::Disable),
        (Modifiers::NONE, Key::Delete, Command::Delete),
    ];
    for (modifiers, key, command) in all {
        if with(modifiers, key) && viewer.selection.is_some() {
            run(ui, viewer, command);
        }
    }
    for event in ui.input(|i| i.events.clone()) {
        match event {
            Event::Copy if !viewer.selected_bars().is_empty() => run(ui, viewer, Command::Copy),
            Event::Cut if !viewer.selected_bars().is_empty() => run(ui, viewer, Command::Cut),
            Event::Paste(text) => paste(viewer, &text),
            _ => {}
        }
    }
    if with(Modifiers::COMMAND, Key::A) {
        let all: Vec<Selected> =
            viewer.bars().filter(|b| b.strip.is_some()).map(|b| b.what.clone()).collect();
        viewer.select_all(all);
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
        Command::Delete => viewer.edit(|v| v.delete_cues(&all)),
        Command::GoToLine => {
            let line = viewer.selection.as_ref().and_then(|what| super::script::line_of(viewer, what));
            viewer.go_to = line.or(viewer.go_to);
        }
    }
}
