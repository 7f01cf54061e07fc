//! `cargo xtask book`: builds the guide as a website. The crate `guide` writes pages and images, and mdBook converts them to HTML.

use crate::{cargo, run, target};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Version of mdBook that is installed if none is found: the tests of the guide expect its anchors and its search.
const VERSION: &str = "0.5.4";

pub(crate) fn book() -> Result<(), String> {
    // Uses the profile of the tests, which have already built the crate: the renderer is optimized in it too.
    let out = website(cargo(&["run", "--quiet", "-p", "guide", "--"]))?;
    println!("wrote {}", out.join("index.html").display());
    Ok(())
}

/// Builds the website from the output of the program `guide`, and returns its folder.
pub(crate) fn website(mut guide: Command) -> Result<PathBuf, String> {
    let out = target().join("guide");
    guide.arg(&out);
    run(guide, "the guide")?;
    let mut build = Command::new(mdbook(&target().join("mdbook"))?);
    build.arg("build").arg(&out);
    run(build, "mdbook")?;
    Ok(out.join("book"))
}

/// Path of the program `mdbook`: the one on the path if its version is 0.5, else one that cargo installs into a folder.
fn mdbook(folder: &Path) -> Result<PathBuf, String> {
    let installed = folder.join("bin").join(format!("mdbook{}", std::env::consts::EXE_SUFFIX));
    for program in [PathBuf::from("mdbook"), installed.clone()] {
        let version = Command::new(&program).arg("--version").output();
        if version.is_ok_and(|v| String::from_utf8_lossy(&v.stdout).starts_with("mdbook v0.5.")) {
            return Ok(program);
        }
    }
    println!("installing mdBook {VERSION} into {}", folder.display());
    let mut install =
        cargo(&["install", "mdbook", "--locked", "--version", VERSION, "--no-default-features"]);
    install.args(["--features", "search", "--root"]).arg(folder);
    run(install, "cargo install mdbook")?;
    Ok(installed)
}
