//! Tests of golden images, planted faults, reports and stored results.

#[path = "../common/mod.rs"]
mod common;

mod golden_images;
mod planted_faults;
mod reports;
mod results;
mod visible_differences;
