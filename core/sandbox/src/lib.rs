//! Resource limits for untrusted scripts, which scene scripts and Rhai importers share: memory in use and sizes of values. Also
//! the names of types in messages.

mod engine;
pub mod memory;
mod sizes;
mod types;

pub use engine::engine;
pub use sizes::SizeLimits;
pub use types::{declared_names, operator_error, signature_parts, type_word};
