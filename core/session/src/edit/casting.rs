//! Lines that add a model to the stage.

use super::object::loads_of;
use super::scan::{Call, Source};
use super::values::format_number;
use crate::model::is_built_in;
use choreo_script::{is_name, quoted};
use glam::DVec3;
use std::path::Path;

/// The lines that cast a file at a world position, in metres, and play one of its clips, and the new actor's name, which the script does not use
/// yet:
///
/// ```text
/// let fox_model = load("assets/Fox.glb");
/// let fox = cast("fox", fox_model).at(1.0, 0.0, -2.5);
/// fox.play(fox_model.clip("Survey"));
/// ```
///
/// If a variable of the script already holds the loaded file, the lines use it; for a built-in model only if it was loaded without options,
/// since these change the appearance of the character. `file`: as in `load`.
pub fn cast_lines(text: &str, file: &str, at: DVec3, clip: Option<&str>) -> (String, String) {
    // Built-in models are written as `choreo:mannequin`.
    let stem = file.rsplit(['/', ':']).next().unwrap_or(file);
    let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
    let name = free_name(text, stem);
    let loaded = quoted(file);
    let load = format!("load({loaded})");
    let place = match at == DVec3::ZERO {
        true => String::new(),
        false => format!(".at({})", at.to_array().map(format_number).join(", ")),
    };
    let source = Source::new(text);
    let is_alike = |load: &Call| !is_built_in(Path::new(file)) || source.argument(&load.inside, 1).is_none();
    let known = loads_of(&source, &loaded).find(|(load, _)| is_alike(load)).map(|(_, name)| name.to_string());
    let (mut lines, model) = match (known, clip) {
        (Some(known), _) => (String::new(), known),
        (None, None) => (String::new(), load),
        (None, Some(_)) => {
            let model = free_name(text, &format!("{name}_model"));
            (format!("let {model} = {load};\n"), model)
        }
    };
    lines += &format!("let {name} = cast(\"{name}\", {model}){place};\n");
    if let Some(clip) = clip {
        lines += &format!("{name}.play({model}.clip({}));\n", quoted(clip));
    }
    (lines, name)
}

/// A variable name after a file name that the script does not use yet.
pub(super) fn free_name(text: &str, stem: &str) -> String {
    let name = identifier(stem);
    let taken = |name: &str| text.contains(&format!("\"{name}\"")) || text.contains(&format!("let {name} "));
    first_free(|n| if n == 1 { name.clone() } else { format!("{name}_{n}") }, taken)
}

/// A variable name after any text: lowercase words without accents, joined by `_`.
pub(super) fn identifier(text: &str) -> String {
    let mut name = String::new();
    for c in text.chars().flat_map(char::to_lowercase) {
        match c {
            c if c.is_ascii_alphanumeric() => name.push(c),
            // A combining diaeresis after the letter, as some systems write file names (Unicode NFD).
            DIAERESIS if name.ends_with(['a', 'o', 'u']) => name.push('e'),
            FIRST_COMBINING_MARK..=LAST_COMBINING_MARK => {}
            c => match ACCENTED.iter().find(|(letters, _)| letters.contains(c)) {
                Some((_, plain)) => name += plain,
                None if name.ends_with('_') => {}
                None => name.push('_'),
            },
        }
    }
    match name.trim_matches('_') {
        "" => "actor".to_string(),
        name if is_name(name) => name.to_string(),
        // The text begins with a digit, or is a keyword.
        name => format!("a_{name}"),
    }
}

/// Range of Unicode combining marks, which follow their letter.
const FIRST_COMBINING_MARK: char = '\u{300}';
const LAST_COMBINING_MARK: char = '\u{36f}';
const DIAERESIS: char = '\u{308}';

/// Letters of Latin scripts and their spelling without accents.
const ACCENTED: [(&str, &str); 26] = [
    ("ä", "ae"),
    ("ö", "oe"),
    ("ü", "ue"),
    ("ß", "ss"),
    ("æ", "ae"),
    ("œ", "oe"),
    ("þ", "th"),
    ("àáâãåāăą", "a"),
    ("çćĉċč", "c"),
    ("ðďđ", "d"),
    ("èéêëēĕėęě", "e"),
    ("ĝğġģ", "g"),
    ("ĥħ", "h"),
    ("ìíîïĩīĭįı", "i"),
    ("ĵ", "j"),
    ("ķ", "k"),
    ("ĺļľŀł", "l"),
    ("ñńņňŋ", "n"),
    ("òóôõøōŏő", "o"),
    ("ŕŗř", "r"),
    ("śŝşšș", "s"),
    ("ţťŧț", "t"),
    ("ùúûũūŭůűų", "u"),
    ("ŵ", "w"),
    ("ýÿŷ", "y"),
    ("źżž", "z"),
];

/// The first of `view 1`, `view 2` … that is not taken.
pub fn numbered_name(stem: &str, taken: impl Fn(&str) -> bool) -> String {
    first_free(|n| format!("{stem} {n}"), taken)
}

/// The name itself if it is not taken, else with the next free number.
pub(super) fn free_label(name: &str, taken: impl Fn(&str) -> bool) -> String {
    first_free(|n| if n == 1 { name.to_string() } else { format!("{name} {n}") }, taken)
}

/// The first of `name(1)`, `name(2)` … that is not taken.
pub(super) fn first_free(name: impl Fn(usize) -> String, taken: impl Fn(&str) -> bool) -> String {
    (1..).map(name).find(|name| !taken(name)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_cast_under_an_unused_name_at_the_given_position() {
        let at = DVec3::new(1.0, 0.0, -2.5);
        assert_eq!(
            cast_lines("", "assets/My Fox.glb", at, Some("Survey")).0,
            "let my_fox_model = load(\"assets/My Fox.glb\");\nlet my_fox = cast(\"my_fox\", my_fox_model).at(1.0, 0.0, -2.5);\n\
             my_fox.play(my_fox_model.clip(\"Survey\"));\n"
        );
        let lines = |text, file, at, clip| cast_lines(text, file, at, clip).0;
        assert_eq!(lines("", "7.obj", DVec3::ZERO, None), "let a_7 = cast(\"a_7\", load(\"7.obj\"));\n");
        let text = "let beast = load(\"fox.glb\");\nlet fox = cast(\"fox\", beast);\n";
        assert_eq!(
            lines(text, "fox.glb", DVec3::X, Some("Run")),
            "let fox_2 = cast(\"fox_2\", beast).at(1.0, 0.0, 0.0);\nfox_2.play(beast.clip(\"Run\"));\n"
        );
    }

    /// A new character does not reuse the color of another one; a file is not shared if its options differ.
    #[test]
    fn a_built_in_character_has_its_own_color() {
        let cast = |text: &str, file| cast_lines(text, file, DVec3::ZERO, Some("Idle")).0;
        let coral = "let coral = load(\"choreo:mannequin\", #{ color: \"coral\" });\n";
        let own = cast(coral, "choreo:mannequin");
        assert!(own.starts_with("let mannequin_model = load(\"choreo:mannequin\");\n"), "{own}");
        assert!(own.contains("cast(\"mannequin\", mannequin_model)"), "{own}");
        let plain = format!("{coral}let moves = load(\"choreo:mannequin\");\n");
        assert!(
            cast(&plain, "choreo:mannequin").starts_with("let mannequin = cast(\"mannequin\", moves);\n")
        );
        let fox = cast("let beast = load(\"fox.glb\", #{ scale: 0.01 });\n", "fox.glb");
        assert!(fox.starts_with("let fox = cast(\"fox\", beast);\n"), "{fox}");
    }

    #[test]
    fn variables_have_readable_names() {
        for (text, name) in [
            ("Frau Müller (x) é y!", "frau_mueller_x_e_y"),
            ("Gro\u{308}ße", "groesse"),
            ("e\u{301}te\u{301}", "ete"),
            ("  ÅNGSTRÖM--Łódź ", "angstroem_lodz"),
            ("__a__B__", "a_b"),
            ("木", "actor"),
            ("?!", "actor"),
            ("3D Scan", "a_3d_scan"),
            ("loop", "a_loop"),
        ] {
            assert_eq!(identifier(text), name, "{text}");
        }
        // None of them is a keyword.
        assert_eq!(cast_lines("", "Ünder the_Sea.obj", DVec3::ZERO, None).1, "uender_the_sea");
    }
}
