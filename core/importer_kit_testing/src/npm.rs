//! Packages from npm, in a folder of build outputs that is filled once.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder with the packages installed.
pub struct Packages(PathBuf);

impl Packages {
    /// Installs `packages` (`name@version`) into the folder `name` of `outputs`, unless they are there. `None`, with a message, where
    /// there is no node or no registry.
    pub fn install(outputs: &str, name: &str, packages: &[&str]) -> Option<Packages> {
        match install(Path::new(outputs), name, packages) {
            Ok(folder) => Some(Packages(folder)),
            Err(why) => {
                println!("SKIP 1: no {}: {why}", packages.join(", "));
                None
            }
        }
    }

    /// Runs a script that finds the packages, as an ECMAScript module where the file's name ends in `.mjs`. Panics where it fails.
    pub fn run(&self, file: &str, script: &str, args: &[&Path]) -> String {
        std::fs::write(self.0.join(file), script).unwrap_or_else(|e| panic!("{file}: {e}"));
        let run = Command::new("node").arg(file).args(args).current_dir(&self.0).output();
        let Output { status, stdout, stderr } = run.unwrap_or_else(|e| panic!("node: {e}"));
        assert!(status.success(), "{file}: {}", String::from_utf8_lossy(&stderr));
        String::from_utf8_lossy(&stdout).into_owned()
    }
}

fn install(outputs: &Path, name: &str, packages: &[&str]) -> Result<PathBuf, String> {
    let folder = outputs.join(name);
    std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    let list = packages.join(" ");
    // Tests that run at the same time wait until the folder is filled.
    let lock = File::create(outputs.join(format!("{name}.lock"))).map_err(|e| e.to_string())?;
    lock.lock().map_err(|e| e.to_string())?;
    // This file is written at the end: an installation that was stopped is done again.
    let done = folder.join("installed");
    if std::fs::read_to_string(&done).is_ok_and(|installed| installed == list) {
        return Ok(folder);
    }
    let options = ["install", "--no-save", "--no-audit", "--no-fund", "--fetch-retries=1"];
    let run = Command::new("npm").args(options).args(packages).current_dir(&folder).output();
    let run = run.map_err(|e| format!("npm: {e}"))?;
    if !run.status.success() {
        let text = String::from_utf8_lossy(&run.stderr);
        return Err(format!("npm install: {}", text.lines().next().unwrap_or_default()));
    }
    std::fs::write(done, list).map_err(|e| e.to_string())?;
    Ok(folder)
}
