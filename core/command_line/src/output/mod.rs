//! Output files: where they go, how they are written and resumed, and the provenance in them.

pub(crate) mod budget;
pub(crate) mod image_files;
pub mod journal;
pub mod media;
pub(crate) mod provenance;
pub(crate) mod segment;
pub(crate) mod svg;
pub(crate) mod target;
pub(crate) mod video;
