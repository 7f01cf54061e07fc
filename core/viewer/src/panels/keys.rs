//! Keys that hold everywhere, and the list of them.

use super::Panels;
use super::actions::{self, ACTIONS, Context};
use super::hint::Hint;
use crate::app::Viewer;
use crate::state::selection::Selected;
use crate::state::shortcuts::PRESETS;
use choreo_session::edit::CueTime;
use egui::{Key, Modifiers, Ui};

/// Acts on the keys that were pressed: some always, others unless a text field or a widget takes them.
pub fn handle(panels: &mut Panels, ui: &Ui, viewer: &mut Viewer, now: f64) {
    if panels.is_asking(viewer) {
        return;
    }
    actions::handle(&mut Context { panels, ui, viewer, now });
    if ui.ctx().text_edit_focused() {
        return;
    }
    let pastes = |event: &egui::Event| matches!(event, egui::Event::Cut | egui::Event::Paste(_));
    if !(ui.input(|i| i.events.iter().any(pastes)) && super::script::refuses_keys(viewer)) {
        super::bar_menu::clipboard(ui, viewer);
    }
    // An open menu is closed first, and so is the question about a missing file.
    let is_covered = egui::Popup::is_any_open(ui.ctx()) || viewer.documents.missing.is_some();
    let is_free = !ui.ctx().egui_wants_keyboard_input() && !is_covered;
    if is_free && ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Escape)) {
        if !std::mem::take(&mut panels.help) {
            viewer.selection = None;
        }
        viewer.message = None;
        viewer.note = None;
    }
}

/// The selected cue, effect or cut begins, or ends, this number of frames later.
pub(crate) fn nudge(viewer: &mut Viewer, part: CueTime, frames: i64) {
    if super::headers::refuses_locked(viewer) {
        return;
    }
    let Some(what) = viewer.selection.clone() else { return };
    let bar = viewer.timeline.rows.iter().flat_map(|r| &r.bars).find(|b| b.what == what);
    let Some((time, cut)) = bar.map(|b| (if part == CueTime::End { b.until } else { b.start }, b.cut)) else {
        return;
    };
    let fps = viewer.playhead.fps();
    let secs = fps.time_of((fps.frames_in(time) + frames).max(0)).as_secs();
    let edit = match (cut, part) {
        (Some(cut), CueTime::Start) => viewer.set_cut(cut, secs),
        _ => viewer.set_cue(&what, part, secs),
    };
    viewer.report(edit);
}

/// The part that is played begins or ends here; pressed again there, it is the whole once more.
pub fn range(viewer: &mut Viewer, out: bool) {
    let (now, length) = (viewer.playhead.time(), viewer.playhead.length());
    let (from, to) = viewer.playhead.range().unwrap_or((choreo_motion::Time::ZERO, length));
    let last = to - choreo_motion::Time(1);
    let wanted = if out { (from.min(now), now) } else { (now, last.max(now)) };
    let before = viewer.playhead.range();
    viewer.playhead.set_range(Some(wanted));
    if viewer.playhead.range() == before {
        viewer.playhead.set_range(None);
    }
}

pub fn hide(viewer: &mut Viewer) {
    if let Some(name) = viewer.selection.as_ref().and_then(Selected::actor).map(str::to_string)
        && !viewer.toggles.hidden.remove(&name)
    {
        viewer.toggles.hidden.insert(name);
    }
}

pub(crate) fn next_selection(viewer: &mut Viewer, back: bool) {
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

/// Rows of the list that are no actions: keys of the toolkit, and the mouse.
const MOUSE: [(&str, &str); 23] = [
    ("Ctrl C X V", "copy, cut, paste clips or keys"),
    ("Ctrl click", "selects one more clip or key, as with Shift; a drag over free rows selects a box"),
    ("Esc", "select nothing; close a question"),
    ("Tab Enter", "go through buttons and bars; press"),
    ("", ""),
    ("click", "viewport: select; script, messages: go there"),
    ("drag", "viewport: turn around; with Shift or the middle button: pan"),
    ("drag right", "viewport: look around"),
    ("W A S D Q E", "viewport, mouse over it: walk; with Shift: run"),
    ("drag", "an arrow, ring or box: changes the script; with Ctrl: in steps"),
    ("drag", "a clip's bar: moves it, onto another actor's row, too; with Shift: and all after it"),
    ("Ctrl drag", "a clip's bar over the one before it: they crossfade"),
    ("Alt drag", "a clip's bar: slips its content; its start: trims or rolls it"),
    ("drag", "the corner or the line of the selected clip: speed, weight"),
    ("drag", "a bar's end or fade, a key, a cut, a marker: changes the script"),
    (
        "drag",
        "curves: a key in time and value, with Shift along one of them; a handle of its tangent (Alt: one side, Ctrl: its length) or easing",
    ),
    ("double click", "curves: sets a key on a curve"),
    ("right click", "a bar, a key: all commands; of a key its time, value and easing"),
    ("drag", "a clip from the inspector onto a row: adds a line"),
    ("click", "an event or a foot's strip: the playhead goes there"),
    ("Shift drag", "ruler: the part that is played"),
    (
        "wheel",
        "viewport: nearer; sequencer, curves: zoom, with Shift: pan; over names: other rows; curves with Ctrl: values",
    ),
    ("drop", "a model or clip from a file manager: shows it"),
];

pub fn help(ui: &mut Ui, open: &mut bool, viewer: &mut Viewer) {
    // All of them where there is room; egui would give a window 400 points.
    let room = ui.ctx().content_rect().height() - 80.0;
    let window = egui::Window::new("Keys").open(open).resizable(false).collapsible(false);
    let window = window.default_height(room).anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]);
    window.show(ui.ctx(), |ui| {
        ui.horizontal(|ui| {
            ui.label("Keys like those of");
            for (name, title, _) in PRESETS {
                let is_on = viewer.shortcuts.preset == name;
                if ui.radio(is_on, title).clicked() {
                    viewer.shortcuts.preset = name.to_string();
                }
            }
        });
        ui.weak("Your own keys: shortcuts.json beside the settings of the window.");
        ui.separator();
        let all: Vec<(String, &str, &str)> = ACTIONS
            .iter()
            .filter(|a| !a.keys.is_empty())
            .map(|a| (actions::keys_of(viewer, a.id), a.title, a.id))
            .chain([("Ctrl 1 … 9".to_string(), "open a panel and go there", "panel_curves")])
            .chain(MOUSE.map(|(keys, what)| (keys.to_string(), what, "")))
            .collect();
        egui::ScrollArea::vertical().max_height(room - 60.0).show(ui, |ui| {
            egui::Grid::new("keys").num_columns(2).spacing([16.0, 4.0]).show(ui, |ui| {
                for (keys, what, id) in all {
                    ui.monospace(keys);
                    let label = ui.label(what);
                    if !id.is_empty() {
                        label.hint(format!("in shortcuts.json: \"{id}\""));
                    }
                    ui.end_row();
                }
            });
        });
    });
}
