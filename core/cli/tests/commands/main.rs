//! Commands that describe and check valid input.

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
