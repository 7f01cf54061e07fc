//! Hot reload of scripts, file watching, and edits of script text.

mod keys;
#[path = "../../src/edit/marked.rs"]
mod marked;
mod object_values;
mod reload;
mod strips_text;
mod watching;
