//! Files, what is read of them, and what is refused.

#[path = "../oracle/mod.rs"]
mod oracle;

mod bad_input;
mod motion;
