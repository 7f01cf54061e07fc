//! Effects of plugin files: a name from the start, the rest when something uses them first.

use crate::Effect;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Why a plugin file cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PluginFault {
    /// Complete with its place.
    pub text: String,
    /// The files on which that depends.
    pub files: Vec<PathBuf>,
}

/// An effect that is read and compiled when it is used first. What nothing uses costs nothing and breaks nothing.
pub struct EffectOnUse {
    name: String,
    made: MadeOnce<Arc<dyn Effect>>,
}

/// A value that is made at its first use. What making it needs (an open folder) is freed then.
pub struct MadeOnce<T> {
    make: Mutex<Option<Make<T>>>,
    made: OnceLock<Result<T, PluginFault>>,
}

type Make<T> = Box<dyn FnOnce() -> Result<T, PluginFault> + Send>;

impl<T> MadeOnce<T> {
    pub fn new(make: impl FnOnce() -> Result<T, PluginFault> + Send + 'static) -> MadeOnce<T> {
        MadeOnce { make: Mutex::new(Some(Box::new(make))), made: OnceLock::new() }
    }

    /// The value, made now where it was not made before; other threads that use it wait.
    pub fn get(&self) -> Result<&T, &PluginFault> {
        let make = || {
            let make = self.make.lock().unwrap_or_else(PoisonError::into_inner).take();
            // Empty only after a panic in `make`.
            let gone = || PluginFault { text: "a plugin panicked".into(), files: Vec::new() };
            make.map_or_else(|| Err(gone()), |make| make())
        };
        self.made.get_or_init(make).as_ref()
    }

    /// The value, where it was made without a fault.
    pub fn made(&self) -> Option<&T> {
        self.made.get()?.as_ref().ok()
    }
}

impl EffectOnUse {
    /// `name`: as in the manifest of the effect that `make` gives.
    pub fn new(
        name: &str,
        make: impl FnOnce() -> Result<Arc<dyn Effect>, PluginFault> + Send + 'static,
    ) -> EffectOnUse {
        EffectOnUse { name: name.into(), made: MadeOnce::new(make) }
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// The effect, made now where it was not made before; other threads that use it wait.
    pub fn get(&self) -> Result<&Arc<dyn Effect>, &PluginFault> {
        self.made.get()
    }

    /// The effect, where it was made without a fault.
    pub fn made(&self) -> Option<&Arc<dyn Effect>> {
        self.made.made()
    }
}
