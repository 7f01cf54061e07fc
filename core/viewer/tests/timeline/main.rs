//! The timeline and the curve editor, without a window.

#[path = "../place/mod.rs"]
mod place;

mod bars;
mod editing;
mod events;
mod keys;
mod nudging;
mod property_rows;
mod rows;
mod strips;
