//! Runs the program `choreo`, which is linked into the binary of this crate, in a separate process.

use crate::page::Drawing;
use std::path::Path;
use std::process::{Command, Stdio};

/// The first argument with which the binary is the program `choreo`.
pub const AS_CHOREO: &str = "choreo";

/// The program `choreo`, given the binary of this crate.
pub fn choreo(binary: &Path) -> Command {
    let mut command = Command::new(binary);
    // Plugins that the user has installed are no part of the guide.
    command.arg(AS_CHOREO).env("CHOREO_PLUGINS", "").stdin(Stdio::null());
    command
}

/// Runs a command. The error is its output.
pub fn run(mut command: Command) -> Result<(), String> {
    let output = command.output().map_err(|e| format!("choreo did not start: {e}"))?;
    match output.status.success() {
        true => Ok(()),
        false => {
            let text =
                [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
            Err(format!("{}{}", text[0], text[1]))
        }
    }
}

/// `choreo check`: warnings fail, too.
pub fn check(binary: &Path, script: &Path) -> Result<(), String> {
    let mut command = choreo(binary);
    command.args(["check", "--strict"]).arg(script);
    run(command)
}

/// `choreo test` of one file.
pub fn test(binary: &Path, script: &Path) -> Result<(), String> {
    let mut command = choreo(binary);
    command.arg("test").arg(script);
    run(command)
}

/// Draws an image, or each frame of a contact sheet, of a width in pixels.
pub fn draw(binary: &Path, drawing: &Drawing, out: &Path, width: u32, samples: &str) -> Result<(), String> {
    let mut command = choreo(binary);
    command.arg("render").arg(&drawing.script).args(["--quiet", "--device", "cpu", "--samples", samples]);
    command.args(["--size", &format!("{width}x{}", width * 9 / 16)]);
    match &drawing.time {
        Some(time) => command.args(["--at", time]),
        None => command.arg("--sheet"),
    };
    command.arg("-o").arg(out);
    run(command).map_err(|e| format!("{}: {e}", drawing.script.display()))
}
