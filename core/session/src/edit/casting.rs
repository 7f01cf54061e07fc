//! Lines that put a model on stage.

use super::object::{loads_of, quoted};
use super::scan::{Call, Source};
use super::values::format_number;
use crate::model::is_built_in;
use choreo_script::is_name;
use glam::DVec3;
use std::path::Path;

/// The lines that cast a file at a place of the world, and let it play one of its clips, under a name that the text has not yet; and that name:
///
/// ```text
/// let fox_model = load("assets/Fox.glb");
/// let fox = cast("fox", fox_model).at(1.0, 0.0, -2.5);
/// fox.play(fox_model.clip("Survey"));
/// ```
///
/// A file that the script has loaded goes by the script's name of it; a built-in one, of which the options are the looks of a character, only
/// where it has none. `file`: as `load` takes it.
pub fn cast_lines(text: &str, file: &str, at: DVec3, clip: Option<&str>) -> (String, String) {
    // A built-in one is written as `choreo:mannequin`.
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

/// A name for a variable after the name of a file, which the text does not use.
pub(super) fn free_name(text: &str, stem: &str) -> String {
    let name = identifier(stem);
    let taken = |name: &str| text.contains(&format!("\"{name}\"")) || text.contains(&format!("let {name} "));
    first_free(|n| if n == 1 { name.clone() } else { format!("{name}_{n}") }, taken)
}

/// A name for a variable after any text: words in small letters without accents, with one `_` between them.
pub(super) fn identifier(text: &str) -> String {
    let mut name = String::new();
    for c in text.chars().flat_map(char::to_lowercase) {
        match c {
            c if c.is_ascii_alphanumeric() => name.push(c),
            // Two dots over the letter before, as some systems write file names.
            DIAERESIS if name.ends_with(['a', 'o', 'u']) => name.push('e'),
            ACCENTS_FIRST..=ACCENTS_LAST => {}
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
        // A digit in front, or a keyword.
        name => format!("a_{name}"),
    }
}

/// Marks over and under the letter before them.
const ACCENTS_FIRST: char = '\u{300}';
const ACCENTS_LAST: char = '\u{36f}';
const DIAERESIS: char = '\u{308}';

/// Letters of Latin scripts, and how they are written without accents.
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

/// `view 1`, `view 2` …: the first of them that is not taken.
pub fn numbered_name(stem: &str, taken: impl Fn(&str) -> bool) -> String {
    first_free(|n| format!("{stem} {n}"), taken)
}

/// The name itself, else the name with the next number that is not taken.
pub(super) fn free_label(name: &str, taken: impl Fn(&str) -> bool) -> String {
    first_free(|n| if n == 1 { name.to_string() } else { format!("{name} {n}") }, taken)
}

/// The first name of a row of them, counted from 1, that is not taken.
pub(super) fn first_free(name: impl Fn(usize) -> String, taken: impl Fn(&str) -> bool) -> String {
    (1..).map(name).find(|name| !taken(name)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_cast_under_a_free_name_where_it_was_put() {
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

    /// The color of another character is not that of a new one; the options of a file say how it is read.
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
