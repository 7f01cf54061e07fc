//! Row headers of the sequencer: collapse, expand, mute, solo, lock. They change what this window shows, never the script.

use super::bar_menu::{self, Command};
use super::hint::Hint;
use super::icons;
use crate::app::Viewer;
use crate::editing::EditError;
pub(super) use crate::editing::locked_row_message;
use crate::state::selection::Selected;
use crate::state::timeline::Timeline;
use egui::{Align2, FontId, Rect, Response, Sense, Ui, pos2, vec2};

/// Width of a button, points.
const BUTTON_WIDTH: f32 = 16.0;
/// Width of the triangle that collapses, points.
const EXPANDER_WIDTH: f32 = 13.0;

/// A button in a row header that was pressed.
pub(super) enum Toggle {
    Collapse(String),
    /// Shows or hides a row for each keyed property.
    Expand((String, Option<usize>)),
    /// Mutes or unmutes a layer of an actor.
    Mute(String, usize),
    Solo(String),
    Lock(String),
}

/// Context menu of a row, or of an entry of the stage tree.
pub(super) fn show_menu(response: &Response, viewer: &Viewer, what: &Selected) -> Option<Command> {
    let mut command = None;
    response.context_menu(|ui| {
        command = bar_menu::show_entries(ui, viewer, |command| command.suits_row(viewer, what))
    });
    command
}

/// Refuses an edit of the selection if its row is locked. Returns whether it is.
pub(super) fn refuses_locked(viewer: &mut Viewer) -> bool {
    let why = viewer.locked_selection().map(locked_row_message);
    let is_refused = why.is_some();
    if let Some(why) = why {
        viewer.edit(|_| Err(EditError::refused(why)));
    }
    is_refused
}

fn has_layers(timeline: &Timeline, index: usize) -> bool {
    let row = &timeline.rows[index];
    let next_row = timeline.rows.get(index + 1);
    row.layer == Some(0) && next_row.is_some_and(|next| next.what == row.what && next.layer > Some(0))
}

/// Rectangle of the triangle that shows a row for each keyed property; next to that of the layers, if there is one.
fn expander_rect(timeline: &Timeline, index: usize, label: Rect) -> Rect {
    let is_indented = has_layers(timeline, index) || timeline.rows[index].layer > Some(0);
    let left = if is_indented { EXPANDER_WIDTH - 2.0 } else { 0.0 };
    Rect::from_min_size(label.min + vec2(left, 0.0), vec2(EXPANDER_WIDTH, label.height()))
}

/// Rectangle left for the name of the row.
pub(crate) fn name_rect(timeline: &Timeline, index: usize, label: Rect) -> Rect {
    let row = &timeline.rows[index];
    let left = match row.parts.is_empty() {
        false => expander_rect(timeline, index, label).right() - label.left() - 4.0,
        true if has_layers(timeline, index) || row.layer > Some(0) => EXPANDER_WIDTH - 4.0,
        true => 0.0,
    };
    let buttons = match (&row.what, row.layer) {
        (Some(Selected::Actor(_)), Some(1..)) => 1.0,
        (Some(Selected::Actor(_)), _) => 3.0,
        _ => 0.0,
    };
    Rect::from_min_max(label.min + vec2(left, 0.0), label.max - vec2(buttons * BUTTON_WIDTH, 0.0))
}

pub(super) fn show_buttons(ui: &Ui, viewer: &Viewer, index: usize, label: Rect) -> Option<Toggle> {
    let row = &viewer.timeline.rows[index];
    let mut toggled = None;
    if !row.parts.is_empty() {
        let place = expander_rect(&viewer.timeline, index, label);
        let open = viewer.is_expanded(row);
        let icon = if open { icons::CARET_DOWN } else { icons::CARET_RIGHT };
        let accessible_name = format!("keyed properties of {}", row.label);
        if show_toggle_button(
            ui,
            place,
            icon,
            open,
            &accessible_name,
            "show or hide a row for each keyed property",
        ) {
            toggled = Some(Toggle::Expand(row.key()));
        }
    }
    let Some(Selected::Actor(name)) = &row.what else { return toggled };
    let toggles = &viewer.toggles;
    if has_layers(&viewer.timeline, index) {
        let place = Rect::from_min_size(label.min, vec2(EXPANDER_WIDTH, label.height()));
        let closed = toggles.collapsed.contains(name);
        let icon = if closed { icons::CARET_RIGHT } else { icons::CARET_DOWN };
        let accessible_name = format!("layers of {name}");
        if show_toggle_button(ui, place, icon, !closed, &accessible_name, "show or hide the layers") {
            toggled = Some(Toggle::Collapse(name.clone()));
        }
    }
    let place = |number: f32| {
        let right = label.right() - 2.0 - number * BUTTON_WIDTH;
        Rect::from_min_max(pos2(right - BUTTON_WIDTH, label.top() + 3.0), pos2(right, label.bottom() - 3.0))
    };
    let layer = row.layer.unwrap_or(0);
    let is_base = layer == 0;
    if row.layer.is_some() {
        let muted = toggles.muted.contains(&(name.clone(), layer));
        let accessible_name = format!("mute {}", row.label);
        let number = if is_base { 2.0 } else { 0.0 };
        let icon = if muted { icons::SPEAKER_SLASH } else { icons::SPEAKER_HIGH };
        if show_toggle_button(
            ui,
            place(number),
            icon,
            muted,
            &accessible_name,
            "mute: its clips do not play in this window",
        ) {
            toggled = Some(Toggle::Mute(name.clone(), layer));
        }
    }
    if is_base {
        let accessible_name = format!("only {name} in rows");
        let solo = toggles.solo.contains(name);
        if show_toggle_button(
            ui,
            place(1.0),
            icons::STAR,
            solo,
            &accessible_name,
            "solo: only solo actors are shown here",
        ) {
            toggled = Some(Toggle::Solo(name.clone()));
        }
        let accessible_name = format!("lock the row of {name}");
        let hint = "lock: its bars, keys, curves and fields cannot be changed, its gizmo cannot be dragged";
        let locked = toggles.locked.contains(name);
        let icon = if locked { icons::LOCK_SIMPLE } else { icons::LOCK_SIMPLE_OPEN };
        if show_toggle_button(ui, place(0.0), icon, locked, &accessible_name, hint) {
            toggled = Some(Toggle::Lock(name.clone()));
        }
    }
    toggled
}

pub(crate) fn apply_toggle(viewer: &mut Viewer, toggle: Toggle) {
    let toggles = &mut viewer.toggles;
    let (set, name) = match toggle {
        Toggle::Mute(name, layer) => {
            if !toggles.muted.remove(&(name.clone(), layer)) {
                toggles.muted.insert((name, layer));
            }
            return;
        }
        Toggle::Expand(key) => {
            if !toggles.expanded.remove(&key) {
                toggles.expanded.insert(key);
            }
            return;
        }
        Toggle::Collapse(name) => (&mut toggles.collapsed, name),
        Toggle::Solo(name) => (&mut toggles.solo, name),
        Toggle::Lock(name) => (&mut toggles.locked, name),
    };
    if !set.remove(&name) {
        set.insert(name);
    }
}

fn show_toggle_button(ui: &Ui, place: Rect, icon: &str, on: bool, accessible_name: &str, hint: &str) -> bool {
    let response = ui.interact(place, ui.id().with(accessible_name), Sense::click());
    response
        .widget_info(|| egui::WidgetInfo::selected(egui::WidgetType::Checkbox, true, on, accessible_name));
    let visuals = ui.visuals();
    let is_expander = [icons::CARET_DOWN, icons::CARET_RIGHT].contains(&icon);
    let color = match on {
        true if !is_expander => visuals.selection.stroke.color,
        _ if response.hovered() => visuals.text_color(),
        _ => visuals.weak_text_color(),
    };
    if on && !is_expander {
        ui.painter().rect_filled(place.shrink(1.0), 2.0, visuals.selection.bg_fill);
    }
    let font = FontId::proportional(if is_expander { 10.0 } else { 12.0 });
    ui.painter().text(place.center(), Align2::CENTER_CENTER, icon, font, color);
    response.hint(hint).clicked()
}
