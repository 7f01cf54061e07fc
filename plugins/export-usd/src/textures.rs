//! Images as PNG files beside the layer or in its package, each content once.

use choreo_exporter_kit::png_of;
use choreo_plugin::ExportError;
use choreo_plugin::asset::{ContentHash, Image};
use std::collections::BTreeMap;
use std::sync::Arc;

#[derive(Default)]
pub struct Textures {
    /// Stem of the names.
    pub stem: String,
    /// Ends of names, and bytes.
    pub files: Vec<(String, Vec<u8>)>,
    known: BTreeMap<ContentHash, usize>,
    /// Images by the address of what holds them, so that each is hashed once.
    hashed: BTreeMap<usize, usize>,
}

impl Textures {
    /// The path of an image from the layer.
    ///
    /// # Errors
    /// The image cannot be written as PNG.
    pub fn path(&mut self, image: &Arc<Image>) -> Result<String, ExportError> {
        let address = Arc::as_ptr(image) as usize;
        let index = match self.hashed.get(&address) {
            Some(index) => *index,
            None => {
                let next = self.files.len();
                let index = *self.known.entry(image.content_hash()).or_insert(next);
                if index == next {
                    self.files.push((format!("_{index}.png"), png_of(image)?));
                }
                self.hashed.insert(address, index);
                index
            }
        };
        Ok(format!("./{}{}", self.stem, self.files[index].0))
    }
}
