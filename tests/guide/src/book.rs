//! The book: the pages that `SUMMARY.md` lists, pages of the repository and generated pages among them, with links that hold inside
//! the book.

use crate::markdown::{self, Link};
use crate::page::{Drawing, Page};
use crate::{gallery, lesson, reference};
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// The folder of the guide's own pages.
const SOURCES: &str = "scripts/guide/src";
/// The folder of the scripts that pages include and whose images they show.
const SCENES: &str = "scripts/guide/scenes";

pub struct Book {
    pub summary: String,
    pub pages: Vec<Page>,
    /// Images by their paths in the book.
    pub drawings: BTreeMap<String, Drawing>,
    /// Files that are copied, by their paths in the book.
    pub copies: BTreeMap<String, PathBuf>,
    /// Faults of the sources: `FILE: broken link TARGET`.
    pub problems: Vec<String>,
    root: PathBuf,
    /// Files that have another text than in the repository.
    edited: Vec<(String, String)>,
    /// Path in the book by path in the repository.
    paths: BTreeMap<String, String>,
}

impl Book {
    /// Reads the book from the repository at `root`, where some files have another text, as in a test.
    pub fn read(root: &Path, edited: &[(&str, &str)]) -> Result<Book, String> {
        let mut book = Book {
            summary: String::new(),
            pages: Vec::new(),
            drawings: BTreeMap::new(),
            copies: BTreeMap::new(),
            problems: Vec::new(),
            root: root.to_path_buf(),
            edited: edited.iter().map(|(file, text)| (file.to_string(), text.to_string())).collect(),
            paths: BTreeMap::new(),
        };
        let lessons = lesson::lessons(root)?;
        let mut generated = reference::pages(root, &lessons)?;
        // Pages of the repository link to the file of the reference there, and to the scripts of the lessons.
        book.paths.insert("core/script/API.md".to_string(), "reference/index.md".to_string());
        for lesson in &lessons {
            let (page, place, drawing) = gallery::page(lesson);
            book.paths.insert(lesson.file.clone(), page.path.clone());
            book.drawings.insert(place, drawing);
            generated.push(page);
        }
        for page in &generated {
            book.paths.insert(page.source.clone(), page.path.clone());
        }
        let summary = book.read_file(&format!("{SOURCES}/SUMMARY.md"))?;
        let listed = book.add_listed_pages(&summary, &generated)?;
        for source in listed {
            let path = book.paths[&source].clone();
            let text = book.expanded(&source, &path)?;
            let is_own = source.starts_with(SOURCES);
            book.pages.push(Page { path, source, text, is_own });
        }
        for mut page in generated {
            page.text = book.localized(&page.text, &page.source, &page.path);
            book.pages.push(page);
        }
        let broken = book.broken_links();
        book.problems.extend(broken);
        Ok(book)
    }

    fn read_file(&self, path: &str) -> Result<String, String> {
        if let Some((_, text)) = self.edited.iter().find(|(file, _)| file == path) {
            return Ok(text.clone());
        }
        std::fs::read_to_string(self.root.join(path)).map_err(|e| format!("{path}: {e}"))
    }

    /// Writes the summary of the book and gives the files of the pages that it lists. An item may be a file of the repository, a pattern
    /// `*` of these, or `{{PREFIX}}` for the generated pages under a path.
    fn add_listed_pages(&mut self, summary: &str, generated: &[Page]) -> Result<Vec<String>, String> {
        let mut sources = Vec::new();
        for line in summary.lines() {
            if let Some((indent, prefix)) =
                line.split_once("{{").and_then(|(i, p)| Some((i, p.strip_suffix("}}")?)))
            {
                for page in generated.iter().filter(|page| page.path.starts_with(prefix)) {
                    if self.summary.contains(&format!("]({})", page.path)) {
                        continue;
                    }
                    self.summary += &format!("{indent}[{}]({})\n", title(&page.text), page.path);
                }
                continue;
            }
            let Some(link) = markdown::links(line).pop() else {
                self.summary += &format!("{line}\n");
                continue;
            };
            let target = normal(SOURCES, &line[link.target.clone()]);
            let files = self.matching_files(&target)?;
            // A pattern does not list a page again.
            for file in files.into_iter().filter(|file| !sources.contains(file)).collect::<Vec<_>>() {
                let path = match file.strip_prefix(&format!("{SOURCES}/")) {
                    Some(own) => own.to_string(),
                    None => format!(
                        "pages/{}.md",
                        file.trim_end_matches("/README.md").trim_end_matches(".md").replace('/', "-")
                    ),
                };
                let title = match &line[link.text.clone()] {
                    "" => title(&self.read_file(&file)?),
                    given => given.to_string(),
                };
                self.summary += &format!("{}[{title}]({path})\n", &line[..link.whole.start]);
                self.paths.insert(file.clone(), path);
                sources.push(file);
            }
        }
        Ok(sources)
    }

    /// The files of a pattern with one `*`, in order; the file itself where there is none.
    fn matching_files(&self, pattern: &str) -> Result<Vec<String>, String> {
        let Some((before, after)) = pattern.split_once('*') else { return Ok(vec![pattern.to_string()]) };
        let (folder, start) = before.rsplit_once('/').unwrap_or(("", before));
        let entries = std::fs::read_dir(self.root.join(folder)).map_err(|e| format!("{folder}: {e}"))?;
        let names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
        // `*.md` is a file, `*/README.md` a file in each folder.
        let file = |name: String| match after.starts_with('/') {
            true => Some(format!("{folder}/{name}{after}")).filter(|_| name.starts_with(start)),
            false => {
                Some(format!("{folder}/{name}")).filter(|_| name.starts_with(start) && name.ends_with(after))
            }
        };
        let files = names.filter_map(file).filter(|file| self.root.join(file).is_file());
        let mut files: Vec<String> = files.collect();
        files.sort();
        Ok(files)
    }

    /// A page with its includes, and with links for a page at `path` of the book.
    fn expanded(&mut self, source: &str, path: &str) -> Result<String, String> {
        let text = self.read_file(source)?;
        let text = self.localized(&text, source, path);
        let mut whole = String::with_capacity(text.len());
        let mut rest = text.as_str();
        while let Some((before, after)) = rest.split_once("{{#include ") {
            let (file, after) = after.split_once("}}").ok_or(format!("{source}: an include without }}}}"))?;
            let file = normal(parent(source), file.trim());
            whole += before;
            match file.ends_with(".md") {
                true => whole += self.expanded(&file, path)?.trim_end(),
                false => whole += self.read_file(&file).map_err(|e| format!("{source}: {e}"))?.trim_end(),
            }
            rest = after;
        }
        Ok(whole + rest)
    }

    /// The text of a file with links that hold for a page at `path` of the book.
    fn localized(&mut self, text: &str, source: &str, path: &str) -> String {
        let mut text = text.to_string();
        // Links are replaced from the end, so that places before them stay; a link around an image ends behind it.
        for link in markdown::links(&text).into_iter().rev() {
            let target = text[link.target.clone()].to_string();
            if target.starts_with('#') || target.contains("://") {
                continue;
            }
            let (file, anchor) =
                target.split_once('#').map_or((&*target, ""), |(file, anchor)| (file, anchor));
            let file = normal(parent(source), file);
            match self.place(&file, &link) {
                Some(place) => {
                    let anchor = if anchor.is_empty() { String::new() } else { format!("#{anchor}") };
                    text.replace_range(link.target.clone(), &format!("{}{anchor}", relative(path, &place)));
                }
                // A file of the source code is named; the book does not contain it.
                None if self.root.join(&file).exists() => {
                    let words = text[link.text.clone()].to_string();
                    let named = match words.starts_with('!') {
                        // The image keeps its place in the text.
                        true => format!(" {words}"),
                        false if words.contains(&file) => words,
                        false => format!("{words} (`{file}`)"),
                    };
                    text.replace_range(link.whole.clone(), &named);
                }
                None => self.problems.push(format!("{source}: broken link {target}")),
            }
        }
        text
    }

    /// The place in the book of a file of the repository, if the book has it.
    fn place(&mut self, file: &str, link: &Link) -> Option<String> {
        if let Some(page) = self.paths.get(file) {
            return Some(page.clone());
        }
        if self.drawings.contains_key(file.strip_prefix(&format!("{SOURCES}/")).unwrap_or(file)) {
            return file.strip_prefix(&format!("{SOURCES}/")).map(String::from);
        }
        if !link.is_image {
            return None;
        }
        let own = file.strip_prefix(&format!("{SOURCES}/"));
        let drawn = own.and_then(|own| Some((own, own.strip_prefix("images/")?.strip_suffix(".png")?)));
        if let Some((place, name)) = drawn {
            let (scene, time) =
                name.split_once('@').map_or((name, None), |(scene, time)| (scene, Some(time)));
            let folders =
                [SCENES, "scripts"].map(|folder| self.root.join(folder).join(format!("{scene}.rhai")));
            let script = folders.into_iter().find(|script| script.is_file());
            let drawing = Drawing { script: script?, time: time.map(String::from) };
            self.drawings.insert(place.to_string(), drawing);
            return Some(place.to_string());
        }
        let place = own.map_or_else(|| format!("files/{file}"), String::from);
        let path = self.root.join(file);
        path.is_file().then(|| self.copies.insert(place.clone(), path));
        self.copies.contains_key(&place).then_some(place)
    }

    /// The links of the finished pages that lead nowhere, anchors included.
    fn broken_links(&self) -> Vec<String> {
        let anchors: BTreeMap<&str, _> =
            self.pages.iter().map(|page| (page.path.as_str(), markdown::anchors(&page.text))).collect();
        let mut broken = Vec::new();
        for page in &self.pages {
            for link in markdown::links(&page.text) {
                let target = &page.text[link.target.clone()];
                let (file, anchor) = target.split_once('#').unwrap_or((target, ""));
                let file = match file {
                    "" => page.path.clone(),
                    _ if file.contains("://") => continue,
                    file => normal(parent(&page.path), file),
                };
                let holds = match anchors.get(file.as_str()) {
                    Some(anchors) => anchor.is_empty() || anchors.contains(anchor),
                    None => self.drawings.contains_key(&file) || self.copies.contains_key(&file),
                };
                // Faults of a source are reported with it.
                let known = self.problems.iter().any(|known| known.ends_with(&format!(" {target}")));
                if !holds && !known {
                    broken.push(format!("{}: broken link {target}", page.source));
                }
            }
        }
        broken
    }
}

/// The first heading of a page, without its marks.
fn title(text: &str) -> String {
    let heading = text.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or("untitled");
    heading.replace('`', "")
}

fn parent(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}

/// A path relative to a folder, with `.` and `..` taken out.
fn normal(folder: &str, path: &str) -> String {
    let mut parts: Vec<String> = Vec::new();
    for part in Path::new(folder).join(path).components() {
        match part {
            Component::ParentDir => drop(parts.pop()),
            Component::Normal(name) => parts.push(name.to_string_lossy().into_owned()),
            _ => {}
        }
    }
    parts.join("/")
}

/// The link from one page of the book to another.
pub fn relative(from: &str, to: &str) -> String {
    let up = "../".repeat(from.matches('/').count());
    format!("{up}{to}")
}
