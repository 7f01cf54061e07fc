//! A scene built with the mouse alone from an empty stage: three characters, eight clips, two cameras, keys, a light, titles. The
//! keyboard only enters numbers and words. In the folder CHOREO_SHOTS, if it is set, a screenshot of each step is saved, and all in one image:
//! `CHOREO_SHOTS=folder cargo test -p choreo -p choreo-viewer --test panels by_mouse`.

use crate::place::Place;
use crate::place::mouse::Mouse;
use choreo_viewer::library::templates::TEMPLATES;
use egui::{Pos2, pos2, vec2};
use std::path::Path;
use std::process::Command;

/// Lines after those of the template.
const MADE: &str = r##"let ada_model = load("choreo:mannequin", #{ color: "coral" });
let ada = cast("ada", ada_model);
ada.play(ada_model.clip("Walk")).until(2.0);
ada.play(ada_model.clip("Dance_Groove"), #{ fade: 0.3 }).from(2.0);
ada.play(ada_model.clip("Bow"), #{ fade: 0.3 }).from(6.0);
ada.key("position", [[0.0, [0.0, 0.0, -2.4]], [2.0, [0.0, 0.0, 0.0]]]);
let bob_model = load("choreo:mannequin", #{ color: "teal" });
let bob = cast("bob", bob_model);
bob.play(bob_model.clip("Walk")).until(2.0);
bob.play(bob_model.clip("Dance_Groove"), #{ fade: 0.3 }).from(2.0);
bob.play(bob_model.clip("Wave"), #{ fade: 0.3 }).from(6.0);
bob.key("position", [[0.0, [1.0, 0.0, -2.4]], [2.0, [1.0, 0.0, 0.0]]]);
let cleo_model = load("choreo:mannequin", #{ color: "gold" });
let cleo = cast("cleo", cleo_model);
cleo.play(cleo_model.clip("Walk")).until(2.0);
cleo.play(cleo_model.clip("Dance_Spin"), #{ fade: 0.3 }).from(2.0);
cleo.key("position", [[0.0, [-1.0, 0.0, -2.4]], [2.0, [-1.0, 0.0, 0.0]]]);
camera("round 1").orbit([0.0, 0.95, 0.0], #{ distance: 4.5, elevation: 10.0, speed: 30.0 }).cut(4.0);
spot(#{ position: [2.0, 3.5, 3.0], look_at: [0.0, 1.0, 0.0], intensity: 90.0, outer: 35.0, shadow: true });
text("Three dance", #{ at: [0.5, 0.85] }).from(0.5).until(2.5).fade(0.3);
text("The end", #{ at: [0.5, 0.85] }).from(5.5).until(7.5).fade(0.3);
"##;

/// File names of the screenshots of the steps.
const STEPS: [&str; 6] = ["2_characters", "3_walks", "5_ends", "6_keys", "8_light", "9_titles"];

/// Screen position of a time in the ruler.
fn at(mouse: &Mouse, secs: f64) -> Pos2 {
    let (ruler, span) = (mouse.find("time"), mouse.desk.state().viewer.visible_span);
    let part = (secs - span.from) / (span.to - span.from);
    pos2(ruler.left() + part as f32 * ruler.width(), ruler.center().y)
}

fn seek(mouse: &mut Mouse, secs: f64) {
    mouse.click_at(at(mouse, secs));
}

/// Adds a clip of the selected character at a time.
fn play(mouse: &mut Mouse, actor: &str, clip: &str, secs: f64) {
    seek(mouse, secs);
    mouse.click(actor);
    mouse.click(&format!("play {clip}"));
}

#[test]
fn a_scene_of_three_actors_is_built_with_the_mouse_from_an_empty_stage() {
    let empty = TEMPLATES.iter().find(|template| template.name == "Empty stage").unwrap();
    let mut mouse = Mouse::new(Place::new(empty.text), vec2(1600.0, 1000.0));
    mouse.type_into("stage length", "8");
    mouse.picture("1_empty");
    for _ in 0..3 {
        mouse.menu(&["Add", "Character"]);
    }
    mouse.picture("2_characters");
    for name in ["ada", "bob", "cleo"] {
        mouse.click(&format!("Idle on {name}"));
        mouse.click("clip: Idle");
        mouse.click("Walk");
        mouse.type_into("until field", "2");
    }
    mouse.picture("3_walks");
    play(&mut mouse, "ada", "Dance_Groove", 2.0);
    play(&mut mouse, "bob", "Dance_Groove", 2.0);
    play(&mut mouse, "cleo", "Dance_Spin", 2.0);
    mouse.picture("4_dances");
    play(&mut mouse, "ada", "Bow", 6.0);
    play(&mut mouse, "bob", "Wave", 6.0);
    mouse.picture("5_ends");
    // They walk in: one key at the start of the walk, and one at its end.
    for name in ["ada", "bob", "cleo"] {
        mouse.click(name);
        seek(&mut mouse, 0.0);
        mouse.type_into("z", "-2.4");
        mouse.click("key of position");
        seek(&mut mouse, 2.0);
        mouse.type_into("z", "0");
    }
    mouse.picture("6_keys");
    seek(&mut mouse, 4.0);
    mouse.menu(&["Add", "Camera", "Around the middle"]);
    mouse.picture("7_camera");
    mouse.menu(&["Add", "Light", "Spot"]);
    mouse.type_into("intensity", "90");
    mouse.picture("8_light");
    seek(&mut mouse, 0.5);
    mouse.menu(&["Add", "Title"]);
    mouse.write("words", "Three dance");
    seek(&mut mouse, 5.5);
    mouse.menu(&["Add", "Title"]);
    mouse.write("words", "The end");
    seek(&mut mouse, 6.5);
    mouse.picture("9_titles");
    let text = mouse.desk.state().text();
    assert_eq!(text, empty.text.replace("length: 5.0", "length: 8.0") + MADE);
    assert!(mouse.desk.state().viewer.problems.is_empty(), "{:?}", mouse.desk.state().viewer.problems);
    strip();
}

/// Joins the screenshots of the steps in one image, two per row.
fn strip() {
    let Some(folder) = std::env::var_os("CHOREO_SHOTS") else { return };
    let steps = STEPS.map(|name| Path::new(&folder).join(format!("{name}.png")));
    let out = Path::new(&folder).join("by_mouse.png");
    let made = Command::new("montage")
        .args(steps)
        .args(["-resize", "50%", "-tile", "2x", "-geometry", "+4+4", "-background", "#222"])
        .arg(format!("PNG24:{}", out.display()))
        .status();
    assert!(made.is_ok_and(|made| made.success()), "montage is part of ImageMagick");
}
