//! Folders of the user for caches, data and states (XDG Base Directory Specification, version 0.8).

use std::path::PathBuf;

/// A folder of the user: the one that the environment variable names (such as `XDG_CACHE_HOME`), else `below_home` in the home folder, else
/// `LOCALAPPDATA` (Windows). Relative paths in these variables are ignored, as the specification demands. The folder need not exist.
pub fn user_folder(variable: &str, below_home: &str) -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|f| f.is_absolute());
    folder(variable)
        .or_else(|| folder("HOME").map(|home| home.join(below_home)))
        .or_else(|| folder("LOCALAPPDATA"))
}
