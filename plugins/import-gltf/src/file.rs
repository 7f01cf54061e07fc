//! The open file: JSON, buffers (read on first use), memory budget and warnings.

use crate::container::Container;
use crate::draco::Unpacked;
use crate::nodes::Tree;
use crate::packed;
use crate::pointers::Pointers;
use crate::problem::{Problem, Result, WithPlace, element};
use crate::profile::Document;
use crate::uri;
use choreo_asset::Warning;
use choreo_importer_kit::{Budget, Notes};
use choreo_plugin::Files;
use gltf::json::Root;
use std::cell::{OnceCell, RefCell};
use std::ops::Deref;
use std::sync::Arc;

/// Limit of all bytes decoded from one file together: many accessors can refer to the same bytes.
pub(crate) const MAX_DECODED_BYTES: u64 = 2 << 30;

pub(crate) struct File<'a> {
    pub root: Root,
    pub pointers: Pointers,
    /// The chosen variant of KHR_materials_variants.
    pub variant: Option<u64>,
    bin: Option<&'a [u8]>,
    pub files: &'a dyn Files,
    buffers: Vec<OnceCell<Bytes<'a>>>,
    /// Decompressed buffer views, filled on first use.
    unpacked: Vec<OnceCell<Vec<u8>>>,
    /// The decoded data of the primitive that is being read, where Draco has compressed it.
    pub unpacked_primitive: RefCell<Unpacked>,
    budget: Budget,
    pub notes: Notes,
}

pub(crate) enum Bytes<'a> {
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
    pub(crate) fn new(
        (root, pointers): (Root, Pointers),
        container: &Container<'a>,
        files: &'a dyn Files,
    ) -> File<'a> {
        let buffers = root.buffers.iter().map(|_| OnceCell::new()).collect();
        let unpacked = root.buffer_views.iter().map(|_| OnceCell::new()).collect();
        let file = File {
            root,
            pointers,
            variant: None,
            bin: container.bin,
            files,
            buffers,
            unpacked,
            unpacked_primitive: RefCell::default(),
            budget: Budget::new(MAX_DECODED_BYTES),
            notes: Notes::default(),
        };
        for (place, text) in &container.warnings {
            file.warn(place.clone(), text.clone());
        }
        file
    }

    pub(crate) fn warn(&self, place: impl Into<String>, text: impl Into<String>) {
        self.notes.warn(place, text);
    }

    /// The file as a profile sees it; `tree` is `None` before the nodes are read.
    pub(crate) fn document<'d>(&'d self, tree: Option<&'d Tree>) -> Document<'d> {
        Document { root: &self.root, notes: &self.notes, budget: &self.budget, tree }
    }

    pub(crate) fn into_warnings(self) -> Vec<Warning> {
        self.notes.into_warnings()
    }

    /// Charges `count` items of `size` bytes to the budget, before they are allocated.
    pub(crate) fn charge(&self, count: u64, size: usize) -> Result<()> {
        self.budget.charge(count, size)
    }

    /// Bytes that may still be decoded.
    pub(crate) fn budget_left(&self) -> u64 {
        self.budget.left()
    }

    /// The first `byteLength` bytes of a buffer.
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
            // Fallback buffers of compressed views (EXT_meshopt_compression, "Fallback buffers") also have no bytes, but are
            // never read.
            (None, _) => Err(Problem::new(place(), "has neither a uri nor a binary chunk of a GLB")
                .hint("the file was exported without its data; export it again")),
        }
    }

    fn load_uri(&self, uri: &str, place: impl Fn() -> String) -> Result<Bytes<'a>> {
        match uri::data_uri(uri) {
            Some(Ok(bytes)) => Ok(Bytes::Owned(bytes)),
            Some(Err(problem)) => Err(problem.used_by(place())),
            None => {
                let name = uri::file_name(uri);
                // Some writers do not percent-encode, so a name that only looks encoded is also tried literally.
                let as_it_stands = |what| match uri == name {
                    true => Err(what),
                    false => self.files.read(uri).map_err(|_| what),
                };
                let read = self.files.read(&name).or_else(as_it_stands).map_err(|what| {
                    let what =
                        if what.contains(&name) { what } else { format!("cannot read \"{name}\": {what}") };
                    Problem::new(place(), what)
                        .hint("files that a .gltf refers to must lie beside it, under the names it gives")
                })?;
                Ok(Bytes::Shared(read))
            }
        }
    }

    /// The bytes of a buffer view and its stride (0 = tightly packed). `user`: the referring element, for errors.
    pub(crate) fn view(&self, index: usize, user: impl Fn() -> String) -> Result<(&[u8], usize)> {
        let view = element(&self.root.buffer_views, index, "bufferViews", &user)?;
        let place = || format!("bufferViews[{index}]");
        let stride = view.byte_stride.map_or(0, |s| s.0);
        if let Some(extensions) = &view.extensions
            && let Some(extension) = packed::of(&extensions.others)
        {
            return Ok((self.unpack(index, extension)?, stride));
        }
        let offset = view.byte_offset.map_or(0, |o| o.0);
        Ok((self.slice(view.buffer.value(), offset, view.byte_length.0, place)?, stride))
    }

    fn slice(&self, buffer: usize, offset: u64, length: u64, place: impl Fn() -> String) -> Result<&[u8]> {
        let bytes = self.buffer(buffer)?;
        let end = offset.saturating_add(length);
        let range = usize::try_from(offset).unwrap_or(usize::MAX)..usize::try_from(end).unwrap_or(usize::MAX);
        bytes.get(range).ok_or_else(|| {
            let what = format!("ends at byte {end} of buffers[{buffer}], which has {} bytes", bytes.len());
            Problem::new(place(), what)
        })
    }

    /// The decompressed bytes of a compressed view. The extension names the source; the view's own buffer and offset are for
    /// readers without the extension.
    fn unpack(&self, index: usize, (name, extension): (&str, &serde_json::Value)) -> Result<&[u8]> {
        if let Some(bytes) = self.unpacked[index].get() {
            return Ok(bytes);
        }
        let place = || format!("bufferViews[{index}].{name}");
        let view = packed::read(extension).at(place)?;
        let length = self.root.buffer_views[index].byte_length.0;
        if view.packed.bytes() != length {
            let what = format!("unpacks to {} bytes, but the view has {length}", view.packed.bytes());
            return Err(Problem::new(place(), what));
        }
        let data = self.slice(view.buffer, view.offset, view.length, place)?;
        self.charge(view.packed.bytes(), 1).at(place)?;
        let bytes = view
            .packed
            .unpack(data)
            .at(place)
            .map_err(|problem| problem.hint("the file is damaged; fetch or export it again"))?;
        Ok(self.unpacked[index].get_or_init(|| bytes))
    }
}
