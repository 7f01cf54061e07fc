//! Plugin files ([`choreo_session::plugin_files`]), with errors of their folders as failures of a command.

use crate::failure::{Failure, print_message};
use choreo_plugin::Registry;
use choreo_session::plugin_files::{FolderError, Listing, list_plugin_files};
use std::path::{Path, PathBuf};

/// Registry with the given plugins and those of plugin files. Files that nothing uses are not compiled.
pub(crate) fn registry_with_files(
    plugins: &Registry,
    named: &[PathBuf],
    inputs: &[&Path],
) -> Result<Registry, Failure> {
    listing(plugins, named, inputs).map(|listing| listing.registry)
}

/// Like [`registry_with_files`], with the errors of the files. Prints a note for each plugin that replaces another one of the same name.
pub(crate) fn listing(plugins: &Registry, named: &[PathBuf], inputs: &[&Path]) -> Result<Listing, Failure> {
    let listing = list_plugin_files(plugins, named, inputs, None).map_err(|error| match error {
        FolderError::Missing { .. } => Failure::Usage(error.to_string()),
        FolderError::Unreadable { .. } | FolderError::Link { .. } => Failure::input(error.to_string()),
    })?;
    listing.replacement_notes.iter().for_each(|text| print_message(format_args!("note: {text}")));
    Ok(listing)
}
