//! Effects as part of a scene shader: each plugin's text with unique names, and the generated functions that call the effects in
//! order.

use super::SourceFile;
use crate::plan::REACH_ROWS;
use choreo_plugin::{Effect, EffectFrame, Hook};

/// An effect whose function a shader calls.
pub struct SceneEffect {
    /// Bit of the effect in [`crate::plan::PipelineKey::effects`].
    pub bit: u8,
    /// Plugin name.
    pub name: String,
    pub wgsl: String,
    pub hook: Hook,
    pub in_model_space: bool,
    /// Index among the recorded faults.
    pub faults: u32,
    /// Rows of this effect in the uniform buffer of all effects on surfaces.
    pub parameters: ParameterRows,
}

/// Rows of an effect's parameters in a uniform array of vec4, followed by the frame's numbers if the effect reads them.
#[derive(Clone, Copy)]
pub struct ParameterRows {
    pub first: u32,
    /// Number of parameters.
    pub length: u32,
    pub reads_frame: bool,
}

impl ParameterRows {
    pub fn of(effect: &Effect, first: u32) -> ParameterRows {
        let length = effect.manifest().parameter_length() as u32;
        ParameterRows { first, length, reads_frame: effect.reads_frame() }
    }

    /// The first row of the frame's numbers.
    fn frame(self) -> u32 {
        self.first + self.length.div_ceil(4)
    }

    /// The row after the last one of the effect.
    pub fn end(self) -> u32 {
        self.frame() + if self.reads_frame { EffectFrame::NUMBERS as u32 / 4 } else { 0 }
    }

    /// A WGSL function `name` that returns the parameters as an array.
    pub fn function(self, name: &str, rows: &str) -> String {
        let length = self.length;
        let number =
            |i: u32| format!("{rows}[{}].{}", self.first + i / 4, ["x", "y", "z", "w"][i as usize % 4]);
        let numbers: Vec<String> = (0..length).map(number).collect();
        format!(
            "fn {name}() -> array<f32, {length}> {{ return array<f32, {length}>({}); }}\n",
            numbers.join(", ")
        )
    }

    /// WGSL functions that return the frame's numbers; empty if the effect does not read them.
    pub(crate) fn frame_functions(self, rows: &str) -> String {
        let function = |row: u32| {
            format!("fn effect_frame_row_{}() -> vec4<f32> {{ return {rows}[{row}]; }}\n", row - self.frame())
        };
        (self.frame()..self.end()).map(function).collect()
    }
}

/// The WGSL text that calls an effect's function and uses its result.
fn call_text(effect: &SceneEffect) -> String {
    let (bit, faults) = (effect.bit, effect.faults);
    let p = format!("surface_parameters_{bit}()");
    let call = match effect.hook {
        Hook::Vertex => {
            let offset = format!("effect_offset(effect_s{bit}(vertex, {p}), {faults}u)");
            let offset = if effect.in_model_space { format!("turned_by(m, {offset})") } else { offset };
            format!("    sum += within_reach({offset}, {bit}u);\n")
        }
        Hook::Lighting => format!("    f.lit = effect_light(effect_s{bit}(f, {p}), {faults}u);\n"),
        _ => format!("    c = effect_color(effect_s{bit}(c, surface, {p}), {faults}u);\n"),
    };
    format!("    effect_begin();\n{call}")
}

/// The texts of the effects whose functions a shader calls.
pub fn surface_files(effects: &[SceneEffect]) -> Vec<SourceFile> {
    // A shader without lighting calls no lighting effects, whose texts would not compile there.
    let calls_of = |hook: Hook| effects.iter().filter(|e| e.hook == hook).map(call_text).collect::<String>();
    let functions = [
        (
            Hook::Surface,
            "fn surface_effects(color: vec4<f32>, surface: SurfaceSample) -> vec4<f32> {\n    var c = color;\n",
            "    return c;\n}\n",
        ),
        (
            Hook::Vertex,
            "fn vertex_effects(vertex: VertexSample, m: Rows) -> vec3<f32> {\n    var sum = vec3(0.0);\n",
            "    return sum;\n}\n",
        ),
        (
            Hook::Lighting,
            "fn light_effects(sample: LightSample) -> vec3<f32> {\n    var f = sample;\n",
            "    return f.lit;\n}\n",
        ),
    ];
    let mut files: Vec<SourceFile> = Vec::new();
    for effect in effects {
        files.push(SourceFile {
            name: format!("effect \"{}\"", effect.name),
            text: with_name_suffix(&effect.wgsl, &format!("_s{}", effect.bit)),
        });
    }
    let rows = effects.iter().map(|effect| effect.parameters.end()).max().unwrap_or(0).max(REACH_ROWS);
    let mut text = format!("const surface_rows: u32 = {rows}u;\n");
    for effect in effects {
        let name = format!("surface_parameters_{}", effect.bit);
        text += &effect.parameters.function(&name, "surface_parameters");
    }
    // All effects read the numbers of the same frame.
    if let Some(effect) = effects.iter().find(|effect| effect.parameters.reads_frame) {
        text += &effect.parameters.frame_functions("surface_parameters");
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

/// Appends a suffix to every function, constant and type that the text declares, because two effects may use the same names. Line
/// numbers stay.
fn with_name_suffix(text: &str, ending: &str) -> String {
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
    fn suffixes_keep_the_names_of_effects_apart() {
        let text = "const a = 2.0;\nfn mix_in(x: f32) -> f32 { return x * a; }\nfn effect(c: vec4<f32>) -> vec4<f32> {\n  return c * mix_in(c.a); }";
        let got = with_name_suffix(text, "_s1");
        assert!(
            got.starts_with("const a_s1 = 2.0;\nfn mix_in_s1(x: f32) -> f32 { return x * a_s1; }"),
            "{got}"
        );
        assert!(got.contains("fn effect_s1(") && got.contains("mix_in_s1(c.a)"), "{got}");
        assert_eq!(got.lines().count(), text.lines().count());
    }
}
