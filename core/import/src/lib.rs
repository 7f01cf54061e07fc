//! What importers of mesh formats share: pictures, normals, tangents, a memory budget, problems and warnings with places.

pub mod budget;
pub mod normals;
pub mod pictures;
pub mod problem;
pub mod tangents;

pub use budget::{Budget, Notes};
pub use problem::{Problem, Result};
