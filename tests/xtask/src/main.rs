//! The project's own tasks, without anything to install by hand:
//!
//! ```text
//! cargo xtask test [--no-install] [FILTER]   install what the tests need, run all of them, count
//! cargo xtask lint                           formatting, clippy, and links of the documentation
//! cargo xtask bench [--quick]                the README's table: CPU seconds, memory, first image
//! cargo xtask frames [--quick] [--gpu NAME] [FILTER]  frames a second of scenes, and what each effect costs
//! cargo xtask fuzz TARGET [--seconds N]      libFuzzer on a target of tests/fuzz
//! cargo xtask report [NAME…]                 tests/report: error against run time of the project's own choices
//! cargo xtask book                           the guide as a website in target/guide/book, with its images
//! cargo xtask contact [FILTER]               every sample file turning, its first clip playing: sheets to look at
//! cargo xtask lessons                        an image of every numbered script, for scripts/README.md
//! cargo xtask notices                        the table of THIRD-PARTY.md: crates, versions, licences
//! cargo xtask dist [--check] [--programs DIR]  an archive for this platform, and a Debian package; --check installs and runs them
//! cargo xtask package                        every crate as it would be published
//! cargo xtask vscode                         tests the extension for Visual Studio Code and packs it (npm)
//! cargo xtask farm [PROGRAM]                 a Slurm cluster on this machine renders a film, with a node that dies and one drained
//! cargo xtask semver [COMMIT]                the API of plugins against the last tag, or a commit, by cargo-semver-checks
//! cargo xtask wasm                           the tests of plugins in WebAssembly, whose engine takes minutes to build
//! cargo xtask words                          texts that use a word which the terms of the field replace
//! cargo xtask strip [SCRIPT]                 the image strips of the documentation; twenty frames of a script, side by side
//! ```

mod bench;
mod binaries;
mod book;
mod contact;
mod dist;
#[cfg(unix)]
mod farm;
mod frames;
mod fuzz;
mod lessons;
mod licences;
#[cfg(test)]
mod module_order;
mod notices;
mod package;
mod plain_words;
mod semver;
mod setup;
mod strip;
mod suite;
mod tally;
mod vscode;
mod wasm;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = args.iter().map(String::as_str).collect();
    let done = match words.as_slice() {
        ["test", rest @ ..] => suite::test(rest),
        ["lint"] => suite::lint(),
        ["bench", rest @ ..] => bench::bench(rest),
        ["frames", rest @ ..] => frames::frames(rest),
        ["measured", rest @ ..] => bench::measured(rest),
        ["fuzz", rest @ ..] => fuzz::fuzz(rest),
        ["report", rest @ ..] => report(rest),
        ["book"] => book::book(),
        ["contact", rest @ ..] => contact::contact(rest),
        ["lessons"] => lessons::lessons(),
        ["notices"] => notices::notices(),
        ["dist", rest @ ..] => dist::dist(rest),
        ["package"] => package::package(),
        ["vscode"] => vscode::vscode(),
        #[cfg(unix)]
        ["farm"] => farm::farm(None),
        #[cfg(unix)]
        ["farm", program] => farm::farm(Some(program)),
        ["semver"] => semver::semver(None),
        ["semver", commit] => semver::semver(Some(commit)),
        ["wasm"] => wasm::wasm(),
        ["words"] => plain_words::words(),
        ["strip"] => strip::strip(),
        ["strip", script] => strip::of(script),
        _ => {
            eprintln!(
                "usage: cargo xtask test [--no-install] [FILTER] | lint | bench [--quick] | frames [--quick] [--gpu NAME] [FILTER] | fuzz TARGET [--seconds N] | report [NAME…] | book | contact [FILTER] | lessons | notices | dist [--check] [--programs DIR] | package | vscode | farm [PROGRAM] | semver [COMMIT] | wasm | words | strip [SCRIPT]"
            );
            return ExitCode::from(2);
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(text) => {
            eprintln!("xtask: {text}");
            ExitCode::FAILURE
        }
    }
}

/// Root of the workspace; this crate is in tests/xtask.
fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).unwrap_or(here).to_path_buf()
}

fn cargo(args: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    // Plugins that the user has installed must not affect tests and reports.
    command.args(args).current_dir(root()).env("CHOREO_PLUGINS", "");
    command
}

fn run(mut command: Command, what: &str) -> Result<(), String> {
    let status = command.status().map_err(|e| format!("{what} did not start: {e}"))?;
    if status.success() { Ok(()) } else { Err(format!("{what} failed ({status})")) }
}

/// Runs the report in release mode, because it contains timings.
fn report(names: &[&str]) -> Result<(), String> {
    let mut command = cargo(&["run", "--release", "--quiet", "-p", "report", "--"]);
    command.args(names);
    run(command, "the report")
}

/// Builds the release binary and returns its path.
fn release_binary() -> Result<PathBuf, String> {
    run(cargo(&["build", "--release", "--quiet", "-p", "choreo"]), "cargo build --release")?;
    Ok(target().join("release").join(format!("choreo{}", std::env::consts::EXE_SUFFIX)))
}

/// Folder of cargo's build outputs.
fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from)
}

/// Models by other people for tests and benchmarks, which are not part of the repository.
fn assets() -> Option<PathBuf> {
    let path =
        std::env::var_os("CHOREO_ASSETS").map_or_else(|| root().join("../shared/assets"), PathBuf::from);
    path.canonicalize().ok()
}
