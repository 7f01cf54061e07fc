//! Pictures of reports: SVG files, whole or not at all.

use crate::failure::{Failure, output_error};
use crate::part::Part;
use std::io::Write;
use std::path::Path;

/// Said before any work is done for it.
pub fn check(path: Option<&Path>) -> Result<(), Failure> {
    match path {
        Some(path) if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("svg")) => {
            // A slip of the hand must not replace a script or a model.
            Err(Failure::Usage(format!("--plot {}: write a name that ends in .svg", path.display())))
        }
        _ => Ok(()),
    }
}

pub fn write(path: &Path, svg: &str) -> Result<(), Failure> {
    check(Some(path))?;
    let part = Part::create(path)?;
    let mut out = part.writer()?;
    out.write_all(svg.as_bytes())
        .and_then(|()| out.flush())
        .map_err(|e| output_error(&path.display().to_string(), &e))?;
    drop(out);
    part.commit()
}
