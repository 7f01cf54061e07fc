//! What `load`, `shape` and their like gave: an asset that is there, or one that is still being imported.

use crate::build::Shared;
use crate::call::{ApiError, Place};
use crate::diagnostic::Severity;
use crate::folders::LoadError;
use crate::import::Import;
use choreo_asset::Asset;
use std::sync::{Arc, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// One call, wherever its handle goes.
pub struct Load {
    import: Option<Arc<Import>>,
    /// Settled: the asset, or nothing where the import has failed and that is reported.
    asset: OnceLock<Option<Arc<Asset>>>,
    /// As the script wrote it.
    pub name: String,
    pub at: Place,
    /// Its place among the messages of the script.
    order: u64,
}

impl std::fmt::Debug for Load {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Load({:?})", self.name)
    }
}

impl Load {
    pub fn made(asset: &Arc<Asset>, at: &Place) -> Load {
        let name = asset.name.clone();
        Load { import: None, asset: OnceLock::from(Some(asset.clone())), name, at: at.clone(), order: 0 }
    }

    pub fn begun(import: Arc<Import>, at: &Place, order: u64) -> Load {
        let name = import.name().to_string();
        Load { import: Some(import), asset: OnceLock::new(), name, at: at.clone(), order }
    }

    /// The load of a call that failed.
    pub fn dead() -> Load {
        Load {
            import: None,
            asset: OnceLock::from(None),
            name: String::new(),
            at: Place::default(),
            order: 0,
        }
    }

    pub fn is_of(&self, import: &Arc<Import>) -> bool {
        self.import.as_ref().is_some_and(|own| Arc::ptr_eq(own, import))
    }

    /// The asset where it is there already.
    pub fn ready(&self) -> Option<&Arc<Asset>> {
        self.asset.get().and_then(Option::as_ref)
    }

    /// Waits for the asset. A failed import is reported at the place of the call, once, as if it had been found there; who uses it
    /// gets a silent error.
    pub fn asset(&self, shared: &Shared) -> Result<Arc<Asset>, ApiError> {
        let silent = || ApiError { silent: true, ..ApiError::new("") };
        if let Some(settled) = self.asset.get() {
            return settled.clone().ok_or_else(silent);
        }
        let Some(import) = &self.import else { return Err(silent()) };
        // Loading takes as long as the files are large: the script's own time stands still, but not for what fails or is there
        // already, which could be asked for without end.
        let before = Instant::now();
        let result = import.wait();
        let taken = before.elapsed();
        if let Some(deadline) = shared.deadline.lock().unwrap_or_else(PoisonError::into_inner).as_mut()
            && result.is_ok()
            && taken > Duration::from_millis(1)
        {
            *deadline += taken;
        }
        let first = self.asset.set(result.as_ref().ok().cloned()).is_ok();
        result.map_err(|e| {
            if first {
                let error = from_load(e).focus(self.name.clone());
                shared.note_in_order(Some(self.order), Severity::Error, &self.at, &error);
            }
            silent()
        })
    }
}

pub fn from_load(e: LoadError) -> ApiError {
    let mut error = ApiError::new(e.message);
    error.hint = e.hint;
    error
}
