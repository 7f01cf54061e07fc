//! Keyboard handling of the window.

use super::Panels;
use super::actions::{self, Context};
use super::bars::MoveKind;
use super::shortcut_list;
use crate::app::Viewer;
use crate::state::selection::Selected;
use choreo_session::edit::CueTime;
use egui::{Key, Modifiers, Ui};

/// Handles pressed keys: some always, others unless a text field or a widget uses them.
pub(super) fn handle_keyboard(panels: &mut Panels, ui: &Ui, viewer: &mut Viewer, now: f64) {
    if panels.has_open_dialog(viewer) || shortcut_list::record_shortcut(&mut panels.shortcut_list, ui, viewer)
    {
        return;
    }
    actions::run_pressed_shortcuts(&mut Context { panels, ui, viewer, now });
    if ui.ctx().text_edit_focused() {
        return;
    }
    let pastes = |event: &egui::Event| matches!(event, egui::Event::Cut | egui::Event::Paste(_));
    if !(ui.input(|i| i.events.iter().any(pastes)) && super::script::refuses_keys(viewer)) {
        super::bar_menu::handle_clipboard_events(ui, viewer);
    }
    // Escape first closes an open menu or the question about a missing file.
    let is_covered = egui::Popup::is_any_open(ui.ctx()) || viewer.documents.missing_script.is_some();
    let is_free = !ui.ctx().egui_wants_keyboard_input() && !is_covered;
    if is_free && ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Escape)) {
        if !std::mem::take(&mut panels.shortcut_list.open) {
            viewer.selection = None;
        }
        viewer.message = None;
        viewer.note = None;
    }
}

/// Moves the selected bars, or the end of the selected bar, by a number of frames, as by dragging.
pub(crate) fn nudge_bars(viewer: &mut Viewer, part: CueTime, frames: i64) {
    if super::headers::refuses_locked(viewer) {
        return;
    }
    let bar = match viewer.selected_bar() {
        Ok(Some(bar)) => bar,
        Ok(None) => return,
        Err(why) => return viewer.edit(|_| Err(why)),
    };
    if matches!(bar.what, Selected::Camera(_)) {
        // The moved shot stays selected, even if it leaves the playhead.
        viewer.clicked_camera_bar = Some(bar.clone());
    }
    let time = if part == CueTime::End { bar.draggable_end } else { bar.start };
    let fps = viewer.playhead.fps();
    let secs = fps.time_of((fps.frames_in(time) + frames).max(0)).as_secs();
    if secs == time.as_secs() {
        return;
    }
    viewer.edit(|v| match part {
        CueTime::Start => v.move_bar(&bar, secs, MoveKind::Alone),
        part => v.change_time(&bar, part, secs, false),
    });
}

/// Sets the start or the end of the playback range at the playhead; at the same position again, removes the range.
pub(super) fn set_range_boundary(viewer: &mut Viewer, is_end: bool) {
    let (now, length) = (viewer.playhead.time(), viewer.playhead.length());
    let (from, to) = viewer.playhead.range().unwrap_or((choreo_motion::Time::ZERO, length));
    let last = to - choreo_motion::Time(1);
    let range = if is_end { (from.min(now), now) } else { (now, last.max(now)) };
    let before = viewer.playhead.range();
    viewer.playhead.set_range(Some(range));
    if viewer.playhead.range() == before {
        viewer.playhead.set_range(None);
    }
}

pub(super) fn toggle_hidden(viewer: &mut Viewer) {
    if let Some(name) = viewer.selection.as_ref().and_then(Selected::actor).map(str::to_string)
        && !viewer.toggles.hidden.remove(&name)
    {
        viewer.toggles.hidden.insert(name);
    }
}

/// Toggles whether the selected actor is shown alone (solo).
pub(super) fn toggle_isolated(viewer: &mut Viewer) {
    if let Some(name) = viewer.selection.as_ref().and_then(Selected::actor).map(str::to_string)
        && !viewer.toggles.solo.remove(&name)
    {
        viewer.toggles.solo.insert(name);
    }
}

pub(crate) fn select_adjacent(viewer: &mut Viewer, back: bool) {
    let Some(scene) = viewer.scene.clone() else { return };
    let actors = scene.stage.actors.iter().map(|a| Selected::Actor(a.name.clone()));
    let cameras = scene.stage.cameras.iter().map(|c| Selected::Camera(c.name.clone()));
    let lights = (0..scene.stage.lights.len()).map(Selected::Light);
    let all: Vec<Selected> = actors
        .chain(cameras)
        .chain(lights)
        .chain((0..scene.stage.effects.len()).map(Selected::Effect))
        .collect();
    if all.is_empty() {
        return;
    }
    let at = viewer.selection.as_ref().and_then(|s| all.iter().position(|a| a == s));
    let next = match (at, back) {
        (None, false) => 0,
        (None, true) => all.len() - 1,
        (Some(at), false) => (at + 1) % all.len(),
        (Some(at), true) => (at + all.len() - 1) % all.len(),
    };
    viewer.selection = all.get(next).cloned();
}
