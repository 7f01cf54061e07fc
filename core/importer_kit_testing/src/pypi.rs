//! Python packages, in environments that are made once in the folder of build outputs.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The version of Blender that tests compare with.
const BLENDER: &str = "bpy==5.0.1";

/// A Python that imports `module`, from an environment in the folder `outputs` with this requirement (`name==version`). `None`, with a
/// message, where there is no Python or no package index.
pub fn python_with(outputs: &str, module: &str, requirement: &str) -> Option<PathBuf> {
    let name: String = requirement.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    let folder = Path::new(outputs).join(format!("python_{name}"));
    // Tests that run at the same time wait until the environment is made.
    let lock = File::create(folder.with_extension("lock")).and_then(|file| file.lock().map(|()| file));
    let python = folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    let works = |program: &Path, args: &[&str]| {
        Command::new(program).args(args).stdin(Stdio::null()).output().is_ok_and(|run| run.status.success())
    };
    let imports = format!("import {module}");
    let made = works(&python, &["-c", &imports])
        || (works(Path::new("python3"), &["-m", "venv", &folder.display().to_string()])
            && works(&python, &["-m", "pip", "install", "--quiet", "--retries", "1", requirement])
            && works(&python, &["-c", &imports]));
    drop(lock);
    if !made {
        println!("SKIP 1: no Python with {requirement}");
    }
    made.then_some(python)
}

/// A Python with Blender (the package `bpy`, which requires the version of Python that it was built for); `CHOREO_BPY` names another one.
pub fn blender(outputs: &str) -> Option<PathBuf> {
    let named = std::env::var_os("CHOREO_BPY").map(PathBuf::from);
    named.or_else(|| python_with(outputs, "bpy", BLENDER))
}
