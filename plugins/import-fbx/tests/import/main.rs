//! Integration tests of the importer: features that are read, and errors of bad files.

#[path = "../common/mod.rs"]
mod common;

mod bad_input;
mod blend_shapes;
mod facts;
mod features;
mod properties;
mod truth;
