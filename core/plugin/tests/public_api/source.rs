//! Public items of sources, an entry each. The sources are formatted by rustfmt, so that lines and their indentation say where items
//! begin and end.

use crate::Entries;
use std::path::Path;

/// A public item whose lines are being read.
struct Item {
    /// Path and name: `importer::Claim`.
    path: String,
    /// Ending of entries for its members.
    kind: ItemKind,
}

#[derive(Clone, Copy, PartialEq)]
enum ItemKind {
    Struct,
    Enum,
    Trait,
    /// Methods of a type, or a trait for it.
    Impl,
}

/// Reads one file of a module.
struct Reader<'a> {
    module: &'a str,
    entries: &'a mut Entries,
    /// Attributes in front of the next item.
    attributes: Vec<String>,
    item: Option<Item>,
}

impl Reader<'_> {
    fn file(&mut self, text: &str) {
        let mut lines = text.lines();
        while let Some(line) = lines.next() {
            let indent = line.len() - line.trim_start().len();
            let code = line.trim_start();
            if code.starts_with("//") || code.is_empty() {
                continue;
            }
            if code.starts_with("#[") {
                self.attributes.push(join_lines(line, &mut lines, |so_far| so_far.ends_with(']')));
                continue;
            }
            match indent {
                0 => self.read_top_level_line(line, &mut lines),
                4 => self.read_member_line(line, &mut lines),
                _ => continue,
            }
            self.attributes.clear();
        }
    }

    fn has_attribute(&self, attribute: &str) -> bool {
        self.attributes.iter().any(|a| a.starts_with(attribute))
    }

    fn add(&mut self, entry: String) {
        self.entries.insert(entry);
    }

    /// A line without indentation: an item begins or ends.
    fn read_top_level_line<'t>(&mut self, line: &'t str, lines: &mut impl Iterator<Item = &'t str>) {
        self.item = None;
        if self.has_attribute("#[cfg(test)]") || self.has_attribute("#[doc(hidden)]") {
            return skip_item(line, lines);
        }
        if let Some(name) = line.strip_prefix("macro_rules! ").and_then(|l| l.strip_suffix(" {")) {
            if self.has_attribute("#[macro_export]") {
                self.add(format!("macro {name}"));
            }
            return skip_item(line, lines);
        }
        if let Some((_, name)) = line.split_once("error_texts! { ") {
            let name = name.trim_end_matches(':');
            let path = self.path(name);
            self.add(format!("{path} impl std::fmt::Display for {name}"));
            self.add(format!("{path} impl std::error::Error for {name}"));
            return lines.by_ref().take_while(|line| *line != "}").for_each(drop);
        }
        if line.starts_with("impl") {
            return self.begin_impl(&join_lines(line, lines, |so_far| {
                so_far.ends_with('{') || so_far.ends_with('}')
            }));
        }
        let Some(item) = line.strip_prefix("pub ") else {
            return skip_item(line, lines);
        };
        if let Some(names) = item.strip_prefix("use ") {
            let names = join_lines(names, lines, |so_far| so_far.ends_with(';'));
            return self.add_reexports(names.trim_end_matches(';'));
        }
        let whole = join_lines(item, lines, |so_far| so_far.ends_with(['{', ';', '}']));
        let signature = whole.trim_end_matches(['{', ';']).trim_end_matches("{}").trim();
        let module = self.module;
        let (kind, name) = signature.split_once(' ').unwrap_or((signature, ""));
        let name: String = name.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        let path = self.path(&name);
        match kind {
            "mod" => return self.add(format!("{module} pub mod {name}")),
            "struct" | "enum" | "trait" => {}
            // The body of a function, the value of a constant.
            _ => {
                let shown = without_value(signature);
                self.add(format!("{module} {shown}"));
                if whole.ends_with('{') {
                    skip_item("{", lines);
                }
                return;
            }
        }
        let open = if self.has_attribute("#[non_exhaustive]") { " non_exhaustive" } else { "" };
        self.add(format!("{module} {signature}{open}"));
        for derived in self.attributes.iter().filter_map(|a| a.strip_prefix("#[derive(")) {
            for name in derived.trim_end_matches(")]").split(',').map(str::trim).filter(|n| !n.is_empty()) {
                self.entries.insert(format!("{path} derives {name}"));
            }
        }
        let kind = match kind {
            "struct" => ItemKind::Struct,
            "enum" => ItemKind::Enum,
            _ => ItemKind::Trait,
        };
        if whole.ends_with('{') {
            self.item = Some(Item { path, kind });
        }
    }

    /// Items of other modules that this one passes on, an entry each.
    fn add_reexports(&mut self, names: &str) {
        let names = names.split_once("::{").map_or(names, |(_, names)| names.trim_end_matches('}'));
        for name in names.split(',').map(str::trim).filter(|name| !name.is_empty()) {
            // The module may be a private one.
            let shown = if name.ends_with('*') { name } else { name.rsplit("::").next().unwrap_or(name) };
            self.add(format!("{} use {shown}", self.module));
        }
    }

    /// The path of a type: its crate and name, which are enough. Its methods may be in any module.
    fn path(&self, name: &str) -> String {
        format!("{}::{name}", self.module.split("::").next().unwrap_or_default())
    }

    fn begin_impl(&mut self, line: &str) {
        let head = line.trim_end_matches("{}").trim_end_matches('{').trim();
        let plain = head.strip_prefix("impl").unwrap_or(head).trim_start();
        let (of_trait, on) = match head.split_once(" for ") {
            Some((_, on)) => (true, on),
            // The generic parameters in front are left out.
            None if plain.starts_with('<') => (false, plain.split_once("> ").map_or(plain, |(_, on)| on)),
            None => (false, plain),
        };
        if of_trait {
            let name = on.split(['<', ' ']).next().unwrap_or_default();
            return self.add(format!("{} {head}", self.path(name)));
        }
        let name: String = on.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        self.item = Some(Item { path: self.path(&name), kind: ItemKind::Impl });
    }

    /// A line inside an item: a field, a variant, a method.
    fn read_member_line<'t>(&mut self, line: &'t str, lines: &mut impl Iterator<Item = &'t str>) {
        let Some(Item { path, kind }) = &self.item else { return };
        let (path, kind) = (path.clone(), *kind);
        if self.has_attribute("#[doc(hidden)]") || self.has_attribute("#[cfg(test)]") {
            return;
        }
        let code = line.trim_start();
        let public = code.strip_prefix("pub ");
        match kind {
            ItemKind::Struct => match public {
                Some(field) => self.add(format!("{path} field {}", field.trim_end_matches(','))),
                None => self.add(format!("{path} has private fields")),
            },
            ItemKind::Enum if code.starts_with('}') => {}
            ItemKind::Enum => {
                let whole = join_lines(code, lines, |so_far| {
                    so_far.ends_with(',') && so_far.matches('{').count() == so_far.matches('}').count()
                });
                self.add(format!("{path} variant {}", whole.trim_end_matches(',').replace(", }", " }")));
            }
            ItemKind::Trait | ItemKind::Impl => {
                let Some(code) = public.or((kind == ItemKind::Trait).then_some(code)) else { return };
                if !["fn ", "const ", "type ", "unsafe ", "async "].iter().any(|k| code.starts_with(k)) {
                    return;
                }
                let whole = join_lines(code, lines, |so_far| so_far.ends_with(['{', ';', '}']));
                let provided = kind == ItemKind::Trait && !whole.ends_with(';');
                let signature =
                    without_value(&whole).trim_end_matches(['{', ';']).trim_end_matches("{}").trim();
                let ending = if provided { " (provided)" } else { "" };
                self.add(format!("{path} {signature}{ending}"));
            }
        }
    }
}

/// A line and those that follow, in one, until it is complete.
fn join_lines<'t>(
    line: &str,
    lines: &mut impl Iterator<Item = &'t str>,
    complete: impl Fn(&str) -> bool,
) -> String {
    let mut whole = line.trim().to_string();
    while !complete(&whole) {
        let Some(next) = lines.next() else { break };
        let next = next.trim();
        if next.starts_with("//") || next.starts_with("#[") {
            continue;
        }
        let opened = whole.ends_with(['(', '[', '<']);
        if !opened && !next.starts_with([')', ']', '>', '.', '?']) {
            whole.push(' ');
        }
        // rustfmt ends the last line of a list with a comma.
        if next.starts_with([')', ']', '>']) {
            whole.truncate(whole.trim_end_matches(',').len());
        }
        whole.push_str(next);
    }
    whole
}

/// A constant without its value: a new value is no change, since plugins are compiled again.
fn without_value(signature: &str) -> &str {
    match signature.starts_with("fn ") {
        true => signature,
        false => signature.split(" = ").next().unwrap_or_default(),
    }
}

/// Skips an item of more than one line.
fn skip_item<'t>(line: &str, lines: &mut impl Iterator<Item = &'t str>) {
    if line.ends_with(['{', '(', '[']) {
        // The item ends at the line without indentation.
        lines.find(|next| next.starts_with(['}', ')', ']']));
    }
}

/// The public API of a module, whose sources are in a folder. Items of a private module count as those of the module around it, which passes
/// them on.
pub(crate) fn api(module: &str, folder: &Path, entries: &mut Entries) {
    let head = ["lib.rs", "mod.rs"].iter().find_map(|name| std::fs::read_to_string(folder.join(name)).ok());
    let head = head.unwrap_or_default();
    for file in std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path()) {
        let name = file.file_stem().unwrap().to_string_lossy().into_owned();
        let inner = match head.contains(&format!("pub mod {name};")) {
            true => format!("{module}::{name}"),
            false => module.to_string(),
        };
        if file.is_dir() {
            api(&inner, &file, entries);
        } else if name != "tests" {
            let text = std::fs::read_to_string(&file).unwrap();
            entries_of(&text, &inner, entries);
        }
    }
}
/// Entries of the text of one file.
pub(crate) fn entries_of(text: &str, module: &str, entries: &mut Entries) {
    Reader { module, entries, attributes: Vec::new(), item: None }.file(text);
}
