//! The open file: JSON, buffers (read when first used), the memory budget, the warnings.

use crate::container::Container;
use crate::nodes::Tree;
use crate::problem::{Problem, Result, element};
use crate::profile::Document;
use crate::uri;
use choreo_import::{Budget, Notes};
use choreo_plugin::Files;
use choreo_stage::asset::Warning;
use gltf::json::Root;
use std::cell::OnceCell;
use std::ops::Deref;
use std::sync::Arc;

/// All that is decoded from one file together: a file can point at the same bytes from many accessors.
pub const MAX_DECODED_BYTES: u64 = 2 << 30;

pub struct File<'a> {
    pub root: Root,
    bin: Option<&'a [u8]>,
    files: &'a dyn Files,
    buffers: Vec<OnceCell<Bytes<'a>>>,
    budget: Budget,
    notes: Notes,
}

pub enum Bytes<'a> {
    Borrowed(&'a [u8]),
    Shared(Arc<Vec<u8>>),
    Owned(Vec<u8>),
}

impl Deref for Bytes<'_> {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        match self {
            Bytes::Borrowed(b) => b,
            Bytes::Shared(b) => b,
            Bytes::Owned(b) => b,
        }
    }
}

impl<'a> File<'a> {
    pub fn new(root: Root, container: &Container<'a>, files: &'a dyn Files) -> File<'a> {
        let buffers = root.buffers.iter().map(|_| OnceCell::new()).collect();
        let file = File {
            root,
            bin: container.bin,
            files,
            buffers,
            budget: Budget::new(MAX_DECODED_BYTES),
            notes: Notes::default(),
        };
        for (place, text) in &container.warnings {
            file.warn(place.clone(), text.clone());
        }
        file
    }

    pub fn warn(&self, place: impl Into<String>, text: impl Into<String>) {
        self.notes.warn(place, text);
    }

    /// What a profile sees; `tree` once it is known.
    pub fn document<'d>(&'d self, tree: Option<&'d Tree>) -> Document<'d> {
        Document { root: &self.root, notes: &self.notes, budget: &self.budget, tree }
    }

    pub fn into_warnings(self) -> Vec<Warning> {
        self.notes.into_warnings()
    }

    /// Takes `count` things of `size` bytes from the budget, before they are allocated.
    pub fn charge(&self, count: u64, size: usize) -> std::result::Result<(), String> {
        self.budget.charge(count, size)
    }

    /// A buffer's bytes, `byteLength` of them.
    fn buffer(&self, index: usize) -> Result<&[u8]> {
        let place = || format!("buffers[{index}]");
        let cell = element(&self.buffers, index, "buffers", place)?;
        let declared = usize::try_from(self.root.buffers[index].byte_length.0).unwrap_or(usize::MAX);
        let bytes = match cell.get() {
            Some(bytes) => bytes,
            None => {
                let loaded = self.load_buffer(index)?;
                cell.get_or_init(|| loaded)
            }
        };
        bytes.get(..declared).ok_or_else(|| {
            let from = match &self.root.buffers[index].uri {
                None => "the GLB's binary chunk".to_string(),
                Some(uri) if uri::data_uri(uri).is_some() => "its data URI".to_string(),
                Some(uri) => format!("\"{}\"", uri::file_name(uri)),
            };
            Problem::new(place(), format!("should have {declared} bytes, but {from} has {}", bytes.len()))
                .hint("the file was cut off or belongs to another export")
        })
    }

    fn load_buffer(&self, index: usize) -> Result<Bytes<'a>> {
        let place = || format!("buffers[{index}]");
        match (&self.root.buffers[index].uri, self.bin) {
            (Some(uri), _) => self.load_uri(uri, place),
            (None, Some(bin)) if index == 0 => Ok(Bytes::Borrowed(bin)),
            (None, _) => Err(Problem::new(place(), "has neither a uri nor a binary chunk of a GLB")
                .hint("files compressed with EXT_meshopt_compression must be decompressed first")),
        }
    }

    pub fn load_uri(&self, uri: &str, place: impl Fn() -> String) -> Result<Bytes<'a>> {
        match uri::data_uri(uri) {
            Some(Ok(bytes)) => Ok(Bytes::Owned(bytes)),
            Some(Err(what)) => Err(Problem::new(place(), what)),
            None => {
                let name = uri::file_name(uri);
                let read = self.files.read(&name).map_err(|what| {
                    let what =
                        if what.contains(&name) { what } else { format!("cannot read \"{name}\": {what}") };
                    Problem::new(place(), what)
                        .hint("files that a .gltf refers to must lie beside it, under the names it gives")
                })?;
                Ok(Bytes::Shared(read))
            }
        }
    }

    /// The bytes of a buffer view and its stride (0 = tightly packed).
    pub fn view(&self, index: usize, user: impl Fn() -> String) -> Result<(&[u8], usize)> {
        let view = element(&self.root.buffer_views, index, "bufferViews", &user)?;
        let place = || format!("bufferViews[{index}]");
        if let Some(extensions) = &view.extensions
            && let Some(name) = extensions.others.keys().find(|k| k.ends_with("_meshopt_compression"))
        {
            return Err(Problem::new(place(), format!("is compressed with {name}, which is not supported"))
                .hint("decompress the file, for example with `gltf-transform copy in.glb out.glb`"));
        }
        let bytes = self.buffer(view.buffer.value())?;
        let offset = view.byte_offset.map_or(0, |o| o.0);
        let end = offset.saturating_add(view.byte_length.0);
        let range = usize::try_from(offset).unwrap_or(usize::MAX)..usize::try_from(end).unwrap_or(usize::MAX);
        let Some(slice) = bytes.get(range) else {
            return Err(Problem::new(
                place(),
                format!(
                    "ends at byte {end} of buffers[{}], which has {} bytes",
                    view.buffer.value(),
                    bytes.len()
                ),
            ));
        };
        Ok((slice, view.byte_stride.map_or(0, |s| s.0)))
    }
}
