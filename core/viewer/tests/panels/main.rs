//! The other panels, without a window.

#[path = "../place/mod.rs"]
mod place;

mod adding;
mod by_mouse;
mod finding;
mod first_dance;
mod inspecting;
mod messages;
mod naming;
mod panels;
mod renaming;
mod toolbars;
mod working;
