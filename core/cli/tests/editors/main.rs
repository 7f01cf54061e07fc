//! The language server.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/editor.rs"]
mod editor;

mod language_server;
mod language_server_display;
