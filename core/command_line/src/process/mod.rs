//! The process: threads, memory, signals, panics.

pub(crate) mod interrupt;
pub mod kept_frames;
pub(crate) mod machine;
pub mod memory;
pub mod panics;
pub mod scratch;
pub mod threads;
