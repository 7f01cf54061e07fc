//! `cargo xtask book` runs this: it writes the sources of the guide for mdBook. It contains `choreo`, which draws the images.

use guide::program::AS_CHOREO;
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let args: Vec<std::ffi::OsString> = std::env::args_os().skip(1).collect();
    match args.as_slice() {
        [first, ..] if first == AS_CHOREO => choreo::run(args, &choreo::app()),
        [out] => match write(Path::new(out)) {
            Ok(()) => ExitCode::SUCCESS,
            Err(text) => {
                eprintln!("guide: {text}");
                ExitCode::FAILURE
            }
        },
        _ => {
            eprintln!("usage: guide FOLDER | guide {AS_CHOREO} COMMAND…");
            ExitCode::from(2)
        }
    }
}

fn write(out: &Path) -> Result<(), String> {
    let root = guide::root();
    let book = guide::Book::read(&root, &[])?;
    if !book.problems.is_empty() {
        return Err(book.problems.join("\n"));
    }
    let binary = std::env::current_exe().map_err(|e| format!("this program has no path: {e}"))?;
    guide::write::write(&book, &root, out, &binary)
}
