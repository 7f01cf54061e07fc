//! Effects in one file: `NAME.wgsl`, a function of a pixel, a surface point, a vertex, a light or a line,
//! with its manifest in the head comment.
//!
//! ```text
//! head comment ─► Manifest          ┌► the renderer's template ─► SPIR-V (Vulkan)
//! text ─► naga: parse, validate ────┴► Program: the same module, evaluated a pixel at a time (CPU)
//! ```

mod compile;
mod effect;
mod environment;
mod head;
mod lower;
mod machine;
mod nesting;
mod operators;
mod overlay;
mod parameters;
mod pool;
mod program;
mod shape;
mod signature;
mod suggestions;
mod trial;

pub use effect::{ENDING, EffectError, TextureImage, WgslEffect};
pub use head::{files, is_meant, name};
