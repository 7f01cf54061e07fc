//! `cargo xtask book`: the guide as a website. The crate `guide` writes pages and images, mdBook makes HTML of them.

use crate::{cargo, run, target};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The mdBook that is installed where there is none: its anchors and its search are those that the tests of the guide expect.
const VERSION: &str = "0.5.4";

pub fn book() -> Result<(), String> {
    // The profile of the tests, which have built the crate: drawing is optimized in it, too.
    let out = website(cargo(&["run", "--quiet", "-p", "guide", "--"]))?;
    println!("wrote {}", out.join("index.html").display());
    Ok(())
}

/// The folder of the website that mdBook makes of what the program of the crate `guide` writes.
pub fn website(mut guide: Command) -> Result<PathBuf, String> {
    let out = target().join("guide");
    guide.arg(&out);
    run(guide, "the guide")?;
    let mut build = Command::new(mdbook(&target().join("mdbook"))?);
    build.arg("build").arg(&out);
    run(build, "mdbook")?;
    Ok(out.join("book"))
}

/// The program `mdbook`: that on the path if it is of the series 0.5, else one that cargo installs into a folder.
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
