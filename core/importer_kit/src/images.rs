//! Images of a model file: sized from their headers, then decoded in parallel with the rest of the import.

use crate::budget::Notes;
use crate::ktx2;
use crate::problem::{Problem, Result};
use choreo_asset::{Image, ImageFile, ImageFileFormat};
use choreo_plugin::{Files, ImportScope};
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, ImageResult};
use std::io::Cursor;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, OnceLock};

pub(crate) const MAX_IMAGE_SIDE: u32 = 16384;
pub(crate) const MAX_IMAGE_PIXELS: u64 = 64 << 20;
/// Largest number of images that are decoded at once; each can take a gigabyte while it is decoded.
const MAX_WORKERS: usize = 4;

/// An image whose header has been read. `B` holds its bytes.
#[derive(Debug)]
pub struct Encoded<B> {
    /// Element of the file that refers to the image: `images[3]`.
    pub place: String,
    pub name: String,
    pub width: u32,
    pub height: u32,
    pub bytes: B,
    format: Format,
}

/// Formats that a kind of file may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Formats {
    /// PNG, JPEG, WebP and KTX2: the formats of glTF.
    Web,
    /// The formats of `Web`, BMP, and TGA (known by the name's extension, as it has no magic number).
    All,
}

/// The decoder of an image.
#[derive(Clone, Copy, Debug)]
enum Format {
    Plain(ImageFormat),
    Ktx2,
}

/// Format and size in pixels, read from an image's header.
struct Header {
    format: Format,
    width: u32,
    height: u32,
}

impl<B: AsRef<[u8]>> Encoded<B> {
    /// Reads format and size from the header alone.
    pub fn examine(place: String, name: String, bytes: B, formats: Formats) -> Result<Encoded<B>> {
        let fail = |what: String| Problem::new(place.clone(), format!("\"{name}\" {what}"));
        let Header { format, width, height } = header(&name, bytes.as_ref(), formats, &fail)?;
        Ok(Encoded { place, name, width, height, bytes, format })
    }

    pub fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Whether the header shows that no pixel is transparent.
    pub fn is_opaque(&self) -> bool {
        let Format::Plain(format) = self.format else { return false };
        let decoder = ImageReader::with_format(Cursor::new(self.bytes.as_ref()), format).into_decoder();
        decoder.is_ok_and(|decoder| !decoder.color_type().has_alpha())
    }

    /// The image with its size from the header and without pixels.
    pub fn without_pixels(&self) -> Image {
        Image {
            name: self.name.clone(),
            width: self.width,
            height: self.height,
            rgba: Vec::new(),
            file: None,
        }
    }

    /// Decodes to 8-bit RGBA. Only the image's own bytes are needed, so images can be decoded in parallel with the rest of the import.
    pub fn decode(&self) -> Result<Arc<Image>> {
        let fail = |what: String| {
            Problem::new(self.place.clone(), format!("\"{}\" cannot be decoded: {what}", self.name))
        };
        let (format, width, height) = (self.format, self.width, self.height);
        let rgba = decode_rgba(self.bytes.as_ref(), &Header { format, width, height }, &fail)?;
        Ok(Arc::new(Image { name: self.name.clone(), width, height, rgba, file: None }))
    }

    /// Decodes to 8-bit RGBA. If `needs` asks for image files, the file is kept beside the pixels, provided that other programs read its
    /// format.
    pub fn decode_for(&self, needs: ImportScope) -> Result<Arc<Image>> {
        let image = self.decode()?;
        let Some(format) = self.file_format().filter(|_| needs.image_files) else { return Ok(image) };
        let file = Some(ImageFile { format, bytes: Arc::new(self.bytes.as_ref().to_vec()) });
        Ok(Arc::new(Image { file, ..Arc::unwrap_or_clone(image) }))
    }

    fn file_format(&self) -> Option<ImageFileFormat> {
        match self.format {
            Format::Plain(ImageFormat::Png) => Some(ImageFileFormat::Png),
            Format::Plain(ImageFormat::Jpeg) => Some(ImageFileFormat::Jpeg),
            Format::Plain(ImageFormat::WebP) => Some(ImageFileFormat::WebP),
            _ => None,
        }
    }
}

// The functions below have no type parameters, so that the decoders are compiled once and not in each importer.

fn header(name: &str, bytes: &[u8], formats: Formats, fail: &dyn Fn(String) -> Problem) -> Result<Header> {
    let header = match ktx2::is_ktx2(bytes) {
        true => {
            let [width, height] = ktx2::size(bytes).map_err(|e| {
                fail(e.to_string()).hint("convert the texture to PNG, JPEG, or KTX2 as in glTF")
            })?;
            Header { format: Format::Ktx2, width, height }
        }
        false => plain_header(name, bytes, formats, fail)?,
    };
    let Header { width, height, .. } = header;
    if width > MAX_IMAGE_SIDE || height > MAX_IMAGE_SIDE {
        return Err(fail(format!("has {width} x {height} pixels; the limit is {MAX_IMAGE_SIDE} a side"))
            .hint("make the texture smaller"));
    }
    let pixels = u64::from(width) * u64::from(height);
    if pixels > MAX_IMAGE_PIXELS || pixels == 0 {
        let limit = MAX_IMAGE_PIXELS >> 20;
        return Err(fail(format!(
            "has {width} x {height} pixels; the limits are 1 pixel and {limit} megapixels"
        ))
        .hint("make the texture smaller"));
    }
    Ok(header)
}

fn plain_header(
    name: &str,
    bytes: &[u8],
    formats: Formats,
    fail: &dyn Fn(String) -> Problem,
) -> Result<Header> {
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| fail(format!("cannot be read: {e}")))?;
    let all = formats == Formats::All;
    let tga = all && name.rsplit_once('.').is_some_and(|(_, e)| e.eq_ignore_ascii_case("tga"));
    let format = match reader.format() {
        Some(f @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP)) => f,
        Some(ImageFormat::Bmp) if all => ImageFormat::Bmp,
        None if tga => ImageFormat::Tga,
        _ => {
            let known = if all { "PNG, JPEG, WebP, KTX2, BMP or TGA" } else { "PNG, JPEG, WebP or KTX2" };
            return Err(fail(format!("is not a {known} image"))
                .hint("convert the textures to PNG or JPEG; DDS is not supported"));
        }
    };
    reader.set_format(format);
    let (width, height) = reader.into_dimensions().map_err(|e| fail(format!("has a damaged header: {e}")))?;
    Ok(Header { format: Format::Plain(format), width, height })
}

/// The pixels as 8-bit RGBA.
fn decode_rgba(bytes: &[u8], header: &Header, fail: &dyn Fn(String) -> Problem) -> Result<Vec<u8>> {
    let format = match header.format {
        Format::Plain(format) => format,
        Format::Ktx2 => return ktx2::decode(bytes).map_err(|e| fail(e.to_string())),
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_IMAGE_SIDE);
    limits.max_image_height = Some(MAX_IMAGE_SIDE);
    // Enough for a 16-bit RGBA image and the decoder's own rows.
    limits.max_alloc = Some(MAX_IMAGE_PIXELS * 16);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| fail(e.to_string()))?;
    if decoder.dimensions() != (header.width, header.height) {
        return Err(fail("its size differs from its header".into()));
    }
    rgba(decoder).map_err(|e| fail(e.to_string()))
}

/// Decodes to 8-bit RGBA. 8-bit colors are widened in place, so that no second image is in memory.
fn rgba(decoder: impl ImageDecoder) -> ImageResult<Vec<u8>> {
    let (width, height) = decoder.dimensions();
    let channels = match decoder.color_type() {
        ColorType::L8 => 1,
        ColorType::La8 => 2,
        ColorType::Rgb8 => 3,
        ColorType::Rgba8 => 4,
        _ => return Ok(DynamicImage::from_decoder(decoder)?.into_rgba8().into_raw()),
    };
    let pixels = width as usize * height as usize;
    let mut rgba = vec![0; 4 * pixels];
    decoder.read_image(&mut rgba[..channels * pixels])?;
    if channels < 4 {
        // Pixels are widened from the end, so that none is overwritten before it is read.
        for pixel in (0..pixels).rev() {
            let from: [u8; 3] = std::array::from_fn(|i| rgba[channels * pixel + i.min(channels - 1)]);
            let wide = match channels {
                1 => [from[0], from[0], from[0], 255],
                2 => [from[0], from[0], from[0], from[1]],
                _ => [from[0], from[1], from[2], 255],
            };
            rgba[4 * pixel..4 * pixel + 4].copy_from_slice(&wide);
        }
    }
    Ok(rgba)
}

/// The error of an import that was cancelled.
pub const CANCELLED: &str = "the import was cancelled";

/// Progress of an import, 0 to 1, when it begins to wait for its images, which take most of the rest.
const PROGRESS_BEFORE_IMAGES: f32 = 0.5;

/// Decodes images on worker threads while `rest` runs on this one; one result per image, in order. If no pixels are needed, the images have
/// only a name and a size. `files` gets the progress by decoded pixels; if it cancels the import, the remaining images are not decoded.
pub fn decode_beside<B: AsRef<[u8]> + Sync, R>(
    entries: &[Encoded<B>],
    needs: ImportScope,
    files: &dyn Files,
    rest: impl FnOnce() -> R,
) -> (Vec<Result<Arc<Image>>>, R) {
    if !needs.pixels {
        return (entries.iter().map(|e| Ok(Arc::new(e.without_pixels()))).collect(), rest());
    }
    if entries.is_empty() {
        // The query of the number of cores reads system files, which takes a tenth of the time of importing a small model.
        return (Vec::new(), rest());
    }
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let next = AtomicUsize::new(0);
    let slots: Vec<OnceLock<Result<Arc<Image>>>> = entries.iter().map(|_| OnceLock::new()).collect();
    let work = |done: Sender<u64>| {
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let (Some(entry), Some(slot)) = (entries.get(at), slots.get(at)) else { return };
            // Each index is handed out once, so the slot is empty.
            let _ = slot.set(entry.decode_for(needs));
            // The receiver is gone if `rest` has panicked.
            let _ = done.send(entry.pixels());
        }
    };
    let mut cancelled = false;
    let rest = std::thread::scope(|scope| {
        let (done, decoded) = channel();
        let workers: Vec<_> = (0..cores.min(MAX_WORKERS).min(entries.len()))
            .map_while(|_| {
                let done = done.clone();
                let thread = std::thread::Builder::new().name("picture".into());
                thread.spawn_scoped(scope, || work(done)).ok()
            })
            .collect();
        let rest = rest();
        if workers.is_empty() {
            // No thread could be started.
            work(done.clone());
        }
        drop(done);
        let all: u64 = entries.iter().map(Encoded::pixels).sum();
        let mut sum = 0;
        while let Ok(pixels) = decoded.recv() {
            sum += pixels;
            let part = sum as f64 / all.max(1) as f64;
            if !files.progress(PROGRESS_BEFORE_IMAGES + (1.0 - PROGRESS_BEFORE_IMAGES) * part as f32) {
                cancelled = sum < all;
                next.store(entries.len(), Ordering::Relaxed);
            }
        }
        // A decoder that panics leaves its slot empty, which is reported below.
        workers.into_iter().for_each(|w| drop(w.join()));
        rest
    });
    let failed =
        |entry: &Encoded<B>| match cancelled {
            true => Err(Problem::new(entry.place.clone(), CANCELLED)),
            false => Err(Problem::new(entry.place.clone(), "the image decoder failed")
                .hint("convert the image to PNG")),
        };
    let images = slots.into_iter().zip(entries).map(|(s, e)| s.into_inner().unwrap_or_else(|| failed(e)));
    (images.collect(), rest)
}

/// Decoded images, with one white pixel and a warning in place of each image that cannot be decoded. An error if the import was cancelled.
pub fn replace_failed_with_white<B>(
    decoded: Vec<Result<Arc<Image>>>,
    entries: &[Encoded<B>],
    notes: &Notes,
) -> Result<Vec<Arc<Image>>> {
    let white = |(result, entry): (Result<Arc<Image>>, &Encoded<B>)| match result {
        Err(problem) if problem.what != CANCELLED => {
            notes.warn(problem.place, format!("{}; white is used", problem.what));
            Ok(Arc::new(Image {
                name: entry.name.clone(),
                width: 1,
                height: 1,
                rgba: vec![255; 4],
                file: None,
            }))
        }
        other => other,
    };
    decoded.into_iter().zip(entries).map(white).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    /// Records the progress reports, and cancels the import after the given number of them.
    struct ProgressRecorder(RefCell<Vec<f32>>, usize);

    impl Files for ProgressRecorder {
        fn read(&self, name: &str) -> std::result::Result<Arc<Vec<u8>>, String> {
            Err(format!("{name}: not found"))
        }

        fn progress(&self, part: f32) -> bool {
            self.0.borrow_mut().push(part);
            self.0.borrow().len() <= self.1
        }
    }

    fn encoded_images(count: usize) -> Vec<Encoded<Vec<u8>>> {
        let mut png = Vec::new();
        let image = image::RgbaImage::from_pixel(64, 64, image::Rgba([9, 8, 7, 255]));
        image.write_to(&mut Cursor::new(&mut png), ImageFormat::Png).unwrap_or_else(|e| panic!("{e}"));
        let one = |k| Encoded::examine(format!("images[{k}]"), format!("{k}.png"), png.clone(), Formats::Web);
        (0..count).map(|k| one(k).unwrap_or_else(|e| panic!("{}", e.what))).collect()
    }

    #[test]
    fn images_of_few_channels_are_widened_in_place() {
        // Against the conversions of the image crate.
        let (width, height) = (7, 5);
        let gray = image::GrayImage::from_fn(width, height, |x, y| image::Luma([(31 * x + 7 * y) as u8]));
        let gray_alpha = image::GrayAlphaImage::from_fn(width, height, |x, y| {
            image::LumaA([(9 * x) as u8, (40 * y) as u8])
        });
        let color =
            image::RgbImage::from_fn(width, height, |x, y| image::Rgb([x as u8, y as u8, (x * y) as u8]));
        let deep = image::ImageBuffer::from_fn(width, height, |x, y| {
            image::Rgb([(9000 * x) as u16, (9000 * y) as u16, 77])
        });
        let images: [DynamicImage; 4] = [gray.into(), gray_alpha.into(), color.into(), deep.into()];
        for (index, image) in images.into_iter().enumerate() {
            let mut png = Vec::new();
            image.write_to(&mut Cursor::new(&mut png), ImageFormat::Png).unwrap_or_else(|e| panic!("{e}"));
            let encoded = Encoded::examine("i".into(), "i.png".into(), png, Formats::Web);
            let decoded = encoded.and_then(|e| e.decode()).unwrap_or_else(|e| panic!("{}", e.what));
            assert!(decoded.rgba == image.to_rgba8().into_raw(), "image {index}");
        }
    }

    #[test]
    fn each_decoded_image_is_reported_as_progress() {
        let bar = ProgressRecorder(RefCell::default(), 100);
        let (images, rest) = decode_beside(&encoded_images(20), ImportScope::ALL, &bar, || 7);
        assert!(rest == 7 && images.iter().all(|i| i.as_ref().is_ok_and(|i| i.rgba[..3] == [9, 8, 7])));
        let reported = bar.0.into_inner();
        assert!(reported.is_sorted() && reported.len() == 20 && reported[19] == 1.0, "{reported:?}");
        assert_eq!(reported[0], 0.525);
    }

    #[test]
    fn images_of_a_cancelled_import_are_not_decoded() {
        let bar = ProgressRecorder(RefCell::default(), 0);
        // More images than can be decoded before the first progress report is read.
        let (images, _) = decode_beside(&encoded_images(4000), ImportScope::ALL, &bar, || ());
        let left = images.iter().filter(|i| i.as_ref().is_err_and(|p| p.what == CANCELLED)).count();
        assert!(left > 0, "{left}");
    }
}
