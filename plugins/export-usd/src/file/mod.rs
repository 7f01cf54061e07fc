//! Layers as files: text (`.usda`), crate files (`.usdc`), and packages of both (`.usdz`).

pub mod binary;
mod integers;
mod out;
mod paths;
pub mod text;
pub mod zip;

pub use out::Out;
