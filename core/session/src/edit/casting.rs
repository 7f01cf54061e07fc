//! Lines that put a model on stage.

use super::object::{loaded_as, quoted};
use super::scan::Source;
use super::values::format_number;
use glam::DVec3;

/// The lines that cast a file at a place of the world, and let it play one of its clips, under a name that the text has not yet:
///
/// ```text
/// let fox_model = load("assets/Fox.glb");
/// let fox = cast("fox", fox_model).at(1.0, 0.0, -2.5);
/// fox.play(fox_model.clip("Survey"));
/// ```
///
/// A file that the script has loaded goes by the script's name of it. `file`: as `load` takes it.
pub fn cast_lines(text: &str, file: &str, at: DVec3, clip: Option<&str>) -> String {
    let stem = file.rsplit('/').next().unwrap_or(file);
    let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
    let name = free_name(text, stem);
    let loaded = quoted(file);
    let load = format!("load({loaded})");
    let place = match at == DVec3::ZERO {
        true => String::new(),
        false => format!(".at({})", at.to_array().map(format_number).join(", ")),
    };
    let known = loaded_as(&Source::new(text), &loaded, text.len()).map(str::to_string);
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
    lines
}

/// A name for a variable after the name of a file, which the text does not use.
pub(super) fn free_name(text: &str, stem: &str) -> String {
    let name = identifier(stem);
    let taken = |name: &str| text.contains(&format!("\"{name}\"")) || text.contains(&format!("let {name} "));
    first_free(|n| if n == 1 { name.clone() } else { format!("{name}_{n}") }, taken)
}

/// A name for a variable after any text.
pub(super) fn identifier(text: &str) -> String {
    let name = text.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' });
    let name: String = name.collect();
    if name.starts_with(|c: char| c.is_ascii_lowercase()) { name } else { format!("a_{name}") }
}

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
            cast_lines("", "assets/My Fox.glb", at, Some("Survey")),
            "let my_fox_model = load(\"assets/My Fox.glb\");\nlet my_fox = cast(\"my_fox\", my_fox_model).at(1.0, 0.0, -2.5);\n\
             my_fox.play(my_fox_model.clip(\"Survey\"));\n"
        );
        assert_eq!(cast_lines("", "7.obj", DVec3::ZERO, None), "let a_7 = cast(\"a_7\", load(\"7.obj\"));\n");
        let text = "let beast = load(\"fox.glb\");\nlet fox = cast(\"fox\", beast);\n";
        assert_eq!(
            cast_lines(text, "fox.glb", DVec3::X, Some("Run")),
            "let fox_2 = cast(\"fox_2\", beast).at(1.0, 0.0, 0.0);\nfox_2.play(beast.clip(\"Run\"));\n"
        );
    }
}
