//! Commands that describe and check, on good input.

#[path = "../common/mod.rs"]
mod common;

mod capabilities;
mod check;
mod commands;
mod format;
mod help;
mod new;
mod poses;
mod project_file;
mod short_messages;
