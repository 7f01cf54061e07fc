//! The process: threads, memory, signals, panics.

pub(crate) mod interrupt;
pub(crate) mod kept_frames;
pub(crate) mod machine;
pub(crate) mod memory;
pub(crate) mod panics;
pub(crate) mod scratch;
pub(crate) mod threads;
