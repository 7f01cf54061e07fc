//! Edits of cues as strips of a timeline: trim, split, duplicate, copy, paste, disable.

use crate::marked::marked;
use choreo_session::edit::{
    CueTime, Edit, EditRefused, EditTime, NewValueSyntax, ScriptObject, SecondHalf, copied_cues, copy_cue,
    delete_cue, duplicate_cue, paste_cue, set_disabled, set_number, set_time, set_trim, shift_cue,
    shift_keys, split_cue,
};

fn at(secs: f64) -> EditTime {
    EditTime { secs, fps: 25.0 }
}

type StripEdit<'c> = &'c dyn Fn(&str, usize, usize) -> Result<Edit, EditRefused>;

fn changed(text: &str, change: StripEdit) -> Result<String, String> {
    let (text, line, column) = marked(text);
    let edit = change(&text, line, column).map_err(|refused| refused.why)?;
    let after = edit.apply(&text);
    assert_eq!(edit.inverse(&text).apply(&after), text);
    Ok(after)
}

#[test]
fn numbers_of_a_cue_replace_the_stated_ones() {
    let trim = |text: &str| changed(text, &|t, l, c| set_trim(t, l, c, [0.5, 2.0], 25.0));
    assert_eq!(trim("a.|play(c).until(2.0);").unwrap(), "a.play(c, #{ trim: [0.5, 2.0] }).until(2.0);");
    assert_eq!(trim("a.|play(c).trim( 0, 1.5 );").unwrap(), "a.play(c).trim( 0.5, 2.0 );");
    assert_eq!(trim("a.|play(c, #{ trim: [0.0, 1.0] });").unwrap(), "a.play(c, #{ trim: [0.5, 2.0] });");
    // An end that changes keeps its style, seconds or frames; an unchanged end is not rewritten.
    assert_eq!(trim("a.|play(c).trim(f(5), 4.0 / 2.0);").unwrap(), "a.play(c).trim(0.5, 4.0 / 2.0);");
    assert_eq!(trim("a.|play(c).trim(1.0 / 2.0, f(75));").unwrap(), "a.play(c).trim(1.0 / 2.0, f(50));");
    assert_eq!(
        trim("a.|play(c).trim(x, 1.0);").unwrap_err(),
        "line 1: trim: x, 1.0 is computed; change it there"
    );
    let speed = |text: &str| changed(text, &|t, l, c| set_number(t, l, c, "speed", 1.25)).unwrap();
    assert_eq!(speed("a.|play(c, #{ speed: 2 }).speed(3);"), "a.play(c, #{ speed: 2 }).speed(1.25);");
    // A calculation with literals is replaced like a number.
    assert_eq!(speed("a.|play(c, #{ speed: 1.0 / 3.0 });"), "a.play(c, #{ speed: 1.25 });");
    assert_eq!(speed("a.|play(c).speed(-(1.0 + 2.0) / 3.0);"), "a.play(c).speed(1.25);");
    assert_eq!(trim("a.|play(c).trim(1.0/3.0, 1.5);").unwrap(), "a.play(c).trim(0.5, 2.0);");
    assert_eq!(
        trim("a.|play(c, #{ trim: [0.0, 4.0 / 3.0] });").unwrap(),
        "a.play(c, #{ trim: [0.5, 2.0] });"
    );
    let weight = changed("a.|play(c).weight(1.0/3.0);", &|t, l, c| set_number(t, l, c, "weight", 0.5));
    assert_eq!(weight.unwrap(), "a.play(c).weight(0.5);");
    let computed = changed("a.|play(c).speed(1.0 / x);", &|t, l, c| set_number(t, l, c, "speed", 1.25));
    assert!(computed.unwrap_err().contains("computed"));
}

/// A new value is an option or a method like the other values of the cue, and an option if there are none.
#[test]
fn a_new_value_has_the_syntax_of_the_other_values_of_the_cue() {
    let speed = |text: &str| changed(text, &|t, l, c| set_number(t, l, c, "speed", 2.0)).unwrap();
    assert_eq!(
        speed("a.|play(c).from(1.0).on(\"Head\");"),
        "a.play(c, #{ speed: 2.0 }).from(1.0).on(\"Head\");"
    );
    assert_eq!(
        speed("a.|play(c, #{ fade: 0.4 }).weight(0.5);"),
        "a.play(c, #{ fade: 0.4, speed: 2.0 }).weight(0.5);"
    );
    assert_eq!(speed("a.|play(c).from(1.0).weight(0.5);"), "a.play(c).from(1.0).weight(0.5).speed(2.0);");
    assert_eq!(speed("a.|play(c, options);"), "a.play(c, options).speed(2.0);");
    let fade = |text: &str| changed(text, &|t, l, c| set_time(t, l, c, CueTime::FadeIn, at(0.8))).unwrap();
    assert_eq!(fade("a.|play(c).until(2.0);"), "a.play(c, #{ fade: 0.8 }).until(2.0);");
    assert_eq!(fade("a.|play(c).until(2.0).weight(0.5);"), "a.play(c).until(2.0).weight(0.5).fade(0.8);");
    // The edit changes the value that has effect.
    assert_eq!(fade("a.|play(c, #{ fade: 0.1 }).fade(f(5));"), "a.play(c, #{ fade: 0.1 }).fade(f(20));");
    assert_eq!(fade("a.|play(c, #{ inertial: 0.2 });"), "a.play(c, #{ inertial: 0.8 });");
    let end = |text: &str| changed(text, &|t, l, c| set_time(t, l, c, CueTime::End, at(3.0))).unwrap();
    assert_eq!(end("a.|play(c, #{ until: f(50) });"), "a.play(c, #{ until: f(75) });");
    let stated = |text: &str, new_syntax| {
        changed(text, &|t, l, c| ScriptObject::at(t, l, c)?.set_value("speed", "1.0 / 3.0", new_syntax))
            .unwrap()
    };
    assert_eq!(
        stated("a.|play(c).weight(0.5);", NewValueSyntax::LikeOthers),
        "a.play(c).weight(0.5).speed(1.0 / 3.0);"
    );
    assert_eq!(stated("a.|play(c);", NewValueSyntax::LikeOthers), "a.play(c, #{ speed: 1.0 / 3.0 });");
    assert_eq!(
        stated("a.|play(c).speed(2.0 / 3.0);", NewValueSyntax::LikeOthers),
        "a.play(c).speed(1.0 / 3.0);"
    );
}

#[test]
fn a_disabled_cue_keeps_its_weight_in_a_comment() {
    let off = |text: &str| changed(text, &|t, l, c| set_disabled(t, l, c, true)).unwrap();
    let on = |text: &str| changed(text, &|t, l, c| set_disabled(t, l, c, false)).unwrap();
    for text in [
        "a.|play(c).until(2.0);",
        "a.|play(c).weight(0.5);",
        "a.|play(c).weight(1.0 / 3.0);",
        "a.|play(c, #{ weight: 0.7 });",
    ] {
        let plain = text.replace('|', "");
        let disabled = off(text);
        assert!(disabled.contains("0.0"), "{disabled}");
        assert_eq!(on(&disabled.replace("play", "|play")), plain);
    }
    assert_eq!(off("a.|play(c).weight(0.5);"), "a.play(c).weight(0.0 /* 0.5 */);");
    assert_eq!(off("a.|play(c).weight(1);"), "a.play(c).weight(0 /* 1 */);");
    assert!(changed("a.|play(c).weight(w);", &|t, l, c| set_disabled(t, l, c, true)).is_err());
}

#[test]
fn splitting_a_cue_preserves_its_content() {
    let rest = SecondHalf::Trim([1.0, 2.5]);
    let split = |text: &str, rest, fade| changed(text, &|t, l, c| split_cue(t, l, c, at(1.5), rest, fade));
    assert_eq!(
        split("x();\n  a.|play(c, #{ fade: 0.3, speed: 2 }).from(0.5).until(f(75)); // in", rest, None)
            .unwrap(),
        "x();\n  a.play(c, #{ fade: 0.3, speed: 2 }).from(0.5).until(1.5) // in\n      .then(c, #{ speed: 2, trim: [1.0, 2.5] }).until(f(75));"
    );
    let chain = split("a.|play(c).weight(0.5)\n    .then(d);", SecondHalf::LikeFirstHalf, None).unwrap();
    assert_eq!(chain, "a.play(c).until(1.5).weight(0.5)\n    .then(c).weight(0.5)\n    .then(d);");
    let keys = SecondHalf::ClipTime([[1.5, 0.25], [4.0, 2.75]]);
    // The second half gets all options that are not about the ends of the cue.
    let in_place =
        split("a.|play(c, #{ reverse: true, ease: \"smooth\" }).in_place().inertial(0.2);", rest, None);
    let second = ".then(c, #{ reverse: true, trim: [1.0, 2.5] }).in_place()";
    assert!(in_place.as_ref().is_ok_and(|text| text.contains(second)), "{in_place:?}");
    let looped = split("a.|play(c, #{ until: 4.0 });", keys, None).unwrap();
    assert_eq!(
        looped,
        "a.play(c, #{ until: 1.5 })\n    .then(c).clip_time([[1.5, 0.25], [4.0, 2.75]]).until(4.0);"
    );
    let layer = split("a.|play(c).fade(0.5).until(2.0).on(\"Head\");", rest, Some(0.5)).unwrap();
    assert_eq!(
        layer,
        "a.play(c).fade(0.5).until(1.5).fade_out(0.0).on(\"Head\")\n    .then(c).trim(1.0, 2.5).until(2.0).fade_out(0.5);"
    );
    let why = split("let w = a.|play(c);", rest, None).unwrap_err();
    assert_eq!(why, "line 1: the script uses this clip as variable \"w\"; change it there");
    assert!(split("let a = cast(\"a\", m).|play(c);", rest, None).is_ok());
}

#[test]
fn a_duplicated_cue_follows_the_original() {
    let twice =
        |text: &str, by, until| changed(text, &|t, l, c| duplicate_cue(t, l, c, at(by), until)).unwrap();
    assert_eq!(
        twice("a.|play(c).trim(0.5, 1).from(1.0).until(2.0).then(d);", 1.0, Some(at(3.0))),
        "a.play(c).trim(0.5, 1).from(1.0).until(2.0)\n    .then(c).trim(0.5, 1).until(3.0).then(d);"
    );
    assert_eq!(twice("a.|play(c);", 1.0, None), "a.play(c)\n    .then(c);");
    assert_eq!(twice("a.|play(c, options);", 1.0, None), "a.play(c, options)\n    .then(c, options);");
    // The new time has the style of the duplicated cue, and the comment stays on its line.
    assert_eq!(
        twice("a.|play(c).from(f(25)).until(f(50)); // in", 1.0, Some(at(3.0))),
        "a.play(c).from(f(25)).until(f(50)) // in\n    .then(c).until(f(75));"
    );
    // The duplicate gets everything but stage times and calls that apply to the whole layer.
    assert_eq!(
        twice(
            "a.|play(c, #{ fade: 0.2, from: 1.0 }).ease(\"smooth\").on(\"x\").until(2.0);",
            1.0,
            Some(at(3.0))
        ),
        "a.play(c, #{ fade: 0.2, from: 1.0 }).ease(\"smooth\").on(\"x\").until(2.0)\n    .then(c, #{ fade: 0.2 }).ease(\"smooth\").until(3.0);"
    );
    // Keys and freezes are in stage time, so they are shifted.
    assert_eq!(
        twice(
            "a.|play(c).clip_time([[1.0, 0.0], [f(50), 1.0]]).freeze(1.5, 0.5).weight([[1, 0], [2, 1]]);",
            1.0,
            None
        ),
        "a.play(c).clip_time([[1.0, 0.0], [f(50), 1.0]]).freeze(1.5, 0.5).weight([[1, 0], [2, 1]])\n    .then(c).clip_time([[2.0, 0.0], [f(75), 1.0]]).freeze(2.5, 0.5).weight([[2, 0], [3, 1]]);"
    );
    assert_eq!(
        twice("a.|play(c, #{ weight: [[1, 0], [f(50), 1]], fade: 0.2 });", 1.0, None),
        "a.play(c, #{ weight: [[1, 0], [f(50), 1]], fade: 0.2 })\n    .then(c, #{ weight: [[2, 0], [f(75), 1]], fade: 0.2 });"
    );
    assert!(
        changed("a.|play(c)\n    .freeze(now, 0.5);", &|t, l, c| duplicate_cue(t, l, c, at(1.0), None))
            .is_err()
    );
}

#[test]
fn a_copied_cue_is_pasted_on_another_row_and_into_another_script() {
    let text = "let m = load(\"m.glb\");\nlet a = cast(\"a\", m);\na.play(m.clip(\"x\")).on(\"Head\").until(1.0)\n    .|then(m.clip(\"y\"), #{ fade: 0.2 }).until(2.0).weight([[1.0, 0], [f(50), 1]]);\nlet b = cast(\"b\", m);\n";
    let (text, line, column) = marked(text);
    let copied = copy_cue(&text, line, column, at(1.0), Some(at(2.0))).unwrap();
    assert_eq!(
        copied,
        "play(load(\"m.glb\").clip(\"y\"), #{ fade: 0.2 }).from(1.0).until(2.0).weight([[1.0, 0], [f(50), 1]]).on(\"Head\")"
    );
    let pasted = paste_cue(&text, 5, 9, &copied, at(3.0)).unwrap().apply(&text);
    let line = "\nb.play(m.clip(\"y\"), #{ fade: 0.2 }).from(3.0).until(4.0).weight([[3.0, 0], [f(100), 1]]).on(\"Head\");\n";
    assert!(pasted.ends_with(line), "{pasted}");
    let other = "let z = cast(\"z\", load(\"z.glb\"));";
    let pasted = paste_cue(other, 1, 9, &copied, at(0.0)).unwrap().apply(other);
    assert!(pasted.contains("\nz.play(load(\"m.glb\").clip(\"y\"), #{ fade: 0.2 }).until(1.0)"), "{pasted}");
    // If the actor's own variable holds the same file, the clip comes from it.
    let own =
        "let m = load(\"m.glb\", #{ color: \"red\" });\nlet n = load(\"m.glb\");\nlet z = cast(\"z\", n);";
    let pasted = paste_cue(own, 3, 9, &copied, at(0.0)).unwrap().apply(own);
    assert!(pasted.contains("\nz.play(n.clip(\"y\"), #{ fade: 0.2 })"), "{pasted}");
    let why = paste_cue(other, 1, 9, "play(walk).from(1.0)", at(0.0)).unwrap_err().why;
    assert_eq!(why, "this script has no variable \"walk\", which the copied clip uses");
    for none in ["", "hello", "play(", "cast(c).from(1.0)", "play(c).from(1.0); b.play(d)"] {
        assert_eq!(
            paste_cue(other, 1, 9, none, at(0.0)).unwrap_err().why,
            "the clipboard holds no clip of a timeline"
        );
    }
}

/// Options on several lines, comments, and calls in later lines on the variable of the cue are copied.
#[test]
fn a_copied_cue_has_its_options_of_all_lines() {
    let text = "let m = load(\"m.glb\");\nlet a = cast(\"a\", m);\nlet w = a.|play(m.clip(\"x\"), #{\n    fade: 0.2, // in\n}).until(2.0)\n    .speed(2) // fast\n    .reverse();\nw.ease(\"smooth\").from(1.0);\nif x { w.weight(0.5); }\nlet b = cast(\"b\", m);\n";
    let (text, line, column) = marked(text);
    let copied = copy_cue(&text, line, column, at(1.0), Some(at(2.0))).unwrap();
    let wanted = "play(load(\"m.glb\").clip(\"x\"), #{\n    fade: 0.2, // in\n}).from(1.0).until(2.0)\n    .speed(2) // fast\n    .reverse().ease(\"smooth\")";
    assert_eq!(copied, wanted);
    let two = format!("{copied}\nplay(c).from(2.0);\n");
    assert_eq!(copied_cues(&two), [wanted, "play(c).from(2.0);"]);
    assert_eq!(copied_cues("say(play(c));"), Vec::<&str>::new());
    let pasted = paste_cue(&text, 10, 9, &copied, at(3.0)).unwrap().apply(&text);
    assert!(pasted.ends_with("\nb.play(m.clip(\"x\"), #{\n    fade: 0.2, // in\n}).from(3.0).until(4.0)\n    .speed(2) // fast\n    .reverse().ease(\"smooth\");\n"), "{pasted}");
}

/// Lines keep their indentation relative to the first line of the cue.
#[test]
fn a_pasted_cue_of_several_lines_is_indented() {
    let text = "let m = load(\"m.glb\");\nlet a = cast(\"a\", m);\na.play(m.clip(\"x\")).until(1.0)\n    .|then(m.clip(\"y\"), #{\n        fade: 0.2, // soft\n        speed: 2.0,\n    })\n    .until(2.0);\nlet b = cast(\"b\", m);\n";
    let (text, line, column) = marked(text);
    let play = "play(m.clip(\"y\"), #{\n    fade: 0.2, // soft\n    speed: 2.0,\n})";
    let copied = copy_cue(&text, line, column, at(1.0), Some(at(2.0))).unwrap();
    let pasted = paste_cue(&text, 9, 9, &copied, at(3.0)).unwrap().apply(&text);
    assert!(pasted.ends_with(&format!("\nb.{play}.from(3.0)\n    .until(4.0);\n")), "{pasted}");
    // Deleting the first cue makes the second cue the first of the chain.
    let alone = delete_cue(&text, 3, 3, Some(at(1.0))).unwrap().apply(&text);
    assert!(alone.contains(&format!("\na.{play}.from(1.0)\n    .until(2.0);\n")), "{alone}");
    // The list of keys of a duplicate is indented one level deeper.
    let keyed = "a.|play(c).weight([\n    [1.0, 0],\n    [2.0, 1]\n]).until(2.0);";
    let twice = changed(keyed, &|t, l, c| duplicate_cue(t, l, c, at(1.0), Some(at(3.0)))).unwrap();
    let second = "\n    .then(c).weight([\n        [2.0, 0],\n        [3.0, 1]\n    ]).until(3.0);";
    assert!(twice.ends_with(second), "{twice}");
}

/// Times in frames stay in frames.
#[test]
fn a_copied_cue_keeps_its_comment_and_the_style_of_its_times() {
    let text = "let m = load(\"m.glb\");\nlet a = cast(\"a\", m);\na.|play(m.clip(\"x\")).from(f(25)).until(f(50)); // waves\nlet b = cast(\"b\", m);\n";
    let (text, line, column) = marked(text);
    let copied = copy_cue(&text, line, column, at(1.0), Some(at(2.0))).unwrap();
    assert_eq!(copied, "play(load(\"m.glb\").clip(\"x\")).from(f(25)).until(f(50)); // waves");
    let pasted = paste_cue(&text, 4, 9, &copied, at(3.0)).unwrap().apply(&text);
    assert!(pasted.ends_with("\nb.play(m.clip(\"x\")).from(f(75)).until(f(100)); // waves\n"), "{pasted}");
    // A following cue gets its start in frames, like the end of the cue before it.
    let chain = "a.play(c).until(f(50)) // walks\n    .|then(d)\n    .then(e); // both";
    let (chain, line, column) = marked(chain);
    assert_eq!(copy_cue(&chain, line, column, at(2.0), None).unwrap(), "play(d).from(f(50))");
    let copy = |text: &str, start| {
        let (text, line, column) = marked(text);
        copy_cue(&text, line, column, at(start), Some(at(start + 1.0))).unwrap()
    };
    // The comment of a line with two cues is not copied.
    assert_eq!(
        copy("a.play(c).until(1.0).|then(d).until(2.0); // both", 1.0),
        "play(d).from(1.0).until(2.0)"
    );
    // Computed times become the times of the bar; times relative to a sequence become stage times.
    assert_eq!(copy("a.|play(c).from(x).until(x + 1.0);", 3.0), "play(c).from(3.0).until(4.0)");
    assert_eq!(copy("a.|play(c).from(1.0).until(f(50));", 3.0), "play(c).from(3.0).until(f(100))");
    assert_eq!(
        copy("a.|play(c, #{ from: f(25), until: 2.0 });", 1.0),
        "play(c, #{ from: f(25), until: 2.0 })"
    );
    // For an actor without a variable, the cue is added to the chain of its `cast`.
    let pasted = |text: &str| {
        paste_cue(text, 1, 1, "play(load(\"m\").clip(\"x\")); // in", at(0.0)).unwrap().apply(text)
    };
    assert_eq!(pasted("cast(\"a\", m);\n"), "cast(\"a\", m).play(load(\"m\").clip(\"x\")); // in\n");
    assert_eq!(pasted("cast(\"a\", m); // a"), "cast(\"a\", m).play(load(\"m\").clip(\"x\")) /* in */; // a");
}

#[test]
fn shifting_a_cue_shifts_its_keys() {
    let text = "a.|play(c).clip_time([[1.0, 0.0], [f(50), 1.0]]).freeze(1.5, 0.5).from(1.0);";
    let moved = changed(text, &|t, l, c| shift_cue(t, l, c, at(0.4))).unwrap();
    assert_eq!(moved, "a.play(c).clip_time([[1.4, 0.0], [f(60), 1.0]]).freeze(1.9, 0.5).from(1.4);");
    let option = "a.|play(c, #{ speed: [[1.0, 1], [2.0, 3]] }).from(1.0);";
    let moved = changed(option, &|t, l, c| shift_cue(t, l, c, at(0.4))).unwrap();
    assert_eq!(moved, "a.play(c, #{ speed: [[1.4, 1], [2.4, 3]] }).from(1.4);");
    let why = changed("a.|play(c).weight([[t, 0]]);", &|t, l, c| shift_keys(t, l, c, at(1.0))).unwrap_err();
    assert_eq!(why, "line 1: weight: [[t, 0]] is computed; change it there");
}

#[test]
fn edits_of_truncated_text_do_not_panic() {
    let text = "ä.play(\"ü(\").from(1.0).weight(0.0 /* é */).then(x).until('\\'').trim(0,1);";
    let ends: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
    for from in &ends {
        for to in ends.iter().filter(|to| *to >= from) {
            for column in 1..9 {
                let part = &text[*from..*to];
                let _ = split_cue(part, 1, column, at(1.0), SecondHalf::LikeFirstHalf, Some(0.1));
                let _ = duplicate_cue(part, 1, column, at(1.0), None);
                let _ = set_disabled(part, 1, column, false);
                let _ = copy_cue(part, 1, column, at(0.0), None);
                let _ = paste_cue(part, 1, column, part, at(0.0));
                let _ = shift_cue(part, 1, column, at(0.0));
            }
        }
    }
}
