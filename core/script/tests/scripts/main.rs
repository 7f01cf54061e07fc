//! Scripts: what they may do, what they make, and what is reported about them.

#[path = "../common/mod.rs"]
mod common;

mod binding;
mod imports;
mod key_tangents;
mod sandbox;
mod script_constraints;
mod scripts;
mod testing;
mod wrong;
