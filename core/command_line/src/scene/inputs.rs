//! The files that a scene was made from. No output may replace one of them.

use crate::failure::Failure;
use choreo_files::{Identity, containing_folder, part_name};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Input files of a scene, by identity.
#[derive(Debug, Default)]
pub(crate) struct Inputs {
    /// Input files by device and inode, so that symbolic links, hard links and other spellings of a path make no difference.
    files: BTreeMap<Identity, PathBuf>,
    /// The folder of the script or model, canonical.
    scene_folder: Option<PathBuf>,
}

impl Inputs {
    /// `files`: the script or model, and all files read for it, including those of used plugins.
    pub(crate) fn new(files: impl IntoIterator<Item = PathBuf>) -> Inputs {
        let files = files.into_iter().filter_map(|path| Some((Identity::of(&path)?, path))).collect();
        Inputs { files, scene_folder: None }
    }

    /// Adds the folder of `input`, the script or model: its content is not trusted, so symbolic links in it are checked.
    pub(crate) fn with_scene_folder(self, input: &Path) -> Inputs {
        Inputs { scene_folder: containing_folder(input).canonicalize().ok(), ..self }
    }

    /// Refuses an output that is an input, whose temporary file is an input, or whose path leaves the scene's folder through a symbolic
    /// link.
    pub(crate) fn check_output(&self, output: &Path) -> Result<(), Failure> {
        if let Some(link) = self.scene_folder.as_deref().and_then(|folder| escaping_link(output, folder)) {
            return Err(Failure::Output(format!(
                "{}: cannot write: {} is a symbolic link that leads out of the scene's folder; remove it, or name the folder it leads to",
                output.display(),
                relative_to_current_folder(&link)
            )));
        }
        for place in [output.to_path_buf(), part_name(output)] {
            let Some(input) = Identity::of(&place).and_then(|identity| self.files.get(&identity)) else {
                continue;
            };
            let what = if place == output { "it".to_string() } else { place.display().to_string() };
            return Err(Failure::Output(format!(
                "{}: cannot write: {what} is the input {}; give the output another name",
                output.display(),
                relative_to_current_folder(input)
            )));
        }
        Ok(())
    }
}

/// The first symbolic link on the way from the folder to the output that leads out of the folder.
fn escaping_link(output: &Path, folder: &Path) -> Option<PathBuf> {
    let below = std::path::absolute(output).ok()?;
    let below = below.parent()?.strip_prefix(folder).ok()?.to_path_buf();
    let mut place = folder.to_path_buf();
    for part in below.components() {
        place.push(part);
        if place.is_symlink() && !place.canonicalize().is_ok_and(|real| real.starts_with(folder)) {
            return Some(place);
        }
    }
    None
}

/// Formats a path for messages: relative to the current folder if it lies beneath it, else unchanged.
fn relative_to_current_folder(path: &Path) -> String {
    let here = std::env::current_dir().and_then(|d| d.canonicalize()).unwrap_or_default();
    path.strip_prefix(&here).unwrap_or(path).display().to_string()
}
