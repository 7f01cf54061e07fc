//! Lights, shadows, reflected and refracted light, and the way from light to colors.

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
