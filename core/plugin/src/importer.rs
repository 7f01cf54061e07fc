//! Files in: an importer turns bytes into an [`Asset`].

use crate::{Manifest, PluginFile};
use choreo_asset::Asset;
use std::collections::BTreeMap;
use std::sync::Arc;
use thiserror::Error;

pub trait Importer: Send + Sync {
    fn manifest(&self) -> &Manifest;

    /// Whether the bytes are this importer's own. Looks only at `source`, and must be fast.
    /// By default: the magic bytes of the manifest, else its extensions.
    fn claim(&self, source: &Source) -> Claim {
        self.manifest().claim(source)
    }

    /// The file that it was read from, where it is no part of the program: what it makes depends on that file too.
    fn file(&self) -> Option<&PluginFile> {
        None
    }

    /// `options` are those of the manifest, all of them: the caller has checked the given ones and added the
    /// defaults ([`Manifest::complete`]).
    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: Needs,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError>;
}

/// What an importer says of a file: the greatest claim reads it. What the bytes say counts more than any name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Claim {
    NotMine,
    /// The name ends as such files do, and the bytes do not say that they are something else.
    Extension,
    /// The bytes say so: 100 = there is no doubt, 50 = other formats could begin like this too.
    Content(u8),
}

impl std::fmt::Display for Claim {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Claim::NotMine => f.write_str("not mine"),
            Claim::Extension => f.write_str("by extension"),
            Claim::Content(score) => write!(f, "by content, {score} of 100"),
        }
    }
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

    /// Reported by importers that take long, from 0 to 1. False: nobody wants the asset any more, so that it can be given up with
    /// any error.
    fn progress(&self, part: f32) -> bool {
        let _ = part;
        true
    }
}

/// What the caller will use; the rest is not decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needs {
    pub geometry: bool,
    pub clips: bool,
    /// Which pictures lie on the materials, by name and size.
    pub textures: bool,
    /// What is in these pictures. Without, their `rgba` is empty and nothing is decoded; their headers are read all the same.
    pub pixels: bool,
}

impl Needs {
    pub const ALL: Needs = Needs { geometry: true, clips: true, textures: true, pixels: true };
    pub const CLIPS: Needs = Needs { geometry: false, clips: true, textures: false, pixels: false };
    /// Everything but pixels, to describe a scene without drawing it.
    pub const NO_PIXELS: Needs = Needs { pixels: false, ..Needs::ALL };

    /// What both need.
    pub fn both(self, other: Needs) -> Needs {
        Needs {
            geometry: self.geometry && other.geometry,
            clips: self.clips && other.clips,
            textures: self.textures && other.textures,
            pixels: self.pixels && other.pixels,
        }
    }
}

/// Option values by name.
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

impl std::fmt::Display for OptionValue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            OptionValue::Number(v) => write!(f, "{v}"),
            OptionValue::Bool(v) => write!(f, "{v}"),
            OptionValue::Text(v) => write!(f, "\"{v}\""),
        }
    }
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
