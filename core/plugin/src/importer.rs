//! Files in: an importer turns bytes into an [`Asset`].

use crate::Manifest;
use choreo_stage::Asset;
use std::collections::BTreeMap;
use std::sync::Arc;
use thiserror::Error;

pub trait Importer: Send + Sync {
    fn manifest(&self) -> &Manifest;

    /// How sure this importer is that the bytes are its own, 0 = not mine … 100 = certain.
    /// Only looks at `source`; must be fast. By default: magic bytes 90, extension alone 50.
    fn claim(&self, source: &Source) -> u8 {
        let m = self.manifest();
        if m.magic.iter().any(|magic| source.bytes.starts_with(magic)) {
            90
        } else if m.extensions.iter().any(|e| *e == source.extension()) {
            50
        } else {
            0
        }
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: Needs,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError>;
}

/// A file handed to an importer.
#[derive(Clone, Debug)]
pub struct Source {
    /// As the user wrote it, for messages; not to be opened.
    pub name: String,
    pub bytes: Arc<Vec<u8>>,
}

impl Source {
    pub fn extension(&self) -> String {
        match self.name.rsplit_once('.') {
            Some((_, e)) if !e.contains(['/', '\\']) => e.to_ascii_lowercase(),
            _ => String::new(),
        }
    }
}

/// The only way for an importer to reach further files (buffers, textures): relative to the source, confined to
/// the folders that the user gave. Refusals and failures are texts that name the file and why.
pub trait Files {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String>;
}

/// What the caller will use; the rest is not decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needs {
    pub geometry: bool,
    pub clips: bool,
    pub textures: bool,
}

impl Needs {
    pub const ALL: Needs = Needs { geometry: true, clips: true, textures: true };
}

/// Option values by name, checked against the manifest by the registry.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportOptions(pub BTreeMap<String, OptionValue>);

/// The same for exporters.
pub type ExportOptions = ImportOptions;

#[derive(Clone, Debug, PartialEq)]
pub enum OptionValue {
    Number(f64),
    Bool(bool),
    Text(String),
}

impl ImportOptions {
    pub fn number(&self, name: &str) -> Option<f64> {
        match self.0.get(name) {
            Some(OptionValue::Number(v)) => Some(*v),
            _ => None,
        }
    }
    pub fn text(&self, name: &str) -> Option<&str> {
        match self.0.get(name) {
            Some(OptionValue::Text(v)) => Some(v),
            _ => None,
        }
    }
    pub fn bool(&self, name: &str) -> Option<bool> {
        match self.0.get(name) {
            Some(OptionValue::Bool(v)) => Some(*v),
            _ => None,
        }
    }
}

/// `NAME: PLACE: WHAT` and what to do, where there is something to do.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{file}: {place}{what}", place = if place.is_empty() { String::new() } else { format!("{place}: ") })]
pub struct ImportError {
    pub file: String,
    /// Element path ("accessors[3]") or byte offset ("byte 1024"); may be empty.
    pub place: String,
    pub what: String,
    pub hint: Option<String>,
}
