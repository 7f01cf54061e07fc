//! Materials, transparency, lines, and geometry of effects.

#[path = "../common/mod.rs"]
mod common;

mod cutouts;
mod image_sequences;
mod material_overrides;
mod outlines;
mod own_geometry;
mod thick_lines;
mod toon;
mod transparency;
mod triplanar;
