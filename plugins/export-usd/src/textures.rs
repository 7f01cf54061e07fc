//! Images beside the layer or in its package, each content once.

use choreo_exporter_kit::ImageFiles;
use choreo_plugin::ExportError;
use choreo_plugin::asset::{Image, ImageFile, ImageFileFormat};
use std::sync::Arc;

/// Formats of images in packages (the USDZ specification).
const FORMATS: &[ImageFileFormat] = &[ImageFileFormat::Png, ImageFileFormat::Jpeg];

pub struct Textures {
    /// Stem of the names.
    pub stem: String,
    images: ImageFiles,
}

impl Default for Textures {
    fn default() -> Textures {
        // Readers take the green and blue of a gray image for black.
        Textures { stem: String::new(), images: ImageFiles::new(FORMATS).in_color() }
    }
}

impl Textures {
    /// The path of an image from the layer.
    pub fn path(&mut self, image: &Arc<Image>) -> String {
        let number = self.images.number(image);
        format!("./{}{}", self.stem, self.images.ending(number))
    }

    /// Ends of names, and files.
    ///
    /// # Errors
    /// An image that cannot be written as PNG.
    pub fn files(&self) -> Result<Vec<(String, ImageFile)>, ExportError> {
        let files = self.images.files()?.into_iter().enumerate();
        Ok(files.map(|(number, file)| (self.images.ending(number), file)).collect())
    }
}
