//! Methods that are added to a chain of calls where a person would write them: grouped by kind, in the usual order of scripts, and on a line of
//! their own if the other calls of the chain are.

use super::Edit;
use super::scan::{Call, Source};
use super::strips::is_layer_call;

/// Methods that return another object or value: the calls after them are no longer about the object of the chain.
const RETURN_OTHER_VALUES: [&str; 15] = [
    "joint",
    "joints",
    "reach",
    "aim",
    "plant_feet",
    "mirror",
    "walk_to",
    "camera",
    "play",
    "then",
    "then_at",
    "length",
    "time_of",
    "start",
    "end",
];
/// Calls that make a clip or a constraint; their times come first in the chain.
const TIMED_CALLS: [&str; 9] =
    ["play", "then", "then_at", "walk_to", "reach", "aim", "plant_feet", "mirror", "look_at"];
/// Methods that place an object.
const PLACING_METHODS: [&str; 10] =
    ["at", "move_by", "turn", "rotate", "scale", "face", "look_at", "follow", "orbit", "frame"];
/// Methods that change the space of the placing methods after them.
const PARENTING_METHODS: [&str; 2] = ["attach", "detach"];

/// Rank of a method in the order in which a person writes them.
fn method_rank(is_timed: bool, name: &str) -> usize {
    match name {
        "from" if is_timed => 0,
        "until" if is_timed => 1,
        name if is_timed => 2 + usize::from(is_layer_call(name)),
        name if PLACING_METHODS.contains(&name) => 0,
        "from" => 2,
        "until" => 3,
        "fade" => 4,
        "cut" => 5,
        "key" | "path" | "shake" => 6,
        name if PARENTING_METHODS.contains(&name) => 6,
        _ => 1,
    }
}

/// The edit that adds a method, `scale(2.0)`, to the chain of a call, after the methods that come before it in [`method_rank`].
pub(super) fn add_method(text: &Source, creating_call: &Call, method: &str) -> Edit {
    let maker = &text[creating_call.name.clone()];
    let name = method.split('(').next().unwrap_or_default();
    let is_timed = TIMED_CALLS.contains(&maker);
    let own = method_rank(is_timed, name);
    let chain = text.chain_after(creating_call.end);
    let is_before = |call: &&Call| {
        let other = &text[call.name.clone()];
        let is_other = RETURN_OTHER_VALUES.contains(&other) || other == "look_at" && maker == "cast";
        // A `fade` also sets the fade-out, so it must come before a `fade_out`.
        let ends = own == 0 && PARENTING_METHODS.contains(&other) || name == "fade" && other == "fade_out";
        !is_other && !ends
    };
    let before = chain.iter().take_while(is_before);
    let last = before.filter(|call| method_rank(is_timed, &text[call.name.clone()]) <= own).last();
    add_method_after(text, creating_call, last.map_or(creating_call.end, |call| call.end), method)
}

/// The edit that adds a method after a byte of a chain: on a line of its own if the calls of the chain are, with the same indentation and after the
/// comment of the line.
pub(super) fn add_method_after(text: &Source, creating_call: &Call, at: usize, method: &str) -> Edit {
    let end = text[at..].find('\n').map_or(text.len(), |end| at + end);
    let rest = text[at..end].trim_end();
    let next = text.next_token_start(at);
    let continues = next < end && text[next..].starts_with('.');
    let Some(blanks) = indentation(text, creating_call).filter(|_| !continues) else {
        return Edit { range: at..at, text: format!(".{method}") };
    };
    let line = format!("\n{blanks}.{method}");
    let is_comment = |rest: &str| {
        let block = rest.strip_prefix("/*").and_then(|rest| rest.split_once("*/"));
        rest.starts_with("//") || block.is_some_and(|(_, behind)| behind.is_empty())
    };
    match rest.strip_prefix(';') {
        None if is_comment(rest.trim_start()) => {
            let behind = at + rest.len();
            Edit { range: behind..behind, text: line }
        }
        Some(comment) if is_comment(comment.trim_start()) => {
            Edit { range: at..at + rest.len(), text: format!("{comment}{line};") }
        }
        _ => Edit { range: at..at, text: line },
    }
}

/// Indentation of the calls of a chain that begin a line. `None` if none does.
fn indentation<'t>(text: &'t Source, creating_call: &Call) -> Option<&'t str> {
    let begins = |call: &Call| {
        let dot = text[..call.name.start].rfind('.')?;
        let line = text[..dot].rfind('\n')? + 1;
        Some(&text[line..dot]).filter(|blanks| blanks.trim().is_empty())
    };
    let chain = text.chain_after(creating_call.end);
    // A `then` gets a line of its own if each clip of the chain has one.
    let next = || text.call_from(creating_call.end).filter(|call| text[call.name.clone()] == *"play");
    match chain.is_empty() {
        true => next().as_ref().and_then(begins),
        false => chain.iter().find_map(begins),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The chain after a creating call, with a method added.
    fn chain_with_method(made: &str, chain: &str, method: &str) -> String {
        let text = format!("{made}{chain}");
        let source = Source::new(&text);
        let made_call = source.call_from(made.find('.').unwrap_or(0)).unwrap();
        add_method(&source, &made_call, method).apply(&text).strip_prefix(made).unwrap().to_string()
    }

    #[test]
    fn a_new_method_follows_the_methods_of_its_group() {
        let (cast, camera, play) = ("cast(\"a\", m)", "camera(\"c\")", "a.play(c)");
        for (made, chain, method, wanted) in [
            (cast, ".at(1, 0, 0);", "scale(2.0)", ".at(1, 0, 0).scale(2.0);"),
            (cast, ".tint(x).play(c);", "at(1.0)", ".at(1.0).tint(x).play(c);"),
            (cast, ".at(1).key(\"x\", k);", "tint(x)", ".at(1).tint(x).key(\"x\", k);"),
            // The calls after `joint` and `reach` are about a joint or a constraint.
            (cast, ".joint(\"J\").turn(5);", "turn(9.0)", ".turn(9.0).joint(\"J\").turn(5);"),
            (cast, ".look_at(p).fade(1);", "tint(x)", ".tint(x).look_at(p).fade(1);"),
            // Placing methods after `attach` act in the space of the parent.
            (cast, ".attach(b).turn(5);", "at(1.0)", ".at(1.0).attach(b).turn(5);"),
            (camera, ".at(1).look_at(p).cut(2);", "fov(40.0)", ".at(1).look_at(p).fov(40.0).cut(2);"),
            ("text(\"a\")", ".from(1);", "until(2.0)", ".from(1).until(2.0);"),
            ("effect(\"a\")", ".set(\"b\", 1).until(2);", "from(1.0)", ".set(\"b\", 1).from(1.0).until(2);"),
            (play, ".speed(2).on(\"x\");", "weight(0.5)", ".speed(2).weight(0.5).on(\"x\");"),
            (play, ".speed(2);", "from(1.0)", ".from(1.0).speed(2);"),
            (play, ".until(2).end();", "weight(0.5)", ".until(2).weight(0.5).end();"),
            (play, ".fade_out(1).speed(2);", "fade(0.5)", ".fade(0.5).fade_out(1).speed(2);"),
            (play, ".fade(1).speed(2).then(d);", "fade_out(0.5)", ".fade(1).speed(2).fade_out(0.5).then(d);"),
        ] {
            assert_eq!(chain_with_method(made, chain, method), wanted);
        }
    }

    #[test]
    fn a_chain_over_several_lines_gets_another_line() {
        for (chain, wanted) in [
            ("\n  .at(1, 0, 0);\n", "\n  .at(1, 0, 0)\n  .scale(2.0);\n"),
            ("\n    .at(1) // left\n    .play(c);", "\n    .at(1) // left\n    .scale(2.0)\n    .play(c);"),
            ("\n    .at(1); // left\nb();", "\n    .at(1) // left\n    .scale(2.0);\nb();"),
            (" // she\n    .play(c);", " // she\n    .scale(2.0)\n    .play(c);"),
            ("\n    .at(1) /* a\n b */ .tint(x);", "\n    .at(1)\n    .scale(2.0) /* a\n b */ .tint(x);"),
            // A line with several methods gets one more.
            (".at(1)\n    .play(c);", ".at(1).scale(2.0)\n    .play(c);"),
            ("\n    .at(1).tint(x)\n    .play(c);", "\n    .at(1).scale(2.0).tint(x)\n    .play(c);"),
        ] {
            assert_eq!(chain_with_method("cast(\"a\", m)", chain, "scale(2.0)"), wanted);
        }
        // Each clip has a line.
        let clips = chain_with_method("a.play(c)", ".until(2)\n    .then(d)\n    .then(e);", "speed(2.0)");
        assert_eq!(clips, ".until(2).speed(2.0)\n    .then(d)\n    .then(e);");
        assert_eq!(
            chain_with_method("a.play(c)", "\n    .then(d);", "until(2.0)"),
            ".until(2.0)\n    .then(d);"
        );
    }
}
