//! Layers as files: text (`.usda`), crate files (`.usdc`), and packages of both (`.usdz`).

pub(crate) mod binary;
mod integers;
mod out;
mod paths;
pub(crate) mod text;
pub(crate) mod zip;

pub(crate) use out::Out;
