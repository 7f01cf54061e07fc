//! Actions of keyboard shortcuts and of the command palette, with their default keys.

use super::key_menu::{KeyAct, KeyCommand};
use super::{Panels, Tab, bar_menu, headers, key_menu, keyboard, rename, script, viewport};
use crate::app::Viewer;
use crate::editing::EditError;
use crate::geometry::gizmo::Tool;
use crate::library::file_dialog::Purpose;
use crate::library::templates::TEMPLATES;
use crate::state::selection::Selected;
use crate::state::settings::SCALE_RANGE;
use crate::state::shortcuts::Chord;
use choreo_session::edit::CueTime;
use egui::{Key, Modifiers, Ui};

/// State of the window that an action acts on.
pub(super) struct Context<'c> {
    pub panels: &'c mut Panels,
    pub ui: &'c Ui,
    pub viewer: &'c mut Viewer,
    /// Clock, seconds.
    pub now: f64,
}

/// Contexts in which the keys of an action work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scope {
    Always,
    /// Everywhere except in text fields.
    OutsideText,
    /// Edits of the selection: not in text fields, and refused over the panel Script, where they look like typing.
    Edit,
    /// Neither in text fields, nor while a button or bar has the keyboard focus.
    Unfocused,
}

pub(super) struct Action {
    /// Name in the shortcuts file.
    pub id: &'static str,
    pub title: &'static str,
    /// Keys that run the action, separated by commas, unless the user chooses others.
    pub default_shortcuts: &'static str,
    pub scope: Scope,
    pub run: fn(&mut Context),
}

const fn always(
    id: &'static str,
    title: &'static str,
    default_shortcuts: &'static str,
    run: fn(&mut Context),
) -> Action {
    Action { id, title, default_shortcuts, scope: Scope::Always, run }
}

const fn outside_text(
    id: &'static str,
    title: &'static str,
    default_shortcuts: &'static str,
    run: fn(&mut Context),
) -> Action {
    Action { id, title, default_shortcuts, scope: Scope::OutsideText, run }
}

const fn edit(
    id: &'static str,
    title: &'static str,
    default_shortcuts: &'static str,
    run: fn(&mut Context),
) -> Action {
    Action { id, title, default_shortcuts, scope: Scope::Edit, run }
}

const fn unfocused(
    id: &'static str,
    title: &'static str,
    default_shortcuts: &'static str,
    run: fn(&mut Context),
) -> Action {
    Action { id, title, default_shortcuts, scope: Scope::Unfocused, run }
}

pub(crate) const ACTIONS: &[Action] = &[
    unfocused("play", "play, pause", "Space", |c| c.viewer.playhead.toggle_playback(c.now)),
    unfocused("previous_frame", "one frame back", "Left", |c| c.viewer.playhead.step(-1)),
    unfocused("next_frame", "one frame forward", "Right", |c| c.viewer.playhead.step(1)),
    unfocused(
        "first_frame",
        "first frame; with the pointer over curves: show all keys",
        "Home",
        go_to_first_frame_or_fit_curves,
    ),
    unfocused("last_frame", "last frame", "End", |c| c.viewer.playhead.step(i64::MAX / 2)),
    unfocused("previous_event", "go to the previous start, end or event", "Up", |c| {
        c.viewer.seek_to_next(true)
    }),
    unfocused("next_event", "go to the next start, end or event", "Down", |c| c.viewer.seek_to_next(false)),
    unfocused("range_from", "range start: play from here; press again: play everything", "I", |c| {
        keyboard::set_range_boundary(c.viewer, false)
    }),
    unfocused("range_to", "range end: play up to here; press again: play everything", "O", |c| {
        keyboard::set_range_boundary(c.viewer, true)
    }),
    unfocused("loop", "loop: play again and again, or once", "L", |c| c.viewer.playhead.looping ^= true),
    unfocused("speed_tenth", "playback speed: a tenth", "", |c| c.viewer.playhead.set_speed(0.1)),
    unfocused("speed_quarter", "playback speed: a quarter", "", |c| c.viewer.playhead.set_speed(0.25)),
    unfocused("speed_half", "playback speed: half", "", |c| c.viewer.playhead.set_speed(0.5)),
    unfocused("speed_normal", "playback speed: normal", "", |c| c.viewer.playhead.set_speed(1.0)),
    unfocused("speed_double", "playback speed: double", "", |c| c.viewer.playhead.set_speed(2.0)),
    unfocused("seconds", "times as seconds or frames", "T", |c| c.viewer.in_seconds ^= true),
    unfocused("snap", "dragged times snap to frames", "N", |c| c.viewer.snap ^= true),
    outside_text(
        "start_earlier",
        "move the selected bars, and the ends that they follow, a frame earlier",
        "Alt+Left",
        |c| {
            keyboard::nudge_bars(c.viewer, CueTime::Start, -1);
        },
    ),
    outside_text(
        "start_later",
        "move the selected bars, and the ends that they follow, a frame later",
        "Alt+Right",
        |c| {
            keyboard::nudge_bars(c.viewer, CueTime::Start, 1);
        },
    ),
    outside_text("end_earlier", "the selected bar ends a frame earlier", "Alt+Shift+Left", |c| {
        keyboard::nudge_bars(c.viewer, CueTime::End, -1);
    }),
    outside_text("end_later", "the selected bar ends a frame later", "Alt+Shift+Right", |c| {
        keyboard::nudge_bars(c.viewer, CueTime::End, 1);
    }),
    outside_text("rename", "rename the selected actor, camera, light or title", "F2", |c| {
        rename::start_rename(c.viewer)
    }),
    outside_text("row_up", "move the row of the selected actor or light up", "Ctrl+Shift+Up", |c| {
        run_bar_command(c, bar_menu::Command::RowUp);
    }),
    outside_text("row_down", "move the row of the selected actor or light down", "Ctrl+Shift+Down", |c| {
        run_bar_command(c, bar_menu::Command::RowDown);
    }),
    outside_text("cut", "cut the selected clips or keys", "", |c| {
        run_clipboard_command(c, bar_menu::Command::Cut)
    }),
    outside_text("copy", "copy the selected clips or keys", "", |c| {
        run_clipboard_command(c, bar_menu::Command::Copy)
    }),
    outside_text(
        "paste",
        "paste at the playhead: clips on the row of the selected actor, or keys",
        "",
        |c| {
            run_clipboard_command(c, bar_menu::Command::Paste);
        },
    ),
    edit("delete", "delete the selected clips and keys from the script", "Delete", delete_selection),
    edit(
        "set_keys",
        "set keys of the selection at the playhead: of all properties with keys whose curves are not hidden, else of its position",
        "K",
        |c| key_menu::set_keys(c.viewer),
    ),
    edit("split", "split the selected clips at the playhead", "Y", |c| {
        run_bar_command(c, bar_menu::Command::Split)
    }),
    edit("disable", "disable or enable the selected clips", "M", |c| {
        run_bar_command(c, bar_menu::Command::Disable)
    }),
    edit(
        "duplicate",
        "duplicate the selection: a clip after itself, an actor, camera, light or title, or keys at the playhead",
        "Ctrl+D",
        duplicate_selection,
    ),
    outside_text("select_all", "select all clips", "Ctrl+A", |c| {
        let all: Vec<Selected> =
            c.viewer.bars().filter(|b| b.strip.is_some()).map(|b| b.what.clone()).collect();
        c.viewer.select_all(all);
    }),
    unfocused("select_previous", "select the previous object", "PageUp", |c| {
        keyboard::select_adjacent(c.viewer, true)
    }),
    unfocused("select_next", "select the next object", "PageDown", |c| {
        keyboard::select_adjacent(c.viewer, false)
    }),
    unfocused("move", "move the selection", "G", |c| c.viewer.tool = Tool::Move),
    unfocused("turn", "turn the selection", "R", |c| c.viewer.tool = Tool::Turn),
    unfocused("scale", "scale the selection", "B", |c| c.viewer.tool = Tool::Scale),
    unfocused("hide", "hide or show the selection", "H", |c| keyboard::toggle_hidden(c.viewer)),
    unfocused("isolate", "isolate the selection: show only solo actors", "", |c| {
        keyboard::toggle_isolated(c.viewer)
    }),
    unfocused("camera", "switch between the script's camera and a free one", "C", |c| {
        viewport::toggle_camera(c.viewer)
    }),
    unfocused("focus", "frame the selection: look at it", "F", |c| viewport::focus_selection(c.viewer)),
    unfocused("screenshot", "save the image", "P", |c| viewport::request_screenshot(c.viewer)),
    outside_text("undo", "undo the last change of the script", "Ctrl+Z", |c| c.viewer.edit(|v| v.undo())),
    outside_text("redo", "redo the change that was undone", "Ctrl+Shift+Z, Ctrl+Y", |c| {
        c.viewer.edit(|v| v.redo())
    }),
    always("larger", "larger texts and buttons", "Ctrl+Plus, Ctrl+Equals", |c| change_scale(c.panels, 0.1)),
    always("smaller", "smaller texts and buttons", "Ctrl+Minus", |c| change_scale(c.panels, -0.1)),
    always("usual_size", "texts and buttons in their default size", "Ctrl+0", |c| c.panels.scale = 1.0),
    always("palette", "search actions, actors, clips and lines", "Ctrl+P", |c| c.panels.palette.toggle()),
    always("new", "new script", "Ctrl+N", |c| open_file_dialog(c, Purpose::New(TEMPLATES[0]))),
    always("open", "open a script or a model", "Ctrl+O", |c| open_file_dialog(c, Purpose::Open)),
    always("save", "show where the script is saved (each change saves it at once)", "Ctrl+S", |c| {
        let path = c.viewer.path.as_ref();
        c.viewer.note = path.map(|path| format!("{}: each change is written at once", path.display()));
    }),
    always("save_as", "save the script under another name", "Ctrl+Shift+S", |c| {
        if c.viewer.path.is_some() {
            open_file_dialog(c, Purpose::SaveAs);
        }
    }),
    always("help", "list of shortcuts", "F1", |c| c.panels.shortcut_list.open ^= true),
    always("close", "close", "Ctrl+Q", |c| c.viewer.should_close = true),
];

/// Default keys that open a panel and go to it.
const PANEL_SHORTCUTS: [&str; 9] =
    ["Ctrl+1", "Ctrl+2", "Ctrl+3", "Ctrl+4", "Ctrl+5", "Ctrl+6", "Ctrl+7", "Ctrl+8", "Ctrl+9"];

/// Additional words to find actions and panels by: those of Blender, Unity and video players.
const SYNONYMS: [(&str, &str); 31] = [
    ("play", "playback stop preview"),
    ("previous_frame", "step backward"),
    ("next_frame", "step forward"),
    ("first_frame", "jump to start, go to beginning, fit, frame all"),
    ("last_frame", "jump to end"),
    ("previous_event", "jump to previous keyframe, marker, edit"),
    ("next_event", "jump to next keyframe, marker, edit"),
    ("range_from", "in point, preview range"),
    ("range_to", "out point, preview range"),
    ("loop", "repeat cycle"),
    ("snap", "snapping, magnet, grid"),
    ("delete", "remove erase"),
    ("set_keys", "insert keyframe, record"),
    ("split", "cut blade razor trim"),
    ("disable", "mute deactivate"),
    ("duplicate", "clone copy"),
    ("move", "translate grab position"),
    ("turn", "rotate rotation"),
    ("scale", "resize size bigger smaller"),
    ("hide", "visibility show unhide"),
    ("isolate", "solo local view"),
    ("focus", "frame selected, view selected, zoom to, center"),
    ("screenshot", "render image, export, picture"),
    ("larger", "zoom in, ui scale"),
    ("smaller", "zoom out, ui scale"),
    ("help", "shortcuts, hotkeys, keyboard, key bindings"),
    ("close", "quit exit"),
    ("panel_sequencer", "timeline, dope sheet, nla, tracks, clips"),
    ("panel_curves", "graph editor, f-curves, animation curves, keyframes"),
    ("panel_stage", "outliner, hierarchy, scene tree"),
    ("panel_assets", "project, asset browser, files, library"),
];

/// Additional words of an action or a panel, by its name in the shortcuts file.
pub(super) fn synonyms(id: &str) -> &'static str {
    SYNONYMS.iter().find(|(other, _)| *other == id).map_or("", |(_, words)| words)
}

/// The action with this name in the shortcuts file.
pub(super) fn find_action(id: &str) -> Option<&'static Action> {
    ACTIONS.iter().find(|action| action.id == id)
}

/// Keys of an action as displayed in menus.
pub(super) fn shortcut_text(viewer: &Viewer, id: &str) -> String {
    let chosen =
        find_action(id).map(|action| viewer.shortcuts.display_text(action.id, action.default_shortcuts));
    let chosen = chosen.filter(|keys| !keys.is_empty());
    system_shortcut(id).map(str::to_string).into_iter().chain(chosen).collect::<Vec<_>>().join(", ")
}

/// Key that the system defines for an action, which the toolkit reports as a command.
pub(super) fn system_shortcut(id: &str) -> Option<&'static str> {
    Some(match id {
        "cut" => "Ctrl X",
        "copy" => "Ctrl C",
        "paste" => "Ctrl V",
        _ => return None,
    })
}

/// A hint about an action, followed by its keys.
pub(super) fn hint_with_shortcut(viewer: &Viewer, id: &str, about: &str) -> String {
    match shortcut_text(viewer, id) {
        keys if keys.is_empty() => about.to_string(),
        keys if about.is_empty() => keys,
        keys => format!("{about} ({keys})"),
    }
}

/// Name of a panel in the shortcuts file: `panel_curves`.
pub(crate) fn panel_id(tab: Tab) -> String {
    format!("panel_{}", tab.title().to_lowercase().replace(' ', "_"))
}

/// Keys that open a panel.
pub(crate) fn panel_shortcuts(viewer: &Viewer, tab: Tab) -> Vec<Chord> {
    let number = Tab::ALL.iter().position(|other| *other == tab);
    let usual = number.and_then(|number| PANEL_SHORTCUTS.get(number)).unwrap_or(&"");
    viewer.shortcuts.chords_of(&panel_id(tab), usual)
}

/// An action or a panel, with its keys.
pub(crate) struct ActionWithShortcuts {
    /// Name in the shortcuts file.
    pub id: String,
    pub title: String,
    pub chords: Vec<Chord>,
}

/// All actions and panels, in the order of the list of shortcuts.
pub(crate) fn actions_with_shortcuts(viewer: &Viewer) -> Vec<ActionWithShortcuts> {
    let actions = ACTIONS.iter().map(|action| {
        let (id, title) = (action.id.to_string(), action.title.to_string());
        ActionWithShortcuts {
            id,
            title,
            chords: viewer.shortcuts.chords_of(action.id, action.default_shortcuts),
        }
    });
    let panels = Tab::ALL.into_iter().map(|tab| {
        let (id, title) = (panel_id(tab), format!("panel {}", tab.title()));
        ActionWithShortcuts { id, title, chords: panel_shortcuts(viewer, tab) }
    });
    actions.chain(panels).collect()
}

fn go_to_first_frame_or_fit_curves(c: &mut Context) {
    match c.viewer.curves.hovered {
        true => c.viewer.curves.fits_to_keys = true,
        false => c.viewer.playhead.step(i64::MIN / 2),
    }
}

fn run_bar_command(c: &mut Context, command: bar_menu::Command) {
    if c.viewer.selection.is_some() {
        bar_menu::run(c.ui, c.viewer, command);
    }
}

fn delete_selection(c: &mut Context) {
    if headers::refuses_locked(c.viewer) {
        return;
    }
    match (c.viewer.selected_keys().is_empty(), c.viewer.curves.hovered) {
        (false, _) => c.viewer.edit(Viewer::delete_selected),
        // Delete applies to keys and not to their object while the pointer is over the curve editor.
        (true, true) => c.viewer.edit(|_| Err(EditError::refused("no key is selected"))),
        (true, false) => run_bar_command(c, bar_menu::Command::Delete),
    }
}

fn run_clipboard_command(c: &mut Context, command: bar_menu::Command) {
    bar_menu::run_clipboard(c.ui, c.viewer, command);
}

fn duplicate_selection(c: &mut Context) {
    match c.viewer.has_only_keys_selected() {
        true => key_menu::run(c.ui, c.viewer, KeyAct::RunCommand(KeyCommand::Duplicate)),
        false => run_bar_command(c, bar_menu::Command::Duplicate),
    }
}

fn change_scale(panels: &mut Panels, by: f32) {
    panels.scale =
        ((panels.scale + by) * 10.0).round().clamp(SCALE_RANGE.0 * 10.0, SCALE_RANGE.1 * 10.0) / 10.0;
}

fn open_file_dialog(c: &mut Context, purpose: Purpose) {
    let shown = c.viewer.path.clone();
    c.viewer.documents.open_dialog(purpose, shown.as_deref());
}

/// The toolkit's modifiers and key for a shortcut. `None` if there is no key with this name; upper and lower case are the same.
pub(super) fn egui_shortcut(chord: &Chord) -> Option<(Modifiers, Key)> {
    let modifiers =
        [(chord.ctrl, Modifiers::COMMAND), (chord.shift, Modifiers::SHIFT), (chord.alt, Modifiers::ALT)];
    let modifiers = modifiers.into_iter().filter(|(is_held, _)| *is_held);
    let modifiers = modifiers.fold(Modifiers::NONE, |all, (_, one)| all | one);
    Some((modifiers, Key::from_name(&chord.key)?))
}

enum ShortcutTarget {
    Action(&'static Action),
    Panel(Tab),
}

/// Performs the actions whose keys were pressed.
pub(super) fn run_pressed_shortcuts(c: &mut Context) {
    let in_text = c.ui.ctx().text_edit_focused();
    let in_widget = in_text || c.ui.ctx().egui_wants_keyboard_input();
    let is_on = |scope: Scope| match scope {
        Scope::Always => true,
        Scope::OutsideText | Scope::Edit => !in_text,
        Scope::Unfocused => !in_widget,
    };
    if !c.ui.input(|i| i.events.iter().any(|event| matches!(event, egui::Event::Key { pressed: true, .. }))) {
        return;
    }
    let shortcuts = &c.viewer.shortcuts;
    let actions = ACTIONS.iter().filter(|action| is_on(action.scope));
    let actions = actions.flat_map(|action| {
        shortcuts
            .chords_of(action.id, action.default_shortcuts)
            .into_iter()
            .map(move |chord| (chord, ShortcutTarget::Action(action)))
    });
    let panels = Tab::ALL.into_iter().flat_map(|tab| {
        panel_shortcuts(c.viewer, tab).into_iter().map(move |chord| (chord, ShortcutTarget::Panel(tab)))
    });
    let mut all: Vec<(Chord, ShortcutTarget)> = actions.chain(panels).collect();
    // A shortcut also matches if more modifiers are held, so those with most modifiers are tested first.
    all.sort_by_key(|(chord, _)| std::cmp::Reverse(chord.modifier_count()));
    for (chord, target) in all {
        let Some((modifiers, key)) = egui_shortcut(&chord) else { continue };
        if !c.ui.input_mut(|i| i.consume_key(modifiers, key)) {
            continue;
        }
        match target {
            ShortcutTarget::Action(action)
                if action.scope == Scope::Edit && script::refuses_keys(c.viewer) => {}
            ShortcutTarget::Action(action) => (action.run)(c),
            ShortcutTarget::Panel(tab) => c.panels.bring_to_front(tab),
        }
    }
}

/// The first error in the user's shortcuts: an unknown action or key.
pub(crate) fn shortcuts_problem(viewer: &Viewer) -> Option<String> {
    for (id, keys) in &viewer.shortcuts.user_keys {
        if find_action(id).is_none() && !Tab::ALL.into_iter().any(|tab| panel_id(tab) == *id) {
            return Some(format!("shortcuts.json: there is no action \"{id}\""));
        }
        let chords = viewer.shortcuts.chords_of(id, "");
        let written = keys.split(", ").filter(|key| !key.trim().is_empty()).count();
        if chords.len() != written || chords.iter().any(|chord| egui_shortcut(chord).is_none()) {
            return Some(format!(
                "shortcuts.json: {id}: \"{keys}\" is not a key; write for example \"Ctrl+Shift+D, F5\""
            ));
        }
    }
    None
}

/// Whether a letter that walks in a viewport is the key of an action. Walking then requires the right mouse button, as in Unity.
pub(crate) fn uses_walking_keys(viewer: &Viewer) -> bool {
    let walks = |chord: &Chord| {
        use Key::{A, D, E, Q, S, W};
        matches!(egui_shortcut(chord), Some((Modifiers::NONE, W | A | S | D | Q | E)))
    };
    ACTIONS
        .iter()
        .any(|action| viewer.shortcuts.chords_of(action.id, action.default_shortcuts).iter().any(walks))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::shortcuts::{PRESETS, Shortcuts};
    use std::collections::BTreeMap;

    /// The menu font has glyphs for all displayed keys.
    #[test]
    fn shortcut_symbols_exist_in_the_font() {
        let (context, mut ran) = (egui::Context::default(), false);
        context.set_fonts(super::super::icons::fonts());
        let mut output = context.run_ui(egui::RawInput::default(), |ui| {
            let font = egui::FontId::proportional(14.0);
            let check =
                |keys: String| ui.fonts_mut(|fonts| assert!(fonts.has_glyphs(&font, &keys), "{keys}"));
            for (preset, ..) in PRESETS {
                let mut viewer = Viewer::new("x");
                viewer.shortcuts = Shortcuts { preset: preset.to_string(), ..Shortcuts::default() };
                ACTIONS.iter().for_each(|action| check(shortcut_text(&viewer, action.id)));
                let panels = Tab::ALL.into_iter().flat_map(|tab| panel_shortcuts(&viewer, tab));
                panels.for_each(|chord| check(chord.to_string()));
            }
            ran = true;
        });
        output.textures_delta.clear();
        assert!(ran);
        assert_eq!(shortcut_text(&Viewer::new("x"), "row_up"), "Ctrl Shift Up");
    }

    /// Each key of each preset exists and belongs to only one action.
    #[test]
    fn preset_shortcuts_are_valid_and_unique() {
        for (preset, _, changed) in PRESETS {
            let mut viewer = Viewer::new("x");
            viewer.shortcuts = Shortcuts { preset: preset.to_string(), ..Shortcuts::default() };
            let mut taken: BTreeMap<Chord, String> = BTreeMap::new();
            for ActionWithShortcuts { id, chords, .. } in actions_with_shortcuts(&viewer) {
                for chord in chords {
                    assert!(egui_shortcut(&chord).is_some(), "{preset}, {id}: {chord}");
                    assert!(
                        !chord.to_string().contains(','),
                        "a comma separates keys: {preset}, {id}: {chord}"
                    );
                    let other = taken.insert(chord.clone(), id.clone());
                    assert_eq!(other, None, "{preset}, {id}: {chord}");
                }
            }
            assert!(changed.iter().all(|(id, _)| find_action(id).is_some()), "{preset}");
            assert_eq!(uses_walking_keys(&viewer), preset != "choreo");
        }
    }

    /// Actions with keys of the system display these in addition to the user's own.
    #[test]
    fn clipboard_shortcuts_are_listed() {
        let mut viewer = Viewer::new("x");
        assert_eq!(
            ["cut", "copy", "paste", "save"].map(|id| shortcut_text(&viewer, id)),
            ["Ctrl X", "Ctrl C", "Ctrl V", "Ctrl S"]
        );
        viewer.shortcuts.user_keys = BTreeMap::from([("cut".to_string(), "F7".to_string())]);
        assert_eq!(shortcut_text(&viewer, "cut"), "Ctrl X, F7");
    }

    #[test]
    fn every_synonym_belongs_to_an_action_or_panel() {
        let all: Vec<String> =
            actions_with_shortcuts(&Viewer::new("x")).into_iter().map(|keyed| keyed.id).collect();
        for (id, _) in SYNONYMS {
            assert!(all.iter().any(|known| known == id), "{id}");
        }
    }

    #[test]
    fn unknown_actions_and_keys_of_shortcuts_are_reported() {
        let mut viewer = Viewer::new("x");
        let mut own = |id: &str, keys: &str| {
            viewer.shortcuts.user_keys = BTreeMap::from([(id.to_string(), keys.to_string())]);
            shortcuts_problem(&viewer)
        };
        assert_eq!(own("split", "Ctrl+Alt+F5, Y"), None);
        assert_eq!(own("panel_curves", ""), None);
        assert_eq!(own("fly", "Y").unwrap(), "shortcuts.json: there is no action \"fly\"");
        assert!(own("split", "Ctrl+Foo").unwrap().contains("\"Ctrl+Foo\" is not a key"));
        assert!(own("split", "Hyper+Y").is_some());
    }
}
