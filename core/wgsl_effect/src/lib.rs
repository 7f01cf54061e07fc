//! Effects in one file: `NAME.wgsl`, a function of a pixel, a surface point, a vertex, a light or a line,
//! with its manifest in the head comment.
//!
//! ```text
//! head comment ─► Manifest          ┌► the renderer's template ─► SPIR-V (Vulkan)
//! text ─► naga: parse, validate ────┴► Program: the same module, evaluated a pixel at a time (CPU)
//! ```

mod around;
mod compile;
mod depth;
mod effect;
mod forms;
mod head;
mod maths;
mod overlay;
mod parameters;
mod prepare;
mod program;
mod shape;
mod slips;
mod trial;

pub use effect::{ENDING, LookError, Picture, WgslEffect};
pub use head::{files, is_meant, name};
