//! Effects of plugin files, which have a name from the start and are compiled at their first use.

use crate::Effect;
use std::path::PathBuf;
use std::sync::{Mutex, OnceLock, PoisonError};

/// Why a plugin file cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PluginError {
    /// The message, with its place.
    pub text: String,
    /// Files on which the error depends.
    pub files: Vec<PathBuf>,
}

/// An effect that is read and compiled at its first use. An unused effect costs nothing, and its faults cause no errors.
///
/// ```
/// use choreo_plugin::{LazyEffect, PluginError};
/// let why = || PluginError { text: "glow.wgsl:3:5: unknown type \"vec5\"".into(), files: vec!["glow.wgsl".into()] };
/// let glow = LazyEffect::new("glow", move || Err(why()));
/// assert!(glow.made().is_none() && glow.get().is_err_and(|error| error.text.contains("vec5")));
/// ```
pub struct LazyEffect {
    name: String,
    made: LazyPlugin<Effect>,
}

/// A value that is made at its first use. The closure that makes it, and anything that the closure holds (an open folder), is freed then.
///
/// ```
/// use choreo_plugin::LazyPlugin;
/// let answer = LazyPlugin::new(|| Ok(6 * 7));
/// assert_eq!(answer.made(), None);
/// assert_eq!((answer.get(), answer.made()), (Ok(&42), Some(&42)));
/// ```
pub struct LazyPlugin<T> {
    make: Mutex<Option<Make<T>>>,
    made: OnceLock<Result<T, PluginError>>,
}

type Make<T> = Box<dyn FnOnce() -> Result<T, PluginError> + Send>;

impl<T> LazyPlugin<T> {
    /// A value that `make` gives at its first use.
    pub fn new(make: impl FnOnce() -> Result<T, PluginError> + Send + 'static) -> LazyPlugin<T> {
        LazyPlugin { make: Mutex::new(Some(Box::new(make))), made: OnceLock::new() }
    }

    /// The value. The first call makes it; other threads wait meanwhile.
    pub fn get(&self) -> Result<&T, &PluginError> {
        let make = || {
            let make = self.make.lock().unwrap_or_else(PoisonError::into_inner).take();
            // Empty only after a panic in `make`.
            let gone = || PluginError { text: "a plugin panicked".into(), files: Vec::new() };
            make.map_or_else(|| Err(gone()), |make| make())
        };
        self.made.get_or_init(make).as_ref()
    }

    /// The value, if it was already made without an error.
    pub fn made(&self) -> Option<&T> {
        self.made.get()?.as_ref().ok()
    }
}

impl LazyEffect {
    /// `name` is the name in the manifest of the effect that `make` returns.
    pub fn new(
        name: &str,
        make: impl FnOnce() -> Result<Effect, PluginError> + Send + 'static,
    ) -> LazyEffect {
        LazyEffect { name: name.into(), made: LazyPlugin::new(make) }
    }

    /// The name of the effect.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The effect. The first call makes it; other threads wait meanwhile.
    pub fn get(&self) -> Result<&Effect, &PluginError> {
        self.made.get()
    }

    /// The effect, if it was already made without an error.
    pub fn made(&self) -> Option<&Effect> {
        self.made.made()
    }
}
