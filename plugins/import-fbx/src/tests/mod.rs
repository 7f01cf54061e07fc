//! Tests of what only this crate sees: clips against the curves of ufbx.

mod accuracy;
mod random;
