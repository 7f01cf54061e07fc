//! Values that edits read, set and remove, and loops that edits unroll. The whole text after each edit is compared.

use crate::marked::marked;
use choreo_session::edit::{
    Edit, EditRefused, EditTime, KeyValue, NamedBy, NewValueSyntax, ScriptObject, unroll,
};

/// Calls `then` with the object whose creating call `|` marks.
fn object<R>(text: &str, then: impl FnOnce(&ScriptObject) -> R) -> R {
    let (plain, line, column) = marked(text);
    then(&ScriptObject::at(&plain, line, column).unwrap())
}

fn without_values(text: &str, names: &[&str]) -> String {
    let edit = object(text, |object| object.remove_values(names));
    edit.apply(&text.replacen('|', "", 1))
}

#[test]
fn removing_a_value_leaves_the_other_values_unchanged() {
    assert_eq!(
        without_values("|sun(#{ intensity: 3.0, color: \"red\" });", &["intensity"]),
        "sun(#{ color: \"red\" });"
    );
    assert_eq!(
        without_values("|sun(#{ color: \"red\", intensity: 3.0 });", &["intensity"]),
        "sun(#{ color: \"red\" });"
    );
    assert_eq!(without_values("|sun(#{ a: [1, 2], b: f(3), c: 1 });", &["b"]), "sun(#{ a: [1, 2], c: 1 });");
    assert_eq!(without_values("|sun(#{ a: 1, b: 2, c: 1 });", &["b", "c"]), "sun(#{ a: 1 });");
    assert_eq!(without_values("|sun(#{ intensity: 3.0 });", &["intensity"]), "sun();");
    assert_eq!(
        without_values("a.|play(c, #{ fade: 0.5 }).until(2.0).then(d);", &["fade"]),
        "a.play(c).until(2.0).then(d);"
    );
    assert_eq!(
        without_values("a.|play(c)\n    .fade(0.5) // why\n    .until(2.0).then(d).fade(1.0);", &["fade"]),
        "a.play(c) // why\n    .until(2.0).then(d).fade(1.0);"
    );
    assert_eq!(
        without_values("a.|play(c) // in\n    .fade(0.5).until(2.0);", &["fade"]),
        "a.play(c) // in\n    .until(2.0);"
    );
    let lamp = "let l = |sun(#{ color: \"red\" });\nl.intensity(3.0);\nl.color(\"blue\").key(\"x\", []);\n";
    assert_eq!(
        without_values(lamp, &["color", "intensity", "kelvin"]),
        "let l = sun();\nl.key(\"x\", []);\n"
    );
    assert_eq!(without_values("|sun();", &["intensity"]), "sun();");
}

#[test]
fn a_value_replaces_the_stated_one_or_is_added() {
    let stated = |text: &str, name: &str, value: &str, new_syntax| {
        let edit = object(text, |object| object.set_value(name, value, new_syntax));
        edit.map(|edit| edit.apply(&text.replacen('|', "", 1))).map_err(|refused| refused.why)
    };
    let camera = "let c = |camera(\"c\");";
    assert_eq!(
        stated(camera, "near", "0.2", NewValueSyntax::Method).unwrap(),
        "let c = camera(\"c\").near(0.2);"
    );
    let lines = "let c = |camera(\"c\")\n    .at(0, 1, 5) // far\n    .cut(2.0);";
    assert_eq!(
        stated(lines, "near", "0.2", NewValueSyntax::Method).unwrap(),
        "let c = camera(\"c\")\n    .at(0, 1, 5) // far\n    .near(0.2)\n    .cut(2.0);"
    );
    let play = "a.|play(c).until(2.0).then(d).ease(\"smooth\");";
    assert_eq!(
        stated(play, "ease", "\"linear\"", NewValueSyntax::Option).unwrap(),
        "a.play(c, #{ ease: \"linear\" }).until(2.0).then(d).ease(\"smooth\");"
    );
    assert_eq!(
        stated("a.|play(c, #{ ease: \"smooth\" });", "ease", "\"linear\"", NewValueSyntax::Method).unwrap(),
        "a.play(c, #{ ease: \"linear\" });"
    );
    let computed = "a.|play(c).on(names(x));";
    assert!(stated(computed, "on", "\"Head\"", NewValueSyntax::Method).unwrap_err().contains("computed"));
    let over = object(computed, |object| {
        assert_eq!(object.written("on"), Some("names(x)"));
        object.overwrite_value("on", "\"Head\"", NewValueSyntax::Method).unwrap()
    });
    assert_eq!(over.apply(&computed.replacen('|', "", 1)), "a.play(c).on(\"Head\");");
}

/// A whole number keeps its style, with or without a decimal point, in methods, options and keys.
#[test]
fn whole_numbers_stay_without_decimal_point() {
    let changed = |text: &str, change: &dyn Fn(&ScriptObject) -> Result<Edit, EditRefused>| {
        object(text, |object| change(object).unwrap()).apply(&text.replacen('|', "", 1))
    };
    let at = |secs| EditTime { secs, fps: 25.0 };
    for (text, number, wanted) in [
        ("|camera(\"c\").fov(34);", "40.0", "camera(\"c\").fov(40);"),
        ("|camera(\"c\").fov(34);", "40.5", "camera(\"c\").fov(40.5);"),
        ("|camera(\"c\").fov(34.0);", "40.0", "camera(\"c\").fov(40.0);"),
        ("|camera(\"c\", #{ fov: 34 });", "40.0", "camera(\"c\", #{ fov: 40 });"),
        ("|camera(\"c\", #{ fov: 34 });", "80.0 / 3.0", "camera(\"c\", #{ fov: 80.0 / 3.0 });"),
    ] {
        assert_eq!(changed(text, &|o| o.set_value("fov", number, NewValueSyntax::Option)), wanted);
    }
    let scaled = |text: &str, to: &[f64]| changed(text, &|o| o.set("scale", to));
    assert_eq!(scaled("|cast(\"a\", m).scale(2);", &[3.0]), "cast(\"a\", m).scale(3);");
    assert_eq!(scaled("|cast(\"a\", m).scale(2);", &[1.0, 2.0, 0.5]), "cast(\"a\", m).scale(1, 2, 0.5);");
    assert_eq!(
        scaled("|cast(\"a\", m).scale(2, 2.0, 1);", &[3.0, 3.0, 3.0]),
        "cast(\"a\", m).scale(3, 3.0, 3);"
    );
    let shot = "|camera(\"c\").cut(2).key(\"fov\", [[0, 40], [2.0, 50]]);";
    assert_eq!(changed(shot, &|o| o.set_time("cut", at(3.0))), shot[1..].replace("cut(2)", "cut(3)"));
    assert_eq!(
        changed(shot, &|o| o.move_key("fov", at(0.0), at(1.0))),
        shot[1..].replace("[0, 40]", "[1, 40]")
    );
    let key = |o: &ScriptObject| o.set_key("fov", at(2.0), KeyValue::Text("30.0"));
    assert_eq!(changed(shot, &key), shot[1..].replace("[2.0, 50]", "[2.0, 30]"));
    let lens = |o: &ScriptObject| o.set_one_of(&["fov", "ortho"], "ortho", "3.0");
    assert_eq!(changed("|camera(\"c\").fov(34);", &lens), "camera(\"c\").ortho(3);");
}

#[test]
fn clip_names_title_words_and_assets_are_replaced() {
    let clip = |text: &str| {
        let edit = object(text, |object| object.set_clip("Run"));
        edit.map(|edit| edit.apply(&text.replacen('|', "", 1))).map_err(|refused| refused.why)
    };
    assert_eq!(
        clip("a.|play(moves.clip(\"Walk\"), #{ fade: 1 });").unwrap(),
        "a.play(moves.clip(\"Run\"), #{ fade: 1 });"
    );
    assert_eq!(
        clip("a.|play(load(\"x.glb\").clip(\"W, (\"));").unwrap(),
        "a.play(load(\"x.glb\").clip(\"Run\"));"
    );
    assert!(clip("a.|play(best);").unwrap_err().contains("best is not written as .clip(NAME)"));
    let title = "let t = |text(\"Hello, (you)\", #{ size: 0.1 });";
    let words = object(title, |object| object.set_words("Bye \"now\"").unwrap());
    assert_eq!(
        words.apply(&title.replacen('|', "", 1)),
        "let t = text(\"Bye \\\"now\\\"\", #{ size: 0.1 });"
    );
    for text in [
        "let a = |cast(\"a\", shape(\"box\", #{ size: 1.0 })).at(0, 1, 0);",
        "let m = shape(\"box\", #{ size: 1.0 });\nlet a = |cast(\"a\", m);",
    ] {
        let edit = object(text, |object| {
            let asset = object.asset_object().unwrap();
            assert_eq!(asset.creating_function(), "shape");
            asset.set_value("roughness", "0.5", NewValueSyntax::Option).unwrap()
        });
        let after = edit.apply(&text.replacen('|', "", 1));
        assert!(after.contains("shape(\"box\", #{ size: 1.0, roughness: 0.5 })"), "{after}");
    }
    assert!(object("let a = |cast(\"a\", pick(3)[0]);", |o| o.asset_object().map(|_| ()).is_ok()));
    assert!(object("let a = |cast(\"a\", other);", |o| o.asset_object().is_err()));
}

fn unrolled(text: &str) -> Result<String, String> {
    let (plain, line, column) = marked(text);
    unroll(&plain, line, column).map(|edit| edit.apply(&plain)).map_err(|refused| refused.why)
}

#[test]
fn unrolling_writes_the_body_once_per_value() {
    assert_eq!(
        unrolled("let x = 1;\nfor at in [1.0, 2.5] { a.|play(c).from(at); }\nlet y = at;").unwrap(),
        "let x = 1;\na.play(c).from(1.0);\na.play(c).from(2.5);\nlet y = at;"
    );
    assert_eq!(
        unrolled("  for i in 0..2 {\n    let d = |cast(`d ${i + 1}`, m).at(i * 2.0, 0, 0); // one\n    d.play(c, #{ i: i });\n  }\n").unwrap(),
        "  let d_1 = cast(\"d 1\", m).at(0.0, 0, 0); // one\n  d_1.play(c, #{ i: 0 });\n  let d_2 = cast(\"d 2\", m).at(2.0, 0, 0); // one\n  d_2.play(c, #{ i: 1 });\n"
    );
    assert_eq!(
        unrolled("for i in 0..2 { let d = |cast(\"d \" + i, m); d.play(c); }").unwrap(),
        "let d_0 = cast(\"d 0\", m); d_0.play(c);\nlet d_1 = cast(\"d 1\", m); d_1.play(c);"
    );
    assert_eq!(
        unrolled("for p in [[1, 2], [3, 4]] { for q in 1..=2 { |sun(#{ p: p[q] }); } }").unwrap(),
        "for p in [[1, 2], [3, 4]] { sun(#{ p: p[1] });\nsun(#{ p: p[2] }); }"
    );
}

/// Values get parentheses where operators need them, and constant expressions become literals.
#[test]
fn unrolling_folds_constant_expressions() {
    let body =
        |values: &str, body: &str| unrolled(&format!("for i in [{values}] {{ |f({body}); }}")).unwrap();
    for (value, written, expected) in [
        ("1", "\"post \" + i", "\"post 1\""),
        ("1", "`post ${i}`, `${i} of ${n}`", "\"post 1\", `1 of ${n}`"),
        (
            "-2",
            "i + 1, x * i, x - i, i * x, -i, 4 % 3, x % i",
            "-1, x * (-2), x - (-2), -2 * x, 2, 4 % 3, x % (-2)",
        ),
        ("3", "i / 2, i * 0.1, [i - 3, i], 1.0 / 3.0", "1, 0.30000000000000004, [0, 3], 1.0 / 3.0"),
        ("a + b", "i * 2, i, [i]", "(a + b) * 2, a + b, [a + b]"),
        ("0", "x + (i + 1) * y, g(i - 1), 1 / i", "x + 1 * y, g(-1), 1 / 0"),
        ("\"l\"", "\"hand_\" + i, a.b + i", "\"hand_l\", a.b + \"l\""),
        ("p[0]", "i * 2, i.x", "p[0] * 2, p[0].x"),
    ] {
        assert_eq!(body(value, written), format!("f({expected});"), "{value}: {written}");
    }
}

/// A variable that holds a literal is removed, so that its uses can be edited; other variables stay.
#[test]
fn unrolling_replaces_constant_variables_by_their_literals() {
    for (body, expected) in [
        (
            "let x = i * 1.5;\n    let n = \"post \" + i;\n    |cast(n, m).at(x, 0.0, -x + 1.0);",
            "cast(\"post 2\", m).at(3.0, 0.0, -2.0);",
        ),
        ("let x = i * 1.5; |f(x, `${x} m`, y.x, #{ x: x });", "f(3.0, \"3.0 m\", y.x, #{ x: 3.0 });"),
        ("let x = i - 3; |f(2 * x, a - x);", "f(-2, a - (-1));"),
        ("let x = i; x += 1; |f(x);", "let x_1 = 2; x_1 += 1; f(x_1);"),
        ("let x = i; // metres\n    |f(x);", "let x_1 = 2; // metres\nf(x_1);"),
        ("let x = sin(i); |f(x);", "let x_1 = sin(2); f(x_1);"),
        ("let x = [i]; |f(x[0]);", "let x_1 = [2]; f(x_1[0]);"),
        ("let x = i; |f(|x| x + 1);", "let x_1 = 2; f(|x_1| x_1 + 1);"),
        ("let x = i; if x == 2 { |f(x); }", "if 2 == 2 { f(2); }"),
    ] {
        let all = unrolled(&format!("for i in [2] {{\n    {body}\n}}")).unwrap();
        assert_eq!(all, expected, "{body}");
    }
}

#[test]
fn loops_that_cannot_be_unrolled_are_refused() {
    for (text, why) in [
        ("|sun();", "it is not in a loop"),
        ("for a in all { |sun(); }", "are computed"),
        ("for a in 0..n { |sun(); }", "are computed"),
        ("for a in 0..1000 { |sun(); }", "too many iterations"),
        ("for a in [1, 2] { if x { break; } |sun(); }", "contains break, continue or return"),
        ("for a in [1, 2] { let a = 3; |sun(); }", "with the loop variable's name"),
        ("for a in [1, 2] { |sun(); for a in [3] { f(a); } }", "with the loop variable's name"),
    ] {
        let refused = unrolled(text).unwrap_err();
        assert!(refused.contains(why), "{text}: {refused}");
    }
}

#[test]
fn unrolling_truncated_text_does_not_panic() {
    let text = "for ä in [\"ü\", `é ${ä}`] { let x = ä; a.play(ä); } for i in 0..";
    let ends: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
    for from in &ends {
        for to in ends.iter().filter(|to| *to >= from) {
            for column in [1, 9, 30] {
                let _ = unroll(&text[*from..*to], 1, column);
            }
        }
    }
}

/// An option whose map becomes empty is set to `true`.
#[test]
fn values_in_the_map_of_an_option_are_set_and_removed() {
    let within = |text: &str, value: &str| {
        let edit = object(text, |object| object.set_value_in_option("shadow", "size", value).unwrap());
        edit.apply(&text.replace('|', ""))
    };
    assert_eq!(within("|sun();", "512"), "sun(#{ shadow: #{ size: 512 } });");
    assert_eq!(within("|sun(#{ shadow: true });", "512"), "sun(#{ shadow: #{ size: 512 } });");
    let both = "|sun(#{ shadow: #{ size: 1024, softness: 0.1 }, color: \"red\" });";
    assert_eq!(within(both, "512"), both.replace('|', "").replace("1024", "512"));
    let computed = "|sun(#{ shadow: soft });";
    let refused = object(computed, |object| object.set_value_in_option("shadow", "size", "512").unwrap_err());
    assert!(refused.why.contains("shadow: soft is computed"), "{}", refused.why);
    let without = |text: &str, name: &str| {
        let edit = object(text, |object| object.remove_value_in_option("shadow", name));
        edit.apply(&text.replace('|', ""))
    };
    assert_eq!(without(both, "size"), both.replace('|', "").replace("size: 1024, ", ""));
    assert_eq!(without("|sun(#{ shadow: #{ size: 1024 } });", "size"), "sun(#{ shadow: true });");
    assert_eq!(without("|sun(#{ shadow: true });", "size"), "sun(#{ shadow: true });");
}

#[test]
fn a_time_replaces_the_stated_one_or_is_added() {
    let timed = |text: &str, new_syntax: NewValueSyntax| {
        let time = EditTime { secs: 1.5, fps: 30.0 };
        object(text, |object| object.set_time_value("from", time, new_syntax).unwrap())
            .apply(&text.replace('|', ""))
    };
    assert_eq!(timed("a.|attach(b);", NewValueSyntax::Option), "a.attach(b, #{ from: 1.5 });");
    assert_eq!(
        timed("a.|attach(b, #{ from: f(6) });", NewValueSyntax::Option),
        "a.attach(b, #{ from: f(45) });"
    );
    assert_eq!(timed("a.|look_at(b).from(1.0);", NewValueSyntax::Option), "a.look_at(b).from(1.5);");
    assert_eq!(timed("a.|look_at(b);", NewValueSyntax::Method), "a.look_at(b).from(1.5);");
    // The options of `reach` are its third argument.
    assert_eq!(
        timed("a.|reach(\"hand\", b);", NewValueSyntax::Option),
        "a.reach(\"hand\", b, #{ from: 1.5 });"
    );
}

/// The text with the new stated name; also the old and the new variable, if it is renamed, too.
fn renamed(text: &str, by: NamedBy, to: &str) -> Result<(String, Option<String>), String> {
    let renaming = object(text, |object| object.rename(by, to)).map_err(|refused| refused.why)?;
    let plain = text.replacen('|', "", 1);
    let stated = renaming.stated.map_or(plain.clone(), |edit| edit.apply(&plain));
    let variable = renaming.variable.map(|(at, name)| {
        let old = plain[at..].split(' ').next().unwrap();
        format!("{old} {name}")
    });
    Ok((stated, variable))
}

#[test]
fn renaming_changes_the_stated_name_and_the_variable_of_the_same_name() {
    let (argument, option) = (NamedBy::Argument, NamedBy::Option);
    for (text, by, to, stated, variable) in [
        (
            "let ada = |cast(\"ada\", m);",
            argument,
            "Eve \"2\"",
            "let ada = cast(\"Eve \\\"2\\\"\", m);",
            Some("ada eve_2"),
        ),
        ("let a = |cast( \"ada\" , m);", argument, "eve", "let a = cast( \"eve\" , m);", None),
        ("|cast(\"ada\", m);", argument, "eve", "cast(\"eve\", m);", None),
        ("let ada = |cast(\"ada\", m);", argument, "Ada", "let ada = cast(\"Ada\", m);", None),
        (
            "let key = |sun(#{ name: \"key\" });",
            option,
            "main",
            "let key = sun(#{ name: \"main\" });",
            Some("key main"),
        ),
        ("let key = |sun();", option, "Main", "let key = sun();", Some("key Main")),
        ("let key = |sun();", option, "main light", "let key = sun();", Some("key main_light")),
        ("|sun();", option, "main light", "sun(#{ name: \"main light\" });", None),
        ("let p = |panel();", NamedBy::Variable, "board", "let p = panel();", Some("p board")),
    ] {
        let wanted = (stated.to_string(), variable.map(str::to_string));
        assert_eq!(renamed(text, by, to), Ok(wanted), "{text}");
    }
    for (text, by, to, why) in [
        (
            "|cast(\"a \" + n, m);",
            argument,
            "b",
            "line 1: its name, \"a \" + n, is computed; change it there",
        ),
        ("|cast(\"a\", m);\ncast(\"b\", m);", argument, "b", "line 2: \"b\" is the name of another cast"),
        (
            "sun(#{ name: \"b\" });\n|sun(#{ name: \"a\" });",
            option,
            "b",
            "line 1: \"b\" is the name of another sun",
        ),
        ("|panel();", NamedBy::Variable, "b", "line 1: it has no variable in the script; write let NAME = …"),
    ] {
        assert_eq!(renamed(text, by, to).unwrap_err(), why);
    }
    let name = |text: &str, by| object(text, |object| object.name(by));
    assert_eq!(name("let a = |cast(\"ada\", m);", argument).as_deref(), Some("ada"));
    assert_eq!(name("let key = |sun();", option).as_deref(), Some("key"));
    assert_eq!(name("|sun();", option), None);
}
