//! Plugins that are files ([`choreo_session::plugin_files`]), with what is wrong with their folders as failures of a command.

use crate::failure::Failure;
use choreo_plugin::Registry;
use choreo_session::plugin_files::{FolderError, Listing, list};
use std::path::{Path, PathBuf};

/// The plugins given and those of the files found; files that nothing uses are not compiled.
pub fn registry(plugins: &Registry, named: &[PathBuf], inputs: &[&Path]) -> Result<Registry, Failure> {
    listing(plugins, named, inputs).map(|listing| listing.registry)
}

/// The same, to be asked what is wrong with the files.
pub fn listing(plugins: &Registry, named: &[PathBuf], inputs: &[&Path]) -> Result<Listing, Failure> {
    list(plugins, named, inputs, None).map_err(|error| match error {
        FolderError::Missing { .. } => Failure::Usage(error.to_string()),
        FolderError::Unreadable { .. } | FolderError::Link { .. } => Failure::input(error.to_string()),
    })
}
