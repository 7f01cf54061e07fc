//! Keys in a script's text, changed and added.

use choreo_session::edit::{Edit, EditTime, KeyValue, ScriptObject};
use glam::{DQuat, DVec3};

/// About x, then y, then z (fixed axes), degrees.
fn turned(x: f64, y: f64, z: f64) -> DQuat {
    let about = |q: fn(f64) -> DQuat, degrees: f64| q(degrees.to_radians());
    about(DQuat::from_rotation_z, z) * about(DQuat::from_rotation_y, y) * about(DQuat::from_rotation_x, x)
}

const FPS: f64 = 25.0;

fn set(text: &str, property: &str, secs: f64, value: KeyValue) -> Result<String, String> {
    let object = ScriptObject::at(text, 1, 1 + text.find("cast").unwrap()).map_err(|r| r.why)?;
    let edit = object.set_key(property, EditTime { secs, fps: FPS }, value).map_err(|r| r.why)?;
    let after = edit.apply(text);
    assert_eq!(edit.inverse(text).apply(&after), text);
    Ok(after)
}

fn yaw(degrees: f64) -> DQuat {
    turned(0.0, degrees, 0.0)
}

#[test]
fn the_key_at_the_time_is_changed_and_nothing_else() {
    let text = "let a = cast(\"a\", m).key(\"position\", [[0.0, [0, 0, 0]], [1.0, [ 1, 0 , 0 ]] /* b */], \"smooth\");";
    let p = KeyValue::Point(DVec3::new(1.5, 0.0, -2.0));
    assert_eq!(set(text, "position", 1.0, p).unwrap(), text.replace("[ 1, 0 , 0 ]", "[ 1.5, 0 , -2.0 ]"));
    // Less than half a frame beside it is it.
    assert!(set(text, "position", 1.01, p).unwrap().contains("[ 1.5, 0 , -2.0 ]"));
    let text = "let a = cast(\"a\", m);\na.key(\"scale\", [[f(5), 2], [f(10), [1, 2, 3]]]);";
    assert!(set(text, "scale", 0.2, KeyValue::Scale(DVec3::splat(3.0))).unwrap().contains("[f(5), 3.0]"));
    let uneven = KeyValue::Scale(DVec3::new(1.0, 2.0, 1.0));
    assert!(set(text, "scale", 0.2, uneven).unwrap().contains("[f(5), [1.0, 2.0, 1.0]]"));
    assert!(set(text, "scale", 0.4, uneven).unwrap().contains("[f(10), [1, 2, 1.0]]"));
}

#[test]
fn a_new_key_is_written_as_its_neighbours_are() {
    let text = "let a = cast(\"a\", m).key(\"position\", [[0.0, [0, 0, 0]], [1.0, [1, 0, 0]]]);";
    let p = KeyValue::Point(DVec3::new(0.5, 1.0, 0.0));
    assert!(
        set(text, "position", 0.44, p).unwrap().contains("[[0.0, [0, 0, 0]], [0.44, [0.5, 1.0, 0.0]], [1.0,")
    );
    assert!(set(text, "position", 2.0, p).unwrap().contains("[1.0, [1, 0, 0]], [2.0, [0.5, 1.0, 0.0]]]);"));
    let text = "let a = cast(\"a\", m).key(\"rotation\", [\n    [f(5), 0], // there\n    [f(50), 90], // and back\n]);";
    let q = KeyValue::Turn(yaw(30.0));
    assert_eq!(
        set(text, "rotation", 1.0, q).unwrap(),
        "let a = cast(\"a\", m).key(\"rotation\", [\n    [f(5), 0], // there\n    [f(25), 30.0],\n    [f(50), 90], // and back\n]);"
    );
    assert_eq!(
        set(text, "rotation", 3.0, q).unwrap(),
        "let a = cast(\"a\", m).key(\"rotation\", [\n    [f(5), 0], // there\n    [f(50), 90], // and back\n    [f(75), 30.0]\n]);"
    );
}

#[test]
fn angles_stay_near_those_that_are_there() {
    let text = "let a = cast(\"a\", m).key(\"rotation\", [[0, 0], [1, 350], [2, 720]]);";
    assert!(set(text, "rotation", 1.0, KeyValue::Turn(yaw(10.0))).unwrap().contains("[1, 370.0]"));
    assert!(set(text, "rotation", 2.0, KeyValue::Turn(yaw(-5.0))).unwrap().contains("[2, 715.0]"));
    let leans = KeyValue::Turn(turned(20.0, 350.0, 0.0));
    assert!(set(text, "rotation", 1.0, leans).unwrap().contains("[1, [20.0, 350.0, 0.0]]"));
    let text = "let a = cast(\"a\", m).key(\"rotation\", [[0, [0, 0, 0, 1]], [1, [170, 20, 175]]]);";
    let after = set(text, "rotation", 1.0, KeyValue::Turn(turned(190.0, 20.0, 185.0))).unwrap();
    assert!(after.contains("[1, [190.0, 20, 185.0]]"), "{after}");
    assert!(
        set(text, "rotation", 0.0, KeyValue::Turn(yaw(180.0))).unwrap().contains("[0, [0, 1.0, 0, 0.0]]")
    );
}

#[test]
fn what_is_computed_is_refused_with_its_line() {
    let p = KeyValue::Point(DVec3::ZERO);
    let why = |text: &str| set(text, "position", 1.0, p).unwrap_err();
    for computed in
        ["keys", "[[x, [0, 0, 0]]]", "[[1.0, way]]", "[[0.0, [0, 0, 0]], [1.0, [x, 0, 0]]]", "[]", "[[1.0]]"]
    {
        let text = format!("let a = cast(\"a\", m);\na.key(\"position\", {computed});");
        assert_eq!(
            why(&text),
            "line 2: its position has keys that are computed; change them there",
            "{computed}"
        );
    }
    let elsewhere = "let a = cast(\"a\", m);\nmove(a);";
    assert_eq!(
        why(elsewhere),
        "line 1: its position has keys that are not written with it; change them there"
    );
    // A value that is computed does not keep others from being added.
    let text = "let a = cast(\"a\", m).key(\"position\", [[0.0, way], [2.0, [1, 0, 0]]]);";
    assert!(set(text, "position", 1.0, p).unwrap().contains("[0.0, way], [1.0, [0.0, 0.0, 0.0]], [2.0"));
}

#[test]
fn no_text_makes_it_panic() {
    let text = "cast(\"ü\").key(\"position\", [[0.0, [1, 2, 3]], // é\n [f(1), [`}`, '\\'']], [2, 3, \"in_sine\"],]).x()";
    let ends: Vec<usize> = text.char_indices().map(|(i, _)| i).chain([text.len()]).collect();
    for to in &ends {
        if let Ok(object) = ScriptObject::at(&text[..*to], 1, 1) {
            for secs in [0.0, 0.5, 9.0] {
                let _ = object.set_key("position", EditTime { secs, fps: FPS }, KeyValue::Point(DVec3::ONE));
            }
        }
    }
}

#[test]
fn a_clip_of_a_file_that_has_a_name_is_played_by_it() {
    let play = |text: &str| {
        let object =
            ScriptObject::at(text, 2, 1 + text.lines().nth(1).unwrap().find("cast").unwrap()).unwrap();
        object.play("Wave", EditTime { secs: 2.0, fps: FPS }, "", None).unwrap().apply(text)
    };
    let text = "let m = load(\"a.glb\");\nlet a = cast(\"a\", load(\"a.glb\", #{ color: \"red\" }));\n";
    assert_eq!(play(text), format!("{text}a.play(m.clip(\"Wave\")).from(2.0);\n"));
    // Another file, one made otherwise, a name that is none: its own words.
    for line in ["let m = load(\"b.glb\");", "let m = load(\"a.glb\").clip(\"x\");", "m.n = load(\"a.glb\");"]
    {
        let after = play(&text.replace("let m = load(\"a.glb\");", line));
        assert!(
            after.ends_with("a.play(load(\"a.glb\", #{ color: \"red\" }).clip(\"Wave\")).from(2.0);\n"),
            "{after}"
        );
    }
}

#[test]
fn a_color_takes_the_place_of_kelvin() {
    let text = "let l = spot(#{ inner: 10, kelvin: 3200 /* warm */, outer: 20 });";
    let object = ScriptObject::at(text, 1, 9).unwrap();
    let refused = object.option("color", "\"#ffffff\"").unwrap_err();
    assert_eq!(refused.why, "line 1: kelvin: 3200 says its color; a color would take its place");
    let after = refused.over.unwrap().apply(text);
    assert_eq!(after, "let l = spot(#{ inner: 10, color: \"#ffffff\" /* warm */, outer: 20 });");
}

#[test]
fn an_edit_between_two_texts_is_the_part_that_differs() {
    for (before, after, range) in [
        ("aXbc", "aYbc", 1..2),
        ("aa", "aaa", 2..2),
        ("é1è", "é2è", 2..3),
        ("", "x", 0..0),
        ("same", "same", 4..4),
    ] {
        let edit = Edit::between(before, after);
        assert_eq!((edit.range.clone(), edit.apply(before)), (range, after.to_string()));
    }
}

/// Applies a change of the object's keys to a text; checks that it can be taken back.
fn changed(
    text: &str,
    change: impl Fn(&ScriptObject) -> Result<Edit, choreo_session::edit::EditRefused>,
) -> Result<String, String> {
    let object = ScriptObject::at(text, 1, 1 + text.find("cast").unwrap()).map_err(|r| r.why)?;
    let edit = change(&object).map_err(|r| r.why)?;
    let after = edit.apply(text);
    assert_eq!(edit.inverse(text).apply(&after), text);
    Ok(after)
}

fn time(secs: f64) -> EditTime {
    EditTime { secs, fps: FPS }
}

#[test]
fn a_key_moves_between_its_neighbours_and_past_them() {
    let text = "let a = cast(\"a\", m).key(\"scale\", [[0.0, 1], [1.0, 2], [f(50), 3, \"in_quad\"]]);";
    let moved = |from, to| changed(text, |o| o.move_key("scale", time(from), time(to)));
    assert_eq!(moved(1.0, 1.2).unwrap(), text.replace("[1.0, 2]", "[1.2, 2]"));
    assert_eq!(moved(2.0, 2.4).unwrap(), text.replace("f(50)", "f(60)"));
    let after = moved(2.0, 0.4).unwrap();
    assert!(after.contains("[[0.0, 1], [f(10), 3, \"in_quad\"], [1.0, 2]]"), "{after}");
    let after = moved(0.0, 3.0).unwrap();
    assert!(after.contains("[[1.0, 2], [f(50), 3, \"in_quad\"], [3.0, 1]]"), "{after}");
    assert_eq!(moved(1.0, 2.0).unwrap_err(), "line 1: its scale has a key at that time already");
    assert!(moved(1.5, 1.6).unwrap_err().contains("no key of its own"));
    // Keys with lines of their own keep them, and their comments.
    let text = "let a = cast(\"a\", m).key(\"scale\", [\n    [0.0, 1], // door\n    [1.0, 2], // table\n    [2.0, 3]\n]);";
    let after = changed(text, |o| o.move_key("scale", time(0.0), time(1.5))).unwrap();
    assert!(after.contains("[\n    [1.0, 2], // table\n    [1.5, 1],\n    [2.0, 3]\n]"), "{after}");
}

#[test]
fn a_key_is_deleted_with_its_comma_and_the_last_one_with_its_call() {
    let text = "let a = cast(\"a\", m).key(\"scale\", [[0.0, 1], [1.0, 2], [2.0, 3]]).at(1, 0, 0);";
    let deleted = |text: &str, at| changed(text, |o| o.delete_key("scale", time(at))).unwrap();
    assert_eq!(deleted(text, 0.0), text.replace("[0.0, 1], ", ""));
    assert_eq!(deleted(text, 1.0), text.replace("[1.0, 2], ", ""));
    assert_eq!(deleted(text, 2.0), text.replace(", [2.0, 3]", ""));
    let one = "let a = cast(\"a\", m).key(\"scale\", [[0.0, 1]]).at(1, 0, 0);";
    assert_eq!(deleted(one, 0.0), "let a = cast(\"a\", m).at(1, 0, 0);");
    let line = "let a = cast(\"a\", m);\na.key(\"scale\", [[0.0, 1]]); // big\nlet b = 1;";
    assert_eq!(deleted(line, 0.0), "let a = cast(\"a\", m);\nlet b = 1;");
    let own = "let a = cast(\"a\", m).key(\"scale\", [\n    [0.0, 1], // door\n    [1.0, 2]\n]);";
    assert_eq!(deleted(own, 0.0), own.replace("    [0.0, 1], // door\n", ""));
}

#[test]
fn a_property_without_keys_gets_its_first() {
    let text = "let a = cast(\"a\", m).at(1, 0, 0); // here\nlet b = 1;";
    let point = KeyValue::Point(DVec3::new(1.0, 0.0, 2.0));
    assert_eq!(
        changed(text, |o| o.add_keys("position", time(31.0 / FPS), point)).unwrap(),
        text.replace("// here", "// here\na.key(\"position\", [[1.24, [1.0, 0.0, 2.0]]]);")
    );
    let turned = changed(text, |o| o.add_keys("rotation", time(0.0), KeyValue::Turn(yaw(90.0)))).unwrap();
    assert!(turned.contains("a.key(\"rotation\", [[0.0, 90.0]]);"), "{turned}");
}
