//! Spring bones: hair, skirts and tails that follow their body.

pub mod parameters;
