//! Integration tests of the importer: features that are read, and errors of bad files.

#[path = "../oracle/mod.rs"]
mod oracle;

mod bad_input;
mod motion;
