//! Keys as an animator works with them, without a window: set, moved, changed, copied, eased and deleted on the timeline and in the
//! curve editor; each gesture is a change of the script's text.

use crate::place::{Desk, Place, drag, secondary_click};
use choreo_motion::Time;
use choreo_viewer::editing::ValueDrag;
use choreo_viewer::geometry::gizmo::Change;
use choreo_viewer::state::events::EventKind;
use choreo_viewer::state::keyed::{KeyRef, KeyedProperty};
use choreo_viewer::state::selection::Selected;
use choreo_viewer::state::tangents::TangentChoice;
use egui::{Event, Key, Modifiers, PointerButton, Pos2, pos2, vec2};
use egui_kittest::kittest::Queryable;
use glam::DVec3;

const SCRIPT: &str = r##"stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let cube = shape("box", #{ size: 1.0 });
let ball = cast("ball", cube).key("position", [[0.0, [0, 0, 0]], [1.0, [1, 0, 0]], [2.0, [1, 2, 0], "in_quad"]]); // up
ball.key("rotation", [
    [0.0, 0], // still
    [f(50), 720]
]);
let ways = [[0.0, [0, 0, 0]], [2.0, [0, 0, 3]]];
let way = cast("way", cube).key("position", ways);
let rest = cast("rest", cube).at(2.0, 0.0, 0.5);
camera("wide").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]).key("fov", [[0.0, 40], [2.0, 50]], "smooth");
let lamp = point(#{ position: [0.0, 2.0, 0.0], intensity: 3.0 });
lamp.key("kelvin", [[0.0, 2700], [2.0, 6500]]);
effect("vignette", #{ strength: 0.5 }).key("strength", [[0.0, 0.1], [2.0, 0.9]]);
for x in [1.0, 2.0] { cast("one " + x, cube).key("scale", [[0.0, 1], [1.0, x]]); }
"##;

fn ball() -> Selected {
    Selected::Actor("ball".into())
}

fn key(what: Selected, property: &str, secs: f64) -> KeyRef {
    KeyRef { what, property: property.into(), at: Time::from_secs(secs) }
}

fn property(place: &Place, what: &Selected, name: &str) -> KeyedProperty {
    place.viewer.keyed_properties(what).into_iter().find(|p| p.name == name).unwrap()
}

/// Script text after a change that must be one undo step.
fn text_after(change: impl FnOnce(&mut Place)) -> String {
    let mut place = Place::new(SCRIPT);
    change(&mut place);
    assert_eq!(place.viewer.message, None);
    let text = place.text();
    assert_ne!(text, SCRIPT);
    place.reload();
    place.viewer.undo().unwrap();
    assert_eq!(place.text(), SCRIPT);
    text
}

fn replaced(pairs: &[(&str, &str)]) -> String {
    pairs.iter().fold(SCRIPT.to_string(), |text, (old, new)| {
        assert!(text.contains(old), "{old}");
        text.replace(old, new)
    })
}

/// Curves equal the values of a snapshot of the whole stage, and rotations keep the turns of the script.
#[test]
fn sampled_curves_equal_the_values_of_the_stage() {
    let mut place = Place::new(SCRIPT);
    place.viewer.selection = Some(ball());
    let scene = place.viewer.scene.clone().unwrap();
    let [position, rotation] = ["position", "rotation"].map(|name| property(&place, &ball(), name));
    let fov = property(&place, &Selected::Camera("wide".into()), "fov");
    let kelvin = property(&place, &Selected::Light(0), "kelvin");
    let strength = property(&place, &Selected::Effect(0), "strength");
    for frame in 0..100 {
        let time = scene.stage.settings.fps.time_of(frame);
        let snapshot = scene.evaluator.clone().at(time).unwrap();
        let secs = time.as_secs();
        let (_, turned, at) = snapshot.actors[0].world_from_model.to_scale_rotation_translation();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-5, "{a} for {b} at {secs}");
        position.at(time).iter().zip(at.to_array()).for_each(|(a, b)| near(*a, b));
        // Two full turns in two seconds, which a quaternion cannot represent.
        let degrees = rotation.at(time);
        assert_eq!(degrees.len(), 1);
        near(degrees[0], 360.0 * secs.min(2.0));
        let (sin, cos) = libm::sincos(degrees[0].to_radians() / 2.0);
        near((turned.y * sin + turned.w * cos).abs(), 1.0);
        let choreo_asset::Projection::Perspective { yfov, .. } = snapshot.camera.projection else { panic!() };
        near(fov.at(time)[0].to_radians(), f64::from(yfov));
        let color = snapshot.lights[0].light.color;
        kelvin.at(time).iter().zip(color.to_array()).for_each(|(a, b)| near(*a, f64::from(b)));
        let shown = snapshot.effects[0].parameters.iter().find(|(name, _)| name == "strength").unwrap().1;
        near(strength.at(time)[0], shown);
    }
}

/// An easing becomes many keys in the stage but is one key of the script.
#[test]
fn key_markers_match_the_keys_of_the_script() {
    let place = Place::new(SCRIPT);
    let row = place.viewer.timeline.rows.iter().find(|row| row.label == "ball").unwrap();
    let times: Vec<f64> = row.events.iter().map(|event| event.at.as_secs()).collect();
    assert_eq!(times, [0.0, 1.0, 2.0]);
    assert!(row.events.iter().all(|event| event.kind == EventKind::Key));
    assert_eq!(place.viewer.scene.as_ref().unwrap().stage.actors[0].channels[0].times.len(), 62);
    let lamp = place.viewer.timeline.rows.iter().find(|row| row.label == "lamp").unwrap();
    assert_eq!(lamp.events[0].key_refs(), [key(Selected::Light(0), "kelvin", 0.0)]);
}

#[test]
fn several_keys_are_moved_or_deleted_in_one_undo_step() {
    let keys = [key(ball(), "position", 1.0), key(ball(), "position", 2.0), key(ball(), "rotation", 2.0)];
    let text = text_after(|place| {
        place.viewer.select_keys(keys.to_vec());
        place.viewer.edit(|v| v.drag_keys(&keys, 0.4, None));
        // The keys stay selected at their new times.
        place.reload();
        let at: Vec<f64> = place.viewer.selected_keys().iter().map(|key| key.at.as_secs()).collect();
        assert_eq!(at, [1.4, 2.4, 2.4]);
    });
    assert_eq!(
        text,
        replaced(&[
            ("[1.0, [1, 0, 0]]", "[1.4, [1, 0, 0]]"),
            ("[2.0, [1, 2", "[2.4, [1, 2"),
            ("f(50)", "f(60)")
        ])
    );
    let text = text_after(|place| place.viewer.edit(|v| v.delete_keys(&keys)));
    assert_eq!(
        text,
        replaced(&[(", [1.0, [1, 0, 0]], [2.0, [1, 2, 0], \"in_quad\"]", ""), ("    [f(50), 720]\n", "")])
    );
    // If all keys of two properties are deleted, their calls are removed, too.
    let all: Vec<KeyRef> = [("position", 0.0), ("rotation", 0.0)]
        .map(|(name, at)| key(ball(), name, at))
        .into_iter()
        .chain(keys)
        .collect();
    let text = text_after(|place| place.viewer.edit(|v| v.delete_keys(&all)));
    assert!(text.contains("let ball = cast(\"ball\", cube); // up\nlet ways"), "{text}");
}

#[test]
fn one_value_of_several_keys_is_changed_in_place() {
    let keys = [key(ball(), "position", 1.0), key(ball(), "position", 2.0)];
    let value = ValueDrag { property: "position".into(), part: 1, offset: 0.25 };
    let text = text_after(|place| place.viewer.edit(|v| v.drag_keys(&keys, 0.2, Some(&value))));
    assert_eq!(
        text,
        replaced(&[("[1.0, [1, 0, 0]]", "[1.2, [1, 0.25, 0]]"), ("[2.0, [1, 2, 0]", "[2.2, [1, 2.25, 0]")])
    );
    let turned = [key(ball(), "rotation", 2.0)];
    let value = ValueDrag { property: "rotation".into(), part: 0, offset: 200.0 };
    let text = text_after(|place| place.viewer.edit(|v| v.drag_keys(&turned, 0.0, Some(&value))));
    assert_eq!(text, replaced(&[("720", "920")]));
    // A value is clamped to the range of its property.
    let strength = [key(Selected::Effect(0), "strength", 2.0)];
    let value = ValueDrag { property: "strength".into(), part: 0, offset: 5.0 };
    let text = text_after(|place| place.viewer.edit(|v| v.drag_keys(&strength, 0.0, Some(&value))));
    assert_eq!(text, replaced(&[("[2.0, 0.9]", "[2.0, 1.0]")]));
}

/// The other numbers of a key keep their source text, also computed ones.
#[test]
fn editing_one_number_of_a_key_keeps_the_others() {
    let script = SCRIPT
        .replace("let cube =", "let n = 0.5;\nlet cube =")
        .replace("[1.0, [1, 0, 0]]", "[1.0, [n * 2.0, 0, 1.0 / 3.0]]")
        + "text(\"Hi\").key(\"position\", [[0.0, [0.0, 0.0]], [1.0 / 3.0, [1.0 / 3.0, 0.5]]]);\n";
    let changed = |key: KeyRef, part: usize| {
        let mut place = Place::new(&script);
        let value = ValueDrag { property: "position".into(), part, offset: 0.25 };
        place.viewer.edit(|v| v.drag_keys(&[key], 0.0, Some(&value)));
        (place.text(), place.viewer.message.clone().unwrap_or_default())
    };
    let (text, message) = changed(key(ball(), "position", 1.0), 1);
    assert_eq!(message, "");
    assert_eq!(text, script.replace("[n * 2.0, 0, 1.0 / 3.0]", "[n * 2.0, 0.25, 1.0 / 3.0]"));
    let (text, message) = changed(key(Selected::Title(0), "position", 1.0 / 3.0), 1);
    assert_eq!(message, "");
    assert_eq!(text, script.replace("[1.0 / 3.0, 0.5]", "[1.0 / 3.0, 0.75]"));
    let (text, message) = changed(key(ball(), "position", 1.0), 0);
    assert!(
        message.ends_with("line 4: its position has keys that are computed; change them there"),
        "{message}"
    );
    assert_eq!(text, script);
    // Setting a key with the present value changes nothing.
    let mut place = Place::new(&script);
    place.viewer.set_keys_at(&ball(), &["position"], Time::from_secs(1.0)).unwrap();
    assert_eq!(place.text(), script);
}

#[test]
fn a_key_is_set_where_the_playhead_is() {
    let set = |what: Selected, names: &[&str], secs: f64| {
        text_after(|place| {
            place.viewer.playhead.seek(Time::from_secs(secs));
            place.viewer.edit(|v| v.set_keys(&what, names));
        })
    };
    // The first key of a property becomes a new line.
    let text = set(Selected::Actor("rest".into()), &["position", "scale"], 1.24);
    let lines = "rest.key(\"scale\", [[1.24, 1.0]]);\n";
    // The keys replace a position that is written as numbers.
    assert!(text.contains("let rest = cast(\"rest\", cube);\n"), "{text}");
    assert!(
        text.contains(lines) && text.contains("rest.key(\"position\", [[1.24, [2.0, 0.0, 0.5]]]);\n"),
        "{text}"
    );
    // Between two keys the new one gets the interpolated value.
    let text = set(ball(), &["position", "rotation"], 0.48);
    let inserted = [
        ("[1.0, [1, 0, 0]]", "[0.48, [0.48, 0.0, 0.0]], [1.0, [1, 0, 0]]"),
        ("    [f(50), 720]", "    [0.48, 172.8],\n    [f(50), 720]"),
    ];
    assert_eq!(text, replaced(&inserted));
    let text = set(Selected::Camera("wide".into()), &["fov"], 1.0);
    assert_eq!(text, replaced(&[("[2.0, 50]", "[1.0, 45.0], [2.0, 50]")]));
    let text = set(Selected::Light(0), &["kelvin", "intensity"], 1.0);
    let keys =
        [("[2.0, 6500]]);\n", "[1.0, 4600.0], [2.0, 6500]]);\nlamp.key(\"intensity\", [[1.0, 3.0]]);\n")];
    assert_eq!(text, replaced(&keys));
    let text = set(Selected::Effect(0), &["strength"], 1.0);
    assert_eq!(text, replaced(&[("[2.0, 0.9]", "[1.0, 0.5], [2.0, 0.9]")]));
    // The first key of a property does not change the image.
    let mut place = Place::new(SCRIPT);
    let before = place.viewer.scene.clone().unwrap();
    place.viewer.set_keys(&Selected::Actor("rest".into()), &["position", "rotation", "scale"]).unwrap();
    place.reload();
    let after = place.viewer.scene.clone().unwrap();
    for secs in [0.0, 1.0, 3.0] {
        let at = |scene: &choreo_session::Scene| {
            scene.evaluator.clone().at(Time::from_secs(secs)).unwrap().actors[2].world_from_model
        };
        assert_eq!(at(&before), at(&after));
    }
}

#[test]
fn editing_computed_keys_is_refused_and_offers_literal_keys() {
    let way = Selected::Actor("way".into());
    let mut place = Place::new(SCRIPT);
    let refused =
        place.viewer.drag_keys(&[key(way.clone(), "position", 2.0)], 1.0, None).unwrap_err().to_string();
    assert!(
        refused.ends_with("line 9: its position has keys that are computed; change them there"),
        "{refused}"
    );
    let mut desk = place.harness(vec2(1500.0, 1000.0));
    let line = "way.key(\"position\", [[0.0, [0.0, 0.0, 0.0]], [3.0, [0.0, 0.0, 3.0]]]);";
    desk.get_by_label(&format!("+ {line}"));
    desk.get_by_label("Add the line").click();
    desk.run();
    assert_eq!(
        desk.state().text(),
        replaced(&[("\"position\", ways);\n", &format!("\"position\", ways);\n{line}\n"))])
    );
    desk.state_mut().reload();
    // Now the line can be edited.
    desk.state_mut().viewer.drag_keys(&[key(way, "position", 3.0)], 0.4, None).unwrap();
    assert!(desk.state().text().contains("[3.4, [0.0, 0.0, 3.0]]"));
    // An object of a loop cannot be edited alone.
    desk.state_mut().reload();
    let one = Selected::Actor("one 1.0".into());
    let refused = desk.state_mut().viewer.delete_keys(&[key(one, "scale", 1.0)]).unwrap_err();
    assert!(refused.to_string().contains("this line makes 2 objects"), "{refused}");
}

#[test]
fn keys_are_copied_to_another_time_and_to_another_object() {
    let keys = [key(ball(), "position", 1.0), key(ball(), "position", 2.0)];
    let text = text_after(|place| place.viewer.edit(|v| v.duplicate_keys(&keys, 3.0)));
    assert_eq!(
        text,
        replaced(&[(
            "\"in_quad\"]]); // up",
            "\"in_quad\"], [3.0, [1, 0, 0]], [4.0, [1, 2, 0], \"in_quad\"]]); // up"
        )])
    );
    let text = text_after(|place| {
        let copied = place.viewer.copy_keys(&keys).unwrap();
        assert_eq!(copied, ".key(\"position\", [[1.0, [1, 0, 0]], [2.0, [1, 2, 0], \"in_quad\"]])");
        place.viewer.edit(|v| v.paste_keys(&Selected::Actor("rest".into()), &copied, 0.4));
    });
    let line = "rest.key(\"position\", [[0.4, [1, 0, 0]], [1.4, [1, 2, 0], \"in_quad\"]]);\n";
    assert!(text.contains(line), "{text}");
    let mut place = Place::new(SCRIPT);
    let copied = place.viewer.copy_keys(&keys).unwrap();
    let why = place.viewer.paste_keys(&Selected::Effect(0), &copied, 0.0).unwrap_err().to_string();
    assert_eq!(why, "the object has no position that keys could animate");
}

#[test]
fn easings_are_written_for_one_key_or_for_all() {
    let keys = [key(ball(), "position", 1.0), key(ball(), "position", 2.0)];
    let text = text_after(|place| place.viewer.edit(|v| v.set_key_ease(&keys, Some("\"out_sine\""))));
    assert_eq!(
        text,
        replaced(&[("[1.0, [1, 0, 0]]", "[1.0, [1, 0, 0], \"out_sine\"]"), ("in_quad", "out_sine")])
    );
    let fov = [key(Selected::Camera("wide".into()), "fov", 2.0)];
    let text = text_after(|place| place.viewer.edit(|v| v.set_key_ease(&fov, Some("\"in_expo\""))));
    assert_eq!(text, replaced(&[("[2.0, 50]], \"smooth\"", "[2.0, 50, \"in_expo\"]]")]));
    let text = text_after(|place| place.viewer.edit(|v| v.set_key_interpolation(&fov, Some("\"step\""))));
    assert_eq!(text, replaced(&[("\"smooth\"", "\"step\"")]));
}

fn harness_with_script() -> Desk {
    Place::new(SCRIPT).harness(vec2(1500.0, 1000.0))
}

fn press(desk: &mut Desk, modifiers: Modifiers, key: Key) {
    desk.key_press_modifiers(modifiers, key);
    desk.run();
}

/// Screen position of a time in the ruler, which shows four seconds.
fn x_of(desk: &Desk, secs: f32) -> f32 {
    let curves = desk.query_by_label("time of the curves");
    let ruler = curves.unwrap_or_else(|| desk.get_by_label("time")).rect();
    ruler.left() + ruler.width() * secs / 4.0
}

/// Reloads as the file watcher would, undoes the edit, and asserts that the script is the original one.
fn assert_undo_restores_the_script(desk: &mut Desk) {
    assert_eq!(desk.state().viewer.message, None);
    desk.state_mut().reload();
    desk.run();
    press(desk, Modifiers::COMMAND, Key::Z);
    assert_eq!(desk.state().text(), SCRIPT);
    desk.state_mut().reload();
    desk.run();
}

#[test]
fn diamonds_are_selected_in_a_box_moved_and_deleted_together() {
    let mut desk = harness_with_script();
    let row = desk.get_by_label("row ball").rect().center().y;
    // The diamond is at half the height of the row, since ball has no clips.
    let (left, right) = (x_of(&desk, 0.7), x_of(&desk, 2.3));
    drag(&mut desk, pos2(left, row - 9.0), pos2(right, row + 9.0));
    assert_eq!(desk.state().viewer.selected_keys().len(), 3, "{:?}", desk.state().viewer.selected_keys());
    let mark = desk.get_all_by_label_contains("on ball").filter(|n| n.rect().center().x > left).count();
    assert_eq!(mark, 2);
    let from = pos2(x_of(&desk, 1.0), row);
    let to = pos2(x_of(&desk, 1.4), row);
    drag(&mut desk, from, to);
    assert_eq!(
        desk.state().text(),
        replaced(&[
            ("[1.0, [1, 0, 0]]", "[1.4, [1, 0, 0]]"),
            ("[2.0, [1, 2", "[2.4, [1, 2"),
            ("f(50)", "f(60)")
        ])
    );
    assert_undo_restores_the_script(&mut desk);
    drag(&mut desk, pos2(left, row - 9.0), pos2(right, row + 9.0));
    press(&mut desk, Modifiers::NONE, Key::Delete);
    assert!(
        !desk.state().text().contains("in_quad") && !desk.state().text().contains("720"),
        "{}",
        desk.state().text()
    );
    assert_undo_restores_the_script(&mut desk);
    // One by one with Ctrl.
    let click = |desk: &mut Desk, at: Pos2, modifiers: Modifiers| {
        desk.hover_at(at);
        desk.run();
        for pressed in [true, false] {
            let button = PointerButton::Primary;
            desk.event_modifiers(Event::PointerButton { pos: at, button, pressed, modifiers }, modifiers);
            desk.run();
        }
    };
    click(&mut desk, from, Modifiers::NONE);
    assert_eq!(desk.state().viewer.selected_keys(), [key(ball(), "position", 1.0)]);
    assert_eq!(desk.state().viewer.playhead.frame(), 25);
    let second = pos2(x_of(&desk, 2.0), row);
    click(&mut desk, second, Modifiers::COMMAND);
    assert_eq!(desk.state().viewer.selected_keys().len(), 3);
    click(&mut desk, second, Modifiers::COMMAND);
    assert_eq!(desk.state().viewer.selected_keys().len(), 1);
}

#[test]
fn the_key_menu_sets_easing_and_value_and_deletes() {
    let mut desk = harness_with_script();
    let row = desk.get_by_label("row ball").rect().center().y;
    let at = pos2(x_of(&desk, 1.0), row);
    secondary_click(&mut desk, at);
    desk.get_by_label_contains("Easing into the key").click();
    desk.run();
    desk.get_by_label("in_out_cubic").click();
    desk.run();
    assert_eq!(desk.state().text(), replaced(&[("[1.0, [1, 0, 0]]", "[1.0, [1, 0, 0], \"in_out_cubic\"]")]));
    assert_undo_restores_the_script(&mut desk);
    secondary_click(&mut desk, at);
    let field = desk.get_by_label("position y of the key").rect().center();
    drag(&mut desk, field, field + vec2(50.0, 0.0));
    let text = desk.state().text();
    assert!(text.contains("[1.0, [1, 0.") && !text.contains("[1.0, [1, 0, 0]]"), "{text}");
    press(&mut desk, Modifiers::NONE, Key::Escape);
    assert_undo_restores_the_script(&mut desk);
    secondary_click(&mut desk, at);
    desk.get_by_label_contains("Delete").click();
    desk.run();
    assert_eq!(desk.state().text(), replaced(&[("[1.0, [1, 0, 0]], ", "")]));
    assert_undo_restores_the_script(&mut desk);
}

/// The curve editor in place of the sequencer, with the ball's curves.
fn curves() -> Desk {
    let mut desk = harness_with_script();
    desk.state_mut().viewer.selection = Some(ball());
    press(&mut desk, Modifiers::COMMAND, Key::Num9);
    // Rotations have a much larger range than positions.
    let turns = desk.get_by_label("curve rotation").rect().center();
    desk.hover_at(turns);
    desk.run();
    desk.drag_at(turns);
    desk.drop_at(turns);
    desk.run();
    desk
}

#[test]
fn points_of_curves_are_dragged_in_time_and_value() {
    let mut desk = curves();
    let plot = desk.get_by_label("curves").rect();
    let y = |desk: &Desk, value: f64| {
        let values = desk.state().viewer.curves.values;
        plot.bottom() - ((value - values.from) / (values.to - values.from)) as f32 * plot.height()
    };
    let at = pos2(x_of(&desk, 2.0), y(&desk, 2.0));
    let found = desk.get_by_label("key position y at 50").rect().center();
    assert!((found - at).length() < 1.0, "{found:?} for {at:?}");
    let to = pos2(x_of(&desk, 2.4), y(&desk, 1.5));
    drag(&mut desk, at, to);
    let text = desk.state().text();
    let start = text.find("[2.4, [1, ").unwrap_or_else(|| panic!("{text}")) + 10;
    let number: f64 = text[start..].split(',').next().unwrap().parse().unwrap();
    let point = (desk.state().viewer.curves.values.to - desk.state().viewer.curves.values.from)
        / f64::from(plot.height());
    assert!((number - 1.5).abs() < 1.5 * point, "{number}");
    assert_eq!(
        text,
        replaced(&[(
            "[2.0, [1, 2, 0]",
            &format!("[2.4, [1, {}, 0]", choreo_session::edit::format_number(number))
        )])
    );
    assert_undo_restores_the_script(&mut desk);
    // Shift restricts the drag to the axis with the larger movement.
    desk.key_down_modifiers(Modifiers::SHIFT, Key::ArrowUp);
    let (from, to) = (at, pos2(x_of(&desk, 2.4), at.y + 12.0));
    desk.hover_at(from);
    desk.run();
    for (pos, pressed) in [(from, Some(true)), (to, None), (to, Some(false))] {
        let (button, modifiers) = (PointerButton::Primary, Modifiers::SHIFT);
        desk.event_modifiers(Event::PointerMoved(pos), modifiers);
        desk.run();
        if let Some(pressed) = pressed {
            desk.event_modifiers(Event::PointerButton { pos, button, pressed, modifiers }, modifiers);
            desk.run();
        }
    }
    assert_eq!(desk.state().text(), replaced(&[("[2.0, [1, 2", "[2.4, [1, 2")]));
}

#[test]
fn a_box_of_points_is_deleted_and_home_fits_them() {
    let mut desk = curves();
    let plot = desk.get_by_label("curves").rect();
    let corners =
        [(0.8, plot.top() + 2.0), (2.2, plot.bottom() - 2.0)].map(|(secs, y)| pos2(x_of(&desk, secs), y));
    drag(&mut desk, corners[0], corners[1]);
    let keys = [key(ball(), "position", 1.0), key(ball(), "position", 2.0)];
    assert_eq!(desk.state().viewer.selected_keys(), keys);
    desk.hover_at(plot.center());
    desk.run();
    press(&mut desk, Modifiers::NONE, Key::Home);
    let span = desk.state().viewer.curves.time;
    assert!(span.from > 0.5 && span.from < 1.0 && span.to > 2.0 && span.to < 2.5, "{span:?}");
    assert_eq!(desk.state().viewer.playhead.frame(), 0);
    press(&mut desk, Modifiers::NONE, Key::Delete);
    assert_eq!(desk.state().text(), replaced(&[(", [1.0, [1, 0, 0]], [2.0, [1, 2, 0], \"in_quad\"]", "")]));
    assert_undo_restores_the_script(&mut desk);
}

/// Undo and redo of a key edit select the keys at their present times.
#[test]
fn keys_stay_selected_when_a_change_of_them_is_undone() {
    let mut place = Place::new(SCRIPT);
    let keys = [key(ball(), "position", 1.0), key(ball(), "rotation", 2.0)];
    let moved = [key(ball(), "position", 1.4), key(ball(), "rotation", 2.4)];
    place.viewer.select_keys(keys.to_vec());
    place.viewer.edit(|v| v.drag_keys(&keys, 0.4, None));
    place.reload();
    for _ in 0..2 {
        assert_eq!(place.viewer.selected_keys(), moved);
        place.viewer.undo().unwrap();
        place.reload();
        assert_eq!(place.viewer.selected_keys(), keys);
        place.viewer.redo().unwrap();
        place.reload();
    }
    place.viewer.edit(|v| v.delete_keys(&moved));
    place.reload();
    assert!(place.viewer.selected_keys().is_empty());
    place.viewer.undo().unwrap();
    place.reload();
    assert_eq!(place.viewer.selected_keys(), moved);
    // A newer selection is kept.
    place.viewer.edit(|v| v.delete_keys(&moved));
    place.reload();
    place.viewer.selection = Some(Selected::Light(0));
    place.viewer.undo().unwrap();
    place.reload();
    assert_eq!(place.viewer.selection, Some(Selected::Light(0)));
    assert!(place.viewer.selected_keys().is_empty());
}

/// Delete over the curve editor deletes selected keys and never the actor.
#[test]
fn delete_over_the_curve_editor_deletes_only_keys() {
    let mut desk = curves();
    let plot = desk.get_by_label("curves").rect();
    desk.hover_at(plot.center());
    desk.run();
    assert!(desk.state().viewer.selected_keys().is_empty());
    press(&mut desk, Modifiers::NONE, Key::Delete);
    assert_eq!(desk.state().text(), SCRIPT);
    let viewer = &desk.state().viewer;
    assert_eq!((viewer.message.as_deref(), viewer.refusals), (Some("no key is selected"), 1));
    assert_eq!(viewer.selection, Some(ball()));
}

/// The menu of a key stays open while numbers are typed; only a command, Escape or a click outside closes it.
#[test]
fn the_menu_of_a_key_stays_while_numbers_are_typed() {
    let mut desk = harness_with_script();
    let row = desk.get_by_label("row ball").rect().center().y;
    let at = pos2(x_of(&desk, 1.0), row);
    secondary_click(&mut desk, at);
    let typed = |desk: &mut Desk, label: &str, text: &str| {
        desk.get_by_label(label).click();
        desk.run();
        desk.key_press_modifiers(Modifiers::COMMAND, Key::A);
        desk.event(Event::Text(text.into()));
        desk.run();
        desk.key_press(Key::Enter);
        desk.run();
        assert_eq!(desk.state().viewer.message, None);
        desk.get_by_label("position y of the key");
        desk.state_mut().reload();
        // The menu finds its moved key again.
        desk.run();
        desk.run();
    };
    typed(&mut desk, "position y of the key", "0.5");
    // Moved past the next key, it is another key of the row.
    typed(&mut desk, "time of position", "3.0");
    typed(&mut desk, "position x of the key", "1.5");
    let keys = "[[0.0, [0, 0, 0]], [2.0, [1, 2, 0], \"in_quad\"], [3.0, [1.5, 0.5, 0]]]";
    assert!(desk.state().text().contains(keys), "{}", desk.state().text());
    // Expressions and frame numbers keep their source text.
    typed(&mut desk, "position x of the key", "4/3");
    typed(&mut desk, "time of position", "8/3");
    assert!(desk.state().text().contains("[8.0 / 3.0, [4.0 / 3.0, 0.5, 0]]"), "{}", desk.state().text());
    typed(&mut desk, "time of position", "f(75)");
    assert!(desk.state().text().contains("[f(75), [4.0 / 3.0, 0.5, 0]]"), "{}", desk.state().text());
    press(&mut desk, Modifiers::NONE, Key::Escape);
    assert!(desk.query_by_label("position y of the key").is_none());
    let third = pos2(x_of(&desk, 3.0), row);
    secondary_click(&mut desk, third);
    desk.get_by_label("position y of the key");
    let beside = pos2(40.0, 300.0);
    drag(&mut desk, beside, beside);
    assert!(desk.query_by_label("position y of the key").is_none());
}

/// A typed expression replaces digits of the same value.
#[test]
fn typing_the_displayed_digits_keeps_the_expression() {
    let scene = "stage(#{ size: [64, 36], fps: 30, length: 4.0 });
let cube = shape(\"box\", #{ size: 1.0 });
cast(\"ball\", cube).key(\"scale\", [[0.0, 1], [0.333333333, 0.333], [2.0, 0.333]]);
";
    let mut desk = Place::new(scene).harness(vec2(1500.0, 1000.0));
    let at = pos2(x_of(&desk, 1.0 / 3.0), desk.get_by_label("row ball").rect().center().y);
    secondary_click(&mut desk, at);
    for (label, written) in
        [("scale  of the key", "[0.333333333, 1.0 / 3.0]"), ("time of scale", "[1.0 / 3.0, 1.0 / 3.0]")]
    {
        desk.get_by_label(label).click();
        desk.run();
        desk.key_press_modifiers(Modifiers::COMMAND, Key::A);
        desk.event(Event::Text("1/3".into()));
        desk.run();
        desk.key_press(Key::Enter);
        desk.run();
        assert_eq!(desk.state().viewer.message, None);
        assert_eq!(desk.state().text(), scene.replace("[0.333333333, 0.333]", written));
        desk.state_mut().reload();
        desk.run();
        desk.run();
    }
}

/// Fit changes only the view of the curves, and newly shown curves are entirely visible.
#[test]
fn curves_are_fitted_to_the_view_when_first_shown() {
    let mut desk = harness_with_script();
    let shown = choreo_viewer::state::span::Span { from: 3.0, to: 3.5 };
    desk.state_mut().viewer.visible_span = shown;
    desk.state_mut().viewer.curves.time = shown;
    desk.state_mut().viewer.curves.values = choreo_viewer::state::span::Span { from: 100.0, to: 101.0 };
    desk.state_mut().viewer.selection = Some(ball());
    press(&mut desk, Modifiers::COMMAND, Key::Num9);
    let fits = |desk: &Desk| {
        let curves = &desk.state().viewer.curves;
        // The keys lie between 0 and 2 s, the values between 0 and 720°.
        assert!(
            curves.time.from <= 0.0 && curves.time.to >= 2.0 && curves.time.to < 2.5,
            "{:?}",
            curves.time
        );
        assert!(curves.values.from <= 0.0 && curves.values.to >= 720.0, "{:?}", curves.values);
        assert!(desk.query_by_label("key rotation at 50").is_some());
        assert_eq!(desk.state().viewer.visible_span, shown);
    };
    fits(&desk);
    // A view set by the user stays until Fit is pressed.
    desk.state_mut().viewer.curves.time = shown;
    desk.run();
    assert_eq!(desk.state().viewer.curves.time, shown);
    desk.get_by_label("Fit").click();
    desk.run();
    fits(&desk);
}

/// No tooltip covers a dragged object.
#[test]
fn tooltips_are_hidden_while_a_mouse_button_is_down() {
    let mut desk = Place::new(PARTS).harness(vec2(1500.0, 1000.0));
    // Next to the key in the middle of the bar.
    let bar = desk.get_by_label("Walk on ada").rect().center() + vec2(60.0, 3.0);
    let hint = |desk: &Desk| {
        let texts = desk.output().shapes.iter().filter_map(|shape| match &shape.shape {
            egui::Shape::Text(text) => Some(text.galley.text()),
            _ => None,
        });
        texts.filter(|text| text.starts_with("Walk\n")).count() > 0
    };
    desk.hover_at(bar);
    (0..8).for_each(|_| desk.step());
    assert!(hint(&desk), "over the bar");
    desk.drag_at(bar);
    desk.step();
    desk.step();
    assert!(!hint(&desk), "pressed");
    desk.hover_at(bar + vec2(30.0, 0.0));
    (0..8).for_each(|_| desk.step());
    assert!(!hint(&desk), "dragged");
}

/// The control points of a Bézier easing lie between its keys as in CSS, and can be dragged.
#[test]
fn the_handles_of_a_bezier_easing_are_dragged() {
    let mut desk = curves();
    let bezier = SCRIPT.replace("\"in_quad\"", "[0.4, 0.0, 0.6, 1.0]");
    desk.state_mut().reload_with(&bezier);
    desk.state_mut().viewer.select_keys(vec![key(ball(), "position", 2.0)]);
    desk.run();
    let [from, to] =
        ["key position y at 25", "key position y at 50"].map(|name| desk.get_by_label(name).rect().center());
    let place = |x: f32, y: f32| from + vec2((to.x - from.x) * x, (to.y - from.y) * y);
    // Of x, y and z only y changes; the points of the others lie on flat lines.
    let found: Vec<Pos2> = desk.get_all_by_label("start of the easing").map(|n| n.rect().center()).collect();
    assert!(found.iter().any(|at| (*at - place(0.4, 0.0)).length() < 1.0), "{found:?}");
    let end = place(0.6, 1.0);
    drag(&mut desk, end, place(0.8, 0.5));
    assert_eq!(desk.state().text(), bezier.replace("0.6, 1.0]", "0.8, 0.5]"));
}

#[test]
fn the_k_key_and_the_inspector_diamonds_set_keys() {
    let mut desk = harness_with_script();
    desk.state_mut().viewer.selection = Some(ball());
    desk.state_mut().viewer.playhead.seek(Time::from_secs(0.48));
    desk.run();
    press(&mut desk, Modifiers::NONE, Key::K);
    let both = [
        ("[1.0, [1, 0, 0]]", "[0.48, [0.48, 0.0, 0.0]], [1.0, [1, 0, 0]]"),
        ("    [f(50), 720]", "    [0.48, 172.8],\n    [f(50), 720]"),
    ];
    assert_eq!(desk.state().text(), replaced(&both));
    assert_undo_restores_the_script(&mut desk);
    desk.get_by_label("key of scale").click();
    desk.run();
    assert!(desk.state().text().contains("ball.key(\"scale\", [[0.48, 1.0]]);\n"), "{}", desk.state().text());
    assert_undo_restores_the_script(&mut desk);
    // On an existing key the diamond deletes it.
    desk.state_mut().viewer.playhead.seek(Time::from_secs(1.0));
    desk.run();
    desk.get_by_label("key of position").click();
    desk.run();
    assert_eq!(desk.state().text(), replaced(&[("[1.0, [1, 0, 0]], ", "")]));
    assert_undo_restores_the_script(&mut desk);
    // A keyed parameter of an effect is changed at the playhead.
    desk.state_mut().viewer.set_value(&Selected::Effect(0), "strength", "0.25").unwrap();
    assert_eq!(desk.state().text(), replaced(&[("[2.0, 0.9]", "[1.0, 0.25], [2.0, 0.9]")]));
}

/// A camera and an effect have bars, which are selected with their keys; commands still apply to the keys.
#[test]
fn keys_of_objects_with_bars_are_duplicated_copied_and_cut_by_keyboard() {
    let mut desk = harness_with_script();
    desk.state_mut().viewer.playhead.seek(Time::from_secs(0.48));
    let fov = key(Selected::Camera("wide".into()), "fov", 2.0);
    desk.state_mut().viewer.select_keys(vec![fov]);
    desk.run();
    press(&mut desk, Modifiers::COMMAND, Key::D);
    assert_eq!(desk.state().text(), replaced(&[("[0.0, 40], ", "[0.0, 40], [0.48, 50], ")]));
    assert_undo_restores_the_script(&mut desk);
    let strength = key(Selected::Effect(0), "strength", 2.0);
    desk.state_mut().viewer.select_keys(vec![strength]);
    desk.run();
    desk.event(Event::Copy);
    desk.run_steps(1);
    assert_eq!(desk.state().text(), SCRIPT);
    let copied = desk.output().platform_output.commands.iter().find_map(|command| match command {
        egui::OutputCommand::CopyText(text) => Some(text.clone()),
        _ => None,
    });
    let copied = copied.unwrap();
    assert_eq!(copied, ".key(\"strength\", [[2.0, 0.9]])");
    desk.event(Event::Paste(copied));
    desk.run();
    assert_eq!(desk.state().text(), replaced(&[("[0.0, 0.1], ", "[0.0, 0.1], [0.48, 0.9], ")]));
    assert_undo_restores_the_script(&mut desk);
    desk.state_mut().viewer.select_keys(vec![key(Selected::Effect(0), "strength", 2.0)]);
    desk.run();
    desk.event(Event::Cut);
    desk.run();
    assert_eq!(desk.state().text(), replaced(&[(", [2.0, 0.9]", "")]));
    assert_undo_restores_the_script(&mut desk);
}

#[test]
fn the_k_key_sets_no_keys_on_hidden_curves() {
    let mut desk = curves();
    desk.state_mut().viewer.playhead.seek(Time::from_secs(0.48));
    desk.run();
    press(&mut desk, Modifiers::NONE, Key::K);
    let inserted = "[0.48, [0.48, 0.0, 0.0]], [1.0, [1, 0, 0]]";
    assert_eq!(desk.state().text(), replaced(&[("[1.0, [1, 0, 0]]", inserted)]));
    assert_undo_restores_the_script(&mut desk);
    let hidden = &mut desk.state_mut().viewer.curves.hidden;
    let hide = |what: Selected| (0..3).map(move |part| (what.clone(), "position".to_string(), part));
    hidden.extend(hide(Selected::Actor("way".into())));
    desk.run();
    press(&mut desk, Modifiers::NONE, Key::K);
    assert_eq!(desk.state().text(), replaced(&[("[1.0, [1, 0, 0]]", inserted)]), "those of another thing");
    assert_undo_restores_the_script(&mut desk);
    desk.state_mut().viewer.curves.hidden.extend(hide(ball()));
    desk.run();
    press(&mut desk, Modifiers::NONE, Key::K);
    let message = desk.state().viewer.message.clone().unwrap_or_default();
    assert!(message.starts_with("all curves of the selection are hidden"), "{message}");
    assert_eq!(desk.state().text(), SCRIPT);
}

/// Keys of a clip with an easing appear as in the script, whether written as an option or a method: in rows and in the inspector.
#[test]
fn eased_keys_of_a_clip_are_not_treated_as_samples() {
    const KEYS: &str = "[[1.0, 1.0], [2.0, 0.0, \"in_cubic\"]]";
    for played in [format!(", #{{ weight: {KEYS} }})"), format!(").weight({KEYS})")] {
        let script = format!(
            "stage(#{{ size: [64, 36], fps: 25, length: 4.0 }});
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Walk\")).until(3.0)
    .then(moves.clip(\"Wave\"){played};
"
        );
        let mut place = Place::new(&script);
        let row = place.viewer.timeline.rows.iter().find(|row| row.label == "ada").unwrap();
        let keys = row.events.iter().filter(|event| event.kind == EventKind::Key);
        assert_eq!(keys.map(|event| event.at.as_secs()).collect::<Vec<_>>(), [1.0, 2.0], "{played}");
        place.viewer.selection = Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: 1 });
        place.harness(vec2(1500.0, 1000.0)).get_by_label("2 keys, 1.00 to 2.00 s");
    }
}

/// The menu shows all easings at once, without scrolling.
#[test]
fn the_easing_menu_fits_the_window_in_columns() {
    let mut desk = curves();
    let at = desk.get_by_label("key position y at 50").rect().center();
    secondary_click(&mut desk, at);
    desk.get_by_label_contains("Easing into the key").click();
    desk.run();
    let names = choreo_script::easing_names();
    let places: Vec<egui::Rect> = names.iter().map(|name| desk.get_by_label(name).rect()).collect();
    let all = places.iter().fold(egui::Rect::NOTHING, |all, place| all.union(*place));
    assert!(egui::Rect::from_min_size(Pos2::ZERO, vec2(1500.0, 1000.0)).contains_rect(all), "{all:?}");
    assert!(all.height() < 360.0, "{all:?}");
    let overlaps = |n: usize| places[..n].iter().any(|other| other.shrink(1.0).intersects(places[n]));
    assert!(!(0..places.len()).any(overlaps), "{places:?}");
}

/// The speed of a straight line is constant from its first key to its last, and zero after it.
#[test]
fn the_speed_at_a_key_is_one_sided() {
    let mut place = Place::new(SCRIPT);
    place.viewer.curves.shows_speed = true;
    let speed = |name: &str, secs: f64| {
        place.viewer.curves.displayed_values(
            &property(&place, &ball(), name),
            Time::from_secs(secs),
            (0.0, 1.0),
        )[0]
    };
    for (name, secs, expected) in [
        ("rotation", 0.0, 360.0),
        ("rotation", 1.0, 360.0),
        ("rotation", 2.0, 360.0),
        ("rotation", 2.01, 0.0),
        ("position", 0.0, 1.0),
        ("position", 0.9999, 1.0),
        ("position", 1.0, 0.0),
    ] {
        assert!((speed(name, secs) - expected).abs() < 1e-3, "{name} at {secs}: {}", speed(name, secs));
    }
}

/// The curve editor labels an effect as the other panels do.
#[test]
fn curves_of_an_effect_are_labeled_with_its_name() {
    let mut desk = curves();
    let named = desk.query_all_by_label("vignette").count();
    desk.state_mut().viewer.selection = Some(Selected::Effect(0));
    desk.run();
    assert!(desk.query_by_label("effect 1").is_none());
    // The inspector and the header of the curve editor show the name.
    assert!(desk.query_all_by_label("vignette").count() >= named + 2);
}

/// Curves and key menus of a locked row are shown, but cannot change anything.
#[test]
fn keys_of_a_locked_row_cannot_be_changed_in_curves_or_menus() {
    type Act = fn(&mut Desk, Pos2);
    let acts: [(&str, Act); 6] = [
        ("drag", |desk, at| drag(desk, at, at + vec2(40.0, 30.0))),
        ("menu", |desk, at| {
            secondary_click(desk, at);
            desk.get_by_label_contains("Delete").click();
            desk.run();
        }),
        ("duplicate", |desk, _| {
            desk.state_mut().viewer.select_keys(vec![key(ball(), "position", 2.0)]);
            press(desk, Modifiers::COMMAND, Key::D);
        }),
        ("set", |desk, _| press(desk, Modifiers::NONE, Key::K)),
        ("paste", |desk, _| {
            desk.event(Event::Paste(".key(\"position\", [[1.0, [1, 0, 0]]])".into()));
            desk.run();
        }),
        ("double click", |desk, at| {
            let pos = pos2(x_of(desk, 3.2), at.y);
            desk.hover_at(pos);
            desk.run();
            let click = |pressed| {
                let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
                Event::PointerButton { pos, button, pressed, modifiers }
            };
            // Both clicks within one frame: a frame of the harness takes longer than a double click.
            desk.input_mut().events.extend([true, false, true, false].map(click));
            desk.run();
        }),
    ];
    for (name, act) in acts {
        for locked in [true, false] {
            let mut desk = curves();
            desk.state_mut().viewer.playhead.seek(Time::from_secs(0.48));
            if locked {
                desk.state_mut().viewer.toggles.locked.insert("ball".into());
            }
            desk.run();
            let at = desk.get_by_label("key position y at 50").rect().center();
            act(&mut desk, at);
            let message = desk.state().viewer.message.clone().unwrap_or_default();
            assert_eq!(message.contains("the row of ball is locked"), locked, "{name}: {message}");
            assert_eq!(desk.state().text() == SCRIPT, locked, "{name}: {message}");
        }
    }
}

/// Diamonds and fields of the inspector are refused for a locked row, as in the timeline.
#[test]
fn the_inspector_of_a_locked_row_changes_nothing() {
    type Act = fn(&mut Desk);
    let acts: [(&str, Act); 3] = [
        ("sets a key", |desk| desk.get_by_label("key of scale").click()),
        ("deletes a key", |desk| desk.get_by_label("key of position").click()),
        ("types", |desk| {
            desk.get_by_label("x").click();
            desk.run();
            desk.key_press_modifiers(Modifiers::COMMAND, Key::A);
            desk.event(Event::Text("3".into()));
            desk.run();
            desk.key_press(Key::Enter);
        }),
    ];
    for (name, act) in acts {
        for locked in [true, false] {
            let mut desk = harness_with_script();
            desk.state_mut().viewer.selection = Some(ball());
            if locked {
                desk.state_mut().viewer.toggles.locked.insert("ball".into());
            }
            desk.run();
            act(&mut desk);
            desk.run();
            let message = desk.state().viewer.message.clone().unwrap_or_default();
            assert_eq!(message.contains("the row of ball is locked"), locked, "{name}: {message}");
            assert_eq!(desk.state().text() == SCRIPT, locked, "{name}: {message}");
        }
    }
}

/// The script with keys of every kind and interpolation, some with tangents and easings.
fn shaped(how: &str) -> String {
    format!(
        r##"stage(#{{ size: [64, 36], fps: 25, length: 4.0 }});
let cube = shape("box", #{{ size: 1.0 }});
let ball = cast("ball", cube).key("position", [[0.0, [0, 0, 0]], [1.0, [1, 3, 0], #{{ out_tangent: [1, -2, 4] }}], [2.0, [2, 4, 1]], [3.6, [0, 0, 0], #{{ tangent: 1 }}], [4.0, [0, 0, 0]]]{how});
ball.key("rotation", [[0.0, [0, 0, 0]], [1.0, [20, 0, 0], #{{ tangent: [0, 30, 0], in_weight: 0.5 }}], [2.0, [30, 10, 0]], [4.0, [0, 0, 0]]]{how});
ball.key("scale", [[0.0, 1], [1.0, 2, #{{ tangent: 0 }}], [4.0, 1]]{how});
ball.key("tint", [[0.0, "black"], [2.0, "white", #{{ in_tangent: [1, 0, 0] }}], [4.0, "black"]]{how});
camera("wide").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]).key("fov", [[0.0, 40], [2.0, 50, #{{ tangent: -8 }}], [4.0, 30]]{how});
"##
    )
}

/// Handles are tangent to the curve of the stage, whose slope beside a key is measured numerically.
#[test]
fn tangent_handles_have_the_slopes_of_the_curves() {
    for how in ["", ", \"smooth\"", ", \"cubic\"", ", \"catmull_rom\""] {
        let place = Place::new(&shaped(how));
        let mut counted = 0;
        for what in [ball(), Selected::Camera("wide".into())] {
            for keyed in place.viewer.keyed_properties(&what).iter().filter(|keyed| keyed.has_keys()) {
                for (key, at) in keyed.keys.iter().enumerate() {
                    for (side, handle) in keyed.handles(key).iter().enumerate() {
                        let Some(handle) = handle else { continue };
                        let step = Time::from_secs(if side == 0 { -1e-4 } else { 1e-4 });
                        let [now, then] = [*at, *at + step].map(|time| keyed.at(time));
                        for (part, tangent) in handle.tangent.iter().enumerate() {
                            let slope = (then[part] - now[part]) / step.as_secs();
                            // Rotations are samples of the stage, a few degrees apart.
                            let most = if keyed.name == "rotation" { 3.0 } else { 0.01 };
                            let shown = format!("{how} {} {part} at {} {side}", keyed.name, at.as_secs());
                            assert!((slope - tangent).abs() < most, "{shown}: {slope} for {tangent}");
                            counted += 1;
                        }
                    }
                }
            }
        }
        assert_eq!(counted, 3 * 8 + 3 * 6 + 4 + 3 * 4 + 4, "{how}");
    }
}

#[test]
fn tangents_are_chosen_for_all_selected_keys() {
    let keys = [key(ball(), "position", 1.0), key(ball(), "position", 2.0)];
    let chosen = |choice| text_after(|place| place.viewer.edit(|v| v.set_key_tangents(&keys, choice)));
    let both = |first: &str, second: &str| {
        let of = |number: &str, more: &str| format!("[{number}, 0]{more}");
        replaced(&[
            ("[1.0, [1, 0, 0]]", &of("1.0, [1, 0", &format!(", #{{ {first} }}]"))),
            (
                "[2.0, [1, 2, 0], \"in_quad\"]",
                &of("2.0, [1, 2", &format!(", #{{ ease: \"in_quad\", {second} }}]")),
            ),
        ])
    };
    assert_eq!(chosen(TangentChoice::Flat), both("tangent: 0.0", "out_tangent: 0.0"));
    // Monotone: x rises to the key and stays, y stays and rises; a position keeps its direction.
    let monotone = chosen(TangentChoice::Monotone);
    assert_eq!(monotone, both("tangent: [0.5, 1.0, 0.0]", "out_tangent: 0.0"));
    let linear = "in_tangent: [1.0, 0.0, 0.0], out_tangent: [0.0, 2.0, 0.0]";
    assert_eq!(chosen(TangentChoice::Linear), both(linear, "out_tangent: [0.0, 2.0, 0.0]"));
    let mut place = Place::new(&monotone);
    place.viewer.set_key_tangents(&keys[..1], TangentChoice::Broken).unwrap();
    assert!(place.text().contains("#{ in_tangent: [0.5, 1.0, 0.0], out_tangent: [0.5, 1.0, 0.0] }"));
    place.reload();
    place.viewer.set_key_tangents(&keys, TangentChoice::Automatic).unwrap();
    assert_eq!(place.text(), SCRIPT);
    let kelvin = [key(Selected::Light(0), "kelvin", 0.0)];
    let refused = place.viewer.set_key_tangents(&kelvin, TangentChoice::Flat).unwrap_err().to_string();
    assert!(refused.contains("a.rhai:12: keys of the property kelvin cannot have tangents"), "{refused}");
}

/// Drags with modifier keys held.
fn drag_with(desk: &mut Desk, modifiers: Modifiers, from: Pos2, to: Pos2) {
    desk.hover_at(from);
    desk.run();
    for (pos, pressed) in
        [(from, Some(true)), (from + (to - from) * 0.5, None), (to, None), (to, Some(false))]
    {
        desk.event_modifiers(Event::PointerMoved(pos), modifiers);
        desk.run();
        if let Some(pressed) = pressed {
            let button = PointerButton::Primary;
            desk.event_modifiers(Event::PointerButton { pos, button, pressed, modifiers }, modifiers);
            desk.run();
        }
    }
}

/// Numbers that follow a name in a text.
fn numbers_after(text: &str, name: &str) -> Vec<f64> {
    let start = text.find(name).unwrap_or_else(|| panic!("{name} in {text}")) + name.len();
    let inside = text[start..].trim_start().trim_start_matches('[').split([']', '}', '#']).next().unwrap();
    inside.split(',').map_while(|number| number.trim().parse().ok()).collect()
}

#[test]
fn handles_of_tangents_are_dragged_aligned_broken_and_longer() {
    let mut desk = curves();
    let straight = SCRIPT.replace(", \"in_quad\"", "");
    desk.state_mut().reload_with(&straight);
    desk.state_mut().viewer.select_keys(vec![key(ball(), "position", 1.0)]);
    desk.run();
    let center = |desk: &Desk, name: &str| desk.get_by_label(name).rect().center();
    let [before, here, after] = ["key position y at 0", "key position y at 25", "key position y at 50"]
        .map(|name| center(&desk, name));
    // A third of each span, in the direction of the next key.
    let tip = center(&desk, "tangent of position y out of 25");
    assert!((tip - (here + (after - here) / 3.0)).length() < 1.5, "{tip:?}");
    let tip_before = center(&desk, "tangent of position y into 25");
    assert!((tip_before - (here + (before - here) / 3.0)).length() < 1.5, "{tip_before:?}");
    // Points per second and per two metres.
    let (second, metre) = (here.x - before.x, (here.y - after.y) / 2.0);
    let slope = |to: Pos2| f64::from((here.y - to.y) / metre) / f64::from((to.x - here.x) / second);
    let reloaded = |desk: &mut Desk| {
        assert_eq!(desk.state().viewer.message, None);
        desk.state_mut().reload();
        desk.run();
    };
    let to = tip + vec2(6.0, -15.0);
    drag(&mut desk, tip, to);
    let text = desk.state().text();
    // The other components keep their slope on each side.
    let [into, out] = ["in_tangent:", "out_tangent:"].map(|name| numbers_after(&text, name));
    assert!((out[1] - slope(to)).abs() < 0.05 && out[1] > 2.1, "{text}");
    assert_eq!((into, out.clone()), (vec![1.0, out[1], 0.0], vec![0.0, out[1], 0.0]));
    reloaded(&mut desk);
    // A tangent with different sides is broken: the other side stays. With Ctrl the handle gets longer.
    let tip = center(&desk, "tangent of position y out of 25");
    let to = tip + vec2(second * 0.2, 4.0);
    drag_with(&mut desk, Modifiers::COMMAND, tip, to);
    let text = desk.state().text();
    let [into, now] = ["in_tangent:", "out_tangent:"].map(|name| numbers_after(&text, name));
    let weight = numbers_after(&text, "out_weight:");
    assert_eq!(into[1], out[1], "{text}");
    assert!((now[1] - slope(to)).abs() < 0.05, "{text}");
    assert!((weight[1] - (1.0 / 3.0 + 0.2)).abs() < 0.02 && weight[0] == 0.333, "{text}");
    reloaded(&mut desk);
    for _ in 0..2 {
        press(&mut desk, Modifiers::COMMAND, Key::Z);
        reloaded(&mut desk);
    }
    assert_eq!(desk.state().text(), straight);
    // With Alt only one side gets a tangent.
    let tip = center(&desk, "tangent of position y into 25");
    drag_with(&mut desk, Modifiers::ALT, tip, tip + vec2(0.0, 12.0));
    let text = desk.state().text();
    assert!(text.contains("[1.0, [1, 0, 0], #{ in_tangent: [") && !text.contains("out_tangent"), "{text}");
    reloaded(&mut desk);
    press(&mut desk, Modifiers::COMMAND, Key::Z);
    reloaded(&mut desk);
    // Tangents chosen from the menu, and typed as a number.
    let at = center(&desk, "key position y at 25");
    secondary_click(&mut desk, at);
    desk.get_by_label_contains("Tangents").click();
    desk.run();
    desk.get_by_label("Flat").click();
    desk.run();
    assert_eq!(
        desk.state().text(),
        straight.replace("[1.0, [1, 0, 0]]", "[1.0, [1, 0, 0], #{ tangent: 0.0 }]")
    );
    reloaded(&mut desk);
    secondary_click(&mut desk, at);
    let field = desk.get_by_label("tangent into it y of position").rect().center();
    drag(&mut desk, field, field + vec2(40.0, 0.0));
    let typed = numbers_after(&desk.state().text(), "tangent:");
    assert!(typed[1] > 0.5 && typed[0] == 0.0, "{}", desk.state().text());
    reloaded(&mut desk);
    desk.get_by_label("tangent into it x of position").click();
    desk.run();
    desk.key_press_modifiers(Modifiers::COMMAND, Key::A);
    desk.event(Event::Text("1/3".into()));
    desk.run();
    desk.key_press(Key::Enter);
    desk.run();
    let with = format!("tangent: [1.0 / 3.0, {:?}, 0.0]", typed[1]);
    assert!(desk.state().text().contains(&with), "{with}\n{}", desk.state().text());
}

const PARTS: &str = r##"stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves);
ada.play(moves.clip("Walk")).weight([[0.0, 1], [2.0, 0.4]]).speed([[0.0, 1], [4.0, 2]]);
let wave = ada.play(moves.clip("Wave")).from(1.0).until(4.0).on("RightShoulder..");
wave.layer_weight([[1.0, 0], [2.0, 1]], "smooth");
ada.joint("Head").key("rotation", [[0.0, [0, 0, 0]], [1.0, [0, 40, 10], "in_quad"], [2.0, [0, 0, 0]]]); // no
ada.joint("Hips").key("position", [[0.0, [0, 0, 0]], [2.0, [0, 0.2, 0.1], #{ tangent: 0 }]]);
sky("studio", #{ strength: 0.5 }).key("turn", [[0.0, 0], [2.0, 90]]);
camera("wide").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
"##;

fn part(place: &Place, what: &Selected, name: &str) -> KeyedProperty {
    place
        .viewer
        .keyed_properties(what)
        .into_iter()
        .find(|p| p.name == name)
        .unwrap_or_else(|| panic!("{name}"))
}

/// Joints, cues and the sky have the keys of the script and the values of a snapshot.
#[test]
fn keys_of_joints_cues_and_the_sky_match_the_script() {
    let place = Place::new(PARTS);
    let (ada, cue) = (Selected::Actor("ada".into()), Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 });
    let head = part(&place, &ada, "joint:Head:rotation");
    let hips = part(&place, &ada, "joint:Hips:position");
    let weight = part(&place, &cue, ".weight");
    let turn = part(&place, &Selected::Sky, "turn");
    let secs = |keyed: &KeyedProperty| keyed.keys.iter().map(|at| at.as_secs()).collect::<Vec<_>>();
    assert_eq!((secs(&head), secs(&hips)), (vec![0.0, 1.0, 2.0], vec![0.0, 2.0]));
    assert_eq!((secs(&weight), secs(&turn)), (vec![0.0, 2.0], vec![0.0, 2.0]));
    assert!([&head, &hips, &weight, &turn].iter().all(|keyed| keyed.written.is_some()));
    // The value without these keys, plus that of the curve.
    let plain =
        Place::new(&PARTS.lines().filter(|line| !line.contains(".joint(")).collect::<Vec<_>>().join("\n"));
    for frame in 0..75 {
        let time = Time::from_secs(f64::from(frame) / 25.0);
        let of = |place: &Place| place.viewer.scene.as_ref().unwrap().evaluator.clone().at(time).unwrap();
        let (with, without) = (of(&place), of(&plain));
        let at = |snapshot: &choreo_stage::Snapshot, name: &str| {
            let scene = place.viewer.scene.as_ref().unwrap();
            let joint = scene.stage.actors[0].asset.skeleton.find(name).unwrap();
            snapshot.actors[0].model_from_joint[joint]
        };
        let moved = at(&with, "Hips").translation - at(&without, "Hips").translation;
        let shown = hips.at(time);
        for axis in 0..3 {
            assert!((f64::from(moved[axis]) - shown[axis]).abs() < 1e-5, "{moved} for {shown:?}");
        }
        assert!((with.sky.as_ref().unwrap().turn - turn.at(time)[0].to_radians()).abs() < 1e-9);
        assert!((weight.at(time)[0] - (1.0 - 0.3 * time.as_secs().min(2.0))).abs() < 1e-9);
    }
    assert!((head.at(Time::from_secs(0.5))[1] - 10.0).abs() < 0.05, "{:?}", head.at(Time::from_secs(0.5)));
    let row = |label: &str| place.viewer.timeline.rows.iter().find(|row| row.label == label).unwrap();
    let labels: Vec<&str> = row("ada").events.iter().map(|event| event.label.as_str()).collect();
    assert!(labels[0].contains("Walk weight") && labels[0].contains("joint Head rotation"), "{labels:?}");
    assert!(row("sky").events.iter().all(|event| event.key_refs()[0].what == Selected::Sky));
    let layer = row("ada +1").events.iter().find(|event| event.label == "layer weight").unwrap();
    assert_eq!(layer.key_refs()[0].property, ".layer_weight");
}

#[test]
fn keys_of_joints_cues_and_the_sky_are_edited_like_actor_keys() {
    let (ada, walk) =
        (Selected::Actor("ada".into()), Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 });
    let wave = Selected::Cue { actor: "ada".into(), layer: 1, cue: 0 };
    let changed = |change: &dyn Fn(&mut Place)| {
        let mut place = Place::new(PARTS);
        change(&mut place);
        assert_eq!(place.viewer.message, None);
        let text = place.text();
        place.reload();
        place.viewer.undo().unwrap();
        assert_eq!(place.text(), PARTS);
        text
    };
    let all = [
        key(ada.clone(), "joint:Head:rotation", 1.0),
        key(walk.clone(), ".weight", 2.0),
        key(wave, ".layer_weight", 2.0),
        key(Selected::Sky, "turn", 2.0),
    ];
    let moved = changed(&|place| place.viewer.edit(|v| v.drag_keys(&all, 0.4, None)));
    let expected = PARTS
        .replace("[1.0, [0, 40, 10]", "[1.4, [0, 40, 10]")
        .replace("[2.0, 0.4]", "[2.4, 0.4]")
        .replace("[2.0, 1]], \"smooth\"", "[2.4, 1]], \"smooth\"")
        .replace("[2.0, 90]", "[2.4, 90]");
    assert_eq!(moved, expected);
    let flat = changed(&|place| place.viewer.edit(|v| v.set_key_tangents(&all[1..], TangentChoice::Flat)));
    assert!(
        flat.contains("[2.0, 0.4, #{ tangent: 0.0 }]") && flat.contains("[2.0, 90, #{ tangent: 0.0 }]"),
        "{flat}"
    );
    let gone = changed(&|place| {
        place.viewer.edit(|v| v.delete_keys(&[key(ada.clone(), "joint:Hips:position", 2.0)]))
    });
    assert_eq!(gone, PARTS.replace(", [2.0, [0, 0.2, 0.1], #{ tangent: 0 }]", ""));
    let set = changed(&|place| {
        place.viewer.playhead.seek(Time::from_secs(1.0));
        place.viewer.edit(|v| v.set_keys(&walk, &[".weight"]));
    });
    assert_eq!(set, PARTS.replace("[2.0, 0.4]", "[1.0, 0.7], [2.0, 0.4]"));
    let set = changed(&|place| place.viewer.edit(|v| v.set_keys(&Selected::Sky, &["strength"])));
    assert!(set.contains(".key(\"turn\", [[0.0, 0], [2.0, 90]]).key(\"strength\", [[0.0, 0.5]]);"), "{set}");
    let set = changed(&|place| place.viewer.edit(|v| v.set_value(&Selected::Sky, "turn", "30.0")));
    assert_eq!(set, PARTS.replace("[0.0, 0], [2.0, 90]", "[0.0, 30], [2.0, 90]"));
    let value = ValueDrag { property: "joint:Head:rotation".into(), part: 1, offset: 5.0 };
    let turned = changed(&|place| place.viewer.edit(|v| v.drag_keys(&all[..1], 0.0, Some(&value))));
    assert_eq!(turned, PARTS.replace("[0, 40, 10]", "[0, 45, 10]"));
}

/// Keys among the options of a clip are edited as diamonds, points and numbers like all others, and stay options.
#[test]
fn keys_among_options_are_edited_in_rows_curves_and_menus() {
    const KEYS: &str = "[[0.0, 1], [1.0, 0.6], [2.0, 0.4]]";
    let scene = format!(
        "stage(#{{ size: [64, 36], fps: 25, length: 4.0 }});
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Walk\"), #{{ weight: {KEYS}, speed: 1.0 }});
"
    );
    let walk = Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 };
    let mut desk = Place::new(&scene).harness(vec2(1500.0, 1000.0));
    // Script text with other keys; the next change starts again from the old ones.
    let changed = |desk: &mut Desk, keys: &str| {
        assert_eq!(desk.state().viewer.message, None);
        assert_eq!(desk.state().text(), scene.replace(KEYS, keys));
        desk.state_mut().reload_with(&scene);
        desk.run();
    };
    let marks = desk.get_all_by_label_contains("Walk weight").map(|mark| mark.rect().center());
    let mut marks: Vec<Pos2> = marks.collect();
    marks.sort_by(|a, b| a.x.total_cmp(&b.x));
    let to = pos2(x_of(&desk, 1.4), marks[1].y);
    drag(&mut desk, marks[1], to);
    changed(&mut desk, "[[0.0, 1], [1.4, 0.6], [2.0, 0.4]]");
    desk.state_mut().viewer.select_keys(Vec::new());
    desk.state_mut().viewer.selection = Some(walk.clone());
    desk.state_mut().viewer.playhead.seek(Time::from_secs(0.48));
    desk.run();
    press(&mut desk, Modifiers::NONE, Key::K);
    changed(&mut desk, "[[0.0, 1], [0.48, 0.808], [1.0, 0.6], [2.0, 0.4]]");
    press(&mut desk, Modifiers::COMMAND, Key::Num9);
    let point =
        |desk: &Desk, frame: u32| desk.get_by_label(&format!("key weight at {frame}")).rect().center();
    let at = point(&desk, 25);
    secondary_click(&mut desk, at);
    desk.get_by_label_contains("Easing into the key").click();
    desk.run();
    desk.get_by_label("in_out_cubic").click();
    desk.run();
    changed(&mut desk, "[[0.0, 1], [1.0, 0.6, \"in_out_cubic\"], [2.0, 0.4]]");
    secondary_click(&mut desk, at);
    desk.get_by_label(".weight  of the key").click();
    desk.run();
    desk.key_press_modifiers(Modifiers::COMMAND, Key::A);
    desk.event(Event::Text("1/3".into()));
    desk.run();
    desk.key_press(Key::Enter);
    desk.run();
    press(&mut desk, Modifiers::NONE, Key::Escape);
    changed(&mut desk, "[[0.0, 1], [1.0, 1.0 / 3.0], [2.0, 0.4]]");
    // Several keys in a box selection.
    let (plot, first, last) = (desk.get_by_label("curves").rect(), point(&desk, 25), point(&desk, 50));
    let corners = [pos2(first.x - 30.0, plot.top() + 2.0), pos2(last.x + 30.0, plot.bottom() - 2.0)];
    drag(&mut desk, corners[0], corners[1]);
    let keys = [key(walk.clone(), ".weight", 1.0), key(walk, ".weight", 2.0)];
    assert_eq!(desk.state().viewer.selected_keys(), keys);
    press(&mut desk, Modifiers::NONE, Key::Delete);
    changed(&mut desk, "[[0.0, 1]]");
    // Only a method can set the interpolation of all keys.
    let at = point(&desk, 25);
    secondary_click(&mut desk, at);
    desk.get_by_label_contains("Between all keys").click();
    desk.run();
    desk.get_by_label("smooth").click();
    desk.run();
    let method = format!("#{{ speed: 1.0 }}).weight({KEYS}, \"smooth\");");
    assert_eq!(desk.state().text(), scene.replace(&format!("#{{ weight: {KEYS}, speed: 1.0 }});"), &method));
}

/// The sky and a cue have curves, and the sky can be keyed in the inspector.
#[test]
fn the_sky_and_a_cue_have_curves_and_fields() {
    let mut desk = Place::new(PARTS).harness(vec2(1500.0, 1000.0));
    desk.state_mut().viewer.selection = Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 });
    press(&mut desk, Modifiers::COMMAND, Key::Num9);
    desk.get_by_label("curve weight");
    desk.get_by_label("curve speed");
    desk.state_mut().viewer.selection = Some(Selected::Sky);
    desk.run();
    desk.get_by_label("curve turn");
    desk.get_by_label("key of strength").click();
    desk.run();
    assert!(desk.state().text().contains(".key(\"strength\", [[0.0, 0.5]])"), "{}", desk.state().text());
}

/// A key inserted in a span with tangents keeps the shape of the curve, including weights.
#[test]
fn inserting_a_key_keeps_the_shape_of_the_curve() {
    let script = SCRIPT.replace(
        "[1.0, [1, 0, 0]], [2.0, [1, 2, 0], \"in_quad\"]",
        "[1.0, [1, 0, 0], #{ tangent: [0, 3, -1] }], [2.0, [1, 2, 0], #{ in_tangent: -2, in_weight: [0.1, 0.6, 0.9] }]",
    );
    let mut place = Place::new(&script);
    let before = property(&place, &ball(), "position");
    place.viewer.set_keys_at(&ball(), &["position"], Time::from_secs(0.6)).unwrap();
    place.reload();
    place.viewer.set_keys_at(&ball(), &["position"], Time::from_secs(1.24)).unwrap();
    place.reload();
    let after = property(&place, &ball(), "position");
    assert_eq!(after.keys.len(), 5, "{}", place.text());
    for frame in 0..=100 {
        let time = Time::from_secs(f64::from(frame) / 50.0);
        for (a, b) in before.at(time).iter().zip(after.at(time)) {
            // Numbers are written to a thousandth.
            assert!((a - b).abs() < 2e-3, "{a} and {b} at {}: {}", time.as_secs(), place.text());
        }
    }
    place.viewer.undo().unwrap();
    place.reload();
    place.viewer.undo().unwrap();
    assert_eq!(place.text(), script);
}

/// Several properties change in one step; a refusal names the line that the user sees, although earlier changes have moved it in the text.
#[test]
fn a_refused_change_of_several_names_its_script_line() {
    let script = SCRIPT
        .replace("let ways =", "let n = 1;\nball.key(\"scale\", [[0.0, 1], [1.0 * n, 2]]);\nlet ways =");
    let mut place = Place::new(&script);
    let line = script.lines().position(|line| line.starts_with("ball.key(\"scale\"")).unwrap() + 1;
    // Deleting all keys of the rotation removes their four lines.
    let keys = [key(ball(), "rotation", 0.0), key(ball(), "rotation", 2.0), key(ball(), "scale", 0.0)];
    let refused = place.viewer.delete_keys(&keys).unwrap_err().to_string();
    assert_eq!(
        refused,
        format!("a.rhai: line {line}: its scale has keys that are computed; change them there")
    );
    place.viewer.edit(|v| v.delete_keys(&keys));
    assert_eq!(place.viewer.message_line, Some(line));
    assert_eq!(place.text(), script);
}

/// An object whose keys were deleted stays selected, so that its other curves remain visible: an actor, an effect, and a clip.
#[test]
fn an_object_stays_selected_when_its_keys_are_deleted() {
    let lines = "let moves = load(\"choreo:mannequin\");\nlet ada = cast(\"ada\", moves);\nada.play(moves.clip(\"Walk\")).weight([[0.0, 1.0], [1.0, 0.5], [2.0, 1.0]]);\n";
    let script = format!("{SCRIPT}{lines}");
    let cue = Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 };
    for (what, property, old, new) in [
        (ball(), "position", ", [1.0, [1, 0, 0]]", ""),
        (Selected::Effect(0), "strength", ", [2.0, 0.9]", ""),
        (cue, ".weight", ", [1.0, 0.5]", ""),
    ] {
        let mut place = Place::new(&script);
        place.viewer.selection = Some(what.clone());
        let secs = if property == "strength" { 2.0 } else { 1.0 };
        place.viewer.select_keys(vec![key(what.clone(), property, secs)]);
        let mut desk = place.harness(vec2(1500.0, 1000.0));
        press(&mut desk, Modifiers::NONE, Key::Delete);
        assert_eq!(desk.state().viewer.message, None);
        assert_eq!(desk.state().text(), script.replacen(old, new, 1));
        desk.state_mut().reload();
        desk.run();
        let viewer = &desk.state().viewer;
        assert_eq!(viewer.selection, Some(what.clone()));
        assert!(viewer.selected_keys().is_empty());
        assert!(self::property(desk.state(), &what, property).has_keys());
    }
}

const FUNCTIONS: &str = r##"stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let cube = shape("box", #{ size: 1.0 });
fn bounce(who) {
    who.key("position", [[0.0, [0, 0, 0]], [1.0, [0, 1, 0]]]);
}
let a = cast("a", cube);
bounce(a);
let b = cast("b", cube);
bounce(b);
let c = cast("c", cube);
bounce(c);
fn post(name, cube) {
    let it = cast(name, cube);
    it.key("scale", [[0.0, 1], [1.0, 2]]);
}
post("left", cube);
post("right", cube);
"##;

#[test]
fn keys_in_a_function_are_changed_for_all_objects_or_copied_for_one() {
    let mut desk = Place::new(FUNCTIONS).harness(vec2(1500.0, 1000.0));
    let of = |name: &str| Selected::Actor(name.into());
    let drag = |desk: &mut Desk, keys: &[KeyRef]| {
        let refused = desk.state_mut().viewer.drag_keys(keys, 0.4, None).unwrap_err().to_string();
        desk.run();
        refused
    };
    let refused = drag(&mut desk, &[key(of("a"), "position", 1.0)]);
    assert!(refused.ends_with("a.rhai:4: this line makes 3 objects; change it there"), "{refused}");
    desk.get_by_label("line 4 makes 3 objects. This would change all of them:");
    desk.get_by_label("Change all 3").click();
    desk.run();
    let all = FUNCTIONS.replace("[1.0, [0, 1, 0]]", "[1.4, [0, 1, 0]]");
    assert_eq!(desk.state().text(), all);
    desk.state_mut().reload();
    // The gizmo does not change the other objects by itself either.
    desk.state_mut().viewer.playhead.seek(Time::from_secs(1.4));
    let refused = desk.state_mut().viewer.change_actor("c", Change::Move(DVec3::X)).unwrap_err();
    assert!(refused.to_string().contains("a.rhai:4: this line makes 3 objects"), "{refused}");
    assert_eq!(desk.state().text(), all);
    drag(&mut desk, &[key(of("b"), "position", 1.4)]);
    desk.get_by_label("Add the line").click();
    desk.run();
    let line = "bounce(b);\nb.key(\"position\", [[0.0, [0.0, 0.0, 0.0]], [1.8, [0.0, 1.0, 0.0]]]);\n";
    assert_eq!(desk.state().text(), all.replace("bounce(b);\n", line));
    desk.state_mut().reload();
    // For objects cast in a function, the line of the keys counts, not that of the cast.
    let refused = drag(&mut desk, &[key(of("left"), "scale", 1.0)]);
    assert!(refused.ends_with("a.rhai:15: this line makes 2 objects; change it there"), "{refused}");
    desk.get_by_label("Change all 2").click();
    desk.run();
    assert!(desk.state().text().contains("it.key(\"scale\", [[0.0, 1], [1.4, 2]]);"));
}
