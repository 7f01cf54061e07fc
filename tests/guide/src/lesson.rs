//! The lessons of the repository.

use crate::markdown;
use std::path::{Path, PathBuf};

/// A numbered script of `scripts/`.
pub struct Lesson {
    pub number: String,
    pub title: String,
    /// Path in the repository: `scripts/02_layers.rhai`.
    pub file: String,
    pub path: PathBuf,
    pub text: String,
    /// The words that it shows by the tables of `scripts/README.md`: `.play`, `sun(`.
    pub words: Vec<String>,
    /// The plugin files beside it, with their texts.
    pub plugins: Vec<(String, String)>,
}

impl Lesson {
    /// `02_layers`, also where the lesson is a folder.
    pub fn name(&self) -> &str {
        let name = self.file.trim_start_matches("scripts/");
        name.trim_end_matches(".rhai").trim_end_matches("/lesson")
    }

    pub fn page(&self) -> String {
        format!("gallery/{}.md", self.name())
    }
}

/// The lessons in the order of `scripts/README.md`, which has their titles.
pub fn lessons(root: &Path) -> Result<Vec<Lesson>, String> {
    let read = |path: &Path| std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()));
    let list = read(&root.join("scripts/README.md"))?;
    let mut lessons = Vec::new();
    for link in markdown::links(&list) {
        let (number, target) = (&list[link.text.clone()], &list[link.target.clone()]);
        let Some(title) = list[link.whole.end..].strip_prefix(": ").and_then(|rest| rest.split('|').next())
        else {
            continue;
        };
        let path = root.join("scripts").join(target);
        let mut plugins = Vec::new();
        if target.ends_with("/lesson.rhai") {
            let folder = path.with_file_name("plugins");
            let entries = std::fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
            for entry in entries.flatten() {
                let name = entry.file_name().to_string_lossy().into_owned();
                if name.ends_with(".rhai") || name.ends_with(".wgsl") {
                    plugins.push((name, read(&entry.path())?));
                }
            }
            plugins.sort();
        }
        lessons.push(Lesson {
            number: number.to_string(),
            title: title.trim().to_string(),
            file: format!("scripts/{target}"),
            text: read(&path)?,
            words: words(&list, target),
            path,
            plugins,
        });
    }
    Ok(lessons)
}

/// The words in the rows of tables, `| what | words | lessons | …`, that link to a lesson.
fn words(list: &str, target: &str) -> Vec<String> {
    let rows = list.lines().filter_map(|line| {
        let mut cells = line.strip_prefix("| ")?.split(" | ").skip(1);
        let (words, lessons) = (cells.next()?, cells.next()?);
        lessons.contains(&format!("]({target})")).then_some(words)
    });
    rows.flat_map(|words| words.split('`').skip(1).step_by(2)).map(String::from).collect()
}
