//! A page of the book, and an image that is drawn for one.

use std::path::PathBuf;

/// A page of the book.
pub struct Page {
    /// Path in the book: `recipes/dialogue.md`.
    pub path: String,
    /// The file that it is made from, for messages, and the folder of its links.
    pub source: String,
    pub text: String,
    /// Whether it is one of the guide's own: neither generated nor a page of another part of the repository.
    pub is_own: bool,
}

/// An image that is drawn from a script.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    pub script: PathBuf,
    /// Seconds; none for a contact sheet of the whole scene.
    pub time: Option<String>,
}
