//! Image files beside the layer or in its package; equal content is written once.

use choreo_exporter_kit::ImageFiles;
use choreo_plugin::ExportError;
use choreo_plugin::asset::{Image, ImageFileFormat, Panorama};
use exr::image::{Encoding, Image as ExrImage, SpecificChannels};
use exr::prelude::{Vec2, WritableImage, f16};
use std::io::Cursor;
use std::sync::Arc;

/// Image formats that packages allow (the USDZ specification).
const FORMATS: &[ImageFileFormat] = &[ImageFileFormat::Png, ImageFileFormat::Jpeg];

/// Suffix of a file's name, and its bytes.
type NamedFile = (String, Arc<Vec<u8>>);

pub(crate) struct Textures {
    /// Stem of the file names.
    pub stem: String,
    images: ImageFiles,
    sky: Option<NamedFile>,
}

impl Default for Textures {
    fn default() -> Textures {
        // Grayscale images become RGB: readers take the missing green and blue for black.
        Textures { stem: String::new(), images: ImageFiles::new(FORMATS).in_color(), sky: None }
    }
}

impl Textures {
    /// The path of an image, relative to the layer.
    pub(crate) fn image_path(&mut self, image: &Arc<Image>) -> String {
        let number = self.images.number(image);
        format!("./{}{}", self.stem, self.images.ending(number))
    }

    /// The path of the sky's image: its own Radiance file, or OpenEXR in a package (which cannot hold Radiance files) and for a
    /// sky without a file.
    ///
    /// # Errors
    /// The panorama cannot be encoded as OpenEXR.
    pub(crate) fn sky(&mut self, panorama: &Panorama, is_package: bool) -> Result<String, ExportError> {
        let (ending, _) = self.sky.insert(match &panorama.file {
            Some(file) if !is_package => ("_sky.hdr".into(), file.clone()),
            _ => ("_sky.exr".into(), Arc::new(exr_of(panorama)?)),
        });
        Ok(format!("./{}{ending}", self.stem))
    }

    /// All image files, each with the suffix of its name.
    ///
    /// # Errors
    /// An image cannot be encoded as PNG.
    pub(crate) fn files(&self) -> Result<Vec<NamedFile>, ExportError> {
        let files = self.images.files()?.into_iter().enumerate();
        let images = files.map(|(number, file)| (self.images.ending(number), file.bytes));
        Ok(images.chain(self.sky.clone()).collect())
    }
}

/// A panorama as OpenEXR in half precision.
fn exr_of(panorama: &Panorama) -> Result<Vec<u8>, ExportError> {
    let channels = SpecificChannels::rgb(|Vec2(x, y)| {
        let texel = panorama.texel(x as i64, y as i64);
        (f16::from_f32(texel.x), f16::from_f32(texel.y), f16::from_f32(texel.z))
    });
    let [width, height] = panorama.size().map(|size| size as usize);
    let image = ExrImage::from_encoded_channels((width, height), Encoding::SMALL_LOSSLESS, channels);
    let mut bytes = Vec::new();
    let written = image.write().non_parallel().to_buffered(Cursor::new(&mut bytes));
    written.map_err(|e| ExportError::Format(format!("sky \"{}\": {e}", panorama.name)))?;
    Ok(bytes)
}
