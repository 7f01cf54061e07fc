//! Effects as part of a scene shader: each plugin's text with names of its own, and what calls them in order.

use super::SourceFile;
use choreo_plugin::Hook;

/// Rows before the parameters of effects on surfaces: the reach of each, four a row.
pub const REACH_ROWS: u32 = 2;

/// An effect whose function a shader calls.
pub struct SceneEffect {
    /// Its bit in [`crate::plan::PipelineKey::effects`].
    pub bit: u8,
    /// Plugin name.
    pub name: String,
    pub wgsl: String,
    pub hook: Hook,
    pub in_model_space: bool,
    /// Index among the recorded faults.
    pub faults: u32,
    /// Row of its first four parameters in the uniform buffer of all effects on surfaces.
    pub first_row: u32,
    /// Length of the array of its parameters.
    pub length: u32,
}

/// A function `name` that gives `length` numbers of a uniform array of rows, from a row on.
pub fn parameters_function(name: &str, rows: &str, first_row: u32, length: u32) -> String {
    let number = |i: u32| format!("{rows}[{}].{}", first_row + i / 4, ["x", "y", "z", "w"][i as usize % 4]);
    let numbers: Vec<String> = (0..length).map(number).collect();
    format!(
        "fn {name}() -> array<f32, {length}> {{ return array<f32, {length}>({}); }}\n",
        numbers.join(", ")
    )
}

/// The WGSL text that calls an effect's function and uses its result.
fn call(effect: &SceneEffect) -> String {
    let (bit, faults) = (effect.bit, effect.faults);
    let p = format!("surface_parameters_{bit}()");
    let call = match effect.hook {
        Hook::Vertex => {
            let offset = format!("effect_offset(effect_s{bit}(place, {p}), {faults}u)");
            let offset = if effect.in_model_space { format!("turned_by(m, {offset})") } else { offset };
            format!("    sum += within_reach({offset}, {bit}u);\n")
        }
        Hook::Lighting => format!("    f.lit = effect_light(effect_s{bit}(f, {p}), {faults}u);\n"),
        _ => format!("    c = effect_color(effect_s{bit}(c, seen, {p}), {faults}u);\n"),
    };
    format!("    effect_begin();\n{call}")
}

/// The texts of the effects whose functions a shader calls.
pub fn surface_files(effects: &[SceneEffect]) -> Vec<SourceFile> {
    // A shader without light calls none of those that speak of it: their texts would not compile there.
    let calls_of = |hook: Hook| effects.iter().filter(|e| e.hook == hook).map(call).collect::<String>();
    let functions = [
        (
            Hook::Surface,
            "fn surface_effects(color: vec4<f32>, seen: Seen) -> vec4<f32> {\n    var c = color;\n",
            "    return c;\n}\n",
        ),
        (
            Hook::Vertex,
            "fn vertex_effects(place: Place, m: Rows) -> vec3<f32> {\n    var sum = vec3(0.0);\n",
            "    return sum;\n}\n",
        ),
        (
            Hook::Lighting,
            "fn light_effects(falling: Falling) -> vec3<f32> {\n    var f = falling;\n",
            "    return f.lit;\n}\n",
        ),
    ];
    let mut files: Vec<SourceFile> = Vec::new();
    for effect in effects {
        files.push(SourceFile {
            name: format!("effect \"{}\"", effect.name),
            text: renamed(&effect.wgsl, &format!("_s{}", effect.bit)),
        });
    }
    let end = |effect: &SceneEffect| effect.first_row + effect.length.div_ceil(4);
    let rows = effects.iter().map(end).max().unwrap_or(0).max(REACH_ROWS);
    let mut text = format!("const surface_rows: u32 = {rows}u;\n");
    for effect in effects {
        let name = format!("surface_parameters_{}", effect.bit);
        text += &parameters_function(&name, "surface_parameters", effect.first_row, effect.length);
    }
    for (hook, head, end) in functions {
        let calls = calls_of(hook);
        if !calls.is_empty() {
            text += &format!("{head}{calls}{end}");
        }
    }
    files.push(SourceFile { name: "calls of effects on surfaces".into(), text });
    files
}

fn is_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// Every function, constant and type that the text declares, with an ending: two effects may use the same names. Lines stay.
fn renamed(text: &str, ending: &str) -> String {
    let mut declared: Vec<&str> = Vec::new();
    let mut last = "";
    for word in words(text) {
        if matches!(last, "fn" | "const" | "struct" | "alias") && word.starts_with(is_word) {
            declared.push(word);
        }
        if !word.trim().is_empty() {
            last = word;
        }
    }
    let mut out = String::with_capacity(text.len() + 64);
    let mut before = "";
    for word in words(text) {
        out.push_str(word);
        if before != "." && declared.contains(&word) {
            out.push_str(ending);
        }
        before = word;
    }
    out
}

/// Words and the single characters between them.
fn words(text: &str) -> impl Iterator<Item = &str> {
    let mut rest = text;
    std::iter::from_fn(move || {
        let first = rest.chars().next()?;
        let end = match is_word(first) {
            true => rest.find(|c| !is_word(c)).unwrap_or(rest.len()),
            false => first.len_utf8(),
        };
        let (word, after) = rest.split_at(end);
        rest = after;
        Some(word)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_the_effects_own() {
        let text = "const a = 2.0;\nfn mix_in(x: f32) -> f32 { return x * a; }\nfn effect(c: vec4<f32>) -> vec4<f32> {\n  return c * mix_in(c.a); }";
        let got = renamed(text, "_s1");
        assert!(
            got.starts_with("const a_s1 = 2.0;\nfn mix_in_s1(x: f32) -> f32 { return x * a_s1; }"),
            "{got}"
        );
        assert!(got.contains("fn effect_s1(") && got.contains("mix_in_s1(c.a)"), "{got}");
        assert_eq!(got.lines().count(), text.lines().count());
    }
}
