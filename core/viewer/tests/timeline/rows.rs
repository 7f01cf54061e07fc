//! Bars that move to other rows: dragged onto the row of another actor, or pasted there, with all of their options.

use crate::place::{Desk, Place, drag, secondary_click};
use choreo_motion::Time;
use choreo_viewer::state::selection::Selected;
use egui::{Event, Pos2, pos2, vec2};
use egui_kittest::kittest::Queryable;

const SCRIPT: &str = r#"stage(#{ size: [64, 36], fps: 25, length: 8.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves);
ada.play(moves.clip("Walk")).until(2.0)
    .then(moves.clip("Wave"), #{
        fade: 0.4, // softly
        repeat: "once",
    }).until(4.0).ease("smooth").trim(0.2, 1.8);
ada.play(moves.clip("Bow")).from(1.0).until(2.0).on("RightShoulder..").fade(0.2).speed(1.5);
let bob = cast("bob", moves).at(1.0, 0.0, 0.0);
let ball = cast("ball", shape("sphere"));
sun(#{ intensity: 2.0 });
text("Hello").from(1.0).until(3.0).fade(0.5);
"#;

fn cue(layer: usize, cue: usize) -> Selected {
    Selected::Cue { actor: "ada".into(), layer, cue }
}

fn harness_with_script() -> Desk {
    Place::new(SCRIPT).harness(vec2(1500.0, 1000.0))
}

/// Vertical center of a row.
fn height(desk: &Desk, label: &str) -> f32 {
    desk.get_by_label(&format!("row {label}")).rect().center().y
}

const BOW: &str =
    "bob.play(moves.clip(\"Bow\")).from(3.0).until(4.0).on(\"RightShoulder..\").fade(0.2).speed(1.5);\n";
const WAVE: &str = "bob.play(moves.clip(\"Wave\"), #{\n    fade: 0.4, // softly\n    repeat: \"once\",\n}).from(4.0).until(6.0).ease(\"smooth\").trim(0.2, 1.8);\n";

#[test]
fn dragging_a_bar_onto_another_row_moves_its_clip_there() {
    let mut desk = harness_with_script();
    let second = desk.get_by_label("time").rect().width() / 8.0;
    let bow = desk.get_by_label("Bow on ada +1").rect().center();
    let to = pos2(bow.x + 2.0 * second, height(&desk, "bob"));
    drag(&mut desk, bow, to);
    assert_eq!(desk.state().viewer.message, None);
    let bow_line = SCRIPT.lines().find(|line| line.contains("Bow")).unwrap();
    let wanted = SCRIPT
        .replace(&format!("{bow_line}\n"), "")
        .replace("at(1.0, 0.0, 0.0);\n", &format!("at(1.0, 0.0, 0.0);\n{BOW}"));
    assert_eq!(desk.state().text(), wanted);
    desk.state_mut().reload();
    desk.run();
    desk.get_by_label("Bow on bob +1");
    assert_eq!(desk.state().viewer.selection, Some(Selected::Actor("bob".into())));
    desk.state_mut().viewer.undo().unwrap();
    assert_eq!(desk.state().text(), SCRIPT);
    // Several selected bars move together, also the second one of a chain.
    desk.state_mut().reload();
    desk.state_mut().viewer.move_cues_to(&[cue(1, 0), cue(0, 1)], "bob", 2.0).unwrap();
    let text = desk.state().text();
    assert!(text.contains(&format!("{BOW}{}", WAVE)), "{text}");
    assert!(text.contains("ada.play(moves.clip(\"Walk\")).until(2.0);\nlet bob"), "{text}");
}

/// The line moves unchanged, with its comment and with times in frames.
#[test]
fn a_bar_on_another_row_keeps_its_comment_and_its_style_of_times() {
    const FRAMES: &str = r#"stage(#{ size: [64, 36], fps: 25, length: 8.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves);
ada.play(moves.clip("Walk")).until(f(50)) // walks in
    .then(moves.clip("Wave"), #{ fade: 0.4 }).until(f(100)) // waves
    .then(moves.clip("Idle")); // waits
ada.play(moves.clip("Bow")).from(f(25)).until(f(50)).on("RightShoulder.."); // bows a little
let bob = cast("bob", moves).at(1.0, 0.0, 0.0);
"#;
    let mut desk = Place::new(FRAMES).harness(vec2(1500.0, 1000.0));
    let second = desk.get_by_label("time").rect().width() / 8.0;
    let bow = desk.get_by_label("Bow on ada +1").rect().center();
    let to = pos2(bow.x + 2.0 * second, height(&desk, "bob"));
    drag(&mut desk, bow, to);
    assert_eq!(desk.state().viewer.message, None);
    let line = FRAMES.lines().find(|line| line.contains("Bow")).unwrap();
    let moved = line.replace("ada.", "bob.").replace("from(f(25)).until(f(50))", "from(f(75)).until(f(100))");
    assert_eq!(desk.state().text(), format!("{}{moved}\n", FRAMES.replace(&format!("{line}\n"), "")));
    // Moving a clip out of a chain keeps the comments of the others.
    desk.state_mut().reload_with(FRAMES);
    desk.state_mut().viewer.move_cues_to(&[cue(0, 1)], "bob", 1.0).unwrap();
    let text = desk.state().text();
    let wave = "bob.play(moves.clip(\"Wave\"), #{ fade: 0.4 }).from(f(75)).until(f(125)); // waves\n";
    assert!(text.ends_with(wave), "{text}");
    assert!(text.contains("until(f(50)) // walks in\n    .then(moves.clip(\"Idle\")); // waits\n"), "{text}");
    // A duplicate is written in the style of its bar.
    desk.state_mut().reload_with(FRAMES);
    desk.state_mut().viewer.duplicate_cue(&cue(1, 0)).unwrap();
    let text = desk.state().text();
    assert!(text.contains("// bows a little\n    .then(moves.clip(\"Bow\")).until(f(75));\n"), "{text}");
}

/// Texts that are shown at the pointer while a drag is held over a row.
fn shown_texts(desk: &mut Desk, from: Pos2, to: Pos2) -> Vec<String> {
    desk.hover_at(from);
    desk.run();
    desk.drag_at(from);
    desk.run();
    desk.hover_at(to);
    desk.run();
    let shapes = desk.output().shapes.iter();
    let texts = shapes.filter_map(|shape| match &shape.shape {
        egui::Shape::Text(text) => Some(text.galley.text().to_string()),
        _ => None,
    });
    texts.collect()
}

#[test]
fn a_row_that_refuses_a_bar_says_why_at_the_pointer() {
    let mut desk = harness_with_script();
    let bow = desk.get_by_label("Bow on ada +1").rect().center();
    let title = desk.get_by_label("\u{201c}Hello\u{201d} on titles").rect().center();
    for (from, row, why) in [
        (bow, "ball", "no joint of ball follows Bow of ada"),
        (bow, "sun 1", "only actors play clips: drop the clip on the row of an actor"),
        (bow, "ada", "a layer of an actor is made by .on(…)"),
        (title, "bob", "only actors play clips"),
    ] {
        let to = pos2(from.x, height(&desk, row));
        let texts = shown_texts(&mut desk, from, to);
        assert!(texts.iter().any(|text| text.contains(why)), "{why}: {texts:?}");
        desk.drop_at(to);
        desk.run();
        let message = desk.state().viewer.message.clone().unwrap_or_default();
        assert!(message.contains(why), "{message}");
        assert_eq!(desk.state().text(), SCRIPT);
    }
    desk.state_mut().viewer.toggles.locked.insert("bob".into());
    let to = pos2(bow.x, height(&desk, "bob"));
    drag(&mut desk, bow, to);
    assert!(desk.state().viewer.message.as_ref().unwrap().contains("the row of bob is locked"));
    assert_eq!(desk.state().text(), SCRIPT);
}

/// No tooltip covers the text at the pointer.
#[test]
fn a_bar_below_a_refusal_message_shows_no_tooltip() {
    let mut desk = harness_with_script();
    let bow = desk.get_by_label("Bow on ada +1").rect().center();
    let is_hinted = |desk: &Desk| desk.query_by_label_contains("Bow\n").is_some();
    desk.hover_at(bow);
    desk.run_steps(8);
    assert!(is_hinted(&desk), "shown able to see a hint");
    let viewer = &mut desk.state_mut().viewer;
    (viewer.message, viewer.refusals) = (Some("it cannot be moved there".into()), viewer.refusals + 1);
    desk.run_steps(8);
    assert!(!is_hinted(&desk));
    assert!(desk.get_all_by_label("it cannot be moved there").count() >= 1);
    desk.key_press(egui::Key::Escape);
    desk.run_steps(8);
    assert!(is_hinted(&desk), "the tooltip appears again");
}

/// Bars are copied and pasted by the menu Edit, the menu of a row and the system's shortcuts: onto the selected row, at the playhead.
#[test]
fn clips_are_pasted_on_the_selected_row_with_all_options() {
    let wanted = SCRIPT.replace("at(1.0, 0.0, 0.0);\n", &format!("at(1.0, 0.0, 0.0);\n{BOW}{WAVE}"));
    for way in ["Edit", "row", "keys"] {
        let mut desk = harness_with_script();
        desk.state_mut().viewer.selection = Some(cue(1, 0));
        desk.run();
        desk.get_by_label("Wave on ada").click_modifiers(egui::Modifiers::COMMAND);
        desk.run();
        desk.get_by_label("Edit").click();
        desk.run();
        desk.get_by_label_contains("Copy").click();
        desk.run_steps(1);
        let copied = desk.output().platform_output.commands.iter().find_map(|command| match command {
            egui::OutputCommand::CopyText(text) => Some(text.clone()),
            _ => None,
        });
        desk.run();
        desk.state_mut().viewer.playhead.seek(Time::from_secs(3.0));
        desk.get_by_label("row bob").click();
        desk.run();
        assert_eq!(desk.state().viewer.selection, Some(Selected::Actor("bob".into())));
        match way {
            "Edit" => desk.get_by_label("Edit").click(),
            "row" => {
                let head = desk.get_by_label("row bob").rect().left_center() + vec2(20.0, 0.0);
                secondary_click(&mut desk, head);
            }
            _ => desk.event(Event::Paste(copied.expect("the clipboard"))),
        }
        desk.run();
        if way != "keys" {
            desk.get_by_label_contains("Paste at the playhead").click();
            desk.run();
        }
        assert_eq!(desk.state().viewer.message, None, "{way}");
        assert_eq!(desk.state().text(), wanted, "{way}");
    }
}

/// The color of a bar depends only on its clip, not on other objects.
#[test]
fn adding_bars_keeps_the_colors_of_the_others() {
    let kinds = |place: &Place| -> Vec<(String, usize)> {
        let bars = place.viewer.timeline.rows.iter().flat_map(|row| &row.bars);
        bars.map(|bar| (bar.label.clone(), bar.color_index)).collect()
    };
    let mut place = Place::new(SCRIPT);
    let before = kinds(&place);
    let line = "let first = cast(\"first\", moves);\nfirst.play(moves.clip(\"Jump\"));\nlet ada =";
    place.reload_with(&SCRIPT.replace("let ada =", line));
    let after = kinds(&place);
    assert_eq!(after.len(), before.len() + 1);
    for bar in &before {
        assert!(after.contains(bar), "{bar:?} in {after:?}");
    }
    // Different clips have different colors, as far as there are enough.
    let distinct: std::collections::BTreeSet<usize> =
        after.iter().filter(|(label, _)| !label.contains('\u{201c}')).map(|(_, kind)| kind % 16).collect();
    assert!(distinct.len() >= 3, "{after:?}");
}

/// Each tenth of a second is a frame at 30 frames per second: a bar that is dropped near one begins there, the time that a person would write.
#[test]
fn dragged_times_prefer_tenths_on_frame_boundaries() {
    let script = SCRIPT.replace("fps: 25", "fps: 30").replace("length: 8.0", "length: 2.5");
    let mut desk = Place::new(&script).harness(vec2(1500.0, 1000.0));
    let second = desk.get_by_label("time").rect().width() / 2.5;
    let bow = desk.get_by_label("Bow on ada +1").rect().center();
    // 17 of 30 frames are 0.567 s; the tenth is within reach of 0.305.
    for (by, start) in [(0.305, "1.3"), (17.0 / 30.0, "1.566666667")] {
        drag(&mut desk, bow, bow + vec2(by * second, 0.0));
        let written = format!("\"Bow\")).from({start})");
        assert!(desk.state().text().contains(&written), "{}", desk.state().text());
        desk.state_mut().reload_with(&script);
        desk.run();
    }
}

/// Names of actors and lights in the order of their rows.
fn row_names(desk: &Desk) -> Vec<String> {
    desk.state().viewer.timeline.rows.iter().map(|row| row.label.clone()).collect()
}

#[test]
fn a_row_is_dragged_by_its_name_to_another_place() {
    let script = SCRIPT.replace("sun(", "let key = point(#{ position: [0, 3, 0] });\nsun(");
    let mut desk = Place::new(&script).harness(vec2(1500.0, 1000.0));
    assert_eq!(row_names(&desk), ["camera", "ada", "ada +1", "bob", "ball", "key", "sun 2", "titles"]);
    let name = |desk: &Desk, label: &str| {
        let row = desk.get_by_label(&format!("row {label}")).rect();
        pos2(row.left() + 30.0, row.center().y)
    };
    let above = vec2(0.0, -6.0);
    // An actor moves with its layers, past two rows.
    let (from, to) = (name(&desk, "ball"), name(&desk, "ada") + above);
    drag(&mut desk, from, to);
    assert_eq!(desk.state().viewer.message, None);
    let ball = "let ball = cast(\"ball\", shape(\"sphere\"));\n";
    let moved = script.replace(ball, "").replace("let ada", &format!("{ball}let ada"));
    assert_eq!(desk.state().text(), moved);
    desk.state_mut().reload();
    desk.run();
    assert_eq!(row_names(&desk)[..5], ["camera", "ball", "ada", "ada +1", "bob"]);
    // Dropped on the lower half of a name, below the layers of that actor; then back by the menu.
    let (from, to) = (name(&desk, "ball"), name(&desk, "ada +1"));
    drag(&mut desk, from, to);
    desk.state_mut().reload();
    desk.run();
    assert_eq!(row_names(&desk)[..5], ["camera", "ada", "ada +1", "ball", "bob"]);
    let at = name(&desk, "ball");
    secondary_click(&mut desk, at);
    desk.get_by_label_contains("Move row up").click();
    desk.run();
    desk.state_mut().reload();
    desk.run();
    assert_eq!(row_names(&desk)[..5], ["camera", "ball", "ada", "ada +1", "bob"]);
    // A light stays selected under its new index.
    desk.state_mut().viewer.selection = Some(Selected::Light(1));
    let (from, to) = (name(&desk, "sun 2"), name(&desk, "key") + above);
    drag(&mut desk, from, to);
    assert_eq!(desk.state().viewer.selection, Some(Selected::Light(0)));
    desk.state_mut().reload();
    desk.run();
    assert_eq!(row_names(&desk)[5..7], ["sun 1", "key"]);
    // Every move can be undone.
    for _ in 0..4 {
        desk.state_mut().viewer.undo().unwrap();
    }
    assert_eq!(desk.state().text(), script);
}

/// A row shows its tooltip after a drop only once the pointer moves.
#[test]
fn no_tooltip_appears_where_a_row_was_dropped() {
    let mut desk = harness_with_script();
    let name = |desk: &Desk, label: &str| {
        let row = desk.get_by_label(&format!("row {label}")).rect();
        pos2(row.left() + 30.0, row.center().y)
    };
    let (from, to) = (name(&desk, "ball"), name(&desk, "ada") - vec2(0.0, 6.0));
    drag(&mut desk, from, to);
    let names = |desk: &mut Desk| {
        desk.run_steps(8);
        let is_name =
            |shape: &egui::Shape| matches!(shape, egui::Shape::Text(text) if text.galley.text() == "ada");
        desk.output().shapes.iter().filter(|shape| is_name(&shape.shape)).count()
    };
    let at_rest = names(&mut desk);
    desk.hover_at(to + vec2(12.0, 0.0));
    assert_eq!(names(&mut desk), at_rest + 1);
}

#[test]
fn a_layer_is_dragged_below_another_and_stays_muted() {
    let line = "ada.play(moves.clip(\"Jump\")).from(2.0).until(3.0).on(\"LeftShoulder..\").fade(0.2);\n";
    let script = SCRIPT.replace("let bob", &format!("{line}let bob"));
    let mut desk = Place::new(&script).harness(vec2(1500.0, 1000.0));
    desk.state_mut().viewer.toggles.muted.insert(("ada".into(), 2));
    let name = |label: &str| desk.get_by_label(&format!("row {label}")).rect().center();
    let (from, to) = (name("ada +2"), name("ada +1") - vec2(0.0, 6.0));
    drag(&mut desk, from, to);
    assert_eq!(desk.state().viewer.message, None);
    let bow = script.lines().find(|line| line.contains("Bow")).unwrap();
    let wanted = script.replace(line, "").replace(bow, &format!("{line}{bow}"));
    assert_eq!(desk.state().text(), wanted);
    assert!(desk.state().viewer.toggles.muted.contains(&("ada".into(), 1)));
    assert!(!desk.state().viewer.toggles.muted.contains(&("ada".into(), 2)));
}

#[test]
fn a_row_that_cannot_be_moved_there_says_why() {
    let mut desk = harness_with_script();
    let name = |desk: &Desk, label: &str| desk.get_by_label(&format!("row {label}")).rect().center();
    for (row, to, why) in [
        ("camera", "bob", "the row of cameras stays above the others"),
        ("ada", "sun 1", "can only be moved above or below that of another actor"),
        ("ada +1", "bob", "a layer can only be moved above or below another layer of its actor"),
        ("titles", "ada", "this one cannot"),
    ] {
        let (from, to) = (name(&desk, row), name(&desk, to));
        drag(&mut desk, from, to);
        let message = desk.state().viewer.message.clone().unwrap_or_default();
        assert!(message.contains(why), "{row}: {message}");
        assert_eq!(desk.state().text(), SCRIPT);
    }
    // A row that the moved one refers to stays above it.
    desk.state_mut()
        .reload_with(&SCRIPT.replace("let bob", "let x = 1.0;\nlet bob").replace("at(1.0", "at(x"));
    desk.run();
    let (from, to) = (name(&desk, "bob"), name(&desk, "ada") - vec2(0.0, 6.0));
    drag(&mut desk, from, to);
    let message = desk.state().viewer.message.clone().unwrap_or_default();
    assert!(message.contains("line 10: this line sets x"), "{message}");
}

/// A right click on free space of a row opens the menu of its object.
#[test]
fn a_right_click_on_free_row_space_opens_the_row_menu() {
    let mut desk = harness_with_script();
    let time = desk.get_by_label("time").rect();
    let free = pos2(time.center().x, height(&desk, "bob"));
    secondary_click(&mut desk, free);
    assert_eq!(desk.state().viewer.selection, Some(Selected::Actor("bob".into())));
    desk.get_by_label_contains("Paste at the playhead");
    desk.get_by_label_contains("Duplicate").click();
    desk.run();
    assert!(desk.state().text().contains("let bob_2 = cast(\"bob 2\", moves)"), "{}", desk.state().text());
    // The row of another object has a different menu.
    desk.state_mut().reload();
    desk.run();
    let free = pos2(time.center().x, height(&desk, "sun 1"));
    secondary_click(&mut desk, free);
    assert!(desk.query_by_label_contains("Paste at the playhead").is_none());
    desk.get_by_label_contains("Rename");
}
