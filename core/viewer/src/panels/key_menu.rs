//! Commands for the selected keys: their context menu and keyboard shortcuts.

use super::{headers, tangents, values};
use crate::app::Viewer;
use crate::editing::EditError;
use crate::state::keyed::{KeyRef, KeyedProperty};
use crate::state::selection::Selected;
use crate::state::tangents::TangentChoice;
use choreo_motion::Time;
use choreo_script::{KEY_INTERPOLATIONS, easing_names};
use choreo_session::edit::{KeyShape, TypedNumber, are_keys_of_cue};
use egui::containers::menu::menu_style;
use egui::{
    Align, Button, Event, Id, Layout, Popup, PopupAnchor, PopupCloseBehavior, PopupKind, Pos2, Response, Ui,
};

/// An action of the user on keys.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum KeyAct {
    Select(Vec<KeyRef>),
    RunCommand(KeyCommand),
    /// Sets the easing of the spans before the selected keys, as source text.
    SetEase(Option<String>),
    /// Sets the interpolation of all keys of their properties, as source text.
    SetInterpolation(Option<String>),
    /// Moves a key to a time in seconds.
    SetTime(KeyRef, TypedNumber),
    /// Sets all components of a key's value; the last field is the one that was typed.
    SetValue(KeyRef, Vec<f64>, TypedNumber),
    /// Sets the tangents of the selected keys.
    SetTangents(TangentChoice),
    /// Sets easing and tangents of a key; the last field is the number that was typed.
    SetShape(KeyRef, KeyShape, Option<TypedNumber>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum KeyCommand {
    /// Copies the keys to the playhead.
    Duplicate,
    Copy,
    Cut,
    /// Adds copied keys to the selection at the playhead.
    Paste,
    Delete,
    GoToLine,
}

const COMMANDS: [(KeyCommand, &str, &str); 6] = [
    (KeyCommand::Duplicate, "Duplicate to the playhead", "duplicate"),
    (KeyCommand::Copy, "Copy", "copy"),
    (KeyCommand::Cut, "Cut", "cut"),
    (KeyCommand::Paste, "Paste at the playhead", "paste"),
    (KeyCommand::Delete, "Delete", "delete"),
    (KeyCommand::GoToLine, "Go to its line", ""),
];

/// Initial curve when a Bézier easing is chosen.
const DEFAULT_BEZIER: &str = "[0.42, 0.0, 0.58, 1.0]";

/// Opens the menu of a mark that holds keys.
pub(super) fn open_on_right_click(response: &Response, viewer: &Viewer, keys: &[KeyRef]) -> Option<KeyAct> {
    if !response.secondary_clicked() {
        return None;
    }
    let at = response.interact_pointer_pos().unwrap_or(response.rect.center());
    response.ctx.data_mut(|d| d.insert_temp(menu_id(), OpenMenu { keys: keys.to_vec(), position: at }));
    Popup::open_id(&response.ctx, menu_id());
    let is_selected = keys.iter().any(|key| viewer.is_key_selected(key));
    (!is_selected).then(|| KeyAct::Select(keys.to_vec()))
}

/// Keys whose menu is open, and its position. The menu does not belong to a mark, since the marks change when a time is typed.
#[derive(Clone)]
struct OpenMenu {
    keys: Vec<KeyRef>,
    position: Pos2,
}

fn menu_id() -> Id {
    Id::new("menu of keys")
}

/// Shows the open menu, which stays until something else is clicked, a command is chosen or Escape is pressed.
pub(super) fn show_open_menu(ui: &Ui, viewer: &mut Viewer) {
    let Some(mut menu) = ui.data(|d| d.get_temp::<OpenMenu>(menu_id())) else { return };
    menu.keys.iter_mut().for_each(|key| update_key_time(viewer, key));
    let popup = Popup::new(menu_id(), ui.ctx().clone(), PopupAnchor::Position(menu.position), ui.layer_id())
        .kind(PopupKind::Menu)
        .layout(Layout::top_down_justified(Align::Min))
        .style(menu_style)
        .open_memory(None)
        .close_behavior(PopupCloseBehavior::CloseOnClickOutside);
    let Some(shown) = popup.show(|ui| show_entries(ui, viewer, &menu.keys)) else {
        return ui.data_mut(|d| d.remove::<OpenMenu>(menu_id()));
    };
    let act = shown.inner;
    if let Some(KeyAct::SetTime(moved, time)) = &act {
        for key in menu.keys.iter_mut().filter(|key| *key == moved) {
            key.at = Time::from_secs(time.value);
        }
    }
    ui.data_mut(|d| d.insert_temp(menu_id(), menu));
    if let Some(act) = act {
        run(ui, viewer, act);
    }
}

/// Finds a key again after it was moved: the script has fewer digits, so its time on stage may differ slightly.
fn update_key_time(viewer: &Viewer, key: &mut KeyRef) {
    let max_difference = viewer.playhead.fps().time_of(1).0 / 4;
    let property = viewer.keyed_properties(&key.what).into_iter().find(|p| p.name == key.property);
    let at = property.and_then(|p| p.keys.into_iter().find(|at| (*at - key.at).0.abs() <= max_difference));
    key.at = at.unwrap_or(key.at);
}

fn show_entries(ui: &mut Ui, viewer: &Viewer, keys: &[KeyRef]) -> Option<KeyAct> {
    let (mut act, mut typed) = (None, None);
    for key in keys.iter().take(4) {
        let found = viewer.keyed_properties(&key.what).into_iter().find(|p| p.name == key.property);
        if let Some(property) = found {
            typed = show_number_fields(ui, &property, key).or(typed);
        }
    }
    ui.separator();
    act = tangents::show_menu(ui).or(act);
    ui.menu_button("Easing into the key", |ui| {
        act = show_choices(ui, "default: like all keys", &easing_names()).map(KeyAct::SetEase).or(act.take());
    });
    ui.menu_button("Between all keys", |ui| {
        let mut all: Vec<String> = KEY_INTERPOLATIONS.iter().map(ToString::to_string).collect();
        all.extend(easing_names().into_iter().filter(|name| name.contains('_')));
        act = show_choices(ui, "default: linear", &all).map(KeyAct::SetInterpolation).or(act.take());
    });
    ui.separator();
    for (command, name, key) in COMMANDS {
        if ui.add(Button::new(name).shortcut_text(super::actions::shortcut_text(viewer, key))).clicked() {
            act = Some(KeyAct::RunCommand(command));
        }
    }
    if act.is_some() {
        ui.close();
    }
    act.or(typed)
}

/// Number fields for the time and value of a key.
fn show_number_fields(ui: &mut Ui, property: &KeyedProperty, key: &KeyRef) -> Option<KeyAct> {
    let mut act = None;
    ui.horizontal(|ui| {
        ui.label(property.title());
        let secs = key.at.as_secs();
        let time = values::time_field(ui, &format!("time of {}", property.name), secs, 0.01, 0.0..=1e6);
        act = time.map(|secs| KeyAct::SetTime(key.clone(), values::typed_number(ui, secs)));
        ui.weak("s");
        let now = property.at(key.at);
        for (part, number) in now.iter().enumerate().filter(|_| property.has_editable_components()) {
            let part_name = property.part(part);
            let name = format!("{} {part_name} of the key", property.name);
            let [low, high] = property.range;
            ui.weak(part_name);
            if let Some(to) = values::number_field(ui, &name, *number, 0.01, low..=high) {
                let mut all = now.clone();
                all[part] = to;
                act = Some(KeyAct::SetValue(key.clone(), all, values::typed_number(ui, to)));
            }
        }
        ui.weak(property.unit);
    });
    let index = property.keys.iter().position(|at| *at == key.at);
    index.and_then(|index| tangents::show_number_fields(ui, property, index)).or(act)
}

/// List of names with an entry for none. Easings are in one column for each direction, so that all are visible at once.
fn show_choices(ui: &mut Ui, default_label: &str, names: &[String]) -> Option<Option<String>> {
    const EASING_PREFIXES: [&str; 3] = ["in_out_", "in_", "out_"];
    let prefix_index = |name: &str| EASING_PREFIXES.iter().position(|prefix| name.starts_with(prefix));
    let mut chosen = ui.button(default_label).clicked().then_some(None);
    let mut column = |ui: &mut Ui, prefix: Option<usize>| {
        for name in names.iter().filter(|name| prefix_index(name) == prefix) {
            if ui.button(name).clicked() {
                chosen = Some(Some(format!("\"{name}\"")));
            }
        }
    };
    column(ui, None);
    ui.horizontal_top(|ui| {
        (0..EASING_PREFIXES.len()).for_each(|prefix| drop(ui.vertical(|ui| column(ui, Some(prefix)))));
    });
    if ui.button("Bézier curve, with handles").clicked() {
        chosen = Some(Some(DEFAULT_BEZIER.to_string()));
    }
    chosen
}

/// Handles copy and cut events if only keys are selected.
pub(super) fn handle_clipboard_events(ui: &Ui, viewer: &mut Viewer) {
    if !viewer.has_only_keys_selected() {
        return;
    }
    let mut commands = Vec::new();
    ui.input_mut(|i| {
        i.events.retain(|event| {
            let command = match event {
                Event::Copy => KeyCommand::Copy,
                Event::Cut => KeyCommand::Cut,
                _ => return true,
            };
            commands.push(command);
            false
        });
    });
    commands.into_iter().for_each(|command| run(ui, viewer, KeyAct::RunCommand(command)));
}

/// Performs an action.
pub(super) fn run(ui: &Ui, viewer: &mut Viewer, act: KeyAct) {
    let is_read_only =
        matches!(act, KeyAct::Select(_) | KeyAct::RunCommand(KeyCommand::Copy | KeyCommand::GoToLine));
    if !is_read_only && headers::refuses_locked(viewer) {
        return;
    }
    let keys = viewer.selected_keys().to_vec();
    match act {
        KeyAct::Select(keys) => viewer.select_keys(keys),
        KeyAct::SetEase(ease) => viewer.edit(|v| v.set_key_ease(&keys, ease.as_deref())),
        KeyAct::SetInterpolation(how) => viewer.edit(|v| v.set_key_interpolation(&keys, how.as_deref())),
        KeyAct::SetTime(key, time) => viewer.edit(|v| v.set_key_time(&key, &time)),
        KeyAct::SetValue(key, numbers, typed) => viewer.edit(|v| v.set_key_value(&key, &numbers, &typed)),
        KeyAct::SetTangents(choice) => viewer.edit(|v| v.set_key_tangents(&keys, choice)),
        KeyAct::SetShape(key, shape, typed) => viewer.edit(|v| v.set_key_shape(key, shape, typed.as_ref())),
        KeyAct::RunCommand(command) => run_command(ui, viewer, command, &keys),
    }
}

fn run_command(ui: &Ui, viewer: &mut Viewer, command: KeyCommand, keys: &[KeyRef]) {
    let at = viewer.playhead.time().as_secs();
    match command {
        KeyCommand::Duplicate => viewer.edit(|v| v.duplicate_keys(keys, at)),
        KeyCommand::Copy | KeyCommand::Cut => match viewer.copy_keys(keys) {
            Ok(text) => {
                viewer.copied_clips.clone_from(&text);
                ui.ctx().copy_text(text);
                if command == KeyCommand::Cut {
                    viewer.edit(|v| v.delete_keys(keys));
                }
            }
            Err(error) => viewer.edit(|_| Err(error)),
        },
        KeyCommand::Paste => {
            let copied = viewer.copied_clips.clone();
            paste_keys(viewer, &copied);
        }
        KeyCommand::Delete => viewer.edit(|v| v.delete_keys(keys)),
        KeyCommand::GoToLine => {
            let line = keys.first().and_then(|key| {
                let found = viewer.keyed_properties(&key.what).into_iter().find(|p| p.name == key.property);
                let written = found.and_then(|property| Some(property.written?.line));
                written.or_else(|| Some(viewer.place_of(&key.what)?.0.line))
            });
            viewer.script_scroll_line = line.or(viewer.script_scroll_line);
        }
    }
}

/// Sets keys of the selection at the playhead.
pub(super) fn set_keys(viewer: &mut Viewer) {
    if !headers::refuses_locked(viewer) {
        viewer.edit(Viewer::set_keys_of_selection);
    }
}

/// Adds copied keys to the selection, at the playhead.
pub(crate) fn paste_keys(viewer: &mut Viewer, text: &str) {
    if headers::refuses_locked(viewer) {
        return;
    }
    let at = viewer.playhead.time().as_secs();
    let of_cue = are_keys_of_cue(text);
    let what = match viewer.selection.clone() {
        Some(Selected::Cue { actor, .. }) if !of_cue => Some(Selected::Actor(actor)),
        other => other,
    };
    viewer.edit(|v| match what {
        Some(what) => v.paste_keys(&what, text, at),
        None => Err(EditError::refused("first select what gets the keys")),
    });
}
