//! Gestures on bars: rolls and slips of clips that repeat, modifier keys released together with the button, locked rows, bars at the end of
//! the scene, and upper layers.

use crate::place::{Desk, Place, drag};
use choreo_motion::Time;
use choreo_viewer::app::Viewer;
use choreo_viewer::editing::ClipSource;
use choreo_viewer::editing::constraining::{ConstraintCall, NewConstraint};
use choreo_viewer::library::file_dialog::Purpose;
use choreo_viewer::state::selection::Selected;
use egui::{Event, Key, Modifiers, PointerButton, Pos2, pos2, vec2};
use egui_kittest::kittest::Queryable;

const SCRIPT: &str = r#"stage(#{ size: [64, 36], fps: 25, length: 8.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves);
ada.play(moves.clip("Walk")).until(2.0)
    .then(moves.clip("Run"), #{ fade: 0.4 }).until(5.0);
ada.play(moves.clip("Bow")).from(1.0).until(3.0).on("RightShoulder..").fade(0.2)
    .then(moves.clip("Wave")).until(5.0);
let bob = cast("bob", moves).at(1.0, 0.0, 0.0);
bob.play(moves.clip("Wave")).until(1.0);
marker("turn", 5.02);
"#;

fn cue(layer: usize, cue: usize) -> Selected {
    Selected::Cue { actor: "ada".into(), layer, cue }
}

fn harness_with_script() -> Desk {
    Place::new(SCRIPT).harness(vec2(1500.0, 1000.0))
}

/// Width of one second in the sequencer, points.
fn second(desk: &Desk) -> f32 {
    desk.get_by_label("time").rect().width() / 8.0
}

fn back(desk: &mut Desk) {
    desk.state_mut().reload_with(SCRIPT);
    desk.run();
}

/// Drags with modifier keys that are released in the same frame, right after the button.
fn drag_briefly(desk: &mut Desk, modifiers: Modifiers, from: Pos2, to: Pos2) {
    let button =
        |pos, pressed| Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers };
    let frames = [
        vec![Event::ModifiersChanged(modifiers), Event::PointerMoved(from)],
        vec![button(from, true)],
        vec![Event::PointerMoved(from + (to - from) * 0.5)],
        vec![Event::PointerMoved(to)],
        vec![button(to, false), Event::ModifiersChanged(Modifiers::NONE)],
    ];
    for events in frames {
        desk.input_mut().events.extend(events);
        desk.step();
    }
    desk.run();
}

#[test]
fn modifier_keys_released_with_the_mouse_button_apply_to_the_drag() {
    let mut desk = harness_with_script();
    let by = second(&desk);
    // Ctrl: the bar crossfades.
    let run = desk.get_by_label("Run on ada").rect().center();
    drag_briefly(&mut desk, Modifiers::COMMAND, run, run - vec2(by * 0.4, 0.0));
    assert_eq!(desk.state().viewer.message, None);
    let crossfaded = SCRIPT
        .replace("until(2.0)", "until(1.6)")
        .replace("fade: 0.4 }).until(5.0)", "fade: 0.8 }).until(4.6)");
    assert_eq!(desk.state().text(), crossfaded);
    back(&mut desk);
    // Shift: later clips move along.
    let walk = desk.get_by_label("Walk on ada").rect().center();
    drag_briefly(&mut desk, Modifiers::SHIFT, walk, walk + vec2(by, 0.0));
    let moved = SCRIPT
        .replace("\"Walk\")).until(2.0)", "\"Walk\")).from(1.0).until(3.0)")
        .replace("}).until(5.0)", "}).until(6.0)");
    assert_eq!(desk.state().text(), moved);
    back(&mut desk);
    // Alt: the content slips.
    let wave = desk.get_by_label("Wave on bob").rect().center();
    drag_briefly(&mut desk, Modifiers::ALT, wave, wave - vec2(by * 0.51, 0.0));
    let slipped =
        SCRIPT.replace("clip(\"Wave\")).until(1.0)", "clip(\"Wave\"), #{ trim: [0.52, 3.0] }).until(1.0)");
    assert_eq!(desk.state().text(), slipped);
    // A click with Ctrl selects one more.
    back(&mut desk);
    desk.get_by_label("Walk on ada").click();
    desk.run();
    let run = desk.get_by_label("Run on ada").rect().center();
    drag_briefly(&mut desk, Modifiers::COMMAND, run, run);
    assert_eq!(desk.state().viewer.selected_bars(), [cue(0, 0), cue(0, 1)]);
}

/// The release and Ctrl+Z arrive in one frame on a slow machine: the drag is undone and can be redone.
#[test]
fn a_drag_can_be_undone_in_the_frame_in_which_it_ends() {
    let mut desk = harness_with_script();
    let by = second(&desk);
    let wave = desk.get_by_label("Wave on bob").rect().center();
    let to = wave + vec2(by, 0.0);
    let button = |pos, pressed| Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    let undo = Event::Key {
        key: Key::Z,
        physical_key: None,
        pressed: true,
        repeat: false,
        modifiers: Modifiers::COMMAND,
    };
    let frames = [
        vec![Event::PointerMoved(wave)],
        vec![button(wave, true)],
        vec![Event::PointerMoved(wave + vec2(by * 0.5, 0.0))],
        vec![Event::PointerMoved(to)],
        vec![button(to, false), undo],
    ];
    for events in frames {
        desk.input_mut().events.extend(events);
        desk.step();
    }
    desk.run();
    assert_eq!((desk.state().text().as_str(), desk.state().viewer.message.as_deref()), (SCRIPT, None));
    desk.state_mut().viewer.redo().unwrap();
    let moved = SCRIPT.replace("clip(\"Wave\")).until(1.0)", "clip(\"Wave\")).from(1.0).until(2.0)");
    assert_eq!(desk.state().text(), moved);
}

/// A click where two bars meet, even a long one, selects the bar under the pointer and drags nothing; a dragged handle follows the pointer.
#[test]
fn a_click_on_a_handle_selects_the_bar_under_it() {
    let mut desk = harness_with_script();
    let edge = desk.get_by_label("start of Run in row 1").rect().center();
    let x = desk.get_by_label("Run on ada").rect().left();
    for (at, cue) in [(pos2(x - 2.0, edge.y), cue(0, 0)), (pos2(x + 2.0, edge.y), cue(0, 1))] {
        desk.state_mut().viewer.selection = None;
        drag_briefly(&mut desk, Modifiers::NONE, at, at);
        assert_eq!(desk.state().viewer.selection, Some(cue));
        assert_eq!((desk.state().text().as_str(), desk.state().viewer.message.as_deref()), (SCRIPT, None));
    }
    // A long press that is released where it began.
    desk.hover_at(pos2(x + 3.0, edge.y));
    desk.run();
    desk.drag_at(pos2(x + 3.0, edge.y));
    desk.run_steps(120);
    desk.drop_at(pos2(x + 3.0, edge.y));
    desk.run();
    assert_eq!((desk.state().text().as_str(), desk.state().viewer.message.as_deref()), (SCRIPT, None));
    // Grabbed beside its center, the handle keeps that offset.
    let (by, from) = (second(&desk), pos2(x - 3.0, edge.y));
    drag_briefly(&mut desk, Modifiers::NONE, from, from + vec2(by * 0.6, 0.0));
    assert_eq!(desk.state().text(), SCRIPT.replace("until(2.0)", "until(2.6)"));
}

/// A key where two bars meet or a fade ends is grabbed at the top of the row, the handles at the middle of the bars.
#[test]
fn a_key_at_a_bar_edge_does_not_cover_its_handles() {
    let script =
        format!("{SCRIPT}ada.key(\"position\", [[2.0, [0, 0, 0]], [2.4, [1, 0, 0]], [4.0, [2, 0, 0]]]);\n");
    let mut desk = Place::new(&script).harness(vec2(1500.0, 1000.0));
    let (by, run) = (second(&desk), desk.get_by_label("Run on ada").rect());
    let (edge, middle, fade) = (run.left(), run.center().y, run.left() + by * 0.4);
    for (from, moved, old, new) in [
        (pos2(edge - 3.0, middle), 0.6, "until(2.0)", "until(2.6)"),
        (pos2(fade, middle), 0.4, "fade: 0.4", "fade: 0.8"),
        (pos2(edge, run.top() + 3.0), -0.4, "[2.0, [0, 0, 0]]", "[1.6, [0, 0, 0]]"),
        (pos2(fade, run.top() + 3.0), 0.4, "[2.4, [1, 0, 0]]", "[2.8, [1, 0, 0]]"),
    ] {
        drag_briefly(&mut desk, Modifiers::NONE, from, from + vec2(by * moved, 0.0));
        assert_eq!(desk.state().viewer.message, None);
        assert_eq!(desk.state().text(), script.replace(old, new));
        desk.state_mut().reload_with(&script);
        desk.run();
    }
}

/// A fade-out is dragged at its start, also where only `fade` is given, and is written in the same form.
#[test]
fn a_fade_out_is_dragged_where_it_begins() {
    let (method, option) = (
        "\"Bow\")).from(1.0).until(3.0).on(\"RightShoulder..\").fade(0.2)",
        "\"Bow\"), #{ fade: 0.2 }).from(1.0).until(3.0).on(\"RightShoulder..\")",
    );
    for (bow, from, to) in [
        (method, ".fade(0.2)", ".fade(0.2).fade_out(0.6)"),
        (option, "fade: 0.2", "fade: 0.2, fade_out: 0.6"),
    ] {
        let script = SCRIPT.replace(method, bow);
        let mut desk = Place::new(&script).harness(vec2(1500.0, 1000.0));
        let by = second(&desk);
        desk.get_by_label("Bow on ada +1").click();
        desk.run();
        let at = desk.get_by_label("fade-out of Bow in row 2").rect().center();
        drag_briefly(&mut desk, Modifiers::NONE, at, at - vec2(by * 0.4, 0.0));
        assert_eq!(desk.state().viewer.message, None);
        assert_eq!(desk.state().text(), script.replace(from, to));
        // The drag back changes the fade-out that is now written.
        desk.state_mut().reload();
        desk.run();
        let at = desk.get_by_label("fade-out of Bow in row 2").rect().center();
        drag_briefly(&mut desk, Modifiers::NONE, at, at + vec2(by * 0.2, 0.0));
        assert_eq!(desk.state().text(), script.replace(from, &to.replace("0.6", "0.4")));
    }
}

/// The boundary of two repeating clips moves alone: the first continues its loop, the second starts its first round there.
#[test]
fn a_boundary_of_clips_that_repeat_is_rolled() {
    let mut desk = harness_with_script();
    let by = second(&desk);
    let rolled = SCRIPT.replace("until(2.0)", "until(2.6)");
    let edge = desk.get_by_label("start of Run in row 1").rect().center();
    drag_briefly(&mut desk, Modifiers::ALT, edge, edge + vec2(by * 0.6, 0.0));
    assert_eq!(desk.state().viewer.message, None);
    assert_eq!(desk.state().text(), rolled);
    desk.state_mut().reload();
    let bars = desk.state().viewer.timeline.rows[1].bars.clone();
    assert_eq!((bars[0].draggable_end, bars[1].start), (Time::from_secs(2.6), Time::from_secs(2.6)));
    assert_eq!(bars.iter().map(|bar| bar.strip.unwrap().trim[0]).collect::<Vec<_>>(), [0.0, 0.0]);
    back(&mut desk);
    // Each clip keeps a positive length.
    for (secs, why) in [
        (5.0, "Run would begin at 5.000 s, but it ends at 5.000 s"),
        (0.0, "Walk, the clip before it, begins at 0.000 s and would have no length"),
    ] {
        let error = desk.state_mut().viewer.trim_cue(&cue(0, 1), secs).unwrap_err().to_string();
        assert!(error.contains(why), "{error}");
    }
    // A bar without a neighbor at its edge cannot be rolled.
    let why = desk.state_mut().viewer.trim_cue(&cue(0, 0), 0.5).unwrap_err().to_string();
    assert!(why.contains("the clip repeats, so a trim would shorten every repetition"), "{why}");
}

/// A roll begins on either side of a boundary, also at the bottom of a selected bar, where the speed handle is next to it.
#[test]
fn a_boundary_of_two_clips_is_rolled_from_both_sides() {
    let script = SCRIPT.replace("\"Walk\")).until(2.0)", "\"Wave\"), #{ repeat: \"once\" }).until(2.0)");
    let mut desk = Place::new(&script).harness(vec2(1500.0, 1000.0));
    let (by, run) = (second(&desk), desk.get_by_label("Run on ada").rect());
    for side in [-5.5, 5.5] {
        desk.state_mut().viewer.selection = Some(cue(0, 0));
        desk.run();
        assert!(desk.get_by_label("speed of Wave").rect().right() <= run.left() - 6.0);
        let from = pos2(run.left() + side, run.bottom() - 3.0);
        drag_briefly(&mut desk, Modifiers::ALT, from, from + vec2(by * 0.6, 0.0));
        assert_eq!(desk.state().viewer.message, None);
        assert_eq!(desk.state().text(), script.replace("until(2.0)", "until(2.6)"));
        desk.state_mut().reload_with(&script);
        desk.run();
    }
}

#[test]
fn a_slip_needs_an_unplayed_part_of_the_clip() {
    let mut place = Place::new(SCRIPT);
    let wave = Selected::Cue { actor: "bob".into(), layer: 0, cue: 0 };
    place.viewer.slip_cue(&wave, 0.25).unwrap();
    let slipped =
        SCRIPT.replace("clip(\"Wave\")).until(1.0)", "clip(\"Wave\"), #{ trim: [0.25, 3.0] }).until(1.0)");
    assert_eq!(place.text(), slipped);
    place.reload();
    place.viewer.slip_cue(&wave, -0.1).unwrap();
    assert_eq!(place.text(), slipped.replace("0.25", "0.15"));
    // A clip that is cut short by the next one.
    place.reload_with(SCRIPT);
    place.viewer.slip_cue(&cue(1, 1), 0.5).unwrap();
    assert!(
        place.text().contains(".then(moves.clip(\"Wave\"), #{ trim: [0.5, 3.0] }).until(5.0)"),
        "{}",
        place.text()
    );
    place.reload_with(SCRIPT);
    let why = place.viewer.slip_cue(&cue(0, 0), 0.25).unwrap_err().to_string();
    assert!(why.contains("the bar repeats its whole clip"), "{why}");
}

#[test]
fn dragging_a_bar_of_a_locked_row_is_refused_with_a_message() {
    let mut desk = harness_with_script();
    let by = second(&desk);
    desk.get_by_label("lock the row of ada").click();
    desk.run();
    for bar in ["Walk on ada", "Bow on ada +1"] {
        let bar = desk.get_by_label(bar).rect().center();
        desk.hover_at(bar);
        desk.run();
        desk.drag_at(bar);
        desk.run();
        desk.hover_at(bar + vec2(by, 0.0));
        desk.run();
        let why = "the row of ada is locked; press the lock beside its name to unlock it";
        assert_eq!(desk.state().viewer.message.as_deref(), Some(why));
        // The reason is shown next to the pointer.
        let shapes = desk.output().shapes.iter();
        let texts = shapes.filter_map(|shape| match &shape.shape {
            egui::Shape::Text(text) => Some((text.galley.text().to_string(), text.pos)),
            _ => None,
        });
        let near = |at: Pos2| (at - (bar + vec2(by, 0.0))).length() < 60.0;
        assert!(texts.clone().any(|(text, at)| text == why && near(at)), "{:?}", texts.collect::<Vec<_>>());
        desk.drop_at(bar + vec2(by, 0.0));
        desk.run();
        desk.state_mut().viewer.message = None;
        assert_eq!(desk.state().text(), SCRIPT);
    }
    // A click still selects the bar, and no shortcut changes it.
    desk.get_by_label("Walk on ada").click();
    desk.run();
    assert_eq!(desk.state().viewer.selection, Some(cue(0, 0)));
    for (modifiers, key) in
        [(Modifiers::ALT, Key::ArrowRight), (Modifiers::NONE, Key::Delete), (Modifiers::NONE, Key::M)]
    {
        desk.state_mut().viewer.message = None;
        desk.key_press_modifiers(modifiers, key);
        desk.run();
        let why = "the row of ada is locked; press the lock beside its name to unlock it";
        assert_eq!(desk.state().viewer.message.as_deref(), Some(why), "{key:?}");
        assert_eq!(desk.state().text(), SCRIPT);
    }
}

/// Nothing is added to a locked row: by the inspector, the assets, a drop, the clipboard or the menu of constraints.
#[test]
fn nothing_is_added_to_a_locked_row() {
    let mut desk = Place::new(SCRIPT).harness(vec2(1500.0, 1400.0));
    let copied = desk.state().viewer.copy_cues(&[cue(0, 0)]).unwrap();
    desk.get_by_label("lock the row of ada").click();
    desk.run();
    let refused = |desk: &mut Desk| {
        let why = desk.state_mut().viewer.message.take();
        assert_eq!(
            why.as_deref(),
            Some("the row of ada is locked; press the lock beside its name to unlock it")
        );
        assert_eq!(desk.state().text(), SCRIPT);
    };
    desk.state_mut().viewer.selection = Some(Selected::Actor("ada".into()));
    desk.run();
    desk.get_by_label("play Wave").click();
    desk.run();
    refused(&mut desk);
    let viewer = &mut desk.state_mut().viewer;
    let of = ClipSource::Actor("ada".into());
    viewer.edit(|v| v.add_clip_to_layer("ada", &of, "Wave", None, 0));
    refused(&mut desk);
    desk.state_mut().viewer.edit(|v| v.paste_cues("ada", &copied, 7.0));
    refused(&mut desk);
    let look = NewConstraint { call: ConstraintCall::LookAt, target: None };
    desk.state_mut().viewer.edit(|v| v.add_constraint(&look));
    refused(&mut desk);
}

/// No clip is placed after the end of the scene.
#[test]
fn an_edit_that_starts_after_the_scene_is_refused() {
    let mut desk = harness_with_script();
    let copied = desk.state().viewer.copy_cues(&[cue(0, 0), cue(0, 1)]).unwrap();
    let viewer = |desk: &mut Desk, edit: &dyn Fn(&mut choreo_viewer::app::Viewer)| {
        edit(&mut desk.state_mut().viewer);
        let why = desk.state_mut().viewer.message.take().unwrap_or_default();
        assert!(why.contains("and the scene ends at 8.000 s: make the stage longer"), "{why}");
        assert_eq!(desk.state().text(), SCRIPT);
        why
    };
    // The second of two is pasted 2 s after the first.
    let why = viewer(&mut desk, &|v| v.edit(|v| v.paste_cues("bob", &copied, 6.0)));
    assert!(why.contains("the last pasted clip would begin at 8.000 s"), "{why}");
    viewer(&mut desk, &|v| v.edit(|v| v.move_cues_to(&[cue(0, 1)], "bob", 6.0)));
    viewer(&mut desk, &|v| v.edit(|v| v.move_cue(&cue(1, 0), 8.0, false)));
    viewer(&mut desk, &|v| v.edit(|v| v.move_bars(&[cue(0, 1), cue(1, 0)], 6.0)));
    // A bar is dragged to the end, onto its own row and onto another.
    let (width, bow) = (8.0 * second(&desk), desk.get_by_label("Bow on ada +1").rect());
    for row in ["ada +1", "bob"] {
        let at = pos2(bow.left() + 20.0, bow.center().y);
        let row = desk.get_by_label(&format!("row {row}")).rect().center().y;
        drag(&mut desk, at, pos2(at.x + width, row));
        viewer(&mut desk, &|_| {});
    }
    // A duplicate begins where its bar ends.
    let at_end = SCRIPT.replace("fade: 0.4 }).until(5.0)", "fade: 0.4 }).until(8.0)");
    desk.state_mut().reload_with(&at_end);
    let why = desk.state_mut().viewer.duplicate_cue(&cue(0, 1)).unwrap_err().to_string();
    assert!(why.contains("Run would begin at 8.000 s"), "{why}");
    // Clips that an insertion pushes behind the end are reported.
    desk.state_mut().viewer.edit(|v| v.move_cue(&cue(0, 0), 6.5, true));
    let note = desk.state().viewer.note.clone().unwrap_or_default();
    assert_eq!(note, "Run now begins after the end of the scene at 8.000 s: make the stage longer");
}

/// The end that moves along with a clip is reported during the drag, by its middle or its start, and after it, also if other bars
/// move with it.
#[test]
fn the_message_names_an_end_that_moves_with_the_bar() {
    let mut desk = harness_with_script();
    let (by, run) = (second(&desk), desk.get_by_label("Run on ada").rect());
    let note = "Walk, the clip before it, now ends at 2.600 s";
    let start = pos2(run.left() + 3.0, run.center().y);
    for (from, are_several) in [(run.center(), false), (start, false), (run.center(), true)] {
        desk.state_mut().viewer.selection = Some(cue(0, 1));
        desk.run();
        if are_several {
            let wave = desk.get_by_label("Wave on bob").rect().center();
            drag_briefly(&mut desk, Modifiers::COMMAND, wave, wave);
            assert_eq!(desk.state().viewer.selected_bars().len(), 2);
        }
        let to = from + vec2(by * 0.6, 0.0);
        desk.hover_at(from);
        desk.run();
        desk.drag_at(from);
        desk.run();
        desk.hover_at(to);
        desk.run();
        let is_said = |shape: &egui::epaint::ClippedShape| matches!(&shape.shape, egui::Shape::Text(text) if text.galley.text().contains(note));
        assert!(desk.output().shapes.iter().any(is_said), "at {from:?}");
        desk.drop_at(to);
        desk.run();
        assert_eq!(desk.state().viewer.message, None);
        assert_eq!(desk.state().viewer.note.as_deref(), Some(note), "at {from:?}");
        back(&mut desk);
    }
}

/// Layers above the first crossfade, and are stretched and weighted, as the base layer is.
#[test]
fn upper_layers_are_edited_like_the_base_layer() {
    let mut desk = harness_with_script();
    let by = second(&desk);
    // The later edge of a layer keeps its fade-out.
    let wave = desk.get_by_label("Wave on ada +1").rect().center();
    drag_briefly(&mut desk, Modifiers::COMMAND, wave, wave - vec2(by * 0.6, 0.0));
    assert_eq!(desk.state().viewer.message, None);
    let crossfaded = SCRIPT.replace("from(1.0).until(3.0)", "from(1.0).until(2.4)").replace(
        ".then(moves.clip(\"Wave\")).until(5.0)",
        ".then(moves.clip(\"Wave\"), #{ fade: 0.6, fade_out: 0.0 }).until(4.4)",
    );
    assert_eq!(desk.state().text(), crossfaded);
    desk.state_mut().reload();
    let bars = desk.state().viewer.timeline.rows[2].bars.clone();
    assert_eq!((bars[1].fade_in, bars[1].fade_out), (Time::from_secs(0.6), Time::ZERO));
    assert_eq!(bars[0].end, Time::from_secs(3.0), "it is seen until the other one has faded in");
    // A fade that is written as a method.
    desk.state_mut().viewer.set_cue_time(&cue(1, 0), choreo_session::edit::CueTime::FadeIn, 0.5).unwrap();
    assert!(desk.state().text().contains(".fade(0.5)\n"), "{}", desk.state().text());
    for (layer, row, label) in [(0, 1, "Run"), (1, 2, "Wave")] {
        back(&mut desk);
        let bar = desk.state().viewer.timeline.rows[row].bars[1].clone();
        assert_eq!(bar.what, cue(layer, 1));
        desk.get_by_label(&format!("{label} on ada{}", if layer == 0 { "" } else { " +1" })).click();
        desk.run();
        let at = desk.get_by_label(&format!("speed of {label}")).rect().center();
        drag(&mut desk, at, at + vec2((7.0 - bar.draggable_end.as_secs() as f32) * by, 0.0));
        desk.state_mut().reload();
        desk.run();
        let now = desk.state().viewer.timeline.rows[row].bars[1].clone();
        let speed = (bar.draggable_end - bar.start).as_secs() / (7.0 - bar.start.as_secs());
        assert!((now.strip.unwrap().speed - speed).abs() < 1e-3, "{label}: {}", desk.state().text());
        assert_eq!(now.draggable_end, Time::from_secs(7.0));
        let at = desk.get_by_label(&format!("weight of {label}")).rect().center();
        drag(&mut desk, at, at + vec2(0.0, 8.0));
        desk.state_mut().reload();
        let weight = desk.state().viewer.timeline.rows[row].bars[1].strip.unwrap().weight;
        assert!(weight < 0.8 && weight > 0.1, "{label}: {weight}");
    }
}

/// A clip without an end is stretched by its visible part, whether it repeats to the end of the scene or is held.
#[test]
fn stretching_a_cue_maps_its_old_end_to_the_new_end() {
    let script =
        SCRIPT.replace(".then(moves.clip(\"Run\"), #{ fade: 0.4 }).until(5.0)", ".then(moves.clip(\"Run\"))");
    for (repeat, until) in [("loop", 8.0), ("once", 2.0 + 2.0 / 3.0)] {
        let script = script.replace("clip(\"Run\")", &format!("clip(\"Run\"), #{{ repeat: \"{repeat}\" }}"));
        let mut place = Place::new(&script);
        place.viewer.stretch_cue(&cue(0, 1), 6.0).unwrap();
        place.reload();
        let bar = &place.viewer.timeline.rows[1].bars[1];
        assert!((bar.strip.unwrap().speed - (until - 2.0) / 4.0).abs() < 1e-3, "{}", place.text());
    }
}

/// The outline of a selected clip that is cut short is drawn over the bar that cuts it.
#[test]
fn the_unplayed_part_of_a_clip_is_drawn_over_the_next_bar() {
    let script = SCRIPT.replace("clip(\"Walk\")).until(2.0)", "clip(\"Wave\")).until(2.0)");
    let mut desk = Place::new(&script).harness(vec2(1500.0, 1000.0));
    let (by, time) = (second(&desk), desk.get_by_label("time").rect());
    let run = desk.get_by_label("Run on ada").rect();
    // Indices in drawing order: the bar of Run, and the outline of Wave, which lasts 3 s.
    let drawn = |desk: &Desk| {
        let rects = desk.output().shapes.iter().filter_map(|shape| match &shape.shape {
            egui::Shape::Rect(rect) if (rect.rect.center().y - run.center().y).abs() < 3.0 => {
                Some(rect.clone())
            }
            _ => None,
        });
        let rects: Vec<_> = rects.collect();
        let end = time.left() + 3.0 * by;
        let bar =
            |rect: &egui::epaint::RectShape| (rect.rect.left() - run.left()).abs() < 1.0 && rect.fill.a() > 0;
        let outline =
            |rect: &egui::epaint::RectShape| (rect.rect.right() - end).abs() < 1.0 && rect.stroke.width > 0.0;
        [rects.iter().rposition(bar), rects.iter().rposition(outline)]
    };
    assert_eq!(drawn(&desk)[1], None, "the outline is drawn only with a selection or under the pointer");
    desk.state_mut().viewer.selection = Some(cue(0, 0));
    desk.run();
    let [filled, outline] = drawn(&desk);
    assert!(outline > filled && filled.is_some(), "{outline:?} {filled:?}");
}

/// Dragged bars and dropped clips snap to the beats of a typed tempo.
#[test]
fn bars_snap_to_beats() {
    let mut desk = harness_with_script();
    let by = second(&desk);
    desk.get_by_label("beats a minute").click();
    desk.run();
    desk.key_press_modifiers(Modifiers::COMMAND, egui::Key::A);
    desk.event(Event::Text("80".into()));
    desk.run();
    desk.key_press(egui::Key::Enter);
    desk.run();
    assert_eq!(desk.state().viewer.tempo.beats_per_minute, 80.0);
    // The tempo is kept for the script and for its copy.
    let Place { folder, viewer, .. } = desk.state_mut();
    let (script, copy) = (folder.path().join("a.rhai"), folder.path().join("b.rhai"));
    viewer.take_file(Purpose::SaveAs, &copy).unwrap();
    let tempos = viewer.documents.tempos.clone();
    for (file, bpm) in [(&copy, 80.0), (&script, 80.0), (&folder.path().join("c.rhai"), 0.0)] {
        let mut again = Viewer::new("again");
        (again.documents.recent, again.documents.tempos) = (vec![script.clone()], tempos.clone());
        again.record_opened(file);
        assert_eq!(again.tempo.beats_per_minute, bpm, "{}", file.display());
    }
    for (layer, label, from) in [(1, "Bow on ada +1", 1.0), (0, "Run on ada", 2.0)] {
        let bar = desk.get_by_label(label).rect();
        // One beat takes 0.75 s; the drop is 0.03 s off a beat.
        let at = pos2(bar.left() + 30.0, bar.center().y);
        let wanted = if layer == 1 { 1.5 } else { 3.75 };
        drag(&mut desk, at, at + vec2(by * (wanted - from + 0.03) as f32, 0.0));
        assert_eq!(desk.state().viewer.message, None);
        desk.state_mut().reload();
        let row = &desk.state().viewer.timeline.rows[layer + 1];
        let start = row.bars[1 - layer].start;
        assert_eq!(start, Time::from_secs(wanted), "{}", desk.state().text());
        back(&mut desk);
    }
}

/// Shift moves the later cuts along, as it does later clips, also those written in frames.
#[test]
fn dragging_a_cut_with_shift_moves_the_later_cuts() {
    let script = format!(
        "{SCRIPT}let one = camera(\"one\").at(0.0, 1.0, 4.0);\nlet two = camera(\"two\").at(1.0, 1.0, 4.0).cut(2.0);\none.cut(f(100));\n"
    );
    let mut desk = Place::new(&script).harness(vec2(1500.0, 1000.0));
    let by = second(&desk);
    let two = desk.get_by_label("two on camera").rect().center();
    drag_briefly(&mut desk, Modifiers::SHIFT, two, two + vec2(by, 0.0));
    assert_eq!(desk.state().viewer.message, None);
    assert_eq!(desk.state().text(), script.replace(".cut(2.0)", ".cut(3.0)").replace("f(100)", "f(125)"));
    desk.state_mut().viewer.undo().unwrap();
    desk.state_mut().reload();
    desk.run();
    drag_briefly(&mut desk, Modifiers::NONE, two, two + vec2(by, 0.0));
    assert_eq!(desk.state().text(), script.replace(".cut(2.0)", ".cut(3.0)"));
}

/// A clip after all others is refused if it would begin after the scene; one at time 0 is written without a start.
#[test]
fn an_added_clip_begins_within_the_scene() {
    let script = SCRIPT.replace("clip(\"Wave\")).until(1.0);", "clip(\"Wave\")).until(8.5);");
    let mut place = Place::new(&script);
    let refused = place.viewer.add_clip("bob", "bob", "Bow", 0.0).unwrap_err().to_string();
    assert!(refused.contains(
        "Bow would follow the last clip at 8.500 s, and the scene ends at 8.000 s: move the playhead"
    ));
    assert_eq!(place.text(), script);
    let script = SCRIPT.replace("bob.play(moves.clip(\"Wave\")).until(1.0);\n", "");
    let mut place = Place::new(&script);
    place.viewer.add_clip("bob", "bob", "Bow", 0.0).unwrap();
    assert!(place.text().contains("\nbob.play(moves.clip(\"Bow\"));\n"), "{}", place.text());
}
