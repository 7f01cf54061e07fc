//! Images of the textures in use, each decoded once (glTF 2.0 §3.8). A missing or damaged image is a warning, as in the other
//! importers.

use crate::file::{Bytes, File};
use crate::problem::{Result, element};
use crate::uri;
use choreo_importer_kit::images::{Encoded, Formats};
use choreo_importer_kit::search;

/// Images in the order in which materials request them.
#[derive(Default)]
pub(crate) struct ImageTable<'a> {
    /// Asset image of each file image that was requested; `Some(None)` where it cannot be read.
    index_of_file_image: Vec<Option<Option<u32>>>,
    pub entries: Vec<Encoded<Slice<'a>>>,
}

pub(crate) enum Slice<'a> {
    View(&'a [u8]),
    Loaded(Bytes<'a>),
}

impl AsRef<[u8]> for Slice<'_> {
    fn as_ref(&self) -> &[u8] {
        match self {
            Slice::View(b) => b,
            Slice::Loaded(b) => b,
        }
    }
}

impl<'a> ImageTable<'a> {
    /// The asset image of a file image; `None`, with a warning, where it cannot be read. Equal images of a file are added once.
    pub(crate) fn index_of(
        &mut self,
        file: &'a File<'_>,
        file_image: usize,
        user: &str,
    ) -> Result<Option<u32>> {
        element(&file.root.images, file_image, "images", || user.to_string())?;
        self.index_of_file_image.resize(file.root.images.len(), None);
        if let Some(known) = self.index_of_file_image[file_image] {
            return Ok(known);
        }
        let place = || format!("images[{file_image}]");
        let image = &file.root.images[file_image];
        let bytes = match (&image.buffer_view, &image.uri) {
            // The view is a part of the file itself, so a wrong reference is an error.
            (Some(view), _) => Ok(Slice::View(file.view(view.value(), place)?.0)),
            (None, Some(uri)) => fetch(file, uri),
            (None, None) => Err("has neither a bufferView nor a uri".into()),
        };
        let index = match bytes.and_then(|bytes| self.add(file, file_image, bytes)) {
            Ok(index) => Some(index),
            Err(problem) => {
                file.warn(place(), format!("{}; the texture is left out", problem.what));
                None
            }
        };
        self.index_of_file_image[file_image] = Some(index);
        Ok(index)
    }

    /// The index of the image with these bytes, which is added where no entry equals it.
    fn add(&mut self, file: &File<'_>, file_image: usize, bytes: Slice<'a>) -> Result<u32> {
        for (index, entry) in self.entries.iter().enumerate() {
            if entry.bytes.as_ref().len() == bytes.as_ref().len() {
                // Comparing costs time, as decoding does, so it is charged to the same budget.
                file.charge(bytes.as_ref().len() as u64, 1)?;
                if entry.bytes.as_ref() == bytes.as_ref() {
                    return Ok(index as u32);
                }
            }
        }
        let image = &file.root.images[file_image];
        let name = match (&image.name, &image.uri) {
            (Some(name), _) => name.clone(),
            (None, Some(uri)) if uri::data_uri(uri).is_none() => uri::file_name(uri),
            _ => format!("image {file_image}"),
        };
        // Reads format and size from the image's header only.
        let encoded = Encoded::examine(format!("images[{file_image}]"), name, bytes, Formats::Web)?;
        file.charge(encoded.pixels(), 4).map_err(|p| format!("\"{}\" {}", encoded.name, p.what))?;
        self.entries.push(encoded);
        Ok(self.entries.len() as u32 - 1)
    }
}

/// The bytes of an image, from a data URI or a file: under the name in the URI, else at the places of [`search::places`].
fn fetch<'a>(file: &File<'_>, uri: &str) -> Result<Slice<'a>> {
    if let Some(inside) = uri::data_uri(uri) {
        return inside.map(|bytes| Slice::Loaded(Bytes::Owned(bytes)));
    }
    // Some writers do not percent-encode, so a name that only looks encoded is also tried literally.
    let name = uri::file_name(uri);
    let read = search::read_first(file.files, &search::places(&[&name, uri]));
    read.map(|bytes| Slice::Loaded(Bytes::Shared(bytes))).map_err(|why| search::missing(&name, &why).into())
}
