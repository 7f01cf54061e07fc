//! Files that the viewer opens, lists and creates, without a window.

#[path = "../place/mod.rs"]
mod place;

mod dropping;
mod library;
mod rendering;
mod starting;
