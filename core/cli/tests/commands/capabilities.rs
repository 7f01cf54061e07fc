//! Checks that each capability in the table of `scripts/README.md` occurs in the lessons and test sections that the table names.

use choreo_stage::{Described, Shadow, Sky, StageLight};
use std::path::{Path, PathBuf};

fn scripts_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts")
}

/// Targets of `[text](target)`.
fn link_targets(cell: &str) -> Vec<&str> {
    cell.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect()
}

/// The texts between pairs of a delimiter.
fn texts_between(cell: &str, mark: char) -> Vec<&str> {
    cell.split(mark).skip(1).step_by(2).collect()
}

/// The errors of a table row, or `None` if the line is not a row.
fn row_errors(line: &str) -> Option<Vec<String>> {
    let cells: Vec<&str> = line.strip_prefix("| ")?.trim_end_matches(" |").split(" | ").collect();
    if cells[0] == "what" {
        return None;
    }
    let mut wrong = Vec::new();
    let [what, words, lessons, sections] = cells[..] else {
        return Some(vec![format!("{} cells in {line}", cells.len())]);
    };
    let read = |link: &&str| {
        std::fs::read_to_string(scripts_folder().join(link)).map_err(|e| format!("{link}: {e}"))
    };
    let mut shown = String::new();
    for lesson in link_targets(lessons) {
        match read(&lesson) {
            Ok(text) => shown += &without_comments(&text),
            Err(error) => wrong.push(error),
        }
    }
    let words = texts_between(words, '`');
    if words.is_empty() || shown.is_empty() {
        wrong.push(format!("{what}: no words, or no lessons"));
    }
    for word in words {
        // With the parenthesis, a method is not confused with one whose name begins the same.
        let word = if word.starts_with('.') { format!("{word}(") } else { word.to_string() };
        if !shown.contains(&word) {
            wrong.push(format!("{what}: {word} is in none of its lessons"));
        }
    }
    // Each section's name follows the link to its file.
    let (files, names) = (link_targets(sections), texts_between(sections, '"'));
    if files.is_empty() || files.len() != names.len() {
        wrong.push(format!("{what}: {} files, {} sections", files.len(), names.len()));
    }
    for (file, name) in files.iter().zip(names) {
        match read(file) {
            Ok(text) if text.contains(&format!("test(\"{name}\"")) => {}
            Ok(_) => wrong.push(format!("{what}: {file} has no section {name:?}")),
            Err(error) => wrong.push(error),
        }
    }
    Some(wrong)
}

/// A script without its comments.
fn without_comments(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

#[test]
fn the_capability_table_names_existing_calls_lessons_and_sections() {
    let text = std::fs::read_to_string(scripts_folder().join("README.md")).unwrap();
    let rows: Vec<Vec<String>> = text.lines().filter_map(row_errors).collect();
    assert!(rows.len() >= 40, "{} rows", rows.len());
    let found = rows.concat();
    assert!(found.is_empty(), "{} mistakes:\n{}", found.len(), found.join("\n"));
    // Faults that this test adds must be found: a word, a lesson and a section that do not exist.
    let row = text.lines().find(|line| line.starts_with("| trim |")).unwrap();
    for (from, to) in [(".trim", ".trams"), ("18_times", "18_thyme"), ("over a part", "over a party")] {
        assert!(!row_errors(&row.replace(from, to)).unwrap().is_empty(), "{from} → {to}");
    }
}

fn script_source(file: &str) -> String {
    std::fs::read_to_string(scripts_folder().join("../core/script/src").join(file)).unwrap()
}

/// The text of the first list in square brackets after a marker in a source file.
fn quoted_list(text: &str, mark: &str) -> Vec<String> {
    let rest = text.split_once(mark).unwrap_or_else(|| panic!("{mark} is gone")).1;
    let rest = rest.split_once('[').unwrap().1;
    texts_between(rest.split(']').next().unwrap(), '"').into_iter().map(String::from).collect()
}

/// The names that scripts use for the animatable fields of a type.
fn keyframe_names<T: Described>() -> Vec<String> {
    T::FIELDS.iter().filter_map(|field| Some(field.keyed?.0.to_string())).collect()
}

/// The words that a lesson must contain: options and keys of lights, slots of textures, projections, ways to wrap. The crate
/// that reads materials tests theirs.
fn required_words() -> Vec<String> {
    let texture = script_source("procedural/texture.rs");
    let quoted = |names: Vec<String>| names.into_iter().map(|name| format!("\"{name}\""));
    let mut all: Vec<String> = ["attenuation:", "look_at:", "shadow:"].map(String::from).to_vec();
    all.extend(StageLight::FIELDS.iter().map(|field| format!("{}:", field.name)));
    all.extend(Shadow::FIELDS.iter().map(|field| format!("{}:", field.name)));
    all.extend(quoted(keyframe_names::<StageLight>()));
    all.extend(quoted(keyframe_names::<Sky>()));
    all.extend(quoted(quoted_list(&texture, "SLOTS: &[&str] =")));
    all.extend(quoted(quoted_list(&script_source("procedural/displacement.rs"), "PROJECTIONS: &[&str] =")));
    all.extend(["repeat", "mirror", "clamp", "nearest"].map(|word| format!("\"{word}\"")));
    all.sort();
    all.dedup();
    all
}

/// The words that no lesson contains. An option counts only as a whole word, a text only in quotes.
fn missing_words(wanted: &[String], lessons: &str) -> Vec<String> {
    let occurs = |word: &String| {
        lessons
            .match_indices(word.as_str())
            .any(|(at, _)| !lessons[..at].ends_with(|c: char| c.is_ascii_alphanumeric() || c == '_'))
    };
    wanted.iter().filter(|word| !occurs(word)).cloned().collect()
}

#[test]
fn every_light_and_texture_option_is_in_a_lesson() {
    let mut lessons = String::new();
    for entry in std::fs::read_dir(scripts_folder()).unwrap() {
        let path = entry.unwrap().path();
        let path = if path.is_dir() { path.join("lesson.rhai") } else { path };
        if path.extension().is_some_and(|e| e == "rhai") && path.is_file() {
            lessons += &without_comments(&std::fs::read_to_string(path).unwrap());
            lessons.push('\n');
        }
    }
    let wanted = required_words();
    assert!(wanted.len() >= 30, "{wanted:?}");
    assert_eq!(missing_words(&wanted, &lessons), Vec::<String>::new(), "in no lesson");
    // If a word is removed from the lessons, exactly that word is reported.
    for word in ["kelvin:", "\"specular_color\"", "\"range\"", "attenuation:", "\"cone\""] {
        assert_eq!(missing_words(&wanted, &lessons.replace(word, "")), [word], "{word}");
    }
}
