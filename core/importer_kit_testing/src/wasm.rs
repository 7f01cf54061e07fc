//! Builds crates to WebAssembly plugins as an author does: outside of the workspace.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The Rust target that plugins are built for.
const TARGET: &str = "wasm32-unknown-unknown";

/// Builds the crate in a folder to a plugin and returns the path of `CRATE.wasm`. The versions of dependencies are those of the workspace;
/// build outputs are kept between runs.
///
/// # Panics
/// The build fails; where Rust's target is not installed, its message says how to install it.
pub fn built(folder: &Path, crate_name: &str) -> PathBuf {
    if !folder.join("Cargo.lock").exists() {
        std::fs::copy(sources().join("Cargo.lock"), folder.join("Cargo.lock")).expect("a copy");
    }
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| sources().join("target"), PathBuf::from);
    let target = target.join("wasm-plugins");
    let output = Command::new("cargo")
        .args(["build", "--release", "--offline", "--quiet", "--target", TARGET])
        .current_dir(folder)
        .env("CARGO_TARGET_DIR", &target)
        .env_remove("RUSTFLAGS")
        .output()
        .expect("cargo");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    target.join(TARGET).join("release").join(format!("{}.wasm", crate_name.replace('-', "_")))
}

/// An importer of PLY, built in a folder from a copy of `core/wasm_plugin/tests/import-ply`.
pub fn import_ply(folder: &Path) -> PathBuf {
    copy_crate(&sources().join("core/wasm_plugin/tests/import-ply"), folder, |text| text.to_string());
    built(folder, "import-ply")
}

/// The exporter of CSV, built in a folder from a copy of `plugins/export-csv` as a crate of its own.
pub fn export_csv(folder: &Path) -> PathBuf {
    let ply = sources().join("core/wasm_plugin/tests/import-ply");
    // The other crate's manifest fits, apart from names.
    copy_crate(&ply, folder, |text| text.replace("import-ply", "export-csv").replace("1.0.0", "0.1.0"));
    let source = std::fs::read_to_string(sources().join("plugins/export-csv/src/lib.rs"));
    let source = source.expect("a source").replace("pub mod files;\n", "mod files {}\n");
    std::fs::write(folder.join("src/lib.rs"), source).expect("a copy");
    built(folder, "export-csv")
}

fn copy_crate(from: &Path, folder: &Path, changed: impl Fn(&str) -> String) {
    let plugin = sources().join("core/plugin").display().to_string();
    for name in ["Cargo.toml", "src/lib.rs"] {
        let text = std::fs::read_to_string(from.join(name)).expect("a source");
        let to = folder.join(name);
        std::fs::create_dir_all(to.parent().expect("a folder")).expect("a folder");
        std::fs::write(to, changed(&text).replace("../../../plugin", &plugin)).expect("a copy");
    }
}

fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the sources")
}
