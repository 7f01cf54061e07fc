//! Drags that change the script, without a window: the file, and what the panels show of it.

use crate::place::{Place, drag};
use choreo_motion::Time;
use choreo_session::edit::CueTime;
use choreo_viewer::state::selection::Selected;
use egui::{pos2, vec2};
use egui_kittest::kittest::Queryable;

const SCRIPT: &str = r#"stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves);
ada.play(moves.clip("Walk")).from(0.5).until(2.0)      // she comes in
    .then(moves.clip("Wave"), #{ fade: 0.5 });
for at in [1.0, 2.0] { ada.play(moves.clip("Bow")).from(at).on("RightShoulder.."); }
"#;

fn cue(cue: usize) -> Selected {
    Selected::Cue { actor: "ada".into(), layer: 0, cue }
}

#[test]
fn an_edit_changes_one_number_of_the_file_and_can_be_undone() {
    let mut place = Place::new(SCRIPT);
    place.viewer.set_cue_time(&cue(0), CueTime::Start, 0.72).unwrap();
    assert_eq!(place.text(), SCRIPT.replace(".from(0.5)", ".from(0.72)"));
    place.reload();
    assert_eq!(place.viewer.timeline.rows[1].bars[0].start, Time::from_secs(0.72));
    place.viewer.set_cue_time(&cue(1), CueTime::FadeIn, 0.25).unwrap();
    assert!(place.text().contains("#{ fade: 0.25 }"));
    // Meanwhile the text editor saves another change.
    place.write(&format!("// a note\n{}", place.text()));
    place.viewer.undo().unwrap();
    assert_eq!(place.text(), format!("// a note\n{}", SCRIPT.replace(".from(0.5)", ".from(0.72)")));
    place.viewer.undo().unwrap();
    assert_eq!(place.text(), format!("// a note\n{SCRIPT}"));
    assert_eq!(place.viewer.undo().unwrap_err().to_string(), "there is nothing to undo");
}

/// An edit of the first line of a file with a byte order mark, which the script does not count as a character.
#[test]
fn a_byte_order_mark_stays_before_the_text() {
    let script = SCRIPT.replacen('\n', " ", 3);
    let mut place = Place::new(&format!("\u{feff}{script}"));
    place.viewer.set_cue_time(&cue(0), CueTime::Start, 0.72).unwrap();
    assert_eq!(place.text(), format!("\u{feff}{}", script.replace(".from(0.5)", ".from(0.72)")));
    place.viewer.undo().unwrap();
    assert_eq!(place.text(), format!("\u{feff}{script}"));
}

#[test]
fn moving_a_bar_moves_its_end_and_deleting_removes_its_line() {
    let mut place = Place::new(SCRIPT);
    place.viewer.move_cue(&cue(0), 1.0, false).unwrap();
    assert_eq!(place.text(), SCRIPT.replace(".from(0.5).until(2.0)", ".from(1.0).until(2.5)"));
    place.reload();
    // The second clip follows the first: their boundary moves.
    place.viewer.move_cue(&cue(1), 3.0, false).unwrap();
    assert_eq!(place.text(), SCRIPT.replace(".from(0.5).until(2.0)", ".from(1.0).until(3.0)"));
    place.reload();
    place.viewer.delete_cue(&cue(0)).unwrap();
    let after = "ada.play(moves.clip(\"Wave\"), #{ fade: 0.5 }).from(3.0);\n";
    assert!(place.text().contains(after), "{}", place.text());
    place.reload();
    assert_eq!(place.viewer.timeline.rows[1].bars.len(), 1);
    place.viewer.delete_cue(&cue(0)).unwrap();
    assert!(!place.text().contains("Wave"));
    for _ in 0..4 {
        place.viewer.undo().unwrap();
    }
    assert_eq!(place.text(), SCRIPT);
    place.reload();
    let in_loop = Selected::Cue { actor: "ada".into(), layer: 1, cue: 0 };
    assert!(place.viewer.delete_cue(&in_loop).unwrap_err().to_string().contains("2"));
}

/// The last line that mentions the actor is a loop in which she plays a clip.
#[test]
fn added_clips_are_written_after_all_others_in_order() {
    let mut place = Place::new(SCRIPT);
    for (clip, secs) in [("Run", 3.4), ("Bow", 3.0)] {
        place.viewer.add_clip("ada", "ada", clip, secs).unwrap();
        place.reload();
    }
    let play = |clip, from| format!("ada.play(moves.clip(\"{clip}\"), #{{ fade: 0.3 }}).from({from});\n");
    assert_eq!(place.text(), format!("{SCRIPT}{}{}", play("Run", "3.4"), play("Bow", "3.0")));
}

#[test]
fn moving_a_clip_boundary_changes_the_end_of_the_first_clip() {
    let mut place = Place::new(SCRIPT);
    place.viewer.set_cue_time(&cue(1), CueTime::Start, 1.6).unwrap();
    assert_eq!(place.text(), SCRIPT.replace(".until(2.0)", ".until(1.6)"));
    place.reload();
    let bars = &place.viewer.timeline.rows[1].bars;
    assert_eq!((bars[0].draggable_end, bars[1].start), (Time::from_secs(1.6), Time::from_secs(1.6)));
}

#[test]
fn a_time_that_is_not_one_number_is_refused_unchanged() {
    let mut place = Place::new(SCRIPT);
    let in_loop = Selected::Cue { actor: "ada".into(), layer: 1, cue: 0 };
    let why = place.viewer.set_cue_time(&in_loop, CueTime::Start, 0.1).unwrap_err().to_string();
    assert!(why.contains("a.rhai:6: this line makes 2 objects"), "{why}");
    assert_eq!(place.text(), SCRIPT);
    // The file has changed on disk and is not shown yet.
    let other = SCRIPT.replace("she", "he");
    place.write(&other);
    let why = place.viewer.set_cue_time(&cue(0), CueTime::Start, 0.1).unwrap_err().to_string();
    assert!(why.contains("changed on disk"), "{why}");
    assert_eq!(place.text(), other);
}

/// Grabbed anywhere, a bar moves as far as the pointer; Delete removes the selected one from the script.
#[test]
fn a_dragged_bar_moves_and_delete_removes_it() {
    let place = Place::new(SCRIPT);
    let mut harness = place.harness(vec2(1280.0, 860.0));
    let ruler = harness.get_by_label("time").rect();
    let from = harness.get_by_label("Walk on ada").rect().center();
    let to = pos2(from.x + ruler.width() * 0.25, from.y);
    drag(&mut harness, from, to);
    let place = harness.state_mut();
    assert_eq!(place.viewer.message, None);
    assert_eq!(place.text(), SCRIPT.replace(".from(0.5).until(2.0)", ".from(1.52).until(3.02)"));
    place.reload();
    place.viewer.selection = Some(cue(0));
    harness.run();
    harness.key_press(egui::Key::Delete);
    harness.run();
    let place = harness.state();
    assert_eq!(place.viewer.message, None);
    assert!(!place.text().contains("Walk"), "{}", place.text());
}

#[test]
fn a_drag_of_a_bar_s_end_writes_the_file() {
    let place = Place::new(SCRIPT);
    let mut harness = place.harness(vec2(1280.0, 860.0));
    let ruler = harness.get_by_label("time").rect();
    let handle = harness.get_by_label("start of Walk in row 1").rect().center();
    // The handle is dragged to 1 s of 4.
    let to = pos2(ruler.left() + ruler.width() * 0.25, handle.y);
    drag(&mut harness, handle, to);
    let place = harness.state();
    assert_eq!(place.viewer.message, None);
    assert_eq!(place.text(), SCRIPT.replace(".from(0.5)", ".from(1.0)"));
}
