//! `cargo xtask wasm`: runs the tests of plugins in WebAssembly. Their engine takes minutes to build, so `cargo xtask test` leaves them
//! out.

use crate::{cargo, run};
use std::process::Command;

/// Rust target of plugins.
const TARGET: &str = "wasm32-unknown-unknown";

/// Features: the engine in all programs, and the text format of WebAssembly for damaged plugins.
const FEATURES: &str = "choreo/wasm,choreo-viewer/wasm,choreo-wasm-plugin/wat";

pub(crate) fn wasm() -> Result<(), String> {
    let mut add = Command::new("rustup");
    add.args(["target", "add", TARGET]);
    run(add, "rustup target add")?;
    let lint =
        ["clippy", "--quiet", "--workspace", "--all-targets", "--features", FEATURES, "--", "-D", "warnings"];
    run(cargo(&lint), "cargo clippy")?;
    let tests = ["--test", "damaged", "--test", "same_as_crate", "--test", "wasm"];
    let mut command = cargo(&["test", "--workspace", "--no-fail-fast", "--features", FEATURES]);
    command.args(tests);
    run(command, "cargo test")
}
