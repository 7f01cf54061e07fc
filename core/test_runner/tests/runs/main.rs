//! Runs of test scripts: images, planted faults, reports, results.

#[path = "../common/mod.rs"]
mod common;

mod pictures;
mod planted;
mod reports;
mod results;
mod visible;
