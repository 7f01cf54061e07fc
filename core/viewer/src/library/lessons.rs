//! Lessons, from the installation of the program or from its sources.

use std::path::{Path, PathBuf};

/// A script that teaches a topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lesson {
    pub file: PathBuf,
    /// Name for copies: `07_keys_and_frames`.
    pub name: String,
    /// Displayed title: `7 keys and frames`.
    pub title: String,
}

/// Lessons of the first folder that has some: that of the archive or package of the program, else that of its sources.
pub fn find_lessons() -> Vec<Lesson> {
    let program = std::env::current_exe().ok();
    let beside = program.iter().flat_map(|program| program.ancestors().skip(2).take(1));
    let installed = beside.map(|prefix| prefix.join("share/choreo/examples"));
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts");
    let folders = installed.chain([sources]).filter_map(|folder| folder.canonicalize().ok());
    let found = folders.map(|folder| lessons_in(&folder));
    found.into_iter().find(|lessons| !lessons.is_empty()).unwrap_or_default()
}

/// Lessons of a folder, sorted by number: `NN_name.rhai`, or `NN_name/lesson.rhai`.
pub fn lessons_in(folder: &Path) -> Vec<Lesson> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let lesson = |entry: std::fs::DirEntry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        let path = entry.path();
        let (file, name) = match path.is_dir() {
            true => (path.join("lesson.rhai"), name.as_str()),
            false => (path.clone(), name.strip_suffix(".rhai")?),
        };
        let (number, rest) = name.split_once('_')?;
        let number: u32 = number.parse().ok()?;
        let title = format!("{number} {}", rest.replace('_', " "));
        file.is_file().then(|| (number, Lesson { file, name: name.to_string(), title }))
    };
    let mut lessons: Vec<(u32, Lesson)> = entries.filter_map(lesson).collect();
    lessons.sort_by_key(|(number, _)| *number);
    lessons.into_iter().map(|(_, lesson)| lesson).collect()
}
