//! What importers of mesh formats share: pictures, normals, tangents, a memory budget, problems and warnings with places.

pub mod bones;
pub mod budget;
pub mod color;
pub mod corners;
pub mod decompose;
pub mod normals;
pub mod panorama;
pub mod pictures;
pub mod polygon;
pub mod problem;
pub mod progress;
pub mod search;
pub mod smooth;
pub mod tangents;
pub mod text;
pub mod textures;

pub use budget::{Budget, Notes};
pub use problem::{Problem, Result};
pub use progress::Progress;
