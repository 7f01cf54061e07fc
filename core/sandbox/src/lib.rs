//! Limits on what a script of strangers may use up, for scene scripts and for importers in Rhai: memory in use, and sizes of values;
//! and the words for types in their messages.

mod engine;
pub mod memory;
mod sizes;
mod types;

pub use engine::engine;
pub use sizes::SizeLimits;
pub use types::{declared_names, operator_error, signature_parts, type_word};
