//! `cargo xtask vscode`: tests the extension for Visual Studio Code and packs it into a .vsix, in a separate folder. Needs npm and packages
//! of its registry, which are not part of the repository.

use crate::{cargo, root, run};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

const SOURCES: &str = "core/language_server/editors/vscode";
/// Packages for testing and packing the extension. Packages that the extension contains are listed in its package.json.
const TOOLS: [&str; 3] = ["@vscode/vsce@3.9.2", "vscode-textmate@9.3.2", "vscode-oniguruma@2.0.1"];
/// Error codes of npm for a registry that it cannot reach.
const UNREACHABLE: [&str; 5] = ["ENOTFOUND", "ECONNREFUSED", "ETIMEDOUT", "EAI_AGAIN", "ENETUNREACH"];

pub(crate) fn vscode() -> Result<(), String> {
    let works = |program: &str| {
        let mut command = Command::new(program);
        command.arg("--version").stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    if !works("node") || !works("npm") {
        println!("SKIP 1: node and npm are not installed (Debian packages nodejs and npm)");
        return Ok(());
    }
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), Into::into);
    let (extension, tools) = (target.join("vscode/extension"), target.join("vscode/tools"));
    let _ = fs::remove_dir_all(&extension);
    copy(&root().join(SOURCES), &extension).map_err(|e| format!("{SOURCES}: {e}"))?;
    fs::create_dir_all(&tools).map_err(|e| format!("{}: {e}", tools.display()))?;
    if !installed(&extension, &[])? || !installed(&tools, &TOOLS)? {
        println!("SKIP 1: the npm registry cannot be reached");
        return Ok(());
    }
    // Built with the features of the whole workspace, like the tests.
    run(cargo(&["build", "--quiet", "--workspace", "--bin", "choreo"]), "cargo build")?;
    let mut tests = Command::new("node");
    tests.args(["--test", "test/"]).current_dir(&extension).env("TOOLS", &tools).env("CHOREO_PLUGINS", "");
    tests.env("SCRIPTS", root().join("scripts")).env("CHOREO", target.join("debug/choreo"));
    run(tests, "the extension's tests")?;
    let package = target.join("choreo.vsix");
    let mut pack = Command::new("node");
    pack.arg(tools.join("node_modules/@vscode/vsce/vsce")).args(["package", "--skip-license"]);
    pack.args(["--allow-missing-repository", "--out"]).arg(&package).current_dir(&extension);
    run(pack, "vsce package")?;
    println!("{}: code --install-extension installs it", package.display());
    Ok(())
}

/// Installs packages in a folder, without their scripts; `false` if the registry cannot be reached.
fn installed(folder: &Path, packages: &[&str]) -> Result<bool, String> {
    let options = [
        "install",
        "--omit=dev",
        "--ignore-scripts",
        "--no-audit",
        "--no-fund",
        "--no-package-lock",
        "--fetch-retries=0",
    ];
    let done = Command::new("npm").args(options).args(packages).current_dir(folder).output();
    let done = done.map_err(|e| format!("npm did not start: {e}"))?;
    let text = String::from_utf8_lossy(&done.stderr);
    match done.status.success() {
        true => Ok(true),
        false if UNREACHABLE.iter().any(|word| text.contains(word)) => Ok(false),
        false => Err(format!("npm install failed:\n{text}")),
    }
}

fn copy(from: &Path, to: &Path) -> std::io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let (path, name) = entry.map(|entry| (entry.path(), entry.file_name()))?;
        match path.is_dir() {
            true if name != "node_modules" => copy(&path, &to.join(name))?,
            true => {}
            false => drop(fs::copy(&path, to.join(name))?),
        }
    }
    Ok(())
}
