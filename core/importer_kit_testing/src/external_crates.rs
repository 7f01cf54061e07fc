//! Crates outside the workspace, built as their authors build them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The workspace's folder.
pub fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the workspace")
}

/// An empty folder, the same for every run: cargo keys its outputs by the path of a crate, and outputs of other folders would stay. The
/// folder is inside that of the workspace, so that a crate in it needs a workspace of its own.
pub fn folder(outputs: &str, name: &str) -> PathBuf {
    let folder = Path::new(outputs).join("outside").join(name);
    if folder.exists() {
        fs::remove_dir_all(&folder).expect("the folder of the run before");
    }
    fs::create_dir_all(&folder).expect("a folder for crates");
    folder
}

/// The folder of cargo's outputs, in which the folder `outputs` lies (`CARGO_TARGET_TMPDIR`).
pub fn target(outputs: &str) -> PathBuf {
    Path::new(outputs).parent().expect("a folder of outputs").to_path_buf()
}

/// A `cargo` command in `folder`, whose crates depend on the workspace's crates by their paths. No registry is asked: versions are those of
/// the workspace, and its packages from registries are built with the same settings, so that none is built again. Cargo treats the
/// workspace's own crates as different ones when they are built from outside; they are not optimized there.
pub fn cargo(outputs: &str, folder: &Path) -> Command {
    let read = |name: &str| fs::read_to_string(sources().join(name)).expect("a file of the workspace");
    let lock = read("Cargo.lock");
    let own = lock.split("[[package]]").filter(|package| !package.contains("\nsource = "));
    let own: Vec<&str> = own.filter_map(|package| package.split('"').nth(1)).collect();
    let manifest = read("Cargo.toml");
    let (_, profile) = manifest.split_once("\n[profile.dev]\n").expect("a profile of development builds");
    // The profile ends with its table of packages.
    let is_own = |line: &&str| line.split_once(" = ").is_some_and(|(name, _)| own.contains(&name));
    let shared = profile.lines().filter(|line| !is_own(line)).map(String::from);
    let own = own.iter().map(|name| format!("{name} = {{ opt-level = 0, debug = false }}"));
    let settings: Vec<String> = std::iter::once("[profile.dev]".into()).chain(shared).chain(own).collect();
    fs::create_dir_all(folder.join(".cargo")).expect("a folder of settings");
    fs::write(folder.join(".cargo/config.toml"), settings.join("\n")).expect("settings");
    fs::write(folder.join("Cargo.lock"), lock).expect("a lock file");
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(folder).env("CARGO_TARGET_DIR", target(outputs)).env_remove("RUSTFLAGS");
    command
}
