//! Images of the textures in use, each decoded once (glTF 2.0 §3.8).

use crate::file::{Bytes, File};
use crate::problem::{Problem, Result, element};
use choreo_import::pictures::{Encoded, Formats};

/// Images in the order in which materials ask for them.
#[derive(Default)]
pub struct ImageTable<'a> {
    /// Asset image of each file image asked for so far.
    known: Vec<Option<u32>>,
    pub entries: Vec<Encoded<Slice<'a>>>,
}

pub enum Slice<'a> {
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
    /// The asset's image for an image of the file. Files that hold the same picture twice get it once.
    pub fn index_of(&mut self, file: &'a File<'_>, file_image: usize, user: &str) -> Result<u32> {
        element(&file.root.images, file_image, "images", || user.to_string())?;
        self.known.resize(file.root.images.len(), None);
        if let Some(index) = self.known[file_image] {
            return Ok(index);
        }
        let place = || format!("images[{file_image}]");
        let bytes = fetch(file, file_image)?;
        let mut found = None;
        for (index, entry) in self.entries.iter().enumerate() {
            if entry.bytes.as_ref().len() == bytes.as_ref().len() {
                // Comparing costs time as decoding does: it comes out of the same budget.
                file.charge(bytes.as_ref().len() as u64, 1).map_err(|what| Problem::new(place(), what))?;
                if entry.bytes.as_ref() == bytes.as_ref() {
                    found = Some(index as u32);
                    break;
                }
            }
        }
        let index = match found {
            Some(index) => index,
            None => {
                self.entries.push(examine(file, file_image, bytes)?);
                self.entries.len() as u32 - 1
            }
        };
        self.known[file_image] = Some(index);
        Ok(index)
    }
}

fn fetch<'a>(file: &'a File<'_>, index: usize) -> Result<Slice<'a>> {
    let image = &file.root.images[index];
    let place = || format!("images[{index}]");
    match (&image.buffer_view, &image.uri) {
        (Some(view), _) => Ok(Slice::View(file.view(view.value(), place)?.0)),
        (None, Some(uri)) => Ok(Slice::Loaded(file.load_uri(uri, place)?)),
        (None, None) => Err(Problem::new(place(), "has neither a bufferView nor a uri")),
    }
}

/// Format and size from the header alone.
fn examine<'a>(file: &File<'_>, index: usize, bytes: Slice<'a>) -> Result<Encoded<Slice<'a>>> {
    let image = &file.root.images[index];
    let name = match (&image.name, &image.uri) {
        (Some(name), _) => name.clone(),
        (None, Some(uri)) if crate::uri::data_uri(uri).is_none() => crate::uri::file_name(uri),
        _ => format!("image {index}"),
    };
    let encoded = Encoded::examine(format!("images[{index}]"), name, bytes, Formats::Web)?;
    file.charge(encoded.pixels(), 4)
        .map_err(|what| Problem::new(encoded.place.clone(), format!("\"{}\" {what}", encoded.name)))?;
    Ok(encoded)
}
