//! Effects on surfaces as part of a scene shader: each plugin's text with names of its own, and what calls them in order.

use super::SourceFile;

/// The texts of the effects whose functions a shader calls: (its bit in `PipelineKey::surface`, plugin, WGSL).
pub fn surface_files(effects: &[(u8, String, String)]) -> Vec<SourceFile> {
    let mut calls =
        String::from("fn surface_effects(color: vec4<f32>, seen: Seen) -> vec4<f32> {\n    var c = color;\n");
    let mut files = Vec::new();
    for (bit, name, wgsl) in effects {
        calls += &format!("    c = effect_s{bit}(c, seen, surface_parameters_of({bit}u));\n");
        files.push(SourceFile {
            name: format!("effect \"{name}\""),
            text: renamed(wgsl, &format!("_s{bit}")),
        });
    }
    calls += "    return c;\n}\n";
    files.push(SourceFile { name: "calls of effects on surfaces".into(), text: calls });
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
