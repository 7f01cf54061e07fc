//! Tests with a real window on a virtual display.
#![cfg(target_os = "linux")]

#[path = "../screen/mod.rs"]
mod screen;

#[cfg(feature = "accesskit")]
mod assistance;
mod clipboard;
mod curves;
mod desktop;
mod documents;
mod kept_layout;
mod robust;
mod walkthrough;
mod wayland;
mod window;
mod without_vulkan;
