//! The guide holds: its links lead somewhere, its scripts pass `choreo check`, its commands exist, and its images are drawn from
//! their scripts.

use guide::page::Page;
use guide::{Book, markdown, program, root};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

const BINARY: &str = env!("CARGO_BIN_EXE_guide");
/// The page in which faults are planted.
const PLANTED_PAGE: &str = "scripts/guide/src/recipes/hand_over.md";

fn book() -> Book {
    Book::read(&root(), &[]).unwrap()
}

/// The book with another text at a place of the page for faults.
fn book_with(from: &str, to: &str) -> Book {
    let text = std::fs::read_to_string(root().join(PLANTED_PAGE)).unwrap();
    assert!(text.contains(from), "{PLANTED_PAGE} has no {from}");
    Book::read(&root(), &[(PLANTED_PAGE, &text.replacen(from, to, 1))]).unwrap()
}

#[test]
fn link_and_image_targets_exist() {
    assert_eq!(book().problems, Vec::<String>::new());
    let planted = [
        ("../concepts/constraints.md", "../concepts/constraint.md"),
        ("../reference/actor.md#attach", "../reference/actor.md#attacks"),
        ("images/hand_over@", "images/hand_out@"),
    ];
    for (from, to) in planted {
        let found = book_with(from, to).problems;
        assert!(found.len() == 1 && found[0].starts_with(PLANTED_PAGE), "{from} → {to}: {found:?}");
    }
}

/// The scripts that pages include, with their paths.
fn scripts() -> Vec<(String, PathBuf)> {
    let mut found = Vec::new();
    for folder in ["scripts/guide/scenes", "scripts"] {
        for entry in std::fs::read_dir(root().join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|e| e == "rhai") {
                let text = std::fs::read_to_string(&path).unwrap();
                found.push((format!("{}\n", text.trim_end()), path));
            }
        }
    }
    found
}

/// A scene passes `choreo check`, and tests pass.
fn checked_and_tested(file: &Path, text: &str) -> Result<(), String> {
    let binary = Path::new(BINARY);
    // A file of tests has no stage that `check` could look at.
    if text.starts_with("test(") { Ok(()) } else { program::check(binary, file) }?;
    if text.lines().any(|line| line.starts_with("test(")) { program::test(binary, file) } else { Ok(()) }
}

/// Scripts of the pages that fail `check` or `test`, with their pages. A script that occurs several times is run once.
fn failing<'p>(pages: impl Iterator<Item = &'p Page>) -> Vec<String> {
    let frame = std::fs::read_to_string(root().join("scripts/guide/frame.rhai")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let written = folder.path().join("script.rhai");
    std::fs::copy(root().join("scripts/guide/edit.otio"), folder.path().join("edit.otio")).unwrap();
    let included = scripts();
    let (registry, options) = (choreo::registry(), choreo_script::ScriptOptions::default());
    let (mut known, mut failing) = (BTreeSet::new(), Vec::new());
    for page in pages {
        for block in markdown::blocks(&page.text).into_iter().filter(markdown::Block::is_script) {
            // Importers in Rhai are no scenes.
            if block.text.contains("fn manifest()") {
                continue;
            }
            // A page of another part of the repository marks no fragments.
            let starts = |word: &str| block.text.lines().any(|line| line.starts_with(word));
            let alone = ["stage(", "import ", "test("].iter().any(|word| starts(word));
            let is_whole = if page.is_own { !block.is_fragment() } else { alone };
            if !known.insert((is_whole && page.is_own, block.text.clone())) {
                continue;
            }
            let text = if is_whole { block.text.clone() } else { format!("{frame}\n{}", block.text) };
            // A script that the page includes is run where it lies, beside the files that it loads.
            let own = included.iter().find(|(included, _)| *included == block.text).map(|(_, path)| path);
            let file = own.unwrap_or(&written);
            if own.is_none() {
                std::fs::write(file, text).unwrap();
            }
            let result = match is_whole && page.is_own {
                true => checked_and_tested(file, &block.text),
                false => choreo_script::run_file(file, &registry, &options)
                    .map(drop)
                    .map_err(|errors| errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")),
            };
            if let Err(text) = result {
                failing.push(format!("{}, code block at line {}:\n{text}", page.source, block.line));
            }
        }
    }
    failing
}

#[test]
fn scripts_pass_check() {
    let book = book();
    let scripts = book.pages.iter().filter(|page| page.is_own);
    let count =
        scripts.flat_map(|page| markdown::blocks(&page.text)).filter(markdown::Block::is_script).count();
    assert!(count > 25, "{count} scripts");
    // Lessons have tests of their own.
    let tested = book.pages.iter().filter(|page| !page.path.starts_with("gallery/"));
    let found = failing(tested);
    assert!(found.is_empty(), "{} scripts fail:\n{}", found.len(), found.join("\n"));
}

#[test]
fn a_misspelled_method_is_found() {
    let fault = |from: &str, to: &str| {
        let mut book = book();
        let page = book.pages.iter_mut().find(|page| page.source == PLANTED_PAGE).unwrap();
        assert!(page.text.contains(from), "{from}");
        page.text = page.text.replacen(from, to, 1);
        failing(book.pages.iter().filter(|page| page.source == PLANTED_PAGE))
    };
    for (from, to) in [(".reach(", ".raech("), ("fade(0.8)", "fede(0.8)")] {
        let found = fault(from, to);
        assert!(found.len() == 1 && found[0].contains("did you mean"), "{from} → {to}: {found:?}");
    }
}

/// The commands in blocks of `sh` and between backticks: `choreo render my.rhai --at 1`.
fn commands(text: &str) -> Vec<String> {
    let shell = markdown::blocks(text).into_iter().filter(|block| block.info == "sh" || block.info == "yaml");
    let lines: Vec<String> =
        shell.flat_map(|block| block.text.lines().map(String::from).collect::<Vec<_>>()).collect();
    let plain = markdown::without_code(text);
    let spans =
        text.lines().zip(plain.lines()).filter(|(line, plain)| line != plain && !line.starts_with("```"));
    let spans = spans.flat_map(|(line, _)| line.split('`').skip(1).step_by(2).map(String::from));
    let command = |line: String| {
        let at = line.find("choreo ").filter(|at| *at == 0 || line[..*at].ends_with([' ', '(']))?;
        line[at..].split(['#', ';', '|', '<']).next().map(String::from)
    };
    lines.into_iter().chain(spans).filter_map(command).collect()
}

/// The commands of some pages that the program does not have, or whose options it does not have.
fn unknown_commands<'p>(pages: impl Iterator<Item = &'p Page>) -> Vec<String> {
    let mut helps: BTreeMap<String, String> = BTreeMap::new();
    let mut unknown = Vec::new();
    for page in pages {
        for command in commands(&page.text) {
            let mut words = command.split_whitespace().skip(1);
            let Some(name) = words.next() else { continue };
            let help = helps.entry(name.to_string()).or_insert_with(|| {
                let output = program::choreo(Path::new(BINARY)).args([name, "--help"]).output().unwrap();
                if output.status.success() {
                    String::from_utf8(output.stdout).unwrap()
                } else {
                    String::new()
                }
            });
            let flag = |word: &str| {
                word.strip_prefix("--").map(|flag| flag.split(['=', ')']).next().unwrap().to_string())
            };
            let has = |flag: &String| {
                help.split([' ', '\n', ',', '=', '[']).any(|word| word == format!("--{flag}"))
            };
            if help.is_empty() || words.filter_map(flag).any(|flag| !has(&flag)) {
                unknown.push(format!("{}: {command}", page.source));
            }
        }
    }
    unknown
}

#[test]
fn commands_and_their_options_exist() {
    let mut book = book();
    book.pages.retain(|page| page.is_own);
    let count: usize = book.pages.iter().map(|page| commands(&page.text).len()).sum();
    assert!(count > 40, "{count} commands");
    assert_eq!(unknown_commands(book.pages.iter()), Vec::<String>::new());
    let page = book.pages.iter_mut().find(|page| page.path == "ten_minutes.md").unwrap();
    for (from, to) in [("--at 1", "--when 1"), ("choreo view", "choreo show")] {
        assert!(page.text.contains(from), "{from}");
        let text = std::mem::take(&mut page.text);
        page.text = text.replacen(from, to, 1);
        assert_eq!(unknown_commands(std::iter::once(&*page)).len(), 1, "{from} → {to}");
        page.text = text;
    }
}

#[test]
fn every_image_is_rendered_from_its_script() {
    let book = book();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("image.png");
    let mut blank = Vec::new();
    for (place, drawing) in &book.drawings {
        program::draw(Path::new(BINARY), drawing, &out, 48, "1").unwrap();
        let image = image::open(&out).unwrap().to_rgb8();
        let colors: BTreeSet<[u8; 3]> = image.pixels().map(|pixel| pixel.0).collect();
        if colors.len() < 16 {
            blank.push(format!("{place}: {} colors", colors.len()));
        }
        std::fs::remove_file(&out).unwrap();
    }
    assert!(book.drawings.len() > 60, "{} images", book.drawings.len());
    assert!(blank.is_empty(), "images that show hardly anything:\n{}", blank.join("\n"));
}
