//! Versions of a script: what is read again, and how its text is edited.

mod keys;
#[path = "../../src/edit/marked.rs"]
mod marked;
mod reload;
mod stating;
mod strips_text;
mod watching;
