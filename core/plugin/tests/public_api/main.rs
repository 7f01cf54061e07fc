//! The public API of the crate and of assets and motion, which it passes on, read from their sources and compared with `API.txt`. A
//! difference says whether it breaks plugins that are written already (decision 57). `CHOREO_ACCEPT=1` renews the file.

mod changes;
mod examples;
mod source;

use changes::{differences, type_of};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

/// An entry of the list: a line of text, complete with the path of the item.
type Entries = BTreeSet<String>;

const DERIVES: &str = " derives ";

/// Formats the entries, one per line; the traits that a type derives share one line.
fn list(entries: &Entries) -> String {
    let mut text = String::new();
    let mut of = "";
    for entry in entries {
        match entry.split_once(DERIVES) {
            Some((path, name)) if path == of => text.insert_str(text.len() - 1, &format!(", {name}")),
            other => {
                of = other.map_or("", |(path, _)| path);
                writeln!(text, "{entry}").unwrap();
            }
        }
    }
    text
}

/// The entries of a list.
fn entries_of_list(text: &str) -> Entries {
    let expand = |line: &str| -> Vec<String> {
        match line.split_once(DERIVES) {
            Some((path, names)) => names.split(", ").map(|name| format!("{path}{DERIVES}{name}")).collect(),
            None => vec![line.to_string()],
        }
    };
    text.lines().flat_map(expand).collect()
}

fn entries_of_sources() -> Entries {
    let mut entries = Entries::new();
    let core = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    for name in ["plugin", "asset", "motion"] {
        source::api(name, &core.join(name).join("src"), &mut entries);
    }
    // Methods and traits of types that are not public.
    let types: BTreeSet<String> = entries.iter().filter_map(|entry| type_of(entry)).collect();
    entries.retain(|entry| match entry.split_once(' ') {
        Some((path, rest)) if rest.starts_with("fn ") || rest.starts_with("impl") => {
            let name = path.rsplit("::").next().unwrap_or_default();
            !name.starts_with(char::is_uppercase) || types.contains(name)
        }
        _ => true,
    });
    entries
}

#[test]
fn the_public_api_is_that_of_the_list() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("API.txt");
    let now = entries_of_sources();
    if std::env::var_os("CHOREO_ACCEPT").is_some() {
        return std::fs::write(&file, list(&now)).unwrap();
    }
    let known = entries_of_list(&std::fs::read_to_string(&file).unwrap_or_default());
    let differences = differences(&known, &now);
    assert!(
        differences.is_empty(),
        "the public API is another than core/plugin/API.txt says; what is breaking raises the version (decision 57):\n\
         {differences}renew the list with CHOREO_ACCEPT=1 cargo test -p choreo-plugin --test public_api"
    );
}

/// Entries of a source text of the module `m`.
fn entries(text: &str) -> Entries {
    let mut entries = Entries::new();
    source::entries_of(text, "m", &mut entries);
    entries
}

const SOURCE: &str = "
/// A size.
#[derive(Clone, Default)]
pub struct Size {
    pub width: u32,
    pub(crate) area: u64,
}

pub struct Place {
    pub x: f32,
}

pub enum Way {
    Left,
    Up {
        by: f32,
    },
}

impl Size {
    pub fn grown<T: Into<u32>>(
        &self,
        by: T,
    ) -> Size {
        todo!()
    }
    fn private(&self) {}
}

impl Drop for Size {
    fn drop(&mut self) {}
}

pub trait Shape: Send {
    fn area(&self) -> f32;
    fn name(&self) -> &str {
        \"\"
    }
}

pub const MOST: usize = 1 << 10;

mod private {
    pub fn hidden() {}
}
";

#[test]
fn items_are_read_from_formatted_sources() {
    let expected = [
        "m const MOST: usize",
        "m enum Way",
        "m struct Place",
        "m struct Size",
        "m trait Shape: Send",
        "m::Place field x: f32",
        "m::Shape fn area(&self) -> f32",
        "m::Shape fn name(&self) -> &str (provided)",
        "m::Size derives Clone",
        "m::Size derives Default",
        "m::Size field width: u32",
        "m::Size fn grown<T: Into<u32>>(&self, by: T) -> Size",
        "m::Size has private fields",
        "m::Size impl Drop for Size",
        "m::Way variant Left",
        "m::Way variant Up { by: f32 }",
    ];
    assert_eq!(entries_of_list(&list(&entries(SOURCE))), entries(SOURCE));
    assert_eq!(entries(SOURCE).into_iter().collect::<Vec<_>>(), expected);
}

#[test]
fn changes_that_break_plugins_are_named() {
    let known = entries(SOURCE);
    let changed = |from: &str, to: &str| {
        assert!(SOURCE.contains(from), "{from}");
        differences(&known, &entries(&SOURCE.replace(from, to)))
    };
    assert_eq!(changed("const MOST: usize = 1 << 10", "const MOST: usize = 5"), "");
    assert_eq!(
        changed("by: T,\n", "by: T,\n        _twice: bool,\n")
            .matches("breaking: gone or changed: m::Size fn grown")
            .count(),
        1
    );
    assert_eq!(changed("    pub x: f32,\n", ""), "breaking: gone or changed: m::Place field x: f32\n");
    assert_eq!(
        changed("    pub x: f32,\n", "    pub x: f32,\n    pub y: f32,\n"),
        "breaking: new: m::Place field y: f32\n"
    );
    assert_eq!(
        changed("    pub width: u32,\n", "    pub width: u32,\n    pub height: u32,\n"),
        "new: m::Size field height: u32\n"
    );
    assert_eq!(changed("    Left,\n", "    Left,\n    Right,\n"), "breaking: new: m::Way variant Right\n");
    assert_eq!(
        changed("    fn area(&self) -> f32;\n", "    fn area(&self) -> f32;\n    fn sides(&self) -> u32;\n"),
        "breaking: new: m::Shape fn sides(&self) -> u32\n"
    );
    assert_eq!(
        changed("pub enum Way {\n", "#[non_exhaustive]\npub enum Way {\n").matches("breaking").count(),
        1,
        "plugins may match all variants"
    );
    assert_eq!(
        changed("#[derive(Clone, Default)]\n", "#[derive(Default)]\n"),
        "breaking: gone or changed: m::Size derives Clone\n"
    );
    assert_eq!(changed("pub trait Shape", "pub fn new_one() {}\n\npub trait Shape"), "new: m fn new_one()\n");
}

#[test]
fn every_public_item_has_an_example() {
    let mut examples = examples::Examples::default();
    examples.folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
    let missing = examples.missing();
    assert!(missing.is_empty(), "write an example for these items (decision 74): {missing:#?}");
}

#[test]
fn items_without_examples_are_found() {
    let missing = |text: &str| {
        let mut examples = examples::Examples::default();
        examples.text(text);
        examples.missing().into_iter().map(str::to_string).collect::<Vec<_>>().join(", ")
    };
    let source = "
/// A size.
///
/// ```
/// let size = Size { width: 2 };
/// assert_eq!(size.grown(1).width, 3);
/// ```
pub struct Size {
    pub width: u32,
}

impl Size {
    /// Larger.
    pub fn grown(self, by: u32) -> Size {
        todo!()
    }
    fn private(&self) {}
}

/// A form.
pub trait Shape {
    /// Square metres.
    fn area(&self) -> f32;
}

/// Reads it.
#[doc(hidden)]
pub fn hidden() {}

pub const MOST: usize = 3;

#[cfg(test)]
mod tests {
    pub fn unseen() {}
}
";
    assert_eq!(missing(source), "trait Shape, method Shape::area");
    assert_eq!(
        missing(&source.replace("size.grown(1).width", "size.width + 1")),
        "method Size::grown, trait Shape, method Shape::area"
    );
    let shown = "/// A form.\n///\n/// ```\n/// # struct Ball; impl Shape for Ball { fn area(&self) -> f32 { 1.0 } }\n/// ```";
    assert_eq!(missing(&source.replace("/// A form.", shown)), "");
}

/// The crates that an author's plugin is built with.
#[test]
fn a_plugin_has_fewer_than_15_dependencies() {
    // Features are resolved as in an author's workspace, whatever this one does.
    let tree = std::process::Command::new(env!("CARGO"))
        .args([
            "tree",
            "--offline",
            "--package",
            "choreo-plugin",
            "--edges",
            "normal",
            "--prefix",
            "none",
            "--no-dedupe",
        ])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .env_remove("CARGO_RESOLVER_FEATURE_UNIFICATION")
        .env_remove("CARGO_UNSTABLE_FEATURE_UNIFICATION")
        .output()
        .unwrap();
    assert!(tree.status.success(), "{}", String::from_utf8_lossy(&tree.stderr));
    let text = String::from_utf8(tree.stdout).unwrap();
    let name = |line: &str| line.split(' ').next().unwrap_or_default().to_string();
    let crates: BTreeSet<String> = text.lines().map(name).filter(|name| name != "choreo-plugin").collect();
    assert!(crates.contains("glam") && crates.len() < 15, "{} crates: {crates:?}", crates.len());
    let macros: Vec<&str> = text.lines().filter(|line| line.contains("(proc-macro)")).collect();
    assert!(macros.is_empty(), "{macros:?}");
}
