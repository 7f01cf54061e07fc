//! Plugins that are files ([`choreo_session::plugin_files`]), with what is wrong with their folders as failures of a command.

use crate::failure::{Failure, print_message};
use choreo_plugin::Registry;
use choreo_session::plugin_files::{FolderError, Listing, list};
use std::path::{Path, PathBuf};

/// The plugins given and those of the files found; files that nothing uses are not compiled.
pub fn registry(plugins: &Registry, named: &[PathBuf], inputs: &[&Path]) -> Result<Registry, Failure> {
    listing(plugins, named, inputs).map(|listing| listing.registry)
}

/// Like [`registry`], with the errors of the files. Notes plugins that take the place of others of their name.
pub fn listing(plugins: &Registry, named: &[PathBuf], inputs: &[&Path]) -> Result<Listing, Failure> {
    let listing = list(plugins, named, inputs, None).map_err(|error| match error {
        FolderError::Missing { .. } => Failure::Usage(error.to_string()),
        FolderError::Unreadable { .. } | FolderError::Link { .. } => Failure::input(error.to_string()),
    })?;
    listing.replaced.iter().for_each(|text| print_message(format_args!("note: {text}")));
    Ok(listing)
}
