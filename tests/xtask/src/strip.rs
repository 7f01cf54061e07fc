//! The README's picture strip: frames of the first script, side by side.

use crate::{release_binary, root, run};
use std::process::Command;

/// Times of the pictures, seconds.
const TIMES: [&str; 5] = ["1.6", "3.2", "4.9", "7.6", "9.4"];

pub fn strip() -> Result<(), String> {
    let choreo = release_binary()?;
    let folder = root().join("tests/pictures");
    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    for (i, time) in TIMES.iter().enumerate() {
        let out = folder.join(format!("first_dance_{}.png", i + 1));
        let mut command = Command::new(&choreo);
        command.args([
            "render",
            "scripts/01_first_dance.rhai",
            "--quiet",
            "--size",
            "384x216",
            "--samples",
            "4",
        ]);
        command.args(["--device", "cpu", "--at", time, "-o"]).arg(&out).current_dir(root());
        run(command, "choreo render")?;
    }
    println!("wrote {} pictures to tests/pictures", TIMES.len());
    Ok(())
}
