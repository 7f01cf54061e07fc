//! Effects of plugin files: a name from the start, the rest when something uses them first.

use crate::Effect;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

/// Why a plugin file cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PluginFault {
    /// Complete with its place.
    pub text: String,
    /// The files on which that depends.
    pub files: Vec<PathBuf>,
}

type Made = Result<Arc<dyn Effect>, PluginFault>;

/// An effect that is read and compiled when it is used first. What nothing uses costs nothing and breaks nothing.
pub struct EffectOnUse {
    name: String,
    make: Box<dyn Fn() -> Made + Send + Sync>,
    made: OnceLock<Made>,
}

impl EffectOnUse {
    /// `name`: as in the manifest of the effect that `make` gives.
    pub fn new(name: &str, make: impl Fn() -> Made + Send + Sync + 'static) -> EffectOnUse {
        EffectOnUse { name: name.into(), make: Box::new(make), made: OnceLock::new() }
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// The effect, made now where it was not made before; other threads that use it wait.
    pub fn get(&self) -> Result<&Arc<dyn Effect>, &PluginFault> {
        self.made.get_or_init(&self.make).as_ref()
    }

    /// The effect, where it was made without a fault.
    pub fn made(&self) -> Option<&Arc<dyn Effect>> {
        self.made.get()?.as_ref().ok()
    }
}
