//! `API.md`, from the tables: what is registered is what is listed.

use crate::api::{TABLES, maths::FUNCTIONS};
use crate::call::Gives;
use crate::engine::{CONSTANTS, REFUSED};
use crate::limits::Limits;
use crate::value::Kind;
use std::fmt::Write;

/// The reference of everything that a script can call, as Markdown.
pub fn reference() -> String {
    let mut out = String::from(HEAD);
    for (title, tables) in TABLES {
        let _ = writeln!(out, "\n## {title}\n");
        for def in tables.iter().copied().flatten() {
            let prefix = match def.on {
                Kind::None => String::new(),
                kind => format!("{}.", kind.name()),
            };
            let forms: Vec<String> =
                def.args.split('|').map(|form| format!("{prefix}{}({})", def.name, form.trim())).collect();
            let gives = match def.gives {
                Gives::Nothing | Gives::Itself => String::new(),
                Gives::A(kind) => format!(" → {}", kind.name()),
                Gives::Value(what) => format!(" → {what}"),
            };
            let frame = if def.frame { " ◦" } else { "" };
            let _ = writeln!(out, "- `{}`{gives}{frame} — {}", forms.join("` or `"), def.about);
        }
    }
    let _ = writeln!(
        out,
        "\n## Mathematics\n\nFor ints and floats alike; the same bits on every machine. All ◦.\n"
    );
    for (name, args, about) in FUNCTIONS {
        let _ = writeln!(out, "- `{name}({args})` — {about}");
    }
    for (name, about) in CONSTANTS {
        let _ = writeln!(out, "- `{name}` — {about}");
    }
    let _ = writeln!(out, "\n## What a script cannot use\n");
    for (name, why) in REFUSED {
        let _ = writeln!(out, "- `{name}`: {why}");
    }
    let _ = writeln!(
        out,
        "\n## Limits\n\nSet with `--limit NAME=NUMBER`; the message that one is reached names it.\n"
    );
    for (name, default, about) in Limits::ALL {
        let _ = writeln!(out, "- `{name}` = {} — {about}", Limits::shown(*default, about));
    }
    out
}

const HEAD: &str = "# What a script can call

Made from the tables in `core/script/src/api/`; a test keeps it so (`CHOREO_ACCEPT=1 cargo test -p choreo-script` writes it anew).

The language is [Rhai](https://rhai.rs/book/). Times are seconds, or frames as `f(12)`. Lengths are metres, +y is up, characters look along +z.
Angles are degrees in what moves things and radians in mathematics. A color is a CSS name, `\"#rrggbb\"` or `[r, g, b]` from 0 to 1, in sRGB.
A point is `[x, y, z]`. Methods without an arrow give back what they were called on, so that calls chain. `x?` may be left out.
What bears a ◦ can also be called inside `on_frame`, where it holds for that frame only.
`import \"steps\" as steps;` brings in `steps.rhai` from the script's own folder. `print(…)` and `debug(…)` write to the program's messages.
A script may end with tests, or be nothing but tests: `test(\"name\", || { … })` is a section, which `choreo test` runs on a stage of its own and other commands leave alone.
What the chapters on tests list is for sections only. `//~ error: TEXT` or `//~ warning: TEXT` says that the line it stands on, or below, gives such a message.
";
