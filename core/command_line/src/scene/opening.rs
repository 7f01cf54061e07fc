//! How a scene is opened, and which of its parts a second opening uses again.

use choreo_plugin::ImportScope;
use choreo_sandbox::memory::in_use;
use choreo_script::{AssetCache, Touched};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// How a scene is opened: what will be used of its assets, and whether a bar may be shown.
#[derive(Clone, Copy, Debug)]
pub struct Opening<'a> {
    pub needs: ImportScope,
    pub quiet: bool,
    pub keep: Option<&'a Keep>,
    /// A folder around the script in all of which it may read.
    pub root: Option<&'a Path>,
}

impl Opening<'_> {
    pub(crate) const TO_DRAW: Opening<'static> =
        Opening { needs: ImportScope::ALL, quiet: false, keep: None, root: None };
    /// Images keep the files that they were decoded from.
    pub(crate) const TO_EXPORT: Opening<'static> =
        Opening { needs: ImportScope::WITH_IMAGE_FILES, quiet: false, keep: None, root: None };
    /// No image is decoded.
    pub(crate) const TO_TELL: Opening<'static> =
        Opening { needs: ImportScope::NO_PIXELS, quiet: false, keep: None, root: None };
}

/// State that is kept between openings of the same input: the assets, and the files that the last opening read, also if it failed.
#[derive(Debug, Default)]
pub struct Keep {
    pub assets: AssetCache,
    touched: Mutex<Touched>,
}

impl Keep {
    pub fn touched(&self) -> Touched {
        self.touched.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Releases the assets that no open scene uses, once the program holds a quarter of the memory
    /// that it may: until then a later scene finds them made.
    pub(crate) fn release(&self, limit: u64) {
        let held = in_use();
        // 0: the system does not say.
        if held == 0 || held > limit / 4 {
            self.assets.drop_unused();
        }
    }

    pub(crate) fn set_touched(&self, touched: Touched) {
        *self.touched.lock().unwrap_or_else(PoisonError::into_inner) = touched;
    }
}
