//! List of keyboard shortcuts, in which the keys of each action can be changed.

use super::actions::{self, ActionWithShortcuts};
use super::hint::Hint;
use super::{icons, values};
use crate::app::Viewer;
use crate::state::shortcuts::{Chord, PRESETS};
use egui::{Event, Grid, Key, Label, Modifiers, RichText, ScrollArea, Ui, WidgetType};

/// Width at which a line wraps, points.
const TEXT_WIDTH: f32 = 600.0;

/// State of the list.
#[derive(Default)]
pub(super) struct ShortcutList {
    pub open: bool,
    /// Id of the action whose new keys are being pressed.
    action_to_assign: Option<String>,
}

/// Rows that are not actions: keys of the toolkit, and the mouse.
const FIXED_INPUTS: [(&str, &str); 22] = [
    (
        "Ctrl click",
        "adds a clip or key to the selection, as Shift click; a drag over empty rows selects a box",
    ),
    ("Esc", "clear the selection; close a dialog"),
    ("Tab Enter", "move through buttons and bars; press the focused one"),
    ("", ""),
    ("click", "viewport: select; script, messages: go to the line"),
    ("drag", "viewport: turn around; with Shift or the middle button: pan"),
    ("drag right", "viewport: look around"),
    ("W A S D Q E", "viewport, mouse over it: walk; with Shift: run"),
    ("drag", "an arrow, ring or box of the gizmo: changes the script; with Ctrl: in steps"),
    ("drag", "a clip's bar: moves it, also onto another actor's row; with Shift: all later ones, too"),
    ("Ctrl drag", "a clip's bar over the one before it: they crossfade"),
    ("Alt drag", "a clip's bar: slips its content; its ends: trim it, or roll it where two meet"),
    ("drag", "the corner or the line of the selected clip: speed, weight"),
    ("drag", "a bar's end or fade, a key, a cut, a marker: changes the script"),
    (
        "drag",
        "curves: a key in time and value, with Shift along one of them; a handle of its tangent (Alt: one side, Ctrl: its length) or easing",
    ),
    ("double click", "curves: sets a key on a curve"),
    ("right click", "a bar, a key: all commands; of a key its time, value and easing"),
    ("drag", "a clip from the inspector onto a row: plays it there (adds a line to the script)"),
    ("click", "an event or a foot's strip: the playhead goes there"),
    ("Shift drag", "ruler: sets the range that is played"),
    (
        "wheel",
        "viewport: closer or farther; sequencer, curves: zoom in time, with Shift: pan; over names: scroll; curves with Ctrl: zoom in values",
    ),
    ("drop", "a model or clip from a file manager: shows it"),
];

/// Takes a pressed key as the shortcut of the chosen action. Returns whether the list waits for a key.
pub(super) fn record_shortcut(list: &mut ShortcutList, ui: &Ui, viewer: &mut Viewer) -> bool {
    let Some(action) = list.action_to_assign.take().filter(|_| list.open) else { return false };
    let mut pressed = None;
    ui.input_mut(|i| {
        i.events.retain(|event| match event {
            Event::Key { key, pressed: true, repeat: false, modifiers, .. } => {
                pressed = pressed.or(Some((*key, *modifiers)).filter(|(key, _)| !is_modifier(*key)));
                false
            }
            Event::Key { pressed, .. } => !pressed,
            Event::Text(_) | Event::Copy | Event::Cut | Event::Paste(_) => false,
            _ => true,
        });
    });
    match pressed {
        None => list.action_to_assign = Some(action),
        Some((Key::Escape, Modifiers::NONE)) => {}
        Some((Key::Delete | Key::Backspace, Modifiers::NONE)) => {
            viewer.shortcuts.set(&action, Some(String::new()));
        }
        Some((key, modifiers)) => {
            let (ctrl, shift, alt) = (modifiers.command, modifiers.shift, modifiers.alt);
            let chord = Chord { ctrl, shift, alt, key: key.name().to_string() };
            viewer.shortcuts.set(&action, Some(chord.to_text()));
        }
    }
    true
}

/// Whether a key is a modifier.
fn is_modifier(key: Key) -> bool {
    use Key::{AltLeft, AltRight, ControlLeft, ControlRight, ShiftLeft, ShiftRight, SuperLeft, SuperRight};
    let modifiers =
        [AltLeft, AltRight, ControlLeft, ControlRight, ShiftLeft, ShiftRight, SuperLeft, SuperRight];
    modifiers.contains(&key)
}

pub(super) fn show(ui: &Ui, list: &mut ShortcutList, viewer: &mut Viewer) {
    // The list uses all available height; egui would limit a window to 400 points.
    let room = ui.ctx().content_rect().height() - 80.0;
    let ShortcutList { open, action_to_assign } = list;
    let window = egui::Window::new("Shortcuts").open(open).resizable(false).collapsible(false);
    let window = window.default_height(room).anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]);
    window.show(ui.ctx(), |ui| {
        ui.horizontal(|ui| {
            ui.label("Shortcuts like those of");
            for (name, title, _) in PRESETS {
                let is_on = viewer.shortcuts.preset == name;
                if ui.radio(is_on, title).clicked() {
                    viewer.shortcuts.preset = name.to_string();
                }
            }
        });
        ui.weak("Click a shortcut, then press the new key. Escape keeps the old one, Delete removes it.");
        ui.separator();
        let all = actions::actions_with_shortcuts(viewer);
        ScrollArea::vertical().max_height(room - 60.0).show(ui, |ui| {
            Grid::new("keys").num_columns(2).spacing([16.0, 4.0]).show(ui, |ui| {
                for action in &all {
                    ui.horizontal(|ui| shortcut_row(ui, action_to_assign, action, viewer));
                    ui.vertical(|ui| {
                        ui.set_max_width(TEXT_WIDTH);
                        ui.add(Label::new(&action.title).wrap())
                            .hint(format!("in shortcuts.json: \"{}\"", action.id));
                        if let Some(others) = conflicting_titles(action, &all) {
                            ui.label(RichText::new(others).small().color(ui.visuals().warn_fg_color));
                        }
                    });
                    ui.end_row();
                }
                for (keys, what) in FIXED_INPUTS {
                    ui.monospace(keys);
                    ui.vertical(|ui| {
                        ui.set_max_width(TEXT_WIDTH);
                        ui.add(Label::new(what).wrap());
                    });
                    ui.end_row();
                }
            });
        });
    });
    if !*open {
        *action_to_assign = None;
    }
}

/// Row of the keyboard shortcuts of an action; a click assigns a new one, a button restores the default.
fn shortcut_row(
    ui: &mut Ui,
    action_to_assign: &mut Option<String>,
    action: &ActionWithShortcuts,
    viewer: &mut Viewer,
) {
    let ActionWithShortcuts { id, title, chords } = action;
    let is_chosen = action_to_assign.as_ref() == Some(id);
    let keys = actions::system_shortcut(id).map(str::to_string).into_iter();
    let keys = keys.chain(chords.iter().map(ToString::to_string)).collect::<Vec<_>>().join(", ");
    let name = if is_chosen { format!("press a key for {title}") } else { format!("key of {title}") };
    let button_text = match (is_chosen, keys.is_empty()) {
        (true, _) => "press a key…",
        (false, true) => "none",
        (false, false) => keys.as_str(),
    };
    let button = ui.add(egui::Button::selectable(is_chosen, RichText::new(button_text).monospace()));
    if values::set_widget_name(button, WidgetType::Button, &name).clicked() {
        *action_to_assign = Some(id.clone()).filter(|_| !is_chosen);
    }
    let name = format!("usual key of {title}");
    let is_own = viewer.shortcuts.user_keys.contains_key(id);
    if is_own && icons::small_button(ui, icons::ARROWS_CLOCKWISE, &name, "").clicked() {
        viewer.shortcuts.set(id, None);
    }
}

/// Names of other actions with one of these keys.
fn conflicting_titles(action: &ActionWithShortcuts, all: &[ActionWithShortcuts]) -> Option<String> {
    let own: Vec<_> = action.chords.iter().filter_map(actions::egui_shortcut).collect();
    let has_one = |other: &&ActionWithShortcuts| {
        let mut keys = other.chords.iter().filter_map(actions::egui_shortcut);
        other.id != action.id && keys.any(|key| own.contains(&key))
    };
    let titles: Vec<&str> = all.iter().filter(has_one).map(|other| other.title.as_str()).collect();
    (!titles.is_empty()).then(|| format!("also: {}", titles.join("; ")))
}
