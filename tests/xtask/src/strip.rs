//! The README's picture strips: frames of a script, side by side.

use crate::{release_binary, root, run};
use std::process::Command;

/// Script, name of the pictures, their times in seconds.
const STRIPS: [(&str, &str, [&str; 5]); 2] = [
    ("scripts/01_first_dance.rhai", "first_dance", ["1.6", "3.2", "4.9", "7.6", "9.4"]),
    ("scripts/11_root_motion.rhai", "in_step", ["2.0", "2.15", "2.3", "2.45", "2.6"]),
];

pub fn strip() -> Result<(), String> {
    let choreo = release_binary()?;
    let folder = root().join("tests/pictures");
    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    for (script, name, times) in STRIPS {
        for (i, time) in times.iter().enumerate() {
            let out = folder.join(format!("{name}_{}.png", i + 1));
            let mut command = Command::new(&choreo);
            command.args(["render", script, "--quiet", "--size", "384x216", "--samples", "4"]);
            command.args(["--device", "cpu", "--at", time, "-o"]).arg(&out).current_dir(root());
            run(command, "choreo render")?;
        }
        println!("wrote {} pictures of {script} to tests/pictures", times.len());
    }
    Ok(())
}
