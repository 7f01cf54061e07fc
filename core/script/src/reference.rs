//! Generates the script reference, `API.md`, from the tables that also register the functions.

use crate::api::{TABLES, defs};
use crate::compile::{CONSTANTS, FORBIDDEN_NAMES};
use crate::def::ResultType;
use crate::limits::Limits;
use crate::synonyms::ALIASES;
use std::fmt::Write;

/// The reference of everything that a script can call, as Markdown.
pub fn reference() -> String {
    let mut out = String::from(INTRODUCTION);
    for (title, tables) in TABLES {
        let _ = writeln!(out, "\n## {title}\n");
        for function in tables.iter().copied().flatten() {
            let def = &function.def;
            let forms = def.usages(&def.full_name());
            let result_type = match def.returns {
                ResultType::Nothing | ResultType::Receiver => String::new(),
                ResultType::Handle(kind) => format!(" → {}", kind.name()),
                ResultType::Value(what) => format!(" → {what}"),
            };
            let frame_mark = if def.is_for_frames { " ◦" } else { "" };
            let (usages, about) = (forms.join("` or `"), def.about().join("\n  - "));
            let _ = writeln!(out, "- `{usages}`{result_type}{frame_mark} — {about}");
        }
    }
    let _ = writeln!(
        out,
        "\n## Mathematics\n\nFunctions of numbers take ints and floats. All functions give the same bits on every machine and can be called inside `on_frame` (◦).\n"
    );
    for (name, args, about) in defs().maths {
        let _ = writeln!(out, "- `{name}({args})` — {about}");
    }
    for (name, about) in CONSTANTS {
        let _ = writeln!(out, "- `{name}` — {about}");
    }
    let _ = writeln!(out, "\n## Aliases\n\nOther names for the same.\n");
    for (alias, name) in ALIASES {
        let _ = writeln!(out, "- `{alias}` is `{name}`.");
    }
    let _ = writeln!(out, "\n## What a script cannot use\n");
    for (name, why) in FORBIDDEN_NAMES {
        let _ = writeln!(out, "- `{name}`: {why}");
    }
    let _ = writeln!(
        out,
        "\n## Limits\n\nSet with `--limit NAME=NUMBER`. The message about a reached limit names it.\n"
    );
    for (name, default, about) in Limits::ALL {
        let _ = writeln!(out, "- `{name}` = {} — {about}", Limits::shown(*default, about));
    }
    out
}

const INTRODUCTION: &str = "# What a script can call

This file is generated from the tables in `core/script/src/api/`. A test compares them; `CHOREO_ACCEPT=1 cargo test --workspace --test reference` writes the file anew.

## Conventions

- The language is [Rhai](https://rhai.rs/book/).
- Times are in seconds; `f(12)` is the time of frame 12. Lengths are in metres. +y is up, and characters face +z where their file does not show another front (`choreo info`, `load(…, #{ facing: … })`).
- Angles are in degrees; only `sin`, `cos` and the other trigonometric functions use radians.
- A color is a CSS name, `\"#rrggbb\"` or `[r, g, b]` with numbers from 0 to 1, in sRGB. A point is `[x, y, z]`.
- `x?` is an argument that may be left out. `→` gives the type of the result. A method without an arrow returns the object that it was called on, so that calls can be chained.
- Options are an object map, `#{ name: value }`. Ranges and defaults are in parentheses.
- ◦ marks what can also be called inside `on_frame`, where it holds for that frame only.
- `import \"steps\" as steps;` imports the module `steps.rhai` from the folder of the script. `print(…)` and `debug(…)` write to the messages of the program.
- A script may contain tests, after the scene or alone: `test(\"name\", || { … })`. `choreo test` runs each test on a stage of its own; other commands skip them. The other functions under the headings \"Tests\" work only inside a test. A comment `//~ error: TEXT` or `//~ warning: TEXT` states that its line, or the line above it, gives a message with that text.
- `choreo help TERM` finds a function by a word of the field, of Blender, Unity, Motion Canvas or three.js, such as \"ik\" or \"foot sliding\". Error messages suggest functions and options by the same words.
";
