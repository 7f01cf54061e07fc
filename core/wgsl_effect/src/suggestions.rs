//! "Did you mean" for names in an author's WGSL, from the message of naga's parser.

use crate::compile::Declared;
use crate::header::{Header, hook_word, hooks};
use crate::scene_inputs;
use crate::signature::signature;
use choreo_plugin::suggest::{did_you_mean, list};
use choreo_plugin::{Hook, Manifest};

/// The name that, according to a message of the parser, is not defined.
fn undefined_name(message: &str) -> Option<&str> {
    message.strip_prefix("no definition in scope")?.split('`').nth(1)
}

/// Suggests the line of the header comment that an undefined name needs: a function or a type of another hook, or of a history.
pub(crate) fn suggest_hook_line(message: &str, header: &Header, declared: &[Declared]) -> Option<String> {
    let wanted = undefined_name(message)?;
    if declared.iter().any(|(name, ..)| name == wanted) {
        return None;
    }
    let is_of = |hook: Hook| scene_inputs::names(hook).any(|name| name == wanted);
    if is_of(Hook::Image) && !is_of(header.hook) {
        return Some(format!("; {wanted}() is an input of effects with // hook: image"));
    }
    if signature(header.hook).with_history.iter().any(|(name, ..)| *name == wanted) {
        return Some(format!("; {wanted}() needs a line // history: FRAMES"));
    }
    let of = hooks().filter(|hook| *hook != header.hook).find_map(|hook| {
        let of = signature(hook);
        let is_function = of.functions.iter().chain(of.with_history).any(|(name, ..)| *name == wanted);
        let name = if is_function { format!("{wanted}()") } else { wanted.to_string() };
        (is_function || of.structs().any(|name| name == wanted)).then(|| (name, hook_word(hook)))
    });
    of.map(|(name, hook)| format!("; {name} needs // hook: {hook}"))
}

/// Suggests the line of the header comment that an undefined `halo_at` needs: it reads the texture of a pass.
pub(crate) fn suggest_pass_line(message: &str, header: &Header) -> String {
    let endings = ["_at", "_uv", "_size"];
    let texture = undefined_name(message).and_then(|name| endings.iter().find_map(|e| name.strip_suffix(e)));
    match texture.filter(|name| header.hook == Hook::Image && !name.is_empty()) {
        Some(texture) => format!("; a texture {texture} needs a line // pass {texture} = 1/2: ABOUT"),
        None => String::new(),
    }
}

/// Suggests `p[slope]` in place of `p.slope`, if `slope` is a parameter.
pub(crate) fn suggest_parameter_index(message: &str, manifest: &Manifest) -> Option<String> {
    let name = message.strip_prefix("invalid field accessor `")?.split('`').next()?;
    let is_one = manifest.options.iter().any(|option| option.name == name);
    is_one.then(|| format!("; write p[{name}], or declare p: Parameters"))
}

/// Built-in functions and types that are often used.
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

/// `; did you mean "amount"?` if a name is similar to one of the program, of the text, or a built-in one. `declared`: declarations of the
/// program below the text.
pub(crate) fn suggest_name<'a>(
    message: &str,
    text: &'a str,
    declared: &'a str,
    names: &mut dyn Iterator<Item = &'a str>,
) -> String {
    let Some(wanted) = message.split('`').nth(1) else { return String::new() };
    let own = declared_names(text);
    let types = declared_names(declared);
    let others = || own.iter().chain(&types).copied();
    if message.starts_with("invalid field accessor") {
        let fields = others().filter(|(_, how)| *how == Declaration::Typed).map(|(name, _)| name);
        return did_you_mean(wanted, fields);
    }
    if message.starts_with("no definition in scope") {
        let others = others().map(|(name, _)| name).filter(|name| *name != wanted);
        let known: Vec<&str> = names.chain(others).chain(BUILT_IN).collect();
        let meant = did_you_mean(wanted, known.iter().copied());
        return if meant.is_empty() { suggest_same_word(wanted, &known) } else { meant };
    }
    String::new()
}

/// Suggests functions of the scene that share a word with an undefined name: `normal_at` for `world_normal`. `known`: all names that the
/// text can use.
fn suggest_same_word(wanted: &str, known: &[&str]) -> String {
    // Words as short as "at" and "from" are in many names.
    let words = |name: &'static str| name.split('_').filter(|word| word.len() > 4);
    let alike = scene_inputs::names(Hook::Image)
        .filter(|name| known.contains(name) && words(name).any(|word| wanted.split('_').any(|w| w == word)));
    let alike: Vec<&str> = alike.collect();
    if alike.is_empty() { String::new() } else { format!("; functions of the scene: {}", list(alike, 4)) }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Declaration {
    /// A name after fn, const, let, var or struct.
    Declared,
    /// A name before a colon: a field, a parameter, a variable.
    Typed,
}

/// Names that a text declares, except in comments.
fn declared_names(text: &str) -> Vec<(&str, Declaration)> {
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
                out.push((word, Declaration::Typed));
            } else if matches!(before, "fn" | "const" | "let" | "var" | "struct") {
                out.push((word, Declaration::Declared));
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
    fn declared_names_are_suggested() {
        let text = "struct Pair { a: f32, b: vec2<f32> } // not: this\nfn twice(x: f32) -> f32 { let y = x; return y; }";
        let names: Vec<&str> = declared_names(text).into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["Pair", "a", "b", "twice", "x", "y"]);
        let near = |message: &str| {
            suggest_name(message, text, "struct SurfaceSample { facing: f32 }", &mut ["amount"].into_iter())
        };
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
