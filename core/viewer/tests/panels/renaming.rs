//! Actors, cameras, lights and titles are renamed everywhere in the script: by the menu of a row, F2 and the inspector.

use crate::place::{Desk, Place, secondary_click};
use choreo_viewer::state::selection::Selected;
use choreo_viewer::state::view::ViewCamera;
use egui::{Event, Key, Modifiers, vec2};
use egui_kittest::kittest::Queryable;

const SCRIPT: &str = r##"stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves).at(-0.5, 0.0, 0.0);   // ada is on the left
ada.play(moves.clip("Walk")).until(2.0);
let bob = cast("bob", moves).at(0.5, 0.0, 0.0);
bob.face(ada);
if true { let near = ada; near.tint("red"); }
let told = `${ada.joint(`Head`).name()} and "ada"`;
let options = #{ ada: 1.0 };
let one = cast("a " + "ball", shape("sphere"));
camera("wide").at(0.0, 1.0, 5.0).look_at(ada);
let key = sun(#{ intensity: 3.0 });
key.color("white");
point(#{ position: [0.0, 2.0, 0.0] });
let words = text("Hello").from(1.0);
words.fade(0.5);
"##;

fn harness_with_script() -> Desk {
    let mut place = Place::new(SCRIPT);
    place.paint();
    place.harness(vec2(1500.0, 1000.0))
}

fn typed(desk: &mut Desk, text: &str) {
    desk.key_press_modifiers(Modifiers::COMMAND, Key::A);
    desk.event(Event::Text(text.into()));
    desk.run();
    desk.key_press(Key::Enter);
    desk.run();
}

/// The script with the actor's new name in every reference to it, and nowhere else.
fn with_eve() -> String {
    SCRIPT
        .replace("let ada = cast(\"ada\", moves)", "let eve_2 = cast(\"Eve 2\", moves)")
        .replace("ada.play", "eve_2.play")
        .replace("face(ada)", "face(eve_2)")
        .replace("near = ada", "near = eve_2")
        .replace("${ada.joint", "${eve_2.joint")
        .replace("look_at(ada)", "look_at(eve_2)")
}

#[test]
fn renaming_an_actor_in_its_row_menu_renames_all_references() {
    let mut desk = harness_with_script();
    desk.state_mut().viewer.toggles.locked.insert("ada".into());
    desk.state_mut().viewer.toggles.muted.insert(("ada".into(), 0));
    desk.state_mut().viewer.toggles.expanded.insert(("ada".into(), Some(0)));
    let head = desk.get_by_label("row ada").rect().left_center() + vec2(20.0, 0.0);
    secondary_click(&mut desk, head);
    desk.get_by_label_contains("Rename").click();
    desk.run();
    typed(&mut desk, "Eve 2");
    assert_eq!(desk.state().viewer.message, None);
    assert_eq!(desk.state().text(), with_eve());
    desk.state_mut().reload();
    desk.run();
    let viewer = &desk.state().viewer;
    assert!(viewer.problems.is_empty(), "{:?}", viewer.problems);
    assert_eq!(viewer.selection, Some(Selected::Actor("Eve 2".into())));
    assert!(viewer.toggles.locked.contains("Eve 2") && viewer.toggles.muted.contains(&("Eve 2".into(), 0)));
    assert!(viewer.toggles.expanded.contains(&("Eve 2".into(), Some(0))));
    desk.get_by_label("row Eve 2");
    desk.state_mut().viewer.undo().unwrap();
    assert_eq!(desk.state().text(), SCRIPT);
}

#[test]
fn f2_renames_cameras_lights_and_titles() {
    let mut desk = harness_with_script();
    desk.state_mut().viewer.views[0].camera = ViewCamera::Named("wide".into());
    for (what, new, wanted) in [
        (Selected::Camera("wide".into()), "far", SCRIPT.replace("camera(\"wide\")", "camera(\"far\")")),
        (
            Selected::Light(0),
            "main light",
            SCRIPT.replace("let key =", "let main_light =").replace("key.color", "main_light.color"),
        ),
        (Selected::Light(1), "lamp", SCRIPT.replace("0.0] });\nlet", "0.0], name: \"lamp\" });\nlet")),
        (Selected::Title(0), "Bye", SCRIPT.replace("\"Hello\"", "\"Bye\"")),
    ] {
        desk.state_mut().reload_with(SCRIPT);
        desk.state_mut().viewer.selection = Some(what.clone());
        desk.run();
        desk.key_press(Key::F2);
        desk.run();
        typed(&mut desk, new);
        assert_eq!(desk.state().viewer.message, None);
        assert_eq!(desk.state().text(), wanted);
        desk.state_mut().reload();
        desk.run();
        assert!(desk.state().viewer.problems.is_empty(), "{:?}", desk.state().viewer.problems);
        let shown = desk.state().viewer.timeline.lights.clone();
        match what {
            Selected::Light(0) => assert_eq!(shown[0], "main_light"),
            Selected::Light(1) => assert_eq!(shown[1], "lamp"),
            _ => assert_eq!(shown, ["key", "point light 2"]),
        }
    }
    assert_eq!(desk.state().viewer.views[0].camera, ViewCamera::Named("far".into()));
    // Escape keeps the name.
    desk.state_mut().reload_with(SCRIPT);
    desk.state_mut().viewer.selection = Some(Selected::Actor("bob".into()));
    desk.run();
    desk.key_press(Key::F2);
    desk.run();
    desk.event(Event::Text("x".into()));
    desk.run();
    desk.key_press(Key::Escape);
    desk.run();
    assert!(desk.query_by_label("new name").is_none());
    assert_eq!(desk.state().text(), SCRIPT);
}

#[test]
fn an_object_is_renamed_in_the_inspector() {
    let mut desk = harness_with_script();
    desk.state_mut().viewer.selection = Some(Selected::Actor("bob".into()));
    desk.run();
    desk.get_by_label("name field").click();
    desk.run();
    // The script calls the function `point`, so that no variable may have that name.
    typed(&mut desk, "point");
    let refused = desk.state().viewer.message.clone().unwrap();
    assert!(refused.contains("line 14 uses the name point already"), "{refused}");
    assert_eq!(desk.state().text(), SCRIPT);
    // `max` is a function of scripts, which this one does not call.
    for name in ["cleo", "max"] {
        desk.get_by_label("name field").click();
        desk.run();
        typed(&mut desk, name);
        assert_eq!(desk.state().text(), SCRIPT.replace("bob", name));
        desk.state_mut().reload();
        desk.run();
        assert!(desk.state().viewer.problems.is_empty(), "{:?}", desk.state().viewer.problems);
    }
}

#[test]
fn an_ambiguous_rename_is_refused_with_its_line() {
    let mut place = Place::new(SCRIPT);
    for (what, to, why) in [
        (Selected::Actor("ada".into()), "bob", "a.rhai: line 5: \"bob\" is the name of another cast"),
        (Selected::Actor("ada".into()), "Told", "a.rhai: line 8 uses the name told already"),
        (
            Selected::Actor("a ball".into()),
            "b",
            "a.rhai: line 10: its name, \"a \" + \"ball\", is computed; change it there",
        ),
        (Selected::Actor("ada".into()), "  ", "a.rhai: line 3: a name has at least one letter"),
    ] {
        let refused = place.viewer.rename(&what, to).unwrap_err();
        assert!(refused.to_string().ends_with(why), "{refused}");
        assert_eq!(place.text(), SCRIPT);
    }
    // Another variable of that name within a block is not renamed.
    let shadowed =
        format!("{SCRIPT}for ada in [bob] {{ ada.turn(5); }}\nfn f(ada) {{ ada }}\nada.turn(9);\n");
    place.reload_with(&shadowed);
    place.viewer.rename(&Selected::Actor("ada".into()), "eve").unwrap();
    let text = place.text();
    let end = "for ada in [bob] { ada.turn(5); }\nfn f(ada) { ada }\neve.turn(9);\n";
    assert!(text.ends_with(end) && text.contains("let eve = cast(\"eve\""), "{text}");
}
