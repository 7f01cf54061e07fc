//! The validator of the Khronos Group, from npm, in a folder of its own.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// Errors and warnings of each file, one a line.
const SCRIPT: &str = r#"
const fs = require("fs"), path = require("path"), validator = require("gltf-validator");
(async () => {
  for (const file of process.argv.slice(2)) {
    const beside = (uri) => Promise.resolve(new Uint8Array(fs.readFileSync(path.join(path.dirname(file), decodeURIComponent(uri)))));
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), { externalResourceFunction: beside, maxIssues: 100 });
    for (const m of report.issues.messages.filter((m) => m.severity < 2)) console.log(file + ": " + m.code + " " + m.message + " " + m.pointer);
  }
  console.log("checked " + process.argv.slice(2).length);
})();
"#;

/// The folder with the validator, or why there is none.
fn folder() -> &'static Result<PathBuf, String> {
    static FOLDER: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("gltf-validator");
        std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
        std::fs::write(folder.join("validate.js"), SCRIPT).map_err(|e| e.to_string())?;
        if !folder.join("node_modules/gltf-validator").is_dir() {
            let mut npm = Command::new("npm");
            npm.args([
                "install",
                "--no-save",
                "--no-audit",
                "--no-fund",
                "--fetch-retries=1",
                "gltf-validator@2.0.0-dev.3.10",
            ]);
            let run = npm.current_dir(&folder).output().map_err(|e| format!("npm: {e}"))?;
            if !run.status.success() {
                let text = String::from_utf8_lossy(&run.stderr);
                return Err(format!("npm install: {}", text.lines().next().unwrap_or_default()));
            }
        }
        Ok(folder)
    })
}

/// Fails on any error or warning; skipped with a message where the validator cannot be had.
pub fn validate(files: &[PathBuf]) {
    let folder = match folder() {
        Ok(folder) => folder,
        Err(why) => {
            println!("SKIP {}: no gltf-validator: {why}", files.len());
            return;
        }
    };
    let run = Command::new("node").arg("validate.js").args(files).current_dir(folder).output().unwrap();
    let text = String::from_utf8_lossy(&run.stdout);
    assert_eq!(text.trim(), format!("checked {}", files.len()), "{}", String::from_utf8_lossy(&run.stderr));
}
