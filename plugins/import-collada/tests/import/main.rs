//! Integration tests of the importer: features that are read, and errors of bad files.

mod bad_input;
mod features;
mod motion;
mod properties;
