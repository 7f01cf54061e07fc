//! Effects in one file: `NAME.wgsl`, a function of a pixel, a surface point, a vertex, a light or a line,
//! with its manifest in the header comment.
//!
//! ```text
//! header comment ─► Manifest          ┌► the renderer's template ─► SPIR-V (Vulkan)
//! text ─► naga: parse, validate ────┴► Program: the same module, evaluated a pixel at a time (CPU)
//! ```

mod compile;
mod effect;
mod environment;
mod error;
mod header;
mod header_error;
mod loops;
mod lower;
mod machine;
pub mod mistakes;
mod nesting;
mod operators;
mod overlay;
mod parameters;
mod passes;
mod pool;
mod program;
mod scene_inputs;
mod shape;
mod signature;
mod suggestions;
mod tokens;
mod trial;
mod typed_parameters;

pub use effect::{FILE_ENDING, TextureImage, WgslEffect};
pub use error::EffectError;
pub use header::{declares_effect, effect_name, hook_named, hook_word, hooks, texture_files};

/// The documentation page.
pub const README: &str = include_str!("../README.md");
