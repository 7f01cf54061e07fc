//! Endurance tests: random use of a window for minutes or an hour, by a seed.
#![cfg(target_os = "linux")]

#[path = "../screen/mod.rs"]
mod screen;

mod hour;
mod writing;
