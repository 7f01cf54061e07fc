//! Films from several machines, and from tables.

#[path = "../common/mod.rs"]
mod common;

mod batch;
mod faults;
mod jobs;
mod join;
mod pack;
mod status;
