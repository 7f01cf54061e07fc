//! Integration tests of the importer: features that are read, and errors of bad files.

#[path = "../common/mod.rs"]
mod common;
#[path = "../oracle/mod.rs"]
mod oracle;

mod bad_input;
mod camera_moves;
mod compressed;
mod facts;
mod features;
mod layers;
mod other_writers;
mod packed;
mod pointers;
mod poses;
mod resources;
mod tangents;
