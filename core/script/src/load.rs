//! The result of `load` and of functions that make assets: an asset, or an import that is still running.

use crate::api_error::Place;
use crate::folders::LoadError;
use crate::import::Import;
use choreo_asset::Asset;
use std::sync::{Arc, OnceLock};

/// The result of one call of `load` or of a function that makes an asset. All copies of its handle share it.
pub(crate) struct Load {
    import: Option<Arc<Import>>,
    /// Set when the load has ended: the asset, or `None` if the import has failed.
    asset: OnceLock<Option<Arc<Asset>>>,
    /// The path as the script wrote it; the name of the asset if it is procedural.
    pub name: String,
    pub at: Place,
    /// Sort key of its error among the messages of the script.
    pub order: u64,
}

impl std::fmt::Debug for Load {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Load({:?})", self.name)
    }
}

impl Load {
    /// The load of an asset that a script has made.
    pub(crate) fn procedural(asset: &Arc<Asset>, at: &Place) -> Load {
        let name = asset.name.clone();
        Load { import: None, asset: OnceLock::from(Some(asset.clone())), name, at: at.clone(), order: 0 }
    }

    /// The load of a file that is being imported. `order`: sort key of its error among the messages of the script.
    pub(crate) fn importing(import: Arc<Import>, at: &Place, order: u64) -> Load {
        let name = import.name().to_string();
        Load { import: Some(import), asset: OnceLock::new(), name, at: at.clone(), order }
    }

    /// The load of a call that failed.
    pub(crate) fn failed() -> Load {
        Load {
            import: None,
            asset: OnceLock::from(None),
            name: String::new(),
            at: Place::default(),
            order: 0,
        }
    }

    /// Whether this is the load of an import.
    pub(crate) fn is_of(&self, import: &Arc<Import>) -> bool {
        self.import.as_ref().is_some_and(|own| Arc::ptr_eq(own, import))
    }

    /// The asset, if it is available already.
    pub(crate) fn ready(&self) -> Option<&Arc<Asset>> {
        self.asset.get().and_then(Option::as_ref)
    }

    /// Waits for the asset. If the import has failed, the first call returns the error, and later ones `Err(None)`.
    pub(crate) fn wait(&self) -> Result<Arc<Asset>, Option<LoadError>> {
        if let Some(result) = self.asset.get() {
            return result.clone().ok_or(None);
        }
        let result = self.import.as_ref().ok_or(None)?.wait();
        let is_first_call = self.asset.set(result.as_ref().ok().cloned()).is_ok();
        result.map_err(|e| is_first_call.then_some(e))
    }
}
