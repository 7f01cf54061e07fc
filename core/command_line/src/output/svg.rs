//! Plots of reports: SVG files, which are written completely or not at all.

use crate::failure::{Failure, write_failure};
use crate::output::target::check_folder_exists;
use crate::scene::inputs::Inputs;
use choreo_files::write_whole;
use std::path::Path;

/// Checks the file name of a plot before any work is done for it.
pub(crate) fn check_plot_path(path: Option<&Path>) -> Result<(), Failure> {
    match path {
        Some(path) if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("svg")) => {
            // A typing error must not replace a script or a model.
            Err(Failure::Usage(format!("--plot {}: write a name that ends in .svg", path.display())))
        }
        Some(path) => check_folder_exists(path),
        None => Ok(()),
    }
}

/// Writes a plot. `inputs`: files of the scene, which must not be replaced.
pub(crate) fn write_plot(path: &Path, svg: &str, inputs: &Inputs) -> Result<(), Failure> {
    inputs.check_output(path)?;
    write_whole(path, svg.as_bytes()).map_err(|e| write_failure(&path.display().to_string(), e))
}
