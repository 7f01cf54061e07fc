//! Effects in one file: `NAME.wgsl`, a function of one pixel with its manifest in the head comment.
//!
//! ```text
//! head comment ─► Manifest          ┌► the renderer's template ─► SPIR-V (Vulkan)
//! text ─► naga: parse, validate ────┴► Program: the same module, evaluated a pixel at a time (CPU)
//! ```

mod effect;
mod head;
mod maths;
mod prepare;
mod program;
mod shape;

pub use effect::{ENDING, LookError, WgslEffect};
