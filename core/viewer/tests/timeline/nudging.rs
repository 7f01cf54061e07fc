//! Bars moved frame by frame with the keyboard, with the same results as with the mouse.

use crate::place::{Desk, Place};
use choreo_viewer::state::selection::Selected;
use egui::{Key, Modifiers, vec2};
use egui_kittest::kittest::Queryable;

const SCRIPT: &str = r#"stage(#{ size: [64, 36], fps: 25, length: 8.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves);
ada.play(moves.clip("Walk")).until(2.0)
    .then(moves.clip("Wave"), #{ fade: 0.4, repeat: "once" }).until(4.0);
let bob = cast("bob", moves).at(1.0, 0.0, 0.0);
bob.play(moves.clip("Walk")).from(1.0).until(2.0);
bob.play(moves.clip("Wave")).from(2.0);
let one = camera("one").at(0.0, 1.0, 4.0);
let two = camera("two").at(1.0, 1.0, 4.0).cut(2.0);
camera("three").at(2.0, 1.0, 4.0).cut(f(100), #{ dissolve: 0.4 });
"#;

const END: Modifiers = Modifiers { shift: true, ..Modifiers::ALT };

fn harness_with_script() -> Desk {
    Place::new(SCRIPT).harness(vec2(1500.0, 1000.0))
}

/// Script text after a key press, and the reason if it was refused.
fn press(desk: &mut Desk, what: &Selected, modifiers: Modifiers, key: Key) -> (String, Option<String>) {
    desk.state_mut().reload_with(SCRIPT);
    desk.state_mut().viewer.selection = Some(what.clone());
    desk.run();
    desk.key_press_modifiers(modifiers, key);
    desk.run();
    let place = desk.state_mut();
    (place.text(), place.viewer.message.take())
}

fn refused(desk: &mut Desk, what: &Selected, modifiers: Modifiers, key: Key) -> String {
    let (text, why) = press(desk, what, modifiers, key);
    assert_eq!(text, SCRIPT);
    why.expect("the edit was expected to be refused")
}

/// The end of a camera's bar is the cut to the next camera: its time changes, and no line is added.
#[test]
fn the_end_of_a_camera_is_the_next_cut() {
    let mut desk = harness_with_script();
    let [one, two, three] = ["one", "two", "three"].map(|name| Selected::Camera(name.into()));
    for (camera, modifiers, key, from, to) in [
        (&one, END, Key::ArrowLeft, ".cut(2.0)", ".cut(1.96)"),
        (&two, END, Key::ArrowRight, ".cut(f(100),", ".cut(f(101),"),
        (&two, Modifiers::ALT, Key::ArrowRight, ".cut(2.0)", ".cut(2.04)"),
    ] {
        let moved = (SCRIPT.replace(from, to), None);
        assert_eq!(press(&mut desk, camera, modifiers, key), moved);
    }
    let why = refused(&mut desk, &three, END, Key::ArrowLeft);
    assert!(why.ends_with("the camera is active until the scene ends: no other camera takes over"), "{why}");
    let why = refused(&mut desk, &one, Modifiers::ALT, Key::ArrowRight);
    assert!(why.contains("the first camera is on from the start"), "{why}");
}

/// A chained clip moves with its own end, as in a drag, and a note names what moved along.
#[test]
fn nudging_a_chained_clip_moves_its_start_and_end() {
    let mut desk = harness_with_script();
    let wave = Selected::Cue { actor: "ada".into(), layer: 0, cue: 1 };
    let (text, why) = press(&mut desk, &wave, Modifiers::ALT, Key::ArrowRight);
    let moved = SCRIPT.replace(".until(2.0)\n", ".until(2.04)\n").replace(".until(4.0)", ".until(4.04)");
    assert_eq!((text.as_str(), why), (moved.as_str(), None));
    let note = desk.state().viewer.note.clone();
    assert_eq!(note.as_deref(), Some("Walk, the clip before it, now ends at 2.040 s"));
    desk.state_mut().reload_with(SCRIPT);
    desk.state_mut().viewer.move_cue(&wave, 2.04, false).unwrap();
    assert_eq!(desk.state().text(), moved);
    // A clip with an explicit start moves, too; nothing begins before time 0.
    let walk = |actor: &str| Selected::Cue { actor: actor.into(), layer: 0, cue: 0 };
    let (text, _) = press(&mut desk, &walk("bob"), Modifiers::ALT, Key::ArrowLeft);
    assert_eq!(text, SCRIPT.replace(".from(1.0).until(2.0)", ".from(0.96).until(1.96)"));
    assert_eq!(press(&mut desk, &walk("ada"), Modifiers::ALT, Key::ArrowLeft), (SCRIPT.to_string(), None));
    // An end cannot be moved into another clip.
    let why = refused(&mut desk, &walk("bob"), END, Key::ArrowRight);
    assert!(why.contains("Wave takes over from it at 2.000 s"), "{why}");
}

/// The clicked shot of a camera moves, otherwise the one at the playhead.
#[test]
fn nudging_moves_only_the_selected_shot_of_a_camera() {
    const SHOTS: &str = r#"stage(#{ size: [64, 36], fps: 25, length: 8.0 });
let one = camera("one").at(0.0, 1.0, 4.0);
let two = camera("two").at(1.0, 1.0, 4.0).cut(2.0);
one.cut(4.0);
two.cut(6.0);
"#;
    let mut desk = Place::new(SHOTS).harness(vec2(1500.0, 1000.0));
    let two = Selected::Camera("two".into());
    let later = |desk: &mut Desk, modifiers: Modifiers| {
        desk.key_press_modifiers(modifiers, Key::ArrowRight);
        desk.run();
        let place = desk.state_mut();
        (place.text(), place.viewer.message.take())
    };
    // Only the camera is selected, no shot.
    let select = |desk: &mut Desk, secs: f64| {
        desk.state_mut().viewer.selection = None;
        desk.state_mut().reload_with(SHOTS);
        desk.state_mut().viewer.selection = Some(two.clone());
        desk.state_mut().viewer.playhead.seek(choreo_motion::Time::from_secs(secs));
        desk.run();
    };
    for (secs, modifiers, from, to) in [
        (
            2.5,
            Modifiers::ALT,
            "camera(\"two\").at(1.0, 1.0, 4.0).cut(2.0)",
            "camera(\"two\").at(1.0, 1.0, 4.0).cut(2.04)",
        ),
        (6.5, Modifiers::ALT, "two.cut(6.0)", "two.cut(6.04)"),
        (2.5, END, "one.cut(4.0)", "one.cut(4.04)"),
    ] {
        select(&mut desk, secs);
        assert_eq!(later(&mut desk, modifiers), (SHOTS.replace(from, to), None), "at {secs} s");
    }
    select(&mut desk, 5.0);
    let (text, why) = later(&mut desk, Modifiers::ALT);
    assert_eq!(text, SHOTS);
    let why = why.expect("neither shot is at the playhead");
    assert!(why.contains("two has several shots: click the bar of one"), "{why}");
    // The shot still moves after it has left the playhead.
    select(&mut desk, 6.0);
    for to in ["two.cut(6.04)", "two.cut(6.08)"] {
        assert_eq!(later(&mut desk, Modifiers::ALT), (SHOTS.replace("two.cut(6.0)", to), None));
        desk.state_mut().reload();
        desk.run();
    }
    // The bar is clicked while the playhead is elsewhere.
    select(&mut desk, 2.5);
    let bars = desk.query_all_by_label("two on camera").map(|node| node.rect());
    let last = bars.max_by(|a, b| a.left().total_cmp(&b.left())).unwrap().center();
    desk.hover_at(last);
    desk.run();
    desk.drag_at(last);
    desk.drop_at(last);
    desk.run();
    assert_eq!(later(&mut desk, Modifiers::ALT), (SHOTS.replace("two.cut(6.0)", "two.cut(6.04)"), None));
}
