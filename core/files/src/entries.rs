//! The contents of a folder.

use std::ffi::OsString;
use std::fs::FileType;
use std::path::Path;

/// The names in a folder, in their order, with what each is; of a link, that it is one.
///
/// # Errors
/// Fails where the folder cannot be read.
pub fn entries(folder: &Path) -> std::io::Result<Vec<(OsString, FileType)>> {
    let mut entries = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        entries.push((entry.file_name(), entry.file_type()?));
    }
    entries.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(entries)
}
