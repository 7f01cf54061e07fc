//! Lights, shadows, reflection, refraction, and the conversion from light to display colors.

#[path = "../common/mod.rs"]
mod common;

mod dithering;
mod falloff;
mod lights;
mod reflection;
mod refraction;
mod shadows;
mod sky;
mod view_transform;
