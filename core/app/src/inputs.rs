//! The files that a scene is made of: no output may replace one of them.

use crate::failure::Failure;
use choreo_files::{Identity, part_of};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// By identity, so that links, hard links and other ways to write a path make no difference.
#[derive(Debug, Default)]
pub struct Inputs(BTreeMap<Identity, PathBuf>);

impl Inputs {
    /// `files`: the script or model and all that was read for it, files of plugins that were used included.
    pub fn new(files: impl IntoIterator<Item = PathBuf>) -> Inputs {
        Inputs(files.into_iter().filter_map(|path| Some((Identity::of(&path)?, path))).collect())
    }

    /// Refuses an output that is one of the files, or whose part file is.
    pub fn refuse(&self, output: &Path) -> Result<(), Failure> {
        for place in [output.to_path_buf(), part_of(output)] {
            let Some(input) = Identity::of(&place).and_then(|identity| self.0.get(&identity)) else {
                continue;
            };
            let what = if place == output { "it".to_string() } else { place.display().to_string() };
            return Err(Failure::Output(format!(
                "{}: cannot write: {what} is the input {}; give the output another name",
                output.display(),
                shown(input)
            )));
        }
        Ok(())
    }
}

/// As the user would type it where the current folder is above it.
fn shown(path: &Path) -> String {
    let here = std::env::current_dir().and_then(|d| d.canonicalize()).unwrap_or_default();
    path.strip_prefix(&here).unwrap_or(path).display().to_string()
}
