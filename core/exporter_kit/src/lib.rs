//! Parts that scene exporters share: the timeline as curves with a stated error, images as files, transforms of texture coordinates, and
//! notes about what formats cannot hold.

pub mod bake;
mod images;
pub mod losses;
mod parallel;
mod uv;

pub use bake::{Baked, Series, Style, bake};
pub use images::ImageFiles;
pub use uv::UvParts;
