//! Benchmarks of error against run time: what each method of a numerical choice costs, how far it is from the reference, and where.
//!
//! The reference is always a closed form, f64 or an image of many more samples, never our own earlier output. [`scene`] measures the
//! choices that one scene could make (`choreo measure`); `tests/report` measures those of the project itself, with the same parts.

pub mod blend;
mod error;
pub mod moment;
pub mod plots;
pub mod reference;
pub mod rotation;
pub mod scene;
pub mod skins;
pub mod timing;
pub mod vertex;
pub mod video;

pub use error::BenchError;
