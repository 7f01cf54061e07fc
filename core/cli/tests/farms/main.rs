//! Films rendered on several machines, and from the rows of tables.

#[path = "../common/mod.rs"]
mod common;

mod batch;
mod faults;
mod jobs;
mod join;
mod pack;
mod status;
