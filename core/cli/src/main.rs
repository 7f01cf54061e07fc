//! The program `choreo`, with the built-in plugins.

use std::process::ExitCode;

fn main() -> ExitCode {
    choreo::run(std::env::args_os(), &choreo::app())
}
