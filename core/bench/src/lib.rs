//! Error against run time: what a numerical choice costs, how far each way is from the truth, and where.
//!
//! The truth is always a closed form, f64 or an image of many more samples, never our own earlier output. [`scene`] measures
//! the choices that one scene could make (`choreo measure`); `tests/report` measures the project's own, with the same parts.

pub mod blend;
mod error;
pub mod moment;
pub mod plots;
pub mod rotation;
pub mod scene;
pub mod skins;
pub mod timing;
pub mod truth;
pub mod vertex;
pub mod video;

pub use error::BenchError;
