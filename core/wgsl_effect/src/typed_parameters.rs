//! The struct `Parameters` holds an effect's parameters by name and type, instead of an array of numbers. On the CPU the function gets the
//! struct; shaders get a function `effect` that takes the array of numbers and calls the author's function.

use crate::signature::{PARAMETERS, Signature, signature};
use crate::tokens::Tokens;
use choreo_plugin::parameters::CURVE_SAMPLES;
use choreo_plugin::{Hook, ImagePass, Manifest, OptionKind, OptionSpec};

/// The name of the author's function in shaders.
const AUTHOR_FUNCTION: &str = "effect_of_author";

/// Names that the program declares around a text with the struct.
pub(crate) const DECLARED_NAMES: [&str; 4] = [PARAMETERS, AUTHOR_FUNCTION, "parameters_of", "curve_at"];

/// Whether a text takes its parameters as the struct.
pub(crate) fn is_typed(text: &str) -> bool {
    Tokens::of(text).any(|(_, token)| token == PARAMETERS)
}

/// WGSL of the struct, of a constant for each choice of a text parameter, and of the function that reads curves.
pub(crate) fn declarations(manifest: &Manifest) -> String {
    let numbers = manifest.options.iter().filter(|o| o.number_count() > 0);
    let members: Vec<String> = numbers.map(|o| format!("{}: {}", o.name, type_of(o))).collect();
    // A struct has at least one member.
    let members = if members.is_empty() { "none_: f32".into() } else { members.join(", ") };
    let mut text = format!("struct {PARAMETERS} {{ {members} }}\n");
    for (name, number) in choice_constants(manifest) {
        text += &format!("const {name}: u32 = {number}u;\n");
    }
    if has_curve(manifest) {
        let (last, cells) = (CURVE_SAMPLES - 1, CURVE_SAMPLES - 2);
        text += &format!(
            "fn curve_at(samples: array<f32, {CURVE_SAMPLES}>, x: f32) -> f32 {{\n\
             \x20   var table = samples;\n    let at = clamp(x, 0.0, 1.0) * {last}.0;\n\
             \x20   let cell = min(u32(at), {cells}u);\n\
             \x20   return mix(table[cell], table[cell + 1u], at - f32(cell));\n}}\n"
        );
    }
    text
}

/// Constants for the choices of text parameters, such as `MODE_SOFT`, with their values.
pub(crate) fn choice_constants(manifest: &Manifest) -> impl Iterator<Item = (String, usize)> {
    manifest.options.iter().flat_map(|option| {
        let one_of: &[String] = match &option.kind {
            OptionKind::Text { one_of, .. } => one_of,
            _ => &[],
        };
        let constant = |choice: &String| {
            let word = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_uppercase() } else { '_' };
            format!("{}_{}", option.name, choice).chars().map(word).collect()
        };
        one_of.iter().map(constant).zip(0..)
    })
}

/// The text as shaders use it: the author's function is renamed, and called by a function `effect` with the signature of the hook.
pub(crate) fn adapt_text(text: &str, manifest: &Manifest, signature: &Signature) -> String {
    let head = signature.text.replace(PARAMETERS, &array_type(manifest));
    let arguments: Vec<&str> =
        head.split(['(', ',', ')']).filter_map(|part| part.split_once(':')).map(|p| p.0.trim()).collect();
    let before = &arguments[..arguments.len().saturating_sub(1)];
    let before: String = before.iter().map(|name| format!("{name}, ")).collect();
    format!(
        "{}\n{}{head} {{ return {AUTHOR_FUNCTION}({before}parameters_of(p)); }}\n",
        with_renamed_effect(text),
        struct_from_array(manifest)
    )
}

/// The text as shaders use it if passes have textures: the function `effect` calls the function of the pass that runs.
pub(crate) fn adapt_text_with_passes(text: &str, manifest: &Manifest, passes: &[ImagePass]) -> String {
    let head = signature(Hook::Image).text.replace(PARAMETERS, &array_type(manifest));
    let before = &passes[..passes.len().saturating_sub(1)];
    let call = |(number, pass): (u32, &ImagePass)| {
        format!("    if (pass_number == {number}u) {{ return {}(at, q); }}\n", pass.name)
    };
    let calls: String = (0..).zip(before).map(call).collect();
    format!(
        "{}\n{}{head} {{\n    let q = parameters_of(p);\n{calls}    return {AUTHOR_FUNCTION}(at, q);\n}}\n",
        with_renamed_effect(text),
        struct_from_array(manifest)
    )
}

/// WGSL type of the array of numbers in shaders.
fn array_type(manifest: &Manifest) -> String {
    format!("array<f32, {}>", manifest.parameter_length())
}

/// WGSL function that makes the struct from the array of numbers.
fn struct_from_array(manifest: &Manifest) -> String {
    let values: Vec<String> = (0..)
        .zip(&manifest.options)
        .filter(|(_, option)| option.number_count() > 0)
        .map(|(i, option)| value_of(option, manifest.first_number(i)))
        .collect();
    let values = if values.is_empty() { "0.0".into() } else { values.join(", ") };
    let array = array_type(manifest);
    format!("fn parameters_of(p: {array}) -> {PARAMETERS} {{ return {PARAMETERS}({values}); }}\n")
}

fn type_of(option: &OptionSpec) -> String {
    match &option.kind {
        OptionKind::Number { .. } => "f32".into(),
        OptionKind::Integer { .. } => "i32".into(),
        OptionKind::Bool { .. } => "bool".into(),
        OptionKind::Text { .. } => "u32".into(),
        OptionKind::Color { .. } => "vec3<f32>".into(),
        OptionKind::Vector { default, .. } => format!("vec{}<f32>", default.len()),
        // The remaining kind is a curve.
        _ => format!("array<f32, {}>", option.number_count()),
    }
}

/// WGSL expression of a member, made from the array of numbers.
fn value_of(option: &OptionSpec, first: usize) -> String {
    match &option.kind {
        OptionKind::Number { .. } => format!("p[{first}]"),
        OptionKind::Integer { .. } => format!("i32(p[{first}])"),
        OptionKind::Bool { .. } => format!("p[{first}] > 0.5"),
        OptionKind::Text { .. } => format!("u32(p[{first}])"),
        _ => {
            let numbers: Vec<String> =
                (first..first + option.number_count()).map(|number| format!("p[{number}]")).collect();
            format!("{}({})", type_of(option), numbers.join(", "))
        }
    }
}

fn has_curve(manifest: &Manifest) -> bool {
    manifest.options.iter().any(|o| matches!(o.kind, OptionKind::Curve { .. }))
}

/// The text with its function `effect` renamed; line numbers stay.
fn with_renamed_effect(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 16);
    let (mut copied, mut before) = (0, "");
    for (at, token) in Tokens::of(text) {
        if token == "effect" && before != "." {
            out.push_str(&text[copied..at]);
            out.push_str(AUTHOR_FUNCTION);
            copied = at + token.len();
        }
        before = token;
    }
    out.push_str(&text[copied..]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adapted_text_takes_an_array_of_numbers() {
        let manifest = Manifest::new("all", "1", "")
            .flag("on", "", true)
            .integer("count", "", 1, 0..=9)
            .text("mode", "", "soft", &["soft", "very hard"])
            .color("tint", "", [1.0; 3]);
        let declared = declarations(&manifest);
        assert_eq!(
            declared,
            "struct Parameters { on: bool, count: i32, mode: u32, tint: vec3<f32> }\n\
             const MODE_SOFT: u32 = 0u;\nconst MODE_VERY_HARD: u32 = 1u;\n"
        );
        let text = "fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32> { return color; } // effect";
        let adapted = adapt_text(text, &manifest, signature(Hook::Pixel));
        let end = "fn parameters_of(p: array<f32, 8>) -> Parameters { return Parameters(p[0] > 0.5, i32(p[1]), u32(p[2]), \
                   vec3<f32>(p[3], p[4], p[5])); }\n\
                   fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> \
                   { return effect_of_author(color, uv, parameters_of(p)); }\n";
        assert_eq!(adapted, format!("{}\n{end}", text.replacen("fn effect", "fn effect_of_author", 1)));
        assert!(is_typed(text) && !is_typed("// Parameters\nfn effect() {}"));
    }
}
