//! Mouse input in viewports, without a window.

#[path = "../place/mod.rs"]
mod place;

mod looking;
mod moving;
mod placing;
