//! The program `choreo-view`.

fn main() -> std::process::ExitCode {
    choreo_viewer::run(std::env::args_os(), &choreo::app())
}
