//! Files, what is read of them, and what is refused.

#[path = "../common/mod.rs"]
mod common;

mod bad_input;
mod characters;
mod mtoon;
