//! The contents of a folder.

use std::ffi::OsString;
use std::fs::FileType;
use std::path::Path;

/// Names and file types of a folder's entries, sorted by name. A symbolic link is reported as a link, not followed.
///
/// # Errors
/// Fails if the folder cannot be read.
pub fn entries(folder: &Path) -> std::io::Result<Vec<(OsString, FileType)>> {
    let mut entries = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        entries.push((entry.file_name(), entry.file_type()?));
    }
    entries.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(entries)
}
