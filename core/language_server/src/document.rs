//! An open document, with the unsaved text of the editor.

use crate::position::Lines;
use crate::source::Source;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub(crate) struct Document {
    pub uri: String,
    /// Path of the document, canonical if its folder exists; `None` for a text without a path, such as `untitled:Untitled-1`.
    pub path: Option<PathBuf>,
    pub version: i64,
    pub source: Arc<Source>,
}

impl Document {
    pub(crate) fn new(uri: &str, version: i64, text: &str) -> Document {
        let path = path_of(uri).map(canonical_path);
        Document { uri: uri.to_string(), path, version, source: Arc::new(Source::new(text)) }
    }

    /// Applies changes in the order of the protocol: each is relative to the text after the previous one.
    pub(crate) fn apply_changes(&mut self, version: i64, changes: &[Value]) {
        let mut text = self.source.text.to_string();
        for change in changes {
            let new = change["text"].as_str().unwrap_or_default();
            if change["range"].is_object() {
                let lines = Lines::new(&text);
                let bytes = lines.bytes_of_range(&text, &change["range"]);
                text.replace_range(bytes, new);
            } else {
                text = new.to_string();
            }
        }
        self.version = version;
        self.source = Arc::new(Source::new(&text));
    }

    /// Folder in which files of the script are looked for.
    pub(crate) fn folder(&self) -> Option<&Path> {
        self.path.as_deref().and_then(Path::parent)
    }
}

/// Canonical path of a file, or of a file that will be saved in an existing folder.
fn canonical_path(path: PathBuf) -> PathBuf {
    let in_folder = || Some(path.parent()?.canonicalize().ok()?.join(path.file_name()?));
    let found = path.canonicalize().ok().or_else(in_folder);
    found.unwrap_or(path)
}

/// Path of a `file:` URI, or of an unsaved file in VS Code, `untitled:/…`; `None` for other schemes and other machines.
pub(crate) fn path_of(uri: &str) -> Option<PathBuf> {
    let new = uri.strip_prefix("untitled:").filter(|path| path.starts_with('/'));
    let rest = new.or_else(|| uri.strip_prefix("file://"))?;
    let path = &rest[rest.find('/')?..];
    let host = &rest[..rest.len() - path.len()];
    if !host.is_empty() && host != "localhost" {
        return None;
    }
    let mut bytes = Vec::with_capacity(path.len());
    let mut parts = path.bytes();
    while let Some(byte) = parts.next() {
        let digit = |byte: Option<u8>| byte.and_then(|b| char::from(b).to_digit(16));
        bytes.push(match byte {
            b'%' => (digit(parts.next())? * 16 + digit(parts.next())?) as u8,
            byte => byte,
        });
    }
    let path = String::from_utf8(bytes).ok()?;
    // Windows paths begin with a drive, as in `/c:/scenes`.
    let drive = path.as_bytes().get(2) == Some(&b':');
    Some(PathBuf::from(if drive { &path[1..] } else { &path }))
}

/// The URI of a path.
pub(crate) fn uri_of(path: &Path) -> String {
    let text = path.to_string_lossy().replace('\\', "/");
    let mut uri = String::from(if text.starts_with('/') { "file://" } else { "file:///" });
    for byte in text.bytes() {
        let plain = byte.is_ascii_alphanumeric() || b"/-_.~".contains(&byte);
        match plain {
            true => uri.push(char::from(byte)),
            false => uri.push_str(&format!("%{byte:02X}")),
        }
    }
    uri
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn paths_are_converted_to_uris_and_back() {
        assert_eq!(path_of("file:///a/b%20c/%C3%A4.rhai"), Some("/a/b c/ä.rhai".into()));
        assert_eq!(uri_of(Path::new("/a/b c/ä.rhai")), "file:///a/b%20c/%C3%A4.rhai");
        assert_eq!(path_of("file:///c%3A/scenes/a.rhai"), Some("c:/scenes/a.rhai".into()));
        assert_eq!(path_of("untitled:/a/new%20one.rhai"), Some("/a/new one.rhai".into()));
        assert_eq!(
            [path_of("untitled:1"), path_of("file://server/x"), path_of("file:///%f")],
            [None, None, None]
        );
    }

    #[test]
    fn each_change_applies_to_the_text_after_the_previous_change() {
        let mut document = Document::new("untitled:1", 1, "let é = 𝄞;\r\nb");
        let at = |line, from, to| json!({ "start": { "line": line, "character": from }, "end": { "line": line, "character": to } });
        let changes =
            [json!({ "range": at(0, 8, 10), "text": "12" }), json!({ "range": at(1, 0, 1), "text": "cc\n" })];
        document.apply_changes(2, &changes);
        assert_eq!((&*document.source.text, document.version), ("let é = 12;\r\ncc\n", 2));
        document.apply_changes(3, &[json!({ "text": "whole" })]);
        assert_eq!(&*document.source.text, "whole");
    }
}
