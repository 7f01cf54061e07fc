//! The glTF validator of the Khronos Group, from npm, in its own folder.

use choreo_importer_kit_testing::npm::Packages;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Prints the errors and warnings of each file, one per line.
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

/// Fails on any error or warning. Skipped with a message if the validator cannot be installed.
pub(crate) fn validate(files: &[PathBuf]) {
    static PACKAGES: OnceLock<Option<Packages>> = OnceLock::new();
    let packages = ["gltf-validator@2.0.0-dev.3.10"];
    let install = || Packages::install(env!("CARGO_TARGET_TMPDIR"), "gltf-validator", &packages);
    let Some(packages) = PACKAGES.get_or_init(install) else { return };
    let text =
        packages.run("validate.js", SCRIPT, &files.iter().map(PathBuf::as_path).collect::<Vec<&Path>>());
    assert_eq!(text.trim(), format!("checked {}", files.len()));
}
