//! `@if(A && !B || C)`, `@else`, `@end`: lines are blanked, never removed, so that line and column of an error are
//! those of the file. `@if(A) text` on one line keeps or drops that line alone.

use thiserror::Error;

#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("line {line}: {what}")]
pub struct PreprocessError {
    /// Line number from 1.
    pub line: usize,
    pub what: String,
}

/// Every name that may stand in a condition; an unknown one is a typing mistake, not "off".
pub const SWITCHES: [&str; 88] = [
    "SKIN",
    "SKIN_8",
    "SKIN_DUAL",
    "SKIN_PLACED",
    "MORPH",
    "POSED",
    "VERTEX_COLOR",
    "UV0",
    "UV1",
    "METALLIC_ROUGHNESS",
    "BLINN_PHONG",
    "TOON",
    "BASE_COLOR_TEXTURE",
    "METALLIC_ROUGHNESS_TEXTURE",
    "NORMAL_TEXTURE",
    "OCCLUSION_TEXTURE",
    "EMISSIVE",
    "EMISSIVE_TEXTURE",
    "SPECULAR_TEXTURE",
    "SPECULAR_COLOR_TEXTURE",
    "ALPHA_MASK",
    "COVERAGE",
    "UV_TRANSFORM",
    "LOCAL_LIGHTS",
    "SHADOW",
    "SHADOW_PASS",
    "GEOMETRY",
    "LIGHT_PASS",
    "PEELED",
    "PEEL_PASS",
    "MULTISAMPLED",
    "SKY",
    "PHONG",
    "REFLECTION",
    "POLYNOMIAL",
    "SKY_BACKGROUND",
    "LAYERS",
    "CLEARCOAT",
    "CLEARCOAT_TEXTURE",
    "CLEARCOAT_ROUGHNESS_TEXTURE",
    "CLEARCOAT_NORMAL_TEXTURE",
    "SHEEN",
    "SHEEN_COLOR_TEXTURE",
    "SHEEN_ROUGHNESS_TEXTURE",
    "TRANSMISSION",
    "TRANSMISSION_TEXTURE",
    "VOLUME",
    "THICKNESS_TEXTURE",
    "REFRACTION",
    "DISPERSION",
    "SHELL",
    "EDGES",
    "WIDE",
    "TRIPLANAR",
    "SEEN_NORMALS",
    "SEEN_JOINTS",
    "SEEN_SHADOW",
    "SURFACE",
    "RELIEF",
    "DISPLACED",
    "LIGHTING",
    "EFFECTS",
    "TEXTURES",
    "PLACE",
    "NORMAL_OUT",
    "PICTURE",
    "OUTLINE_WIDTH_TEXTURE",
    "UV_MASK",
    "NORMAL",
    "IRIDESCENCE",
    "IRIDESCENCE_TEXTURE",
    "IRIDESCENCE_THICKNESS_TEXTURE",
    "ANISOTROPY",
    "ANISOTROPY_TEXTURE",
    "DIFFUSE_TRANSMISSION",
    "DIFFUSE_TRANSMISSION_TEXTURE",
    "DIFFUSE_TRANSMISSION_COLOR_TEXTURE",
    "TANGENT",
    "GLASS",
    "GLASS_FILTER",
    "GLASS_LIGHT",
    "LIT",
    "BLEND",
    "DOUBLE_SIDED",
    "TINT",
    "JOINTS_UNIFORM",
    "ONE_LIGHT",
    "LIGHT_LISTS",
];

pub fn preprocess(text: &str, on: &[&str]) -> Result<String, PreprocessError> {
    let mut out = String::with_capacity(text.len());
    // One entry an open `@if`: (line it opened on, this branch is kept, everything around it is kept).
    let mut open: Vec<(usize, bool, bool)> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line_number = i + 1;
        let error = |what: String| PreprocessError { line: line_number, what };
        let kept = open.last().is_none_or(|(_, branch, around)| *branch && *around);
        let code = line.trim_start();
        if let Some(rest) = code.strip_prefix("@if") {
            let rest = rest.trim_start();
            let inner =
                rest.strip_prefix('(').ok_or_else(|| error("`@if` wants a condition in (…)".into()))?;
            let (condition, after) = inner
                .split_once(')')
                .ok_or_else(|| error("`@if(` has no closing parenthesis on its line".into()))?;
            let holds = evaluate(condition, on).map_err(error)?;
            if after.trim().is_empty() {
                open.push((line_number, holds, kept));
            } else if kept && holds {
                // Blanks in place of the condition: columns stay.
                let directive = line.len() - after.len();
                out.extend(std::iter::repeat_n(' ', directive));
                out.push_str(after);
            }
        } else if code.trim_end() == "@else" {
            let last = open.last_mut().ok_or_else(|| error("`@else` without `@if`".into()))?;
            last.1 = !last.1;
        } else if code.trim_end() == "@end" {
            open.pop().ok_or_else(|| error("`@end` without `@if`".into()))?;
        } else if kept {
            out.push_str(line);
        }
        out.push('\n');
    }
    match open.last() {
        Some((line, _, _)) => Err(PreprocessError { line: *line, what: "`@if` without `@end`".into() }),
        None => Ok(out),
    }
}

/// `||` of `&&` of names, each with or without `!`.
fn evaluate(condition: &str, on: &[&str]) -> Result<bool, String> {
    let mut any = false;
    for group in condition.split("||") {
        let mut all = true;
        for term in group.split("&&") {
            let term = term.trim();
            let (negated, name) = match term.strip_prefix('!') {
                Some(name) => (true, name.trim()),
                None => (false, term),
            };
            if !SWITCHES.contains(&name) {
                return Err(format!("unknown switch `{name}`; known: {}", SWITCHES.join(", ")));
            }
            all &= on.contains(&name) != negated;
        }
        any |= all;
    }
    Ok(any)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_columns_stay() {
        let text = "a\n@if(SKIN)\nb\n@else\nc\n@end\n  @if(!LIT) d\ne";
        assert_eq!(preprocess(text, &["SKIN"]).unwrap(), "a\n\nb\n\n\n\n            d\ne\n");
        assert_eq!(preprocess(text, &["LIT"]).unwrap(), "a\n\n\n\nc\n\n\ne\n");
    }

    #[test]
    fn nested_and_combined() {
        let text = "@if(SKIN || MORPH)\n@if(SKIN && !MORPH)\nx\n@end\ny\n@end";
        assert_eq!(preprocess(text, &["MORPH"]).unwrap(), "\n\n\n\ny\n\n");
        assert_eq!(preprocess(text, &["SKIN"]).unwrap(), "\n\nx\n\ny\n\n");
        assert_eq!(preprocess(text, &[]).unwrap(), "\n\n\n\n\n\n");
    }

    #[test]
    fn mistakes_name_their_line() {
        let error = |text: &str| preprocess(text, &[]).unwrap_err().to_string();
        assert!(error("x\n@if(SKNI)\n@end").starts_with("line 2: unknown switch `SKNI`; known: SKIN,"));
        assert_eq!(error("@if(SKIN)\nx"), "line 1: `@if` without `@end`");
        assert_eq!(error("x\n@end"), "line 2: `@end` without `@if`");
        assert_eq!(error("@else"), "line 1: `@else` without `@if`");
        assert_eq!(error("@if SKIN"), "line 1: `@if` wants a condition in (…)");
    }
}
