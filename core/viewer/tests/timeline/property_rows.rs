//! Rows of single keyed properties, which open below the row with the keys of all properties.

use crate::place::{Desk, Place, drag};
use choreo_motion::Time;
use choreo_viewer::state::keyed::KeyRef;
use choreo_viewer::state::selection::Selected;
use egui::{Key, Modifiers, Pos2, pos2, vec2};
use egui_kittest::kittest::Queryable;

const SCRIPT: &str = r##"stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let cube = shape("box", #{ size: 1.0 });
let ball = cast("ball", cube).key("position", [[0.0, [0, 0, 0]], [1.0, [1, 0, 0]]]);
ball.key("rotation", [[0.0, 0], [1.0, 90]]);
let lone = cast("lone", cube).key("position", [[0.0, [0, 0, 3]], [1.0, [1, 0, 3]]]);
camera("wide").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]).key("fov", [[0.0, 40], [2.0, 50]]);
camera("near").at(0.0, 1.0, 2.0).look_at([0.0, 1.0, 0.0]).key("fov", [[0.0, 30], [2.0, 20]]);
"##;

fn click(desk: &mut Desk, label: &str) {
    let at = desk.get_by_label(label).rect().center();
    desk.hover_at(at);
    desk.run();
    desk.drag_at(at);
    desk.drop_at(at);
    desk.run();
}

fn press(desk: &mut Desk, modifiers: Modifiers, key: Key) {
    desk.key_press_modifiers(modifiers, key);
    desk.run();
}

/// Screen position of a time in a row; the ruler shows four seconds.
fn at(desk: &Desk, row: &str, secs: f32) -> Pos2 {
    let ruler = desk.get_by_label("time").rect();
    pos2(ruler.left() + ruler.width() * secs / 4.0, desk.get_by_label(row).rect().center().y)
}

/// Compares the script after a change, and undoes it.
fn expect(desk: &mut Desk, pairs: &[(&str, &str)]) {
    assert_eq!(desk.state().viewer.message, None);
    let wanted = pairs.iter().fold(SCRIPT.to_string(), |text, (old, new)| text.replace(old, new));
    assert_eq!(desk.state().text(), wanted);
    desk.state_mut().reload();
    desk.run();
    press(desk, Modifiers::COMMAND, Key::Z);
    assert_eq!(desk.state().text(), SCRIPT);
    desk.state_mut().reload();
    desk.run();
}

#[test]
fn each_keyed_property_has_its_own_editable_row() {
    let mut desk = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    let (position, rotation) = ("row ball: position", "row ball: rotation");
    assert!(desk.query_by_label(position).is_none(), "closed at first");
    assert!(
        desk.query_by_label("keyed properties of lone").is_none(),
        "the actor has keys of only one property"
    );
    click(&mut desk, "keyed properties of ball");
    let (from, to) = (at(&desk, position, 1.0), at(&desk, position, 1.4));
    drag(&mut desk, from, to);
    expect(&mut desk, &[("[1.0, [1, 0, 0]]", "[1.4, [1, 0, 0]]")]);
    let corners = [(0.7, -9.0), (1.3, 9.0)].map(|(secs, y)| at(&desk, rotation, secs) + vec2(0.0, y));
    drag(&mut desk, corners[0], corners[1]);
    let key = |secs| KeyRef {
        what: Selected::Actor("ball".into()),
        property: "rotation".into(),
        at: Time::from_secs(secs),
    };
    assert_eq!(desk.state().viewer.selected_keys(), [key(1.0)]);
    desk.state_mut().viewer.playhead.seek(Time::from_secs(2.0));
    press(&mut desk, Modifiers::COMMAND, Key::D);
    expect(&mut desk, &[("[1.0, 90]", "[1.0, 90], [2.0, 90]")]);
    desk.state_mut().viewer.select_keys(vec![key(1.0)]);
    press(&mut desk, Modifiers::NONE, Key::Delete);
    expect(&mut desk, &[(", [1.0, 90]", "")]);
    // The diamond of the upper row stands for all keys, also if some of them are selected.
    desk.state_mut().viewer.select_keys(vec![key(1.0)]);
    desk.run();
    let (from, to) = (at(&desk, "row ball", 1.0), at(&desk, "row ball", 1.4));
    drag(&mut desk, from, to);
    expect(&mut desk, &[("[1.0, [1, 0, 0]]", "[1.4, [1, 0, 0]]"), ("[1.0, 90]", "[1.4, 90]")]);
    click(&mut desk, rotation);
    assert_eq!(desk.state().viewer.selected_keys(), [key(0.0), key(1.0)]);
    click(&mut desk, "keyed properties of ball");
    assert!(desk.query_by_label(position).is_none());
    click(&mut desk, "keyed properties of camera");
    desk.get_by_label("row camera: wide field of view");
    desk.get_by_label("row camera: near field of view");
}

/// A property has the same name in its row and in the curve editor.
#[test]
fn a_property_has_the_same_name_in_rows_and_curves() {
    let script = format!(
        "{SCRIPT}{}{}",
        "let day = sun().key(\"direction\", [[0.0, [-1, -1, 0]], [1.0, [1, -1, 0]]]);\n",
        "sky(\"studio\").key(\"strength\", [[0.0, 0.0], [1.0, 1.0]]);\n"
    );
    let mut desk = Place::new(&script).harness(vec2(1500.0, 1000.0));
    press(&mut desk, Modifiers::COMMAND, Key::Num9);
    for (what, of) in
        [(Selected::Camera("wide".into()), "wide "), (Selected::Light(0), ""), (Selected::Sky, "sky ")]
    {
        desk.state_mut().viewer.selection = Some(what.clone());
        desk.run();
        let Place { viewer, .. } = desk.state();
        let rows = viewer.timeline.rows.iter().flat_map(|row| &row.events);
        let keys = rows.flat_map(|event| &event.keys).filter(|key| key.what == what);
        let mut names: Vec<&str> = keys.map(|key| key.label.strip_prefix(of).unwrap()).collect();
        names.sort_unstable();
        names.dedup();
        let curves = viewer.keyed_properties(&what);
        let mut titles: Vec<String> = curves.iter().filter(|p| p.has_keys()).map(|p| p.title()).collect();
        titles.sort_unstable();
        assert_eq!(names, titles);
        assert!(!names.is_empty());
        for name in names {
            assert!(desk.query_all_by_label_contains(&format!("curve {name}")).next().is_some(), "{name}");
        }
    }
}
