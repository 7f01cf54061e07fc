//! Parts that scene exporters share: the timeline as curves with a stated error, images as PNG, transforms of texture coordinates.

pub mod bake;
mod images;
mod uv;

pub use bake::{Baked, Series, Style, bake};
pub use images::png_of;
pub use uv::UvParts;
