//! The timeline: which clips play at a time, where in them, with what weight.

pub(crate) mod active_clips;
pub(crate) mod clip_time;
