//! The viewer of the studio.

fn main() -> std::process::ExitCode {
    choreo_viewer::run(std::env::args_os(), &studio::app())
}
