//! Options for opening a scene, and the state that a second opening reuses.

use choreo_plugin::ImportScope;
use choreo_sandbox::memory::in_use;
use choreo_script::{AssetCache, RunDependencies};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Options for opening a scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OpenOptions<'a> {
    /// Parts of assets that the command needs.
    pub requested_parts: ImportScope,
    /// Whether no progress is shown.
    pub quiet: bool,
    /// State that a second opening of the same input reuses.
    pub reopen_state: Option<&'a ReopenState>,
    /// A folder around the script; the script may read everything in it.
    pub root: Option<&'a Path>,
}

impl OpenOptions<'_> {
    pub(crate) const TO_DRAW: OpenOptions<'static> =
        OpenOptions { requested_parts: ImportScope::ALL, quiet: false, reopen_state: None, root: None };
    /// Images keep the files that they were decoded from.
    pub(crate) const TO_EXPORT: OpenOptions<'static> = OpenOptions {
        requested_parts: ImportScope::WITH_IMAGE_FILES,
        quiet: false,
        reopen_state: None,
        root: None,
    };
    /// Images are not decoded.
    pub(crate) const TO_INSPECT: OpenOptions<'static> =
        OpenOptions { requested_parts: ImportScope::NO_PIXELS, quiet: false, reopen_state: None, root: None };
}

/// State kept between openings of the same input: the assets, and the files that the last opening read, even if it failed.
#[derive(Debug, Default)]
pub(crate) struct ReopenState {
    pub assets: AssetCache,
    dependencies: Mutex<RunDependencies>,
}

impl ReopenState {
    pub(crate) fn dependencies(&self) -> RunDependencies {
        self.dependencies.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Releases the assets that no open scene uses, once the program holds a quarter of the memory that it may use. Until then a later
    /// scene can reuse them.
    pub(crate) fn release_unused_assets(&self, limit: u64) {
        let held = in_use();
        // The value is 0 if the system does not report it.
        if held == 0 || held > limit / 4 {
            self.assets.drop_unused();
        }
    }

    pub(crate) fn set_dependencies(&self, dependencies: RunDependencies) {
        *self.dependencies.lock().unwrap_or_else(PoisonError::into_inner) = dependencies;
    }
}
