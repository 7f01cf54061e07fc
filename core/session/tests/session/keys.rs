//! Edits of keys in the text of a script.

use choreo_session::edit::{
    Edit, EditTime, KeyShape, KeySide, KeyValue, ScriptObject, TypedNumber, set_trim,
};
use glam::{DQuat, DVec3};

/// Rotation by angles about x, then y, then z (fixed axes), degrees.
fn rotation_from_degrees(x: f64, y: f64, z: f64) -> DQuat {
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
    rotation_from_degrees(0.0, degrees, 0.0)
}

/// The style of the neighboring keys matters, not that of other times in the script.
#[test]
fn a_new_key_counts_seconds_or_frames_like_its_neighbors() {
    let script =
        |keys: &str| format!("let a = cast(\"a\", m);\na.play(c).from(f(3));\na.key(\"scale\", [{keys}]);");
    // 1/3 s has no short decimal form: written in seconds it needs all digits, as a frame it is f(8).
    let added = |keys: &str| {
        let (text, when) = (script(keys), EditTime { secs: 1.0 / 3.0, fps: 24.0 });
        let object = ScriptObject::at(&text, 1, 9).unwrap();
        let set = object.set_key("scale", when, KeyValue::Text("2.0")).unwrap().apply(&text);
        let by = EditTime { secs: 1.0 / 3.0, fps: 24.0 };
        let pasted = object.paste_keys(".key(\"scale\", [[f(0), 2.0]])", by).unwrap().apply(&text);
        assert_eq!(set, pasted);
        set
    };
    assert_eq!(added("[0.0, 1.0], [1.0, 3.0]"), script("[0.0, 1.0], [0.333333333, 2.0], [1.0, 3.0]"));
    assert_eq!(added("[0.5, 1.0]"), script("[0.333333333, 2.0], [0.5, 1.0]"));
    assert_eq!(added("[f(0), 1.0]"), script("[f(0), 1.0], [f(8), 2.0]"));
    assert_eq!(added("[f(0), 1.0], [1.0, 3.0]"), script("[f(0), 1.0], [f(8), 2.0], [1.0, 3.0]"));
}

#[test]
fn setting_a_key_changes_only_its_value() {
    let text = "let a = cast(\"a\", m).key(\"position\", [[0.0, [0, 0, 0]], [1.0, [ 1, 0 , 0 ]] /* b */], \"smooth\");";
    let p = KeyValue::Point(DVec3::new(1.5, 0.0, -2.0));
    assert_eq!(set(text, "position", 1.0, p).unwrap(), text.replace("[ 1, 0 , 0 ]", "[ 1.5, 0 , -2 ]"));
    // A time within half a frame of a key selects that key.
    assert!(set(text, "position", 1.01, p).unwrap().contains("[ 1.5, 0 , -2 ]"));
    let text = "let a = cast(\"a\", m);\na.key(\"scale\", [[f(5), 2], [f(10), [1, 2, 3]]]);";
    assert!(set(text, "scale", 0.2, KeyValue::Scale(DVec3::splat(3.0))).unwrap().contains("[f(5), 3]"));
    let uneven = KeyValue::Scale(DVec3::new(1.0, 2.0, 1.0));
    assert!(set(text, "scale", 0.2, uneven).unwrap().contains("[f(5), [1, 2, 1]]"));
    assert!(set(text, "scale", 0.4, uneven).unwrap().contains("[f(10), [1, 2, 1]]"));
}

#[test]
fn a_new_key_has_the_format_of_its_neighbors() {
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

/// The other numbers keep their expressions.
#[test]
fn unchanged_numbers_of_a_key_are_not_rewritten() {
    let text = "let a = cast(\"a\", m).key(\"position\", [[0.0, [x, 1.0 / 3.0, 2]], [2.0, [1.0 / 3.0, 0.5]]]).key(\"scale\", [[1.0 / 3.0, 0.5], [f(12), f(3)]]);";
    let of = |property: &str, secs: f64, before: &[f64], now: &[f64]| {
        set(text, property, secs, KeyValue::Numbers { before, now })
    };
    let third = 1.0 / 3.0;
    let after = of("position", 0.0, &[5.0, third, 2.0], &[5.0, third, 3.0]).unwrap();
    assert_eq!(after, text.replace("1.0 / 3.0, 2]", "1.0 / 3.0, 3]"));
    let after = of("position", 0.0, &[5.0, third, 2.0], &[5.0, 0.5, 2.0]).unwrap();
    assert_eq!(after, text.replace("[x, 1.0 / 3.0, 2]", "[x, 0.5, 2]"));
    let after = of("position", 2.0, &[third, 0.5], &[third, 0.75]).unwrap();
    assert_eq!(after, text.replace("[1.0 / 3.0, 0.5]]])", "[1.0 / 3.0, 0.75]]])"));
    let after = of("scale", third, &[0.5], &[0.75]).unwrap();
    assert_eq!(after, text.replace("[[1.0 / 3.0, 0.5]", "[[1.0 / 3.0, 0.75]"));
    let after = of("scale", 0.48, &[0.12], &[0.75]).unwrap();
    assert_eq!(after, text.replace("[f(12), f(3)]", "[f(12), 0.75]"));
    assert_eq!(of("position", 2.0, &[third, 0.5], &[third, 0.5]).unwrap(), text);
    let why = of("position", 0.0, &[5.0, third, 2.0], &[6.0, third, 2.0]).unwrap_err();
    assert_eq!(why, "line 1: its position has keys that are computed; change them there");
    // A new key gets all numbers.
    let after = of("scale", 1.0, &[0.5], &[0.75]).unwrap();
    assert_eq!(after, text.replace("[f(12), f(3)]", "[f(12), f(3)], [f(25), 0.75]"));
}

/// Other numbers with the same digits stay, whether the edit writes them or they were there before.
#[test]
fn a_typed_expression_replaces_only_the_digits_of_its_own_number() {
    let text = "let a = cast(\"a\", m).at(0.333, 0.333, 0.0).key(\"position\", [[0.333, [0.333, 0.333, 0.0], #{ tangent: [0.333, 0.333, 0.0] }], [1.0, [0.333, 0.0, 0.0]]]);\na.play(c).trim(f(3), 0.333);";
    let typed = TypedNumber { value: 1.0 / 3.0, text: "1.0 / 3.0".into() };
    let (before, now) = ([0.333, 0.333, 0.0], [0.333, typed.value, 0.0]);
    let object = ScriptObject::at(text, 1, 9).unwrap();
    let kept = |made| typed.keep_time(text, made, FPS).unwrap().apply(text);
    let placed = kept(object.set("at", &now));
    assert_eq!(placed, text.replace(".at(0.333, 0.333", ".at(0.333, 1.0 / 3.0"));
    let value = KeyValue::Numbers { before: &before, now: &now };
    let valued = kept(object.set_key("position", time(0.333), value));
    assert_eq!(valued, text.replace("[[0.333, [0.333, 0.333", "[[0.333, [0.333, 1.0 / 3.0"));
    let moved = kept(object.move_key("position", time(0.333), time(typed.value)));
    assert_eq!(moved, text.replace("[[0.333, [", "[[1.0 / 3.0, ["));
    let side = KeySide { tangent: Some(now.to_vec()), weight: None };
    let shape = KeyShape { incoming: side.clone(), outgoing: side, ..KeyShape::default() };
    let shaped = kept(object.set_key_shapes("position", &[(time(0.333), shape)]));
    assert_eq!(shaped, text.replace("tangent: [0.333, 0.333", "tangent: [0.333, 1.0 / 3.0"));
    let trimmed = kept(set_trim(text, 2, 3, [0.12, typed.value], FPS));
    assert_eq!(trimmed, text.replace("trim(f(3), 0.333)", "trim(f(3), 1.0 / 3.0)"));
}

#[test]
fn a_new_angle_is_the_equivalent_nearest_to_its_neighbors() {
    let text = "let a = cast(\"a\", m).key(\"rotation\", [[0, 0], [1, 350], [2, 720]]);";
    assert!(set(text, "rotation", 1.0, KeyValue::Turn(yaw(10.0))).unwrap().contains("[1, 370]"));
    assert!(set(text, "rotation", 2.0, KeyValue::Turn(yaw(-5.0))).unwrap().contains("[2, 715]"));
    let leans = KeyValue::Turn(rotation_from_degrees(20.0, 350.0, 0.0));
    assert!(set(text, "rotation", 1.0, leans).unwrap().contains("[1, [20, 350, 0]]"));
    let text = "let a = cast(\"a\", m).key(\"rotation\", [[0, [0, 0, 0, 1]], [1, [170, 20, 175]]]);";
    let after =
        set(text, "rotation", 1.0, KeyValue::Turn(rotation_from_degrees(190.0, 20.0, 185.0))).unwrap();
    assert!(after.contains("[1, [190, 20, 185]]"), "{after}");
    assert!(set(text, "rotation", 0.0, KeyValue::Turn(yaw(180.0))).unwrap().contains("[0, [0, 1, 0, 0]]"));
}

#[test]
fn computed_keys_are_refused_with_their_line() {
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
        "line 1: its position has keys that are written elsewhere in the script; change them there"
    );
    // Keys can be added beside a key with a computed value.
    let text = "let a = cast(\"a\", m).key(\"position\", [[0.0, way], [2.0, [1, 0, 0]]]);";
    assert!(set(text, "position", 1.0, p).unwrap().contains("[0.0, way], [1.0, [0.0, 0.0, 0.0]], [2.0"));
}

#[test]
fn edits_of_truncated_text_do_not_panic() {
    let text = "cast(\"ü\").key(\"position\", [[0.0, [1, 2, 3]], // é\n [f(1), [`}`, '\\'']], [2, 3, \"in_sine\"], [3, 1, #{ tangent: [1, 2], ease: é }]]).x()";
    let ends: Vec<usize> = text.char_indices().map(|(i, _)| i).chain([text.len()]).collect();
    for to in &ends {
        if let Ok(object) = ScriptObject::at(&text[..*to], 1, 1) {
            for secs in [0.0, 0.5, 9.0] {
                let _ = object.set_key("position", EditTime { secs, fps: FPS }, KeyValue::Point(DVec3::ONE));
                let _ = object.move_keys("position", &[(time(0.0), time(secs)), (time(2.0), time(0.5))]);
                let _ = object.delete_keys("position", &[time(secs), time(2.0)]);
                let _ = object.set_key_ease("position", time(secs), Some("\"in_sine\""));
                let side = KeySide { tangent: Some(vec![1.0, 2.0]), weight: Some(vec![0.5]) };
                let shape = KeyShape { incoming: side, ..KeyShape::default() };
                let _ = object.set_key_shapes("position", &[(time(secs), shape)]);
                let _ = object.paste_keys(&text[text.find(".key").unwrap()..*to.max(&11)], time(secs));
            }
            let _ = object.set_key_interpolation("position", FPS, Some("\"step\""));
            let _ = object.copy_keys("position", &[time(0.0), time(2.0)]);
            let _ = object.written_keys("position", FPS);
        }
    }
    let text = "a.play(\"ü\", #{ weight: [[0.0, 1], [f(50), 0.5, \"in_sine\"]], fade: é }).speed([[0, 1]])";
    for (to, _) in text.char_indices() {
        let Ok(object) = ScriptObject::at(&text[..to], 1, 3) else { continue };
        for property in [".weight", ".speed", ".fade"] {
            let _ = object.set_key(property, time(1.0), KeyValue::Text("0.5"));
            let _ = object.add_keys(property, time(1.0), KeyValue::Text("1.0"));
            let _ = object.delete_keys(property, &[time(0.0), time(2.0)]);
            let _ = object.set_key_interpolation(property, FPS, Some("\"step\""));
        }
    }
}

#[test]
fn a_clip_is_played_by_the_variable_of_its_file() {
    let play = |text: &str| {
        let object =
            ScriptObject::at(text, 2, 1 + text.lines().nth(1).unwrap().find("cast").unwrap()).unwrap();
        object.play("Wave", EditTime { secs: 2.0, fps: FPS }, "", None).unwrap().apply(text)
    };
    let text = "let m = load(\"a.glb\");\nlet a = cast(\"a\", load(\"a.glb\", #{ color: \"red\" }));\n";
    assert_eq!(play(text), format!("{text}a.play(m.clip(\"Wave\")).from(2.0);\n"));
    // With a variable of another file, of a clip, or a property, the new line repeats the argument of `cast`.
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
fn a_color_replaces_kelvin() {
    let text = "let l = spot(#{ inner: 10, kelvin: 3200 /* warm */, outer: 20 });";
    let object = ScriptObject::at(text, 1, 9).unwrap();
    let refused = object.set_option("color", "\"#ffffff\"").unwrap_err();
    assert_eq!(refused.why, "line 1: kelvin: 3200 sets its color; a color would replace that");
    let after = refused.alternative.unwrap().apply(text);
    assert_eq!(after, "let l = spot(#{ inner: 10, color: \"#ffffff\" /* warm */, outer: 20 });");
}

#[test]
fn edit_between_two_texts_is_the_differing_part() {
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

/// Applies an edit of the object's keys to a text, and checks that its inverse restores the text.
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
fn a_moved_key_may_pass_its_neighbors() {
    let text = "let a = cast(\"a\", m).key(\"scale\", [[0.0, 1], [1.0, 2], [f(50), 3, \"in_quad\"]]);";
    let moved = |from, to| changed(text, |o| o.move_key("scale", time(from), time(to)));
    assert_eq!(moved(1.0, 1.2).unwrap(), text.replace("[1.0, 2]", "[1.2, 2]"));
    assert_eq!(moved(2.0, 2.4).unwrap(), text.replace("f(50)", "f(60)"));
    let after = moved(2.0, 0.4).unwrap();
    assert!(after.contains("[[0.0, 1], [f(10), 3, \"in_quad\"], [1.0, 2]]"), "{after}");
    let after = moved(0.0, 3.0).unwrap();
    assert!(after.contains("[[1.0, 2], [f(50), 3, \"in_quad\"], [3.0, 1]]"), "{after}");
    assert_eq!(moved(1.0, 2.0).unwrap_err(), "line 1: its scale has a key at that time already");
    assert!(moved(1.5, 1.6).unwrap_err().contains("no key written there"));
    // Keys on lines of their own keep their lines and comments.
    let text = "let a = cast(\"a\", m).key(\"scale\", [\n    [0.0, 1], // door\n    [1.0, 2], // table\n    [2.0, 3]\n]);";
    let after = changed(text, |o| o.move_key("scale", time(0.0), time(1.5))).unwrap();
    assert!(after.contains("[\n    [1.0, 2], // table\n    [1.5, 1], // door\n    [2.0, 3]\n]"), "{after}");
}

#[test]
fn deleting_the_last_key_removes_its_call() {
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
fn the_first_key_replaces_a_literal_position() {
    let text = "let a = cast(\"a\", m).at(1, 0, 0); // here\nlet b = 1;";
    let point = KeyValue::Point(DVec3::new(1.0, 0.0, 2.0));
    assert_eq!(
        changed(text, |o| o.add_keys("position", time(31.0 / FPS), point)).unwrap(),
        "let a = cast(\"a\", m); // here\na.key(\"position\", [[1.24, [1.0, 0.0, 2.0]]]);\nlet b = 1;"
    );
    // A computed position, or one that another call changes, is not removed.
    for text in
        ["let a = cast(\"a\", m).at(x, 0, 0);", "let a = cast(\"a\", m).at(1, 0, 0).move_by(1, 0, 0);"]
    {
        let keyed = changed(text, |o| o.add_keys("position", time(0.0), point)).unwrap();
        assert!(keyed.starts_with(text), "{keyed}");
    }
    let turned = changed(text, |o| o.add_keys("rotation", time(0.0), KeyValue::Turn(yaw(90.0)))).unwrap();
    assert!(turned.contains("a.key(\"rotation\", [[0.0, 90.0]]);"), "{turned}");
}

#[test]
fn keys_moved_together_keep_their_comments() {
    let text =
        "let a = cast(\"a\", m).key(\"scale\", [[0.0, 1], [1.0, 2], [f(50), 3, \"in_quad\"], [3.0, 4]]);";
    let moved = |text: &str, moves: &[(f64, f64)]| {
        let moves: Vec<_> = moves.iter().map(|(from, to)| (time(*from), time(*to))).collect();
        changed(text, |o| o.move_keys("scale", &moves))
    };
    // The second key takes the time of the third, which moves, too.
    let after = moved(text, &[(1.0, 2.0), (2.0, 2.4)]).unwrap();
    assert_eq!(after, text.replace("[1.0, 2]", "[2.0, 2]").replace("f(50)", "f(60)"));
    let after = moved(text, &[(0.0, 3.4), (1.0, 4.4)]).unwrap();
    assert!(after.contains("[[f(50), 3, \"in_quad\"], [3.0, 4], [3.4, 1], [4.4, 2]]"), "{after}");
    assert_eq!(
        moved(text, &[(0.0, 1.0), (2.0, 3.0)]).unwrap_err(),
        "line 1: its scale has a key at that time already"
    );
    let text = "let a = cast(\"a\", m).key(\"scale\", [\n    [0.0, 1], // door\n    [1.0, 2],\n    [2.0, 3]   // table\n]);";
    let after = moved(text, &[(0.0, 3.0)]).unwrap();
    assert!(after.contains("[\n    [1.0, 2],\n    [2.0, 3], // table\n    [3.0, 1] // door\n]"), "{after}");
    let after = moved(text, &[(2.0, 2.4)]).unwrap();
    assert_eq!(after, text.replace("[2.0, 3]   // table", "[2.4, 3]   // table"));
}

#[test]
fn an_earlier_time_selects_the_first_of_two_simultaneous_keys() {
    let text = "let a = cast(\"a\", m).key(\"scale\", [[0.0, 1], [1.0, 2], [1.0, 5], [2.0, 6]]);";
    let scale = |value: f64| KeyValue::Scale(DVec3::splat(value));
    assert_eq!(set(text, "scale", 1.0 - 1e-9, scale(3.0)).unwrap(), text.replace("[1.0, 2]", "[1.0, 3]"));
    assert_eq!(set(text, "scale", 1.0, scale(3.0)).unwrap(), text.replace("[1.0, 5]", "[1.0, 3]"));
    let moves = [(time(1.0 - 1e-9), time(1.4)), (time(1.0), time(1.4))];
    let after = changed(text, |o| o.move_keys("scale", &moves)).unwrap();
    assert_eq!(after, text.replace("[1.0, 2], [1.0, 5]", "[1.4, 2], [1.4, 5]"));
}

#[test]
fn several_keys_are_deleted_in_one_edit() {
    let text = "let a = cast(\"a\", m).key(\"scale\", [\n    [0.0, 1], // door\n    [1.0, 2],\n    [2.0, 3]\n]).at(1, 0, 0);";
    let deleted = |at: &[f64]| {
        let at: Vec<_> = at.iter().map(|at| time(*at)).collect();
        changed(text, |o| o.delete_keys("scale", &at)).unwrap()
    };
    assert_eq!(deleted(&[1.0, 0.0]), text.replace("    [0.0, 1], // door\n    [1.0, 2],\n", ""));
    assert_eq!(deleted(&[0.0, 1.0, 2.0]), "let a = cast(\"a\", m).at(1, 0, 0);");
}

#[test]
fn copied_keys_are_pasted_with_an_offset_and_into_other_objects() {
    let text = "let a = cast(\"a\", m).key(\"scale\", [[0.0, 1], [1.0, [1, 2, 3],\n  \"in_quad\"], [f(50), x]]);\nlet b = cast(\"b\", m);\n";
    let object = |line| ScriptObject::at(text, line, 9).unwrap();
    let copied = object(1).copy_keys("scale", &[time(2.0), time(1.0)]).unwrap();
    assert_eq!(copied, ".key(\"scale\", [[1.0, [1, 2, 3], \"in_quad\"], [f(50), x]])");
    let after = object(3).paste_keys(&copied, time(0.5)).unwrap().apply(text);
    // Half a second is 12.5 frames, so that the key given in frames falls between frames and is written in seconds.
    assert_eq!(after, format!("{text}b.key(\"scale\", [[1.5, [1, 2, 3], \"in_quad\"], [2.5, x]]);\n"));
    // With an offset of one second, the first pasted key replaces the last key.
    let after = object(1).paste_keys(&copied, time(1.0)).unwrap().apply(text);
    assert!(after.contains("[f(50), [1, 2, 3], \"in_quad\"], [f(75), x]]);"), "{after}");
    assert!(object(3).paste_keys("hello", time(0.0)).unwrap_err().why.contains("holds no keys"));
}

#[test]
fn easings_of_single_keys_and_of_all_keys() {
    let text =
        "let a = cast(\"a\", m).key(\"scale\", [[0.0, 1], [1.0, 2 /* two */], [2.0, 3, \"in_quad\"]]);";
    let ease = |text: &str, at, ease| changed(text, |o| o.set_key_ease("scale", time(at), ease));
    assert_eq!(
        ease(text, 1.0, Some("\"out_sine\"")).unwrap(),
        text.replace("2 /* two */", "2, \"out_sine\" /* two */")
    );
    assert_eq!(
        ease(text, 2.0, Some("[0.4, 0.0, 0.6, 1.0]")).unwrap(),
        text.replace("\"in_quad\"", "[0.4, 0.0, 0.6, 1.0]")
    );
    assert_eq!(ease(text, 2.0, None).unwrap(), text.replace(", \"in_quad\"", ""));
    assert!(ease(text, 0.0, Some("\"smooth\"")).unwrap_err().contains("no key comes before the first"));
    // If all keys are smooth, the other keys stay smooth.
    let all = "let a = cast(\"a\", m).key(\"scale\", [[0.0, 1], [1.0, 2], [2.0, 3]], \"smooth\");";
    assert_eq!(
        ease(all, 1.0, Some("\"in_quad\"")).unwrap(),
        "let a = cast(\"a\", m).key(\"scale\", [[0.0, 1], [1.0, 2, \"in_quad\"], [2.0, 3, \"smooth\"]]);"
    );
    let cubic = all.replace("smooth", "cubic");
    let object = ScriptObject::at(&cubic, 1, 9).unwrap();
    let refused = object.set_key_ease("scale", time(1.0), Some("\"in_quad\"")).unwrap_err();
    assert!(refused.why.contains("all keys of its scale are \"cubic\""), "{}", refused.why);
    assert_eq!(
        refused.alternative.unwrap().apply(&cubic),
        "let a = cast(\"a\", m).key(\"scale\", [[0.0, 1], [1.0, 2, \"in_quad\"], [2.0, 3]]);"
    );
    let how = |text: &str, how| changed(text, |o| o.set_key_interpolation("scale", FPS, how));
    assert_eq!(how(all, Some("\"cubic\"")).unwrap(), cubic);
    assert_eq!(how(all, None).unwrap(), all.replace(", \"smooth\"", ""));
    assert_eq!(how(text, Some("\"in_sine\"")).unwrap(), text.replace("]]);", "]], \"in_sine\");"));
    let object = ScriptObject::at(text, 1, 9).unwrap();
    let refused = object.set_key_interpolation("scale", FPS, Some("\"step\"")).unwrap_err();
    assert_eq!(refused.alternative.unwrap().apply(text), text.replace(", \"in_quad\"]]", "]], \"step\""));
}

#[test]
fn tangents_change_only_their_own_key() {
    let text = "let a = cast(\"a\", m).key(\"position\", [[0.0, [0, 0, 0]], [1.0, [1, 0, 0] /* top */, \"in_quad\"], [2.0, [0, 0, 0], #{ out_tangent: [1,  2 , 3], in_tangent: 0 }]]);";
    let side = |numbers: &[f64]| KeySide { tangent: Some(numbers.to_vec()), weight: None };
    let even = |numbers: &[f64]| KeyShape {
        incoming: side(numbers),
        outgoing: side(numbers),
        ..KeyShape::default()
    };
    let set = |text: &str, at: f64, shape: KeyShape| {
        changed(text, |o| o.set_key_shapes("position", &[(time(at), shape.clone())]))
    };
    let first = set(text, 0.0, even(&[1.0, -0.5, 0.0])).unwrap();
    assert_eq!(first, text.replace("[0.0, [0, 0, 0]]", "[0.0, [0, 0, 0], #{ tangent: [1.0, -0.5, 0.0] }]"));
    // If the options are the same, only the numbers change.
    let broken = KeyShape { broken: true, outgoing: side(&[1.0, 4.0, 3.0]), ..even(&[0.0]) };
    assert_eq!(set(text, 2.0, broken.clone()).unwrap(), text.replace(" 2 ,", " 4 ,"));
    let written = ScriptObject::at(text, 1, 9).unwrap().written_keys("position", FPS).unwrap();
    let shapes: Vec<KeyShape> = written.keys.into_iter().map(|key| key.shape.unwrap()).collect();
    assert_eq!(shapes[1], KeyShape { ease: Some("\"in_quad\"".into()), ..KeyShape::default() });
    assert_eq!(shapes[2], KeyShape { outgoing: side(&[1.0, 2.0, 3.0]), ..broken });
    // An easing shapes the span before its key; the outgoing side may still have a tangent.
    let eased = KeyShape { ease: Some("\"in_quad\"".into()), ..even(&[0.0, 0.0, 0.0]) };
    let after = set(text, 1.0, eased).unwrap();
    assert_eq!(after, text.replace("\"in_quad\"", "#{ ease: \"in_quad\", out_tangent: 0.0 }"));
    let back = changed(&after, |o| o.set_key_ease("position", time(1.0), None)).unwrap();
    assert!(back.contains("/* top */, #{ out_tangent: 0.0 }]"), "{back}");
    assert_eq!(set(&first, 0.0, KeyShape::default()).unwrap(), text);
    // Handle lengths: equal sides are written as one option.
    let long = KeySide { tangent: Some(vec![2.0]), weight: Some(vec![0.5]) };
    let long = KeyShape { incoming: long.clone(), outgoing: long, ..KeyShape::default() };
    assert!(set(text, 0.0, long).unwrap().contains("[0.0, [0, 0, 0], #{ tangent: 2.0, weight: 0.5 }]"));
    // Keys that hold their values have no tangents.
    let step = text.replace(", \"in_quad\"", "").replace("}]]);", "}]], \"step\");");
    let object = ScriptObject::at(&step, 1, 9).unwrap();
    let refused = object.set_key_shapes("position", &[(time(0.0), even(&[0.0]))]).unwrap_err();
    assert!(refused.alternative.unwrap().apply(&step).contains("[0.0, [0, 0, 0], #{ tangent: 0.0 }]"));
    let object = ScriptObject::at(text, 1, 9).unwrap();
    let refused = object.set_key_interpolation("position", FPS, Some("\"step\"")).unwrap_err();
    assert!(refused.why.contains("keys of its position have tangents of their own"), "{}", refused.why);
    assert!(refused.alternative.unwrap().apply(text).ends_with("[2.0, [0, 0, 0]]], \"step\");"));
    let computed = text.replace("out_tangent: [1,", "out_tangent: [x,");
    let why = set(&computed, 2.0, even(&[0.0])).unwrap_err();
    assert!(why.contains("a key of its position has tangents that are computed"), "{why}");
}

#[test]
fn joint_keys_are_edited_in_chains_and_on_variables() {
    let text = "let a = cast(\"a\", m);\na.joint(\"Head\").key(\"rotation\", [[0.0, 0], [1.0, [0, 40, 0]]]); // nods\nlet hand = a.joint(\"LeftHand\");\nhand.key(\"scale\", [[0.0, 1]]).key(\"rotation\", [[0.0, 10]]);\n";
    let (head, hand) = ("joint:Head:rotation", "joint:LeftHand:rotation");
    let turned = KeyValue::Turn(yaw(55.0));
    let point = KeyValue::Point(DVec3::Y);
    assert_eq!(set(text, head, 1.0, point).unwrap(), text.replace("[0, 40, 0]", "[0, 1, 0]"));
    assert_eq!(set(text, hand, 0.0, turned).unwrap(), text.replace("[0.0, 10]", "[0.0, 55]"));
    assert!(set(text, hand, 1.0, turned).unwrap().contains("[[0.0, 10], [1.0, 55.0]]"));
    let moved = changed(text, |o| o.move_key(head, time(1.0), time(1.4))).unwrap();
    assert_eq!(moved, text.replace("[1.0, [0, 40", "[1.4, [0, 40"));
    let gone = changed(text, |o| o.delete_keys(head, &[time(0.0), time(1.0)])).unwrap();
    let line = "a.joint(\"Head\").key(\"rotation\", [[0.0, 0], [1.0, [0, 40, 0]]]); // nods\n";
    assert_eq!(gone, text.replace(line, ""));
    let gone = changed(text, |o| o.delete_keys(hand, &[time(0.0)])).unwrap();
    assert_eq!(gone, text.replace(".key(\"rotation\", [[0.0, 10]])", ""));
    let copied = changed(text, |o| {
        let copied = o.copy_keys(head, &[time(1.0)])?;
        assert_eq!(copied, ".joint(\"Head\").key(\"rotation\", [[1.0, [0, 40, 0]]])");
        o.paste_keys(&copied.replace("Head", "Hips"), time(1.0))
    });
    assert!(copied.unwrap().contains("\na.joint(\"Hips\").key(\"rotation\", [[2.0, [0, 40, 0]]]);\n"));
    let why = set(text, "joint:Head:scale", 0.0, turned).unwrap_err();
    assert_eq!(
        why,
        "line 1: its Head scale has keys that are written elsewhere in the script; change them there"
    );
}

/// The edited object is the call that plays the clip.
#[test]
fn keys_of_a_cue_are_read_from_its_methods() {
    let text = "let a = cast(\"a\", m);\na.play(c).from(1.0).weight([[1.0, 0], [2.0, 1, \"in_quad\"]]).until(4.0)\n    .then(d).speed(2.0);\nlet walk = a.play(c);\nwalk.layer_weight([[0.0, 1]], \"smooth\");\n";
    type EditFunction<'m> = &'m dyn Fn(&ScriptObject) -> Result<Edit, choreo_session::edit::EditRefused>;
    let made = |line: usize, name: &str, change: EditFunction| {
        let column = 1 + text.lines().nth(line - 1).unwrap().find(name).unwrap();
        change(&ScriptObject::at(text, line, column).unwrap()).unwrap().apply(text)
    };
    let half = KeyValue::Text("0.5");
    let set = made(2, "play", &|o| o.set_key(".weight", time(2.0), half));
    assert_eq!(set, text.replace("[2.0, 1, ", "[2.0, 0.5, "));
    let set = made(2, "play", &|o| o.set_key(".weight", time(3.0), half));
    assert_eq!(set, text.replace("\"in_quad\"]]", "\"in_quad\"], [3.0, 0.5]]"));
    let eased = made(2, "play", &|o| o.set_key_interpolation(".weight", FPS, Some("\"in_sine\"")));
    assert_eq!(eased, text.replace("\"in_quad\"]])", "\"in_quad\"]], \"in_sine\")"));
    let gone = made(2, "play", &|o| o.delete_keys(".weight", &[time(1.0), time(2.0)]));
    assert_eq!(gone, text.replace(".weight([[1.0, 0], [2.0, 1, \"in_quad\"]])", ""));
    let moved = made(4, "play", &|o| o.move_key(".layer_weight", time(0.0), time(0.4)));
    assert_eq!(moved, text.replace("[[0.0, 1]]", "[[0.4, 1]]"));
    // A number is not a list of keys. The first key is written as a method after the other calls.
    assert!(!ScriptObject::at(text, 3, 6).unwrap().has_keys(".speed"));
    let added = made(3, "then", &|o| o.add_keys(".weight", time(2.0), half));
    assert_eq!(added, text.replace(".speed(2.0)", ".speed(2.0).weight([[2.0, 0.5]])"));
    let added = made(4, "play", &|o| o.add_keys(".weight", time(2.0), half));
    assert_eq!(added, format!("{text}walk.weight([[2.0, 0.5]]);\n"));
    let copied = ScriptObject::at(text, 2, 3).unwrap().copy_keys(".weight", &[time(2.0)]).unwrap();
    assert_eq!(copied, ".weight([[2.0, 1, \"in_quad\"]])");
    let pasted = made(3, "then", &|o| o.paste_keys(&copied, time(0.0)));
    assert_eq!(pasted, text.replace(".speed(2.0)", ".speed(2.0).weight([[2.0, 1, \"in_quad\"]])"));
}

/// Edits leave the keys in the option.
#[test]
fn keys_of_a_cue_are_read_from_its_options() {
    let text = "let a = cast(\"a\", m);\na.play(c, #{ fade: 0.4, weight: [[0.0, 0], [1.0, 1, \"in_quad\"], [f(50), 0.5]], speed: 2.0 })\n    .then(d, #{\n        weight: [\n            [3.0, 1], // in\n            [4.0, 0]\n        ]\n    });\n";
    type EditFunction<'m> = &'m dyn Fn(&ScriptObject) -> Result<Edit, choreo_session::edit::EditRefused>;
    let made = |line: usize, name: &str, change: EditFunction| {
        let column = 1 + text.lines().nth(line - 1).unwrap().find(name).unwrap();
        change(&ScriptObject::at(text, line, column).unwrap()).map(|edit| edit.apply(text))
    };
    let (play, then) =
        (|change: EditFunction| made(2, "play", change), |change: EditFunction| made(3, "then", change));
    let half = KeyValue::Text("0.7");
    let changed = play(&|o| o.set_key(".weight", time(2.0), half)).unwrap();
    assert_eq!(changed, text.replace("[f(50), 0.5]", "[f(50), 0.7]"));
    let added = play(&|o| o.set_key(".weight", time(1.4), half)).unwrap();
    assert_eq!(added, text.replace("[f(50)", "[1.4, 0.7], [f(50)"));
    let moved = play(&|o| o.move_keys(".weight", &[(time(0.0), time(1.4)), (time(2.0), time(2.4))])).unwrap();
    let list = "[[1.0, 1, \"in_quad\"], [1.4, 0], [f(60), 0.5]]";
    assert_eq!(moved, text.replace("[[0.0, 0], [1.0, 1, \"in_quad\"], [f(50), 0.5]]", list));
    let moved = then(&|o| o.move_key(".weight", time(3.0), time(3.4))).unwrap();
    assert_eq!(moved, text.replace("[3.0, 1], // in", "[3.4, 1], // in"));
    let taken = play(&|o| o.move_key(".weight", time(0.0), time(1.0))).unwrap_err();
    assert_eq!(taken.why, "line 2: its weight has a key at that time already");
    let eased = play(&|o| o.set_key_ease(".weight", time(2.0), Some("\"out_sine\""))).unwrap();
    assert_eq!(eased, text.replace("[f(50), 0.5]", "[f(50), 0.5, \"out_sine\"]"));
    let flat = KeySide { tangent: Some(vec![0.0]), weight: None };
    let flat = KeyShape { incoming: flat.clone(), outgoing: flat, ..KeyShape::default() };
    let shaped = play(&|o| o.set_key_shapes(".weight", &[(time(0.0), flat.clone())])).unwrap();
    assert_eq!(shaped, text.replace("[0.0, 0]", "[0.0, 0, #{ tangent: 0.0 }]"));
    let gone = play(&|o| o.delete_keys(".weight", &[time(0.0), time(2.0)])).unwrap();
    assert_eq!(gone, text.replace("[0.0, 0], ", "").replace(", [f(50), 0.5]", ""));
    // Deleting the last keys removes their option.
    let all = [time(0.0), time(1.0), time(2.0)];
    let gone = play(&|o| o.delete_keys(".weight", &all)).unwrap();
    assert!(gone.contains("a.play(c, #{ fade: 0.4, speed: 2.0 })"), "{gone}");
    let gone = then(&|o| o.delete_keys(".weight", &[time(3.0), time(4.0)])).unwrap();
    assert!(gone.ends_with("speed: 2.0 })\n    .then(d);\n"), "{gone}");
    let pasted = play(&|o| {
        let copied = o.copy_keys(".weight", &[time(1.0)])?;
        assert_eq!(copied, ".weight([[1.0, 1, \"in_quad\"]])");
        o.paste_keys(&copied, time(2.0))
    });
    assert_eq!(pasted.unwrap(), text.replace("[f(50), 0.5]", "[f(50), 0.5], [f(75), 1, \"in_quad\"]"));
}

/// Only a method can state an interpolation of all keys. The first key replaces a number.
#[test]
fn setting_the_interpolation_of_all_keys_moves_them_from_an_option_to_a_method() {
    let made =
        |text: &str, change: &dyn Fn(&ScriptObject) -> Result<Edit, choreo_session::edit::EditRefused>| {
            let column = 1 + text.find("play").unwrap();
            change(&ScriptObject::at(text, 1, column).unwrap()).map(|edit| edit.apply(text))
        };
    let text = "a.play(c, #{ weight: [[0.0, 0], [1.0, 1]] }).until(4.0);";
    let smooth = made(text, &|o| o.set_key_interpolation(".weight", FPS, Some("\"smooth\""))).unwrap();
    assert_eq!(smooth, "a.play(c).until(4.0).weight([[0.0, 0], [1.0, 1]], \"smooth\");");
    let linear = made(text, &|o| o.set_key_interpolation(".weight", FPS, None)).unwrap();
    assert_eq!(linear, text);
    // The interpolation would replace easings of single keys, so the edit is refused.
    let eased = text.replace("[1.0, 1]", "[1.0, 1, \"in_quad\"]");
    let refused = made(&eased, &|o| o.set_key_interpolation(".weight", FPS, Some("\"cubic\""))).unwrap_err();
    let over = refused.alternative.unwrap().apply(&eased);
    assert_eq!(over, "a.play(c).until(4.0).weight([[0.0, 0], [1.0, 1]], \"cubic\");");
    // A method overrides the option, and a number is not a list of keys.
    let both = "a.play(c, #{ weight: [[0.0, 0]] }).weight(0.5);";
    let column = 1 + both.find("play").unwrap();
    assert!(!ScriptObject::at(both, 1, column).unwrap().has_keys(".weight"));
    for (before, after) in [
        ("a.play(c).weight(0.5).until(2.0);", "a.play(c).weight([[1.0, 0.25]]).until(2.0);"),
        ("a.play(c, #{ weight: 0.5 });", "a.play(c, #{ weight: [[1.0, 0.25]] });"),
        ("a.play(c).until(2.0);", "a.play(c).until(2.0).weight([[1.0, 0.25]]);"),
    ] {
        let added = made(before, &|o| o.add_keys(".weight", time(1.0), KeyValue::Text("0.25")));
        assert_eq!(added.unwrap(), after);
    }
}

#[test]
fn keys_of_joints_and_morph_targets_are_told_apart() {
    let text = "let a = cast(\"a\", m).key(\"scale\", [[0.0, 1]]);\na.joint(\"Head\").key(\"scale\", [[0.0, 2]]);\na.key(\"morph\", \"smile\", [[0.0, 0.5]]).key(\"morph\", \"blink\", [[0.0, 0.7]], \"smooth\");";
    let scale = KeyValue::Scale(DVec3::splat(3.0));
    assert_eq!(set(text, "scale", 0.0, scale).unwrap(), text.replace("[0.0, 1]", "[0.0, 3]"));
    let weight = KeyValue::Text("0.25");
    assert_eq!(set(text, "morph:smile", 0.0, weight).unwrap(), text.replace("0.5", "0.25"));
    let written = ScriptObject::at(text, 1, 9).unwrap().written_keys("morph:blink", FPS).unwrap();
    assert_eq!((written.line, written.interpolation.as_deref()), (3, Some("\"smooth\"")));
    assert_eq!(written.keys[0].numbers, Some(vec![0.7]));
    let added = changed("let a = cast(\"a\", m);", |o| o.add_keys("morph:it", time(1.0), weight)).unwrap();
    assert_eq!(added, "let a = cast(\"a\", m);\na.key(\"morph\", \"it\", [[1.0, 0.25]]);");
}

#[test]
fn a_refusal_offers_a_line_that_replaces_computed_keys() {
    let text = "let a = cast(\"a\", m).key(\"scale\", [[x, 1], [2.0, 3]], \"smooth\");\nlet b = 1;";
    let object = ScriptObject::at(text, 1, 9).unwrap();
    let refused = object.move_key("scale", time(2.0), time(3.0)).unwrap_err();
    assert!(refused.is_computed && refused.alternative.is_none());
    let scale = |value: f64| KeyValue::Scale(DVec3::splat(value));
    let anew =
        object.offering_all_keys(refused, "scale", &[(time(0.4), scale(1.0)), (time(3.0), scale(3.0))]);
    let line = "a.key(\"scale\", [[0.4, 1.0], [3.0, 3.0]], \"smooth\");";
    assert_eq!(anew.alternative.unwrap().apply(text), text.replace("\nlet b", &format!("\n{line}\nlet b")));
}
