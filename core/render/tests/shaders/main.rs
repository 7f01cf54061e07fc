//! Shaders without a GPU.

mod keys;
mod layouts;
mod mistakes;
