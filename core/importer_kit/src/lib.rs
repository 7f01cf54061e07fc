//! Helpers that importers of mesh formats share: images, normals, tangents, welding, a memory budget, errors and warnings with places.

pub mod bones;
pub mod budget;
pub mod color;
pub mod decompose;
pub mod images;
mod ktx2;
pub mod panorama;
pub mod parts;
pub mod polygon;
pub mod problem;
pub mod progress;
pub mod rows;
pub mod search;
pub mod smooth;
pub mod tangents;
pub mod text;
pub mod textures;
pub mod weld;

pub use choreo_plugin::build::normals;

pub use budget::{Budget, Notes};
pub use problem::{Problem, Result, WithPlace};
pub use progress::Progress;
