//! Keys that hold everywhere, and the list of them.

use super::{Panels, Tab, viewport};
use crate::app::Viewer;
use crate::geometry::gizmo::Tool;
use crate::state::selection::Selected;
use crate::state::settings::SCALES;
use choreo_session::edit::CueTime;
use egui::{Key, Modifiers, Ui};

/// Panels by Ctrl and their number.
const NUMBERS: [Key; 9] =
    [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8, Key::Num9];

/// Acts on the keys that were pressed: those with Ctrl always, others unless a text field or a widget takes them.
pub fn handle(panels: &mut Panels, ui: &mut Ui, viewer: &mut Viewer, now: f64) {
    window_keys(panels, ui, viewer);
    if ui.ctx().text_edit_focused() {
        return;
    }
    edit_keys(ui, viewer);
    // Keys without Ctrl or Alt belong to the button or bar that has the focus.
    if ui.ctx().egui_wants_keyboard_input() {
        return;
    }
    playback_keys(ui, viewer, now);
    view_keys(ui, viewer);
}

fn window_keys(panels: &mut Panels, ui: &Ui, viewer: &mut Viewer) {
    let with = |modifiers, key| ui.input_mut(|i| i.consume_key(modifiers, key));
    for (key, tab) in NUMBERS.into_iter().zip(Tab::ALL) {
        if with(Modifiers::COMMAND, key) {
            panels.bring(tab);
        }
    }
    let steps = [(Key::Plus, 0.1), (Key::Equals, 0.1), (Key::Minus, -0.1), (Key::Num0, 1.0 - panels.scale)];
    for (key, by) in steps {
        if with(Modifiers::COMMAND, key) {
            panels.scale =
                ((panels.scale + by) * 10.0).round().clamp(SCALES.0 * 10.0, SCALES.1 * 10.0) / 10.0;
        }
    }
    viewer.quit |= with(Modifiers::COMMAND, Key::Q);
    panels.help ^= with(Modifiers::NONE, Key::F1);
}

fn edit_keys(ui: &Ui, viewer: &mut Viewer) {
    let with = |modifiers, key| ui.input_mut(|i| i.consume_key(modifiers, key));
    if with(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z) || with(Modifiers::COMMAND, Key::Y) {
        viewer.edit(|v| v.redo());
    }
    if with(Modifiers::COMMAND, Key::Z) {
        viewer.edit(|v| v.undo());
    }
    super::bar_menu::keys(ui, viewer);
    for (key, frames) in [(Key::ArrowRight, 1), (Key::ArrowLeft, -1)] {
        if with(Modifiers::ALT | Modifiers::SHIFT, key) {
            nudge(viewer, CueTime::End, frames);
        } else if with(Modifiers::ALT, key) {
            nudge(viewer, CueTime::Start, frames);
        }
    }
}

fn playback_keys(ui: &Ui, viewer: &mut Viewer, now: f64) {
    let pressed = |key| ui.input_mut(|i| i.consume_key(Modifiers::NONE, key));
    if pressed(Key::Space) {
        viewer.playhead.toggle(now);
    }
    if viewer.curves.hovered && pressed(Key::Home) {
        viewer.curves.fit = true;
    }
    for (key, frames) in
        [(Key::ArrowRight, 1), (Key::ArrowLeft, -1), (Key::Home, i64::MIN / 2), (Key::End, i64::MAX / 2)]
    {
        if pressed(key) {
            viewer.playhead.step(frames);
        }
    }
    for (key, back) in [(Key::ArrowDown, false), (Key::ArrowUp, true)] {
        if pressed(key) {
            viewer.seek_to_next(back);
        }
    }
    viewer.playhead.looping ^= pressed(Key::L);
    viewer.in_seconds ^= pressed(Key::T);
    viewer.snap ^= pressed(Key::N);
    for (key, out) in [(Key::I, false), (Key::O, true)] {
        if pressed(key) {
            range(viewer, out);
        }
    }
}

fn view_keys(ui: &Ui, viewer: &mut Viewer) {
    let pressed = |key| ui.input_mut(|i| i.consume_key(Modifiers::NONE, key));
    type Action = fn(&mut Viewer);
    let actions: [(Key, Action); 4] = [
        (Key::C, viewport::toggle_camera),
        (Key::F, viewport::focus),
        (Key::H, hide),
        (Key::P, viewport::screenshot),
    ];
    for (key, action) in actions {
        if pressed(key) {
            action(viewer);
        }
    }
    for (key, tool) in [(Key::G, Tool::Move), (Key::R, Tool::Turn), (Key::B, Tool::Scale)] {
        if pressed(key) {
            viewer.tool = tool;
        }
    }
    if pressed(Key::PageDown) || pressed(Key::PageUp) {
        // Both ways round: the next or last in the tree.
        let back = ui.input(|i| i.key_down(Key::PageUp));
        next_selection(viewer, back);
    }
    // An open menu is closed first.
    if !egui::Popup::is_any_open(ui.ctx()) && pressed(Key::Escape) {
        match viewer.offer.is_some() {
            true => viewer.offer = None,
            false => viewer.selection = None,
        }
        viewer.message = None;
        viewer.note = None;
    }
}

/// The selected cue, effect or cut begins, or ends, this number of frames later.
fn nudge(viewer: &mut Viewer, part: CueTime, frames: i64) {
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
fn range(viewer: &mut Viewer, out: bool) {
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

fn hide(viewer: &mut Viewer) {
    if let Some(name) = viewer.selection.as_ref().and_then(Selected::actor).map(str::to_string)
        && !viewer.shelf.hidden.remove(&name)
    {
        viewer.shelf.hidden.insert(name);
    }
}

fn next_selection(viewer: &mut Viewer, back: bool) {
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

const KEYS: [(&str, &str); 50] = [
    ("Space", "play, pause"),
    ("← →", "one frame back, on"),
    ("Home End", "first, last frame; Home over curves: show all of their keys"),
    ("↑ ↓", "to the last, the next thing that begins, ends or happens"),
    ("I O", "play from here, up to here; again: all of it"),
    ("L", "again and again, or once"),
    ("T", "times as seconds or frames"),
    ("N", "dragged times snap to frames"),
    ("Alt ← →", "the selected bar begins a frame earlier, later"),
    ("Alt Shift ← →", "the selected bar ends a frame earlier, later"),
    ("Delete", "delete the selected clips and keys from the script"),
    ("K", "set keys of the selection at the playhead: of what has keys, else of its position"),
    ("Y", "split the selected clips at the playhead"),
    ("M", "disable or enable the selected clips"),
    ("Ctrl D", "play the selected clip once more after it; of keys: a copy at the playhead"),
    ("Ctrl C X V", "copy, cut, paste clips or keys"),
    (
        "Ctrl A",
        "select all clips; with Ctrl or Shift a click adds a clip or key, a drag over free rows a box",
    ),
    ("PgUp PgDn", "select the last, the next"),
    ("Esc", "select nothing; close a question"),
    ("G R B", "move, turn, make bigger"),
    ("H", "hide or show what is selected"),
    ("C", "the script's camera or a free one"),
    ("F", "look at what is selected"),
    ("P", "save the image"),
    ("Ctrl Z", "take a change of the script back"),
    ("Ctrl Shift Z", "make it again"),
    ("Ctrl 1 … 9", "open a panel and go there"),
    ("Ctrl + − 0", "larger, smaller, as at first"),
    ("Tab Enter", "go through buttons and bars; press"),
    ("F1", "this list"),
    ("Ctrl Q", "close"),
    ("", ""),
    ("click", "viewport: select; script, messages: go there"),
    ("drag", "viewport: turn around; with Shift or the middle button: pan"),
    ("drag right", "viewport: look around"),
    ("W A S D Q E", "viewport, mouse over it: walk; with Shift: run"),
    ("drag", "an arrow, ring or box: changes the script; with Ctrl: in steps"),
    ("drag", "a clip's bar: moves it; with Shift: and all after it"),
    ("Ctrl drag", "a clip's bar over the one before it: they crossfade"),
    ("Alt drag", "a clip's bar: slips its content; its start: trims or rolls it"),
    ("drag", "the corner or the line of the selected clip: speed, weight"),
    ("drag", "a bar's end or fade, a key, a cut, a marker: changes the script"),
    ("drag", "curves: a key in time and value, with Shift along one of them; a handle of its easing"),
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

pub fn help(ui: &mut Ui, open: &mut bool) {
    // All of them where there is room; egui would give a window 400 points.
    let room = ui.ctx().content_rect().height() - 80.0;
    let window = egui::Window::new("Keys").open(open).resizable(false).collapsible(false);
    let window = window.default_height(room).anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]);
    window.show(ui.ctx(), |ui| {
        egui::ScrollArea::vertical().max_height(room).show(ui, |ui| {
            egui::Grid::new("keys").num_columns(2).spacing([16.0, 4.0]).show(ui, |ui| {
                for (key, what) in KEYS {
                    ui.monospace(key);
                    ui.label(what);
                    ui.end_row();
                }
            });
        });
    });
}
