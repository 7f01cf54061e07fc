//! The command line of the studio.

fn main() -> std::process::ExitCode {
    choreo::run(std::env::args_os(), &studio::app())
}
