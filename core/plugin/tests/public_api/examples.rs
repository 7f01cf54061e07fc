//! Examples of public items: a type, trait, function or method has one in its own documentation, or is used in one of another item of the
//! crate (decision 74). Constants are their own examples, and fields are shown by the example of their type.

use std::collections::BTreeSet;
use std::path::Path;

/// Modules of bytes between the program and a plugin in WebAssembly: authors write `wasm_importer!` alone.
const NOT_FOR_AUTHORS: [&str; 2] = ["guest.rs", "transfer"];

/// The public items of sources, and the examples in their documentation.
#[derive(Default)]
pub(crate) struct Examples {
    /// Items without an example of their own: what a message calls them, and their name.
    without: Vec<(String, String)>,
    /// Code of all examples.
    code: String,
}

impl Examples {
    /// Items that no example uses by their name.
    pub(crate) fn missing(&self) -> Vec<&str> {
        let words = self.code.split(|c: char| !c.is_alphanumeric() && c != '_');
        let words: BTreeSet<&str> = words.collect();
        let missing = self.without.iter().filter(|(_, name)| !words.contains(name.as_str()));
        missing.map(|(shown, _)| shown.as_str()).collect()
    }

    pub(crate) fn folder(&mut self, folder: &Path) {
        for file in std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path()) {
            let name = file.file_name().unwrap().to_string_lossy().into_owned();
            if NOT_FOR_AUTHORS.contains(&name.as_str()) {
                continue;
            }
            match file.is_dir() {
                true => self.folder(&file),
                false => self.text(&std::fs::read_to_string(&file).unwrap()),
            }
        }
    }

    /// Reads a text that rustfmt has formatted: an item begins at its indentation.
    pub(crate) fn text(&mut self, text: &str) {
        let (mut docs, mut attributes, mut item) =
            (Vec::<&str>::new(), String::new(), EnclosingItem::default());
        for line in text.lines() {
            let code = line.trim_start();
            if let Some(doc) = code.strip_prefix("///").or_else(|| code.strip_prefix("//!")) {
                docs.push(doc);
                continue;
            }
            if code.starts_with("#[") {
                attributes.push_str(code);
                continue;
            }
            if code.is_empty() || code.starts_with("//") {
                self.examples(&std::mem::take(&mut docs));
                continue;
            }
            if attributes.contains("#[cfg(test)]") && code.starts_with("mod ") {
                break;
            }
            let hidden = attributes.contains("#[doc(hidden)]");
            let exported = attributes.contains("#[macro_export]");
            let named = match line.len() - code.len() {
                0 => item.top_level_item(code, exported),
                4 => item.method(code),
                _ => None,
            };
            let has_example = self.examples(&docs);
            if let Some((shown, name)) = named.filter(|_| !has_example && !hidden) {
                self.without.push((shown, name));
            }
            docs.clear();
            attributes.clear();
        }
    }

    /// Adds the examples in a doc comment. Returns whether there are any.
    fn examples(&mut self, docs: &[&str]) -> bool {
        let (mut is_code, mut any) = (false, false);
        for line in docs {
            if line.trim_start().starts_with("```") {
                is_code = !is_code;
                any = true;
            } else if is_code {
                self.code.push_str(line);
                self.code.push('\n');
            }
        }
        any
    }
}

/// The item around a line.
#[derive(Default)]
struct EnclosingItem {
    name: Option<String>,
    is_trait: bool,
}

impl EnclosingItem {
    /// An item without indentation that needs an example.
    fn top_level_item(&mut self, code: &str, exported: bool) -> Option<(String, String)> {
        let first = |text: &str| -> String {
            text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
        };
        *self = EnclosingItem::default();
        if let Some(name) = code.strip_prefix("macro_rules! ").map(first) {
            return exported.then(|| (format!("macro {name}"), name));
        }
        if let Some(of) = code.strip_prefix("impl") {
            let parameters = of.starts_with('<').then(|| of.split_once("> ")).flatten();
            let plain = parameters.map_or(of.trim_start(), |(_, on)| on);
            self.name = (!code.contains(" for ")).then(|| first(plain));
            return None;
        }
        let (kind, rest) = code.strip_prefix("pub ")?.split_once(' ')?;
        let name = first(rest);
        match kind {
            "trait" => (self.name, self.is_trait) = (Some(name.clone()), true),
            "struct" | "enum" | "fn" | "type" => {}
            _ => return None,
        }
        Some((format!("{kind} {name}"), name))
    }

    /// A method that needs an example.
    fn method(&self, code: &str) -> Option<(String, String)> {
        let of = self.name.as_ref()?;
        let public = code.strip_prefix("pub ").or(self.is_trait.then_some(code))?;
        let public = public.strip_prefix("const ").unwrap_or(public);
        let name = public.strip_prefix("fn ")?;
        let name: String = name.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        Some((format!("method {of}::{name}"), name))
    }
}
