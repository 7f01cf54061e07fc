//! Versions of a script: what is read again, and how its text is edited.

mod keys;
#[path = "../../src/edit/marked.rs"]
mod marked;
mod object_values;
mod reload;
mod strips_text;
mod watching;
