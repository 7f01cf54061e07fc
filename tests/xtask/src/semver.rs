//! `cargo xtask semver [COMMIT]`: compares the API of plugins with that of the last tag, or of a commit, by cargo-semver-checks, which is
//! built on first use. It finds changes that the list in `core/plugin/API.txt` cannot show (decision 57): lost trait implementations,
//! generic bounds, macros.

use crate::{cargo, root, run, target};
use std::path::Path;
use std::process::{Command, Stdio};

/// The crate of the plugin API, and the crates that it re-exports.
const CRATES: [&str; 3] = ["choreo-plugin", "choreo-asset", "choreo-motion"];
/// First version that can read the documentation format of the Rust toolchain in use.
const TOOL: &str = "cargo-semver-checks@0.51.0";

pub(crate) fn semver(commit: Option<&str>) -> Result<(), String> {
    let Some(baseline) = commit.map(String::from).or_else(last_tag) else {
        println!(
            "SKIP 1: nothing is released: there is no tag to compare with; cargo xtask semver COMMIT names another baseline"
        );
        return Ok(());
    };
    let tools = target().join("tools");
    let program = tools.join("bin").join(format!("cargo-semver-checks{}", std::env::consts::EXE_SUFFIX));
    if !works(&program) {
        let mut install = cargo(&["install", "--locked", "--quiet", TOOL, "--root"]);
        install.arg(&tools).env("CARGO_TARGET_DIR", target().join("semver-checks-build"));
        // The tool's own release profile would link for minutes on one core.
        install.env("CARGO_PROFILE_RELEASE_LTO", "off").env("CARGO_PROFILE_RELEASE_CODEGEN_UNITS", "16");
        run(install, "cargo install cargo-semver-checks")?;
    }
    println!("compared with {baseline}");
    let mut checks = Command::new(program);
    checks.args(["semver-checks", "--baseline-rev", &baseline]).current_dir(root());
    checks.args(CRATES.iter().flat_map(|name| ["--package", name]));
    run(checks, "cargo-semver-checks")
}

/// Nearest tag before the current commit.
fn last_tag() -> Option<String> {
    let mut git = Command::new("git");
    git.args(["describe", "--tags", "--abbrev=0"]).current_dir(root()).stderr(Stdio::null());
    let output = git.output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).trim().to_string()).filter(|tag| !tag.is_empty())
}

fn works(program: &Path) -> bool {
    let mut command = Command::new(program);
    command.args(["semver-checks", "--version"]).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}
