//! Viewports, and what the mouse does in them, without a window.

#[path = "../place/mod.rs"]
mod place;

mod looking;
mod moving;
mod placing;
