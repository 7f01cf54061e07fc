//! Differences of two lists of public items, and which of them break plugins.

use crate::Entries;
use std::fmt::Write;

/// Whether an entry that is new breaks a plugin: one that builds the struct, matches the enum or implements the trait. A struct with
/// `Default` is written with `..Default::default()`, and one with private fields is not written at all.
fn addition_breaks_plugins(entry: &str, known: &Entries) -> bool {
    let Some((path, rest)) = entry.split_once(' ') else { return false };
    let starts = |start: &str| known.iter().any(|e| e.starts_with(start));
    let name = path.rsplit("::").next().unwrap_or_default();
    // The declaration of the type that has the entry, where it was known before.
    let declared = |kind: &str| {
        let declaration = known.iter().find(|e| declares(e, kind, name))?;
        Some(declaration.ends_with(" non_exhaustive"))
    };
    match rest.split_once(' ').unwrap_or_default().0 {
        "field" => {
            let free =
                starts(&format!("{path} derives Default")) || starts(&format!("{path} has private fields"));
            declared("struct") == Some(false) && !free
        }
        "has" => declared("struct").is_some(),
        "variant" => declared("enum") == Some(false),
        "fn" | "const" | "type" => declared("trait").is_some() && !entry.ends_with(" (provided)"),
        _ => false,
    }
}

/// The type that an entry declares.
pub(crate) fn type_of(entry: &str) -> Option<String> {
    let (_, rest) = entry.split_once(' ')?;
    let (kind, name) = rest.split_once(' ')?;
    let name = name.split(|c: char| !c.is_alphanumeric() && c != '_').next()?;
    ["struct", "enum", "trait", "type"].contains(&kind).then(|| name.to_string())
}

/// Whether an entry declares a type of that kind and name.
fn declares(entry: &str, kind: &str, name: &str) -> bool {
    let of_kind = entry.split_once(' ').is_some_and(|(_, rest)| rest.starts_with(kind));
    of_kind && type_of(entry).as_deref() == Some(name)
}

/// The differences as a text; empty where there are none.
pub(crate) fn differences(known: &Entries, now: &Entries) -> String {
    let mut text = String::new();
    for gone in known.difference(now) {
        writeln!(text, "breaking: gone or changed: {gone}").unwrap();
    }
    for new in now.difference(known) {
        let breaks = if addition_breaks_plugins(new, known) { "breaking: " } else { "" };
        writeln!(text, "{breaks}new: {new}").unwrap();
    }
    text
}
