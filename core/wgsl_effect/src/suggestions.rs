//! "Did you mean" for names in an author's WGSL, from the message of naga's parser.

use choreo_plugin::suggest::did_you_mean;

/// Built-in functions and types that are written often.
const BUILT_IN: [&str; 46] = [
    "abs",
    "acos",
    "all",
    "any",
    "asin",
    "atan",
    "atan2",
    "ceil",
    "clamp",
    "cos",
    "cross",
    "degrees",
    "distance",
    "dot",
    "exp",
    "exp2",
    "floor",
    "fract",
    "length",
    "log",
    "log2",
    "max",
    "min",
    "mix",
    "normalize",
    "pow",
    "radians",
    "reflect",
    "round",
    "saturate",
    "select",
    "sign",
    "sin",
    "smoothstep",
    "sqrt",
    "step",
    "tan",
    "trunc",
    "bool",
    "f32",
    "i32",
    "u32",
    "vec2",
    "vec3",
    "vec4",
    "array",
];

/// `; did you mean "amount"?` where a name is a slip of one that is known: of the program, of the text, or built in.
/// `declared`: what the program declares below the text.
pub fn near<'a>(
    message: &str,
    text: &'a str,
    declared: &'a str,
    names: &mut dyn Iterator<Item = &'a str>,
) -> String {
    let Some(wanted) = message.split('`').nth(1) else { return String::new() };
    let own = names_of(text);
    let types = names_of(declared);
    let others = || own.iter().chain(&types).copied();
    if message.starts_with("invalid field accessor") {
        let fields = others().filter(|(_, how)| *how == How::Typed).map(|(name, _)| name);
        return did_you_mean(wanted, fields);
    }
    if message.starts_with("no definition in scope") {
        let others = others().map(|(name, _)| name).filter(|name| *name != wanted);
        return did_you_mean(wanted, names.chain(others).chain(BUILT_IN));
    }
    String::new()
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum How {
    /// A name after fn, const, let, var or struct.
    Declared,
    /// A name before a colon: a field, a parameter, a variable.
    Typed,
}

/// Names that a text declares, comments left out.
fn names_of(text: &str) -> Vec<(&str, How)> {
    let code = text.lines().map(|line| line.split("//").next().unwrap_or(""));
    let mut out = Vec::new();
    for line in code {
        let mut before = "";
        let is_part = |c: char| c.is_alphanumeric() || c == '_';
        let mut at = 0;
        while let Some(start) = line[at..].find(is_part).map(|i| at + i) {
            let end = line[start..].find(|c| !is_part(c)).map_or(line.len(), |i| start + i);
            let word = &line[start..end];
            if line[end..].trim_start().starts_with(':') {
                out.push((word, How::Typed));
            } else if matches!(before, "fn" | "const" | "let" | "var" | "struct") {
                out.push((word, How::Declared));
            }
            (before, at) = (word, end);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_where_they_are_declared() {
        let text = "struct Pair { a: f32, b: vec2<f32> } // not: this\nfn twice(x: f32) -> f32 { let y = x; return y; }";
        let names: Vec<&str> = names_of(text).into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["Pair", "a", "b", "twice", "x", "y"]);
        let near =
            |message: &str| near(message, text, "struct Seen { facing: f32 }", &mut ["amount"].into_iter());
        assert_eq!(near("no definition in scope for identifier: `amuont`"), "; did you mean \"amount\"?");
        assert_eq!(near("no definition in scope for identifier: `twic`"), "; did you mean \"twice\"?");
        assert_eq!(
            near("no definition in scope for identifier: `smothstep`"),
            "; did you mean \"smoothstep\"?"
        );
        assert_eq!(near("invalid field accessor `facign`"), "; did you mean \"facing\"?");
        assert_eq!(near("no definition in scope for identifier: `zebra`"), "");
        assert_eq!(near("expected `;`, found `}`"), "");
    }
}
