//! Clip editing on the timeline: each gesture on bars changes the text of the script.

use crate::place::{Desk, Place};
use choreo_motion::Time;
use choreo_viewer::state::selection::Selected;
use egui::{Event, Key, Modifiers, PointerButton, Pos2, pos2, vec2};
use egui_kittest::kittest::Queryable;

const SCRIPT: &str = r#"stage(#{ size: [64, 36], fps: 25, length: 8.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves);
ada.play(moves.clip("Walk")).until(2.0)
    .then(moves.clip("Wave"), #{ fade: 0.4, repeat: "once" }).until(4.0);
ada.play(moves.clip("Bow")).from(1.0).until(2.0).on("RightShoulder..");
let bob = cast("bob", moves).at(1.0, 0.0, 0.0);
let sky = sun(#{ intensity: 2.0 });
text("Hello").from(1.0).until(3.0).fade(0.5);
text("Below").from(2.0);
effect("vignette", #{ strength: 0.5 }).from(1.0).until(2.0);
marker("turn", 5.02);
"#;

fn cue(layer: usize, cue: usize) -> Selected {
    Selected::Cue { actor: "ada".into(), layer, cue }
}

fn text_after(change: impl FnOnce(&mut Place)) -> String {
    let mut place = Place::new(SCRIPT);
    change(&mut place);
    assert_eq!(place.viewer.message, None);
    let text = place.text();
    place.reload();
    place.viewer.undo().unwrap();
    assert_eq!(place.text(), SCRIPT);
    text
}

/// Joint matrices of ada in model space at a time.
fn pose(place: &Place, secs: f64) -> Vec<glam::Affine3A> {
    let scene = place.viewer.scene.as_ref().unwrap();
    let snapshot = scene.evaluator.clone().at(Time::from_secs(secs)).unwrap();
    snapshot.actors[0].model_from_joint.clone()
}

fn farthest(a: &[glam::Affine3A], b: &[glam::Affine3A]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a.translation - b.translation).length()).fold(0.0, f32::max)
}

/// A split does not change the motion, wherever it is made, also in a repeating clip.
#[test]
fn splitting_a_clip_does_not_change_the_pose() {
    for (what, at) in [(cue(0, 0), 0.52), (cue(0, 0), 1.72), (cue(0, 1), 3.0)] {
        let mut place = Place::new(SCRIPT);
        let times: Vec<f64> = (0..100).map(|frame| f64::from(frame) / 25.0).collect();
        let before: Vec<_> = times.iter().map(|t| pose(&place, *t)).collect();
        place.viewer.split_cues(std::slice::from_ref(&what), at).unwrap();
        place.reload();
        assert_eq!(place.viewer.timeline.rows[1].bars.len(), 3, "{}", place.text());
        let worst = times.iter().zip(&before).map(|(t, before)| farthest(before, &pose(&place, *t)));
        let worst = worst.fold(0.0, f32::max);
        // A fade at the split would need another clip, so that there is none. Clip times are written to a thousandth.
        assert!(worst < 5e-3, "{what:?} at {at}: {worst} m\n{}", place.text());
        place.viewer.undo().unwrap();
        assert_eq!(place.text(), SCRIPT);
    }
    let mut place = Place::new(SCRIPT);
    let why = place.viewer.split_cues(&[cue(0, 0)], 3.0).unwrap_err().to_string();
    assert_eq!(why, "a.rhai:4: the playhead is not within this clip");
}

/// A trimmed bar keeps its content in place on the timeline; a slip shows another part between the same ends.
#[test]
fn trims_rolls_and_slips_change_only_their_own_part() {
    let mut place = Place::new(SCRIPT);
    let late = pose(&place, 3.6);
    place.viewer.trim_cue(&cue(0, 1), 2.6).unwrap();
    assert_eq!(
        place.text(),
        SCRIPT
            .replace("until(2.0)\n", "until(2.6)\n")
            .replace("\"once\" })", "\"once\", trim: [0.6, 3.0] })")
    );
    place.reload();
    assert!(farthest(&late, &pose(&place, 3.6)) < 2e-3);
    let bars = &place.viewer.timeline.rows[1].bars;
    assert_eq!((bars[0].draggable_end, bars[1].start), (Time::from_secs(2.6), Time::from_secs(2.6)));
    place.viewer.undo().unwrap();
    place.reload();
    // One second of the wave, which lasts 3 s, is visible.
    let short = SCRIPT.replace("until(4.0)", "until(3.0)");
    place.reload_with(&short);
    place.viewer.slip_cue(&cue(0, 1), 0.25).unwrap();
    assert_eq!(place.text(), short.replace("\"once\" })", "\"once\", trim: [0.25, 3.0] })"));
    place.reload();
    let why = place.viewer.trim_cue(&cue(0, 0), 0.5).unwrap_err().to_string();
    assert!(why.contains("the clip repeats, so a trim would shorten every repetition"), "{why}");
}

#[test]
fn clips_that_overlap_crossfade() {
    let text = text_after(|place| place.viewer.edit(|v| v.overlap_cue(&cue(0, 1), 1.4)));
    // The walk is still visible until 2.4 s.
    let expected = SCRIPT.replace("until(2.0)\n", "until(1.4)\n").replace("fade: 0.4", "fade: 1.0");
    assert_eq!(text, expected.replace("until(4.0)", "until(3.4)"));
    let mut place = Place::new(SCRIPT);
    let why = place.viewer.overlap_cue(&cue(0, 1), 3.0).unwrap_err().to_string();
    assert!(
        why.ends_with("the start must be within the previous clip: the clips crossfade where they overlap"),
        "{why}"
    );
}

#[test]
fn a_duplicate_is_appended_and_later_clips_shift() {
    let text = text_after(|place| place.viewer.edit(|v| v.duplicate_cue(&cue(0, 0))));
    let expected = SCRIPT.replace(
        "until(2.0)\n    .then(moves.clip(\"Wave\"), #{ fade: 0.4, repeat: \"once\" }).until(4.0)",
        "until(2.0)\n    .then(moves.clip(\"Walk\")).until(4.0)\n    .then(moves.clip(\"Wave\"), #{ fade: 0.4, repeat: \"once\" }).until(6.0)",
    );
    assert_eq!(text, expected);
}

#[test]
fn copies_go_to_other_rows() {
    let text = text_after(|place| {
        let copied = place.viewer.copy_cues(&[cue(1, 0), cue(0, 1)]).unwrap();
        assert_eq!(copied.lines().count(), 2, "{copied}");
        place.viewer.edit(|v| v.paste_cues("bob", &copied, 4.0));
    });
    let bow = "bob.play(moves.clip(\"Bow\")).from(4.0).until(5.0).on(\"RightShoulder..\");\n";
    let wave = "bob.play(moves.clip(\"Wave\"), #{ fade: 0.4, repeat: \"once\" }).from(5.0).until(7.0);\n";
    assert!(text.contains(bow) && text.contains(wave), "{text}");
}

#[test]
fn a_disabled_clip_has_weight_zero_until_enabled_again() {
    let mut place = Place::new(SCRIPT);
    place.viewer.edit(|v| v.toggle_cues(&[cue(1, 0), cue(0, 1)]));
    assert_eq!(place.viewer.message, None);
    assert_eq!(place.text().matches("weight: 0.0").count(), 2, "{}", place.text());
    place.reload();
    place.viewer.edit(|v| v.toggle_cues(&[cue(1, 0), cue(0, 1)]));
    assert_eq!(place.text(), SCRIPT);
    let why = place.viewer.toggle_cues(&[cue(0, 0)]).unwrap_err().to_string();
    assert!(why.contains("the first clip of the base layer always has full weight"), "{why}");
}

#[test]
fn a_stretched_clip_plays_slower_and_several_bars_move_as_one_change() {
    let text = text_after(|place| place.viewer.edit(|v| v.stretch_cue(&cue(1, 0), 3.0)));
    assert_eq!(
        text,
        SCRIPT.replace(").from(1.0).until(2.0).on", ", #{ speed: 0.5 }).from(1.0).until(3.0).on")
    );
    let text = text_after(|place| {
        let all = [cue(1, 0), Selected::Title(0), Selected::Effect(0)];
        place.viewer.edit(|v| v.move_bars(&all, 0.4));
    });
    assert!(
        text.contains(".from(1.4).until(2.4).on(") && text.contains("text(\"Hello\").from(1.4).until(3.4)")
    );
    assert!(text.contains("#{ strength: 0.5 }).from(1.4).until(2.4)"), "{text}");
}

fn harness_with_script() -> Desk {
    Place::new(SCRIPT).harness(vec2(1500.0, 1000.0))
}

fn drag(desk: &mut Desk, modifiers: Modifiers, from: Pos2, to: Pos2) {
    let button =
        |pos, pressed| Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers };
    for event in [Event::ModifiersChanged(modifiers), Event::PointerMoved(from), button(from, true)] {
        desk.event(event);
    }
    desk.run();
    desk.event(Event::PointerMoved(to));
    desk.run();
    desk.event(button(to, false));
    desk.run();
    desk.event(Event::ModifiersChanged(Modifiers::NONE));
    desk.run();
}

/// Width of one second in the sequencer, points.
fn second(desk: &Desk) -> f32 {
    desk.get_by_label("time").rect().width() / 8.0
}

#[test]
fn mouse_gestures_and_shortcuts_run_all_clip_edits() {
    let mut desk = harness_with_script();
    let by = second(&desk);
    let wave = |desk: &Desk| desk.get_by_label("Wave on ada").rect();
    // Alt: slip. Ctrl: crossfade.
    let at = wave(&desk).center();
    drag(&mut desk, Modifiers::COMMAND, at, at - vec2(by * 0.4, 0.0));
    assert_eq!(desk.state().viewer.message, None);
    assert!(
        desk.state().text().contains("until(1.6)\n    .then(moves.clip(\"Wave\"), #{ fade: 0.8"),
        "{}",
        desk.state().text()
    );
    desk.state_mut().viewer.undo().unwrap();
    desk.state_mut().reload();
    desk.run();
    let start = desk.get_by_label("start of Wave in row 1").rect().center();
    drag(&mut desk, Modifiers::ALT, start, start + vec2(by * 0.6, 0.0));
    assert!(desk.state().text().contains("trim: [0.6, 3.0]"), "{}", desk.state().text());
    desk.state_mut().viewer.undo().unwrap();
    desk.state_mut().reload();
    // The context menu, with its shortcuts.
    desk.state_mut().viewer.playhead.seek(Time::from_secs(3.0));
    desk.run();
    desk.get_by_label("Wave on ada").click_secondary();
    desk.run();
    assert_eq!(desk.state().viewer.selection, Some(cue(0, 1)));
    desk.get_by_label_contains("Split at the playhead").click();
    desk.run();
    assert_eq!(desk.state().viewer.message, None);
    assert!(
        desk.state()
            .text()
            .contains("until(3.0)\n    .then(moves.clip(\"Wave\"), #{ repeat: \"once\", trim: [1.0, 3.0] })"),
        "{}",
        desk.state().text()
    );
    desk.state_mut().viewer.undo().unwrap();
    desk.state_mut().reload();
    desk.run();
    // Copied as text, pasted on the row of the selected bob.
    desk.state_mut().viewer.selection = Some(cue(0, 1));
    desk.run();
    desk.event(Event::Copy);
    desk.run_steps(1);
    let copied = desk.output().platform_output.commands.iter().find_map(|command| match command {
        egui::OutputCommand::CopyText(text) => Some(text.clone()),
        _ => None,
    });
    desk.state_mut().viewer.selection = Some(Selected::Actor("bob".into()));
    desk.run();
    desk.event(Event::Paste(copied.unwrap()));
    desk.run();
    assert_eq!(desk.state().viewer.message, None);
    assert!(desk.state().text().contains("\nbob.play(moves.clip(\"Wave\")"), "{}", desk.state().text());
}

/// The end handle left of a boundary between two bars rolls it as the start handle right of it does.
#[test]
fn both_handles_where_two_bars_meet_roll() {
    let mut desk = harness_with_script();
    let (by, wave) = (second(&desk), desk.get_by_label("Wave on ada").rect());
    let rolled = SCRIPT
        .replace("until(2.0)\n", "until(2.6)\n")
        .replace("\"once\" })", "\"once\", trim: [0.6, 3.0] })");
    for beside in [-2.0, 2.0] {
        let at = pos2(wave.left() + beside, wave.center().y);
        drag(&mut desk, Modifiers::ALT, at, at + vec2(by * 0.6, 0.0));
        assert_eq!(desk.state().viewer.message, None);
        assert_eq!(desk.state().text(), rolled);
        desk.state_mut().reload_with(SCRIPT);
        desk.run();
    }
}

#[test]
fn a_box_and_clicks_select_several_and_delete_takes_them_all() {
    let mut desk = harness_with_script();
    let ruler = desk.get_by_label("time").rect();
    let row = |desk: &Desk, label: &str| desk.get_by_label(&format!("row {label}")).rect();
    // The box reaches from below the rows of bob up to those of ada.
    let from = pos2(ruler.right() - 20.0, row(&desk, "bob").center().y);
    let to = pos2(ruler.left() + 2.5 * second(&desk), row(&desk, "ada").center().y);
    drag(&mut desk, Modifiers::NONE, from, to);
    assert_eq!(desk.state().viewer.selected_bars(), [cue(0, 1)]);
    desk.get_by_label("Bow on ada +1").click_modifiers(Modifiers::COMMAND);
    desk.run();
    assert_eq!(desk.state().viewer.selected_bars(), [cue(0, 1), cue(1, 0)]);
    desk.key_press(Key::Delete);
    desk.run();
    assert_eq!(desk.state().viewer.message, None);
    let text = desk.state().text();
    assert!(!text.contains("Wave") && !text.contains("Bow") && text.contains("Walk"), "{text}");
    desk.state_mut().viewer.undo().unwrap();
    assert_eq!(desk.state().text(), SCRIPT);
}

#[test]
fn dragged_bars_snap_to_markers_and_edges() {
    let mut desk = harness_with_script();
    let by = second(&desk);
    let bow = desk.get_by_label("Bow on ada +1").rect().center();
    // 0.03 s from the marker, which is between two frames.
    drag(&mut desk, Modifiers::NONE, bow, bow + vec2(by * 4.05, 0.0));
    assert!(desk.state().text().contains(".from(5.02).until(6.02)"), "{}", desk.state().text());
}

#[test]
fn the_timeline_has_rows_for_layers_lights_and_titles() {
    let mut desk = harness_with_script();
    let labels: Vec<String> = desk.state().viewer.timeline.rows.iter().map(|row| row.label.clone()).collect();
    assert_eq!(labels[..4], ["camera", "ada", "ada +1", "bob"]);
    assert!(labels.iter().any(|l| l == "effects") && labels.iter().any(|l| l == "titles 2"), "{labels:?}");
    desk.get_by_label("layers of ada").click();
    desk.run();
    assert!(desk.query_by_label("Bow on ada +1").is_none());
    desk.get_by_label("layers of ada").click();
    desk.run();
    desk.get_by_label("mute ada +1").click();
    desk.run();
    let asked = desk.state_mut().viewer.next_request().unwrap();
    assert_eq!(asked.overrides.muted, [(0, 1)]);
    desk.get_by_label("lock the row of ada").click();
    desk.run();
    assert!(desk.query_by_label("start of Wave in row 1").is_none());
    // A title is dragged like a clip.
    let by = second(&desk);
    let title = desk.get_by_label("\u{201c}Hello\u{201d} on titles").rect().center();
    drag(&mut desk, Modifiers::NONE, title, title + vec2(by * 0.48, 0.0));
    assert!(
        desk.state().text().contains("text(\"Hello\").from(1.48).until(3.48)"),
        "{}",
        desk.state().text()
    );
}

/// The pose with a muted layer equals that of the script without the layer.
#[test]
fn muted_layers_do_not_play() {
    let mut place = Place::new(SCRIPT);
    place.viewer.playhead.seek(Time::from_secs(1.6));
    place.viewer.toggles.muted.insert(("ada".into(), 1));
    place.paint();
    let shown = place.viewer.shown().unwrap().snapshot.actors[0].model_from_joint.clone();
    let without: String = SCRIPT.lines().filter(|l| !l.contains("Bow")).map(|l| format!("{l}\n")).collect();
    let at = place.viewer.playhead.time().as_secs();
    assert!(farthest(&shown, &pose(&place, at)) > 0.05);
    place.reload_with(&without);
    assert!(farthest(&shown, &pose(&place, at)) < 1e-6);
}

/// A chained clip follows the previous one of its chain in the script, which need not be the previous bar in the row.
#[test]
fn a_clip_follows_the_one_before_it_in_its_chain() {
    let head = "stage(#{ size: [64, 36], fps: 25, length: 8.0 });\nlet m = load(\"choreo:mannequin\");\nlet ada = cast(\"ada\", m);\n";
    let run = "ada.play(m.clip(\"Run\"), #{ fade: 0.3 }).from(1.0);\n";
    let chain =
        format!("{head}ada.play(m.clip(\"Walk\")).until(2.0).then(m.clip(\"Wave\")).until(4.0);\n{run}");
    let variable = format!(
        "{head}let walk = ada.play(m.clip(\"Walk\")).until(2.0);\n{run}walk.then(m.clip(\"Wave\")).until(4.0);\n"
    );
    let wave = cue(0, 2);
    for script in [chain.as_str(), &variable] {
        let mut place = Place::new(script);
        let starts: Vec<Time> = place.viewer.timeline.rows[1].bars.iter().map(|bar| bar.start).collect();
        assert_eq!(starts, [0.0, 1.0, 2.0].map(Time::from_secs));
        place.viewer.set_cue_time(&wave, choreo_session::edit::CueTime::Start, 1.8).unwrap();
        assert_eq!(place.text(), script.replace("until(2.0)", "until(1.8)"));
        place.reload_with(script);
        for moves_bars in [false, true] {
            let moved = match moves_bars {
                false => place.viewer.move_cue(&wave, 2.4, false),
                true => place.viewer.move_bars(std::slice::from_ref(&wave), 0.4),
            };
            moved.unwrap();
            let note = "Walk, the clip before it, now ends at 2.400 s";
            assert!(moves_bars || place.viewer.note.as_deref() == Some(note), "{:?}", place.viewer.note);
            let both = script.replace("until(2.0)", "until(2.4)").replace("until(4.0)", "until(4.4)");
            assert_eq!(place.text(), both);
            place.reload_with(script);
        }
    }
    // After the first clip is deleted, the next of its chain begins at the old start, and not at the next bar of the row.
    let mut place = Place::new(&chain);
    place.viewer.delete_cue(&cue(0, 0)).unwrap();
    let deleted = format!("{head}ada.play(m.clip(\"Wave\")).from(2.0).until(4.0);\n{run}");
    assert_eq!(place.text(), deleted);
}

/// The trim of the second part of a split is written with the digits of the end time of the first.
#[test]
fn a_trim_is_written_with_the_digits_of_times() {
    let script = "stage(#{ size: [64, 36], fps: 30, length: 8.0 });\nlet m = load(\"choreo:mannequin\");\nlet ada = cast(\"ada\", m);\nada.play(m.clip(\"Wave\"), #{ repeat: \"once\" });\n";
    let mut place = Place::new(script);
    place.viewer.split_cues(&[cue(0, 0)], 41.0 / 30.0).unwrap();
    let split = script.replace(
        "\"once\" });",
        "\"once\" }).until(1.366666667)\n    .then(m.clip(\"Wave\"), #{ repeat: \"once\", trim: [1.366666667, 3.0] });",
    );
    assert_eq!(place.text(), split);
    place.reload();
    // An existing trim is overwritten in the same form.
    place.viewer.trim_cue(&cue(0, 1), 50.0 / 30.0).unwrap();
    assert_eq!(place.text(), split.replace("1.366666667", "1.666666667"));
}
