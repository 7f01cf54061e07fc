//! Image files of assets: unchanged if an importer has kept the file, else as PNG; equal contents only once.

use crate::parallel::in_parallel;
use choreo_plugin::ExportError;
use choreo_plugin::asset::hash::hash_of;
use choreo_plugin::asset::{ContentHash, Image, ImageFile, ImageFileFormat};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The images of a scene, numbered in the order in which they are first used.
#[derive(Default)]
pub struct ImageFiles {
    /// Formats that are kept unchanged.
    formats: &'static [ImageFileFormat],
    /// Gray images are written with three channels.
    in_color: bool,
    images: Vec<Arc<Image>>,
    by_content: BTreeMap<ContentHash, usize>,
    /// Numbers by the address of the image, so that each is hashed once.
    by_address: BTreeMap<usize, usize>,
}

impl ImageFiles {
    /// `formats` are those that readers of the scene's format know.
    pub fn new(formats: &'static [ImageFileFormat]) -> ImageFiles {
        ImageFiles { formats, ..ImageFiles::default() }
    }

    /// Writes gray images with three channels, for readers that expect three.
    pub fn in_color(self) -> ImageFiles {
        ImageFiles { in_color: true, ..self }
    }

    /// The number of an image, which is added if its content is new.
    pub fn number(&mut self, image: &Arc<Image>) -> usize {
        let address = Arc::as_ptr(image) as usize;
        if let Some(number) = self.by_address.get(&address) {
            return *number;
        }
        let content = match self.unchanged(image) {
            Some(file) => hash_of(|w| w.bytes(&file.bytes)),
            None => image.content_hash(),
        };
        let number = *self.by_content.entry(content).or_insert(self.images.len());
        if number == self.images.len() {
            self.images.push(image.clone());
        }
        self.by_address.insert(address, number);
        number
    }

    /// The file of an image, if it may be written unchanged.
    fn unchanged<'i>(&self, image: &'i Image) -> Option<&'i ImageFile> {
        let file = image.file.as_ref().filter(|file| self.formats.contains(&file.format))?;
        match color_channels(file)? {
            1 => (!self.in_color).then_some(file),
            // Few programs read CMYK JPEG.
            count => (count == 3).then_some(file),
        }
    }

    pub fn len(&self) -> usize {
        self.images.len()
    }

    pub fn is_empty(&self) -> bool {
        self.images.is_empty()
    }

    pub fn name(&self, number: usize) -> &str {
        &self.images[number].name
    }

    /// The format in which an image is written.
    pub fn format(&self, number: usize) -> ImageFileFormat {
        self.unchanged(&self.images[number]).map_or(ImageFileFormat::Png, |file| file.format)
    }

    /// The ending of the image's file name beside the scene: `_0.png`.
    pub fn ending(&self, number: usize) -> String {
        format!("_{number}.{}", self.format(number).extension())
    }

    /// The files of all images, in order; missing ones are made on all cores.
    ///
    /// # Errors
    /// An image that cannot be written as PNG.
    pub fn files(&self) -> Result<Vec<ImageFile>, ExportError> {
        let all = in_parallel(&self.images, |image| match self.unchanged(image) {
            Some(file) => Ok(file.clone()),
            None => Ok(ImageFile { format: ImageFileFormat::Png, bytes: Arc::new(png_of(image)?) }),
        });
        all.into_iter().collect()
    }
}

/// Channels of a file, without alpha; `None` if its header does not state them.
fn color_channels(file: &ImageFile) -> Option<u8> {
    match file.format {
        // The color type in the header (PNG, §11.2.1).
        ImageFileFormat::Png => file.bytes.get(25).map(|color_type| if color_type & 2 == 0 { 1 } else { 3 }),
        ImageFileFormat::WebP => Some(3),
        ImageFileFormat::Jpeg => {
            // Segments follow each other up to the start of a frame (ITU-T T.81, §B.1).
            let mut at = 2;
            loop {
                let [mark, kind, high, low] = *file.bytes.get(at..at + 4)?.first_chunk::<4>()?;
                match kind {
                    0xff => at += 1,
                    0xc4 | 0xc8 | 0xcc => at += 2 + usize::from(u16::from_be_bytes([high, low])),
                    0xc0..=0xcf => return file.bytes.get(at + 9).copied(),
                    _ if mark != 0xff => return None,
                    _ => at += 2 + usize::from(u16::from_be_bytes([high, low])),
                }
            }
        }
    }
}

/// The image as PNG: RGB where nothing is transparent, else RGBA.
fn png_of(image: &Image) -> Result<Vec<u8>, ExportError> {
    let failed = |e: png::EncodingError| ExportError::Format(format!("image \"{}\": {e}", image.name));
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, image.width, image.height);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_deflate_compression(png::DeflateCompression::Level(1));
    encoder.set_filter(png::Filter::Paeth);
    let pixels = image.rgba.as_chunks::<4>().0;
    let opaque = pixels.iter().all(|p| p[3] == 255);
    encoder.set_color(if opaque { png::ColorType::Rgb } else { png::ColorType::Rgba });
    let mut writer = encoder.write_header().map_err(failed)?;
    match opaque {
        true => {
            let rgb: Vec<u8> = pixels.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
            writer.write_image_data(&rgb).map_err(failed)?;
        }
        false => writer.write_image_data(&image.rgba).map_err(failed)?,
    }
    writer.finish().map_err(failed)?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: &[ImageFileFormat] = &[ImageFileFormat::Png, ImageFileFormat::Jpeg];

    fn file(format: ImageFileFormat, bytes: Vec<u8>) -> Arc<Image> {
        let file = Some(ImageFile { format, bytes: Arc::new(bytes) });
        Arc::new(Image { name: "i".into(), width: 1, height: 1, rgba: vec![9, 8, 7, 255], file })
    }

    /// The first bytes of a PNG with a color type.
    fn png(color_type: u8) -> Vec<u8> {
        [&b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08"[..], &[color_type, 0, 0, 0]].concat()
    }

    /// The first bytes of a JPEG with a comment, a Huffman table and some components.
    fn jpeg(components: u8) -> Vec<u8> {
        let segments = [
            &b"\xff\xd8\xff\xfe\0\x04hi\xff\xc4\0\x03\0\xff\xff\xc2\0\x0b\x08\0\x01\0\x01"[..],
            &[components],
        ];
        segments.concat()
    }

    #[test]
    fn files_of_known_formats_are_written_unchanged() {
        use ImageFileFormat::{Jpeg, Png, WebP};
        for (format, bytes, stays, in_color) in [
            (Png, png(2), true, true),
            (Png, png(3), true, true),
            (Png, png(6), true, true),
            (Png, png(0), true, false),
            (Png, png(4), true, false),
            (Jpeg, jpeg(3), true, true),
            (Jpeg, jpeg(1), true, false),
            (Jpeg, jpeg(4), false, false),
            (Jpeg, vec![0xff, 0xd8, 0], false, false),
            (WebP, vec![1, 2, 3], false, false),
        ] {
            for (mut images, stays) in
                [(ImageFiles::new(ALL), stays), (ImageFiles::new(ALL).in_color(), in_color)]
            {
                let number = images.number(&file(format, bytes.clone()));
                let written = images.files().unwrap_or_else(|e| panic!("{e}")).remove(number);
                assert_eq!(
                    (*written.bytes == bytes) && written.format == format,
                    stays,
                    "{format:?} {bytes:?}"
                );
                assert_eq!(written.format, images.format(number));
            }
        }
    }

    #[test]
    fn equal_contents_are_written_once() {
        let mut images = ImageFiles::new(ALL);
        let one = file(ImageFileFormat::Png, png(2));
        let numbers =
            [&one, &one, &file(ImageFileFormat::Png, png(2)), &file(ImageFileFormat::Jpeg, jpeg(3))];
        assert_eq!(numbers.map(|image| images.number(image)), [0, 0, 0, 1]);
        assert_eq!([images.ending(0), images.ending(1)], ["_0.png", "_1.jpg"]);
    }
}
