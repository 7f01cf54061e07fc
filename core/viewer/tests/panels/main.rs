//! The other panels, without a window.

#[path = "../place/mod.rs"]
mod place;

mod finding;
mod inspecting;
mod panels;
mod working;
