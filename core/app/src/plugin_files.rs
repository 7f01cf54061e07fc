//! Plugins that are files ([`choreo_live::plugin_files`]), with what is wrong with them as failures of a command.

use crate::failure::{Failure, Problem};
use choreo_live::plugin_files::{FolderError, found as find};
use choreo_plugin::Registry;
use std::path::{Path, PathBuf};

/// The plugins given and those of the files found.
pub fn registry(plugins: &Registry, named: &[PathBuf], inputs: &[&Path]) -> Result<Registry, Failure> {
    let (registry, problems) = found(plugins, named, inputs)?;
    match problems.is_empty() {
        true => Ok(registry),
        false => Err(Failure::Input(problems)),
    }
}

/// The same, with what is wrong with single files beside it.
pub fn found(
    plugins: &Registry,
    named: &[PathBuf],
    inputs: &[&Path],
) -> Result<(Registry, Vec<Problem>), Failure> {
    let found = find(plugins, named, inputs).map_err(|error| match error {
        FolderError::Missing { .. } => Failure::Usage(error.to_string()),
        FolderError::Unreadable { .. } => Failure::input(error.to_string()),
    })?;
    Ok((found.registry, found.problems.into_iter().map(|p| Problem::Text(p.text)).collect()))
}
