//! Warnings about characters that the font of a text lacks.

use crate::api_error::ApiError;
use crate::call::Call;
use crate::diagnostic::Severity;
use crate::suggest::list;
use choreo_stage::Font;
use choreo_text::{fallbacks, needs_shaping};
use std::collections::BTreeMap;

/// Warns about characters that are drawn in a system font, in no font, or without the shaping that their writing system needs.
pub(crate) fn warn_about_missing_characters(c: &Call, font: &Font, words: &str) {
    let missing = font.missing(words);
    let mut by_system_font: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut without_font = Vec::new();
    for (missing, found) in missing.iter().zip(fallbacks(&missing)) {
        match found {
            None => without_font.push(missing.to_string()),
            Some(fallback) if fallback.file.is_some() => {
                by_system_font.entry(fallback.font.name).or_default().push(missing.to_string());
            }
            Some(_) => {}
        }
    }
    let shown = |chars: &[String]| list(chars.iter().map(String::as_str), 24);
    let warn = |text: String, hint: &str| {
        let error = ApiError::new(format!("{}: {text}", c.def.name)).hint(hint);
        c.context.add_diagnostic(Severity::Warning, &c.place, &error.rule("font_lacks"));
    };
    let font_hint = "give a font that has them: font: \"file.ttf\"";
    if !without_font.is_empty() {
        warn(format!("no font has {}: boxes are drawn in their place", shown(&without_font)), font_hint);
    }
    for (name, chars) in by_system_font {
        let chars = shown(&chars);
        let text = format!(
            "the font \"{}\" has no {chars}: drawn in the system font \"{name}\", which other machines may lack",
            font.name
        );
        warn(text, font_hint);
    }
    let unshaped: Vec<String> = words.chars().filter(|c| needs_shaping(*c)).map(String::from).collect();
    if !unshaped.is_empty() {
        let mut unshaped = unshaped;
        unshaped.sort_unstable();
        unshaped.dedup();
        let text = format!(
            "{} are drawn one by one from left to right, neither joined nor reordered",
            shown(&unshaped)
        );
        warn(text, "make an image of such words elsewhere and show it with picture(…)");
    }
}
