//! Drawing frames: the device, the pipeline of threads, frames that are kept for reuse.

pub(crate) mod device;
pub(crate) mod frame_cache;
pub(crate) mod pipeline;
pub(crate) mod png_frame;
