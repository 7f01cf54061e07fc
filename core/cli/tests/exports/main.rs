//! Exports of scenes and passes for other programs.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/exported.rs"]
mod exported;
#[path = "../common/gltf_validator.rs"]
mod gltf_validator;

mod exposure;
mod gltf;
mod import_usd;
mod passes;
mod scenes;
mod usd;
