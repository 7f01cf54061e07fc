//! `scripts/README.md` says where each capability is shown and judged; this holds that it is.

use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts")
}

/// Targets of `[text](target)`.
fn links(cell: &str) -> Vec<&str> {
    cell.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect()
}

/// What stands between pairs of a mark.
fn between(cell: &str, mark: char) -> Vec<&str> {
    cell.split(mark).skip(1).step_by(2).collect()
}

/// What is wrong with a table's row; `None` for lines that are none.
fn wrong(line: &str) -> Option<Vec<String>> {
    let cells: Vec<&str> = line.strip_prefix("| ")?.trim_end_matches(" |").split(" | ").collect();
    if cells[0] == "what" {
        return None;
    }
    let mut wrong = Vec::new();
    let [what, words, lessons, sections] = cells[..] else {
        return Some(vec![format!("{} cells in {line}", cells.len())]);
    };
    let read = |link: &&str| std::fs::read_to_string(folder().join(link)).map_err(|e| format!("{link}: {e}"));
    let mut shown = String::new();
    for lesson in links(lessons) {
        match read(&lesson) {
            Ok(text) => shown += &code(&text),
            Err(error) => wrong.push(error),
        }
    }
    let words = between(words, '`');
    if words.is_empty() || shown.is_empty() {
        wrong.push(format!("{what}: no words, or no lessons"));
    }
    for word in words {
        // A method is called, not another one that begins like it.
        let word = if word.starts_with('.') { format!("{word}(") } else { word.to_string() };
        if !shown.contains(&word) {
            wrong.push(format!("{what}: {word} is in none of its lessons"));
        }
    }
    // Each section's name follows the link to its file.
    let (files, names) = (links(sections), between(sections, '"'));
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
fn code(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

#[test]
fn the_table_names_what_there_is() {
    let text = std::fs::read_to_string(folder().join("README.md")).unwrap();
    let rows: Vec<Vec<String>> = text.lines().filter_map(wrong).collect();
    assert!(rows.len() >= 40, "{} rows", rows.len());
    let found = rows.concat();
    assert!(found.is_empty(), "{} mistakes:\n{}", found.len(), found.join("\n"));
    // Planted faults are found: a word, a lesson and a section that are not there.
    let row = text.lines().find(|line| line.starts_with("| trim |")).unwrap();
    for (from, to) in [(".trim", ".trams"), ("18_times", "18_thyme"), ("over a part", "over a party")] {
        assert!(!wrong(&row.replace(from, to)).unwrap().is_empty(), "{from} → {to}");
    }
}
