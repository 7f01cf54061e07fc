//! The command palette finds actions, actors, clips and lines; shortcuts follow presets and the user's file.

use crate::place::{Desk, Place};
use choreo_viewer::geometry::gizmo::Tool;
use choreo_viewer::state::selection::Selected;
use egui::{Key, Modifiers, vec2};
use egui_kittest::kittest::Queryable;

const SCRIPT: &str = r#"stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves);
ada.play(moves.clip("Walk")).from(0.5).until(2.0).then(moves.clip("Wave"));
camera("wide").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);
// The last line of all.
"#;

fn harness_with_script() -> Desk {
    Place::new(SCRIPT).harness(vec2(1500.0, 1000.0))
}

/// Opens the palette, types `text` and presses Enter.
fn command(desk: &mut Desk, text: &str) {
    desk.key_press_modifiers(Modifiers::COMMAND, Key::P);
    desk.run();
    desk.event(egui::Event::Text(text.to_string()));
    desk.run();
    desk.key_press(Key::Enter);
    desk.run();
}

#[test]
fn the_palette_runs_actions_and_goes_to_actors_clips_and_lines() {
    let mut desk = harness_with_script();
    command(&mut desk, "ada actor");
    assert_eq!(desk.state().viewer.selection, Some(Selected::Actor("ada".into())));
    command(&mut desk, "wave clip at");
    let viewer = &desk.state().viewer;
    assert_eq!(viewer.selection, Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: 1 }));
    assert_eq!(viewer.playhead.time().as_secs(), 2.0, "the playhead goes to its start");
    command(&mut desk, "turn the selection");
    assert_eq!(desk.state().viewer.tool, Tool::Turn);
    command(&mut desk, "panel messages");
    desk.get_by_label("no messages");
    command(&mut desk, "last line of all");
    desk.get_by_label_contains("// The last line of all.");
    command(&mut desk, "times as seconds");
    assert!(!desk.state().viewer.in_seconds);
    command(&mut desk, "split the selected");
    assert!(desk.state().viewer.message.as_deref().unwrap_or_default().contains("playhead"));
    desk.state_mut().viewer.playhead.seek(choreo_motion::Time::from_secs(3.0));
    command(&mut desk, "split the selected");
    assert!(desk.state().text().matches("Wave").count() == 2, "{}", desk.state().text());
    // Keys typed here are not shortcuts, and Escape closes the palette.
    let before = desk.state().text();
    desk.key_press_modifiers(Modifiers::COMMAND, Key::P);
    desk.run();
    desk.key_press(Key::Delete);
    desk.key_press(Key::Escape);
    desk.run();
    assert_eq!(desk.state().text(), before);
    assert!(desk.query_by_label("delete the selected clips and keys from the script").is_none());
}

/// Terms of Blender, Unity and video players find the actions and panels.
#[test]
fn the_palette_knows_the_words_of_other_programs() {
    let mut desk = harness_with_script();
    for (words, found) in [
        ("loop", "loop: play again and again"),
        ("range start", "range start: play from here"),
        ("range end", "range end: play up to here"),
        ("speed", "playback speed: half"),
        ("keyframe", "set keys of the selection"),
        ("dope sheet", "panel Sequencer"),
        ("graph editor", "panel Curves"),
        ("hide", "hide or show the selection"),
        ("isolate", "isolate the selection"),
        ("frame selected", "frame the selection"),
        ("snap", "dragged times snap to frames"),
        ("undo", "undo the last change"),
        ("play", "play, pause"),
        ("render", "panel Render"),
        ("rotate", "turn the selection"),
        ("outliner", "panel Stage"),
    ] {
        desk.key_press_modifiers(Modifiers::COMMAND, Key::P);
        desk.run();
        desk.event(egui::Event::Text(words.to_string()));
        desk.run();
        assert!(desk.query_all_by_label_contains(found).next().is_some(), "{words}");
        desk.key_press(Key::Escape);
        desk.run();
    }
    command(&mut desk, "ada actor");
    command(&mut desk, "isolate");
    assert!(desk.state().viewer.toggles.solo.contains("ada"));
    command(&mut desk, "isolate");
    assert!(desk.state().viewer.toggles.solo.is_empty());
    command(&mut desk, "playback speed half");
    assert_eq!(desk.state().viewer.playhead.speed(), 0.5);
}

/// A long line in the list of shortcuts is wrapped.
#[test]
fn the_list_of_keys_fits_the_window() {
    let mut desk = Place::new(SCRIPT).harness(vec2(1600.0, 1000.0));
    desk.key_press(Key::F1);
    desk.run();
    for line in ["set keys of the selection at the playhead: of all", "curves: a key in time and value"] {
        let labels = desk.query_all_by_label_contains(line).map(|node| node.rect());
        let widest =
            labels.max_by(|a, b| a.width().total_cmp(&b.width())).unwrap_or_else(|| panic!("{line}"));
        assert!(widest.width() < 640.0 && widest.right() < 1600.0, "{line}: {widest}");
    }
}

#[test]
fn arrow_keys_move_in_the_palette_and_a_click_runs_an_entry() {
    let mut desk = harness_with_script();
    desk.key_press_modifiers(Modifiers::COMMAND, Key::P);
    desk.run();
    desk.event(egui::Event::Text("one frame".into()));
    desk.run();
    desk.key_press(Key::ArrowDown);
    desk.run();
    desk.key_press(Key::Enter);
    desk.run();
    assert_eq!(desk.state().viewer.playhead.frame(), 1, "the second entry is one frame forward");
    desk.key_press_modifiers(Modifiers::COMMAND, Key::P);
    desk.run();
    desk.event(egui::Event::Text("one frame".into()));
    desk.run();
    desk.get_by_label_contains("one frame back").click();
    desk.run();
    assert_eq!(desk.state().viewer.playhead.frame(), 0);
}

/// A click outside the palette closes it and presses nothing behind it.
#[test]
fn clicks_outside_the_palette_do_not_reach_the_panels() {
    let mut desk = harness_with_script();
    let row = desk.get_by_label("row ada").rect().center();
    let click = |desk: &mut Desk| {
        desk.hover_at(row);
        desk.run();
        desk.drag_at(row);
        desk.drop_at(row);
        desk.run();
    };
    desk.key_press_modifiers(Modifiers::COMMAND, Key::P);
    desk.run();
    desk.get_by_label("find a command");
    click(&mut desk);
    assert!(desk.query_by_label("find a command").is_none(), "it is closed");
    assert_eq!(desk.state().viewer.selection, None);
    click(&mut desk);
    assert_eq!(desk.state().viewer.selection, Some(Selected::Actor("ada".into())));
    // After a search without results, the list has its full height again for the next one.
    desk.key_press_modifiers(Modifiers::COMMAND, Key::P);
    desk.run();
    let area = |desk: &Desk| desk.ctx.memory(|m| m.area_rect(egui::Id::new(("dialog", "Commands"))));
    let before = area(&desk).unwrap();
    desk.event(egui::Event::Text("nothing like it".into()));
    desk.run();
    desk.get_by_label("nothing found");
    assert!(area(&desk).unwrap().height() < before.height());
    desk.key_press_modifiers(Modifiers::COMMAND, Key::A);
    desk.key_press(Key::Backspace);
    desk.run();
    assert_eq!(area(&desk).unwrap(), before);
}

/// A click on a shortcut in the list waits for a new key, which then triggers nothing; actions with the same key name each other.
#[test]
fn shortcuts_are_assigned_in_the_shortcut_list() {
    const SPLIT: &str = "split the selected clips at the playhead";
    let mut desk = harness_with_script();
    desk.key_press(Key::F1);
    desk.run();
    let choose = |desk: &mut Desk, modifiers: Modifiers, key: Key| {
        desk.get_by_label(&format!("key of {SPLIT}")).click();
        desk.run();
        desk.get_by_label_contains("press a key");
        desk.key_press_modifiers(modifiers, key);
        desk.run();
        let own = desk.state().viewer.shortcuts.user_keys.get("split").cloned();
        (own, desk.query_by_label_contains("press a key").is_none())
    };
    let own = |keys: &str| (Some(keys.to_string()), true);
    assert_eq!(choose(&mut desk, Modifiers::NONE, Key::Escape), (None, true), "left as it was");
    let held = Modifiers::COMMAND | Modifiers::SHIFT;
    assert_eq!(choose(&mut desk, held, Key::U), own("Ctrl+Shift+U"));
    assert!(desk.state().viewer.shortcuts.changed.contains("split"), "to be written");
    assert!(desk.query_by_label_contains("also: ").is_none());
    // H is the shortcut for hiding: choosing it hides nothing and is a conflict.
    desk.state_mut().viewer.selection = Some(Selected::Actor("ada".into()));
    assert_eq!(choose(&mut desk, Modifiers::NONE, Key::H), own("H"));
    assert!(desk.state().viewer.toggles.hidden.is_empty());
    desk.get_by_label("also: hide or show the selection");
    desk.get_by_label(&format!("also: {SPLIT}"));
    assert_eq!(choose(&mut desk, Modifiers::NONE, Key::Delete), own(""));
    assert!(desk.query_by_label_contains("also: ").is_none());
    desk.get_by_label(&format!("usual key of {SPLIT}")).click();
    desk.run();
    assert!(desk.state().viewer.shortcuts.user_keys.is_empty());
    // Panels have shortcuts, too; Escape closes the list if it does not wait for a key.
    desk.get_by_label("key of panel Sequencer");
    assert_eq!(choose(&mut desk, Modifiers::NONE, Key::J), own("J"));
    desk.key_press(Key::Escape);
    desk.run();
    assert!(desk.query_by_label("key of panel Sequencer").is_none());
    let cue = Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 };
    desk.state_mut().viewer.selection = Some(cue);
    desk.state_mut().viewer.playhead.seek(choreo_motion::Time::from_secs(1.0));
    desk.run();
    desk.key_press(Key::J);
    desk.run();
    assert_ne!(desk.state().text(), SCRIPT, "it splits");
}

/// Shortcuts in the user's file are compared independently of their spelling.
#[test]
fn shortcut_conflicts_are_found_in_any_spelling() {
    let mut desk = harness_with_script();
    desk.key_press(Key::F1);
    for written in ["H", "h", "KeyH"] {
        let own = [("split".to_string(), written.to_string())];
        desk.state_mut().viewer.shortcuts.user_keys = own.into_iter().collect();
        desk.run();
        desk.get_by_label("also: hide or show the selection");
        desk.get_by_label("also: split the selected clips at the playhead");
    }
    // Names of keys that contain the separator.
    desk.state_mut().viewer.shortcuts.user_keys.clear();
    desk.state_mut().viewer.shortcuts.preset = "unity".into();
    desk.run();
    let texts = desk.output().shapes.iter().filter_map(|shape| match &shape.shape {
        egui::Shape::Text(text) => Some(text.galley.text().to_string()),
        _ => None,
    });
    let texts: Vec<String> = texts.collect();
    assert!(texts.iter().any(|text| text == "Comma, Left"), "{texts:?}");
}

/// The script panel looks editable, so that keys over it neither delete nor split the selection.
#[test]
fn editing_keys_over_the_script_panel_change_nothing() {
    let mut desk = harness_with_script();
    desk.state_mut().viewer.selection = Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 });
    desk.state_mut().viewer.playhead.seek(choreo_motion::Time::from_secs(1.0));
    desk.get_by_label("Script tab").click();
    desk.run();
    let line = desk.get_by_label_contains("// The last line of all.").rect();
    desk.get_by_label("read only");
    desk.hover_at(line.left_center() + vec2(20.0, 0.0));
    desk.run();
    assert_eq!(desk.output().platform_output.cursor_icon, egui::CursorIcon::PointingHand);
    let why = |desk: &Desk| desk.state().viewer.message.clone().unwrap_or_default();
    let events = [egui::Event::Cut, egui::Event::Paste("ada.play(moves.clip(\"Walk\"));".into())];
    for key in [Key::Delete, Key::Y, Key::M, Key::K] {
        desk.key_press(key);
        desk.run();
        assert!(why(&desk).starts_with("the script is read only here"), "{key:?}: {}", why(&desk));
        desk.state_mut().viewer.message = None;
    }
    for event in events {
        desk.event(event.clone());
        desk.run();
        assert!(why(&desk).starts_with("the script is read only here"), "{event:?}: {}", why(&desk));
        desk.state_mut().viewer.message = None;
    }
    assert_eq!(desk.state().text(), SCRIPT);
    // Over other panels they do.
    desk.hover_at(desk.get_by_label("picture").rect().center());
    desk.run();
    desk.key_press(Key::Y);
    desk.run();
    assert_eq!((desk.state().viewer.message.as_deref(), desk.state().text() == SCRIPT), (None, false));
}

#[test]
fn shortcuts_follow_the_preset_and_user_overrides() {
    let mut desk = harness_with_script();
    let tool = |desk: &mut Desk, key| {
        desk.state_mut().viewer.tool = Tool::Move;
        desk.key_press(key);
        desk.run();
        desk.state().viewer.tool
    };
    assert_eq!((tool(&mut desk, Key::R), tool(&mut desk, Key::S)), (Tool::Turn, Tool::Move));
    desk.key_press(Key::F1);
    desk.run();
    desk.get_by_label("Blender").click();
    desk.run();
    desk.key_press(Key::F1);
    desk.run();
    assert_eq!(desk.state().viewer.shortcuts.preset, "blender");
    assert_eq!((tool(&mut desk, Key::S), tool(&mut desk, Key::B)), (Tool::Scale, Tool::Move));
    desk.state_mut().viewer.shortcuts.preset = "unity".into();
    assert_eq!((tool(&mut desk, Key::E), tool(&mut desk, Key::R)), (Tool::Turn, Tool::Scale));
    desk.key_press(Key::Period);
    desk.run();
    assert_eq!(desk.state().viewer.playhead.frame(), 1);
    desk.state_mut().viewer.shortcuts.user_keys.insert("turn".into(), "Ctrl+Shift+J, J".into());
    assert_eq!((tool(&mut desk, Key::E), tool(&mut desk, Key::J)), (Tool::Move, Tool::Turn));
}
