//! Images of the textures in use, each decoded once (glTF 2.0 §3.8).

use crate::file::{Bytes, File};
use crate::problem::{Problem, Result, element};
use choreo_stage::asset::Image;
use image::{ImageFormat, ImageReader};
use std::io::Cursor;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

pub const MAX_IMAGE_SIDE: u32 = 16384;
pub const MAX_IMAGE_PIXELS: u64 = 64 << 20;
/// Pictures decoded at once; each can take a gigabyte while it is decoded.
const MAX_WORKERS: usize = 4;

/// Images in the order in which materials ask for them.
#[derive(Default)]
pub struct ImageTable<'a> {
    /// Asset image of each file image asked for so far.
    known: Vec<Option<u32>>,
    pub entries: Vec<Encoded<'a>>,
}

pub struct Encoded<'a> {
    pub file_image: usize,
    name: String,
    format: ImageFormat,
    width: u32,
    height: u32,
    bytes: Slice<'a>,
}

enum Slice<'a> {
    View(&'a [u8]),
    Loaded(Bytes<'a>),
}

impl Slice<'_> {
    fn get(&self) -> &[u8] {
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
            if entry.bytes.get().len() == bytes.get().len() {
                // Comparing costs time as decoding does: it comes out of the same budget.
                file.charge(bytes.get().len() as u64, 1).map_err(|what| Problem::new(place(), what))?;
                if entry.bytes.get() == bytes.get() {
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
fn examine<'a>(file: &File<'_>, index: usize, bytes: Slice<'a>) -> Result<Encoded<'a>> {
    let image = &file.root.images[index];
    let name = match (&image.name, &image.uri) {
        (Some(name), _) => name.clone(),
        (None, Some(uri)) if crate::uri::data_uri(uri).is_none() => crate::uri::file_name(uri),
        _ => format!("image {index}"),
    };
    let place = || format!("images[{index}]");
    let fail = |what: String| Problem::new(place(), format!("\"{name}\" {what}"));
    let reader = ImageReader::new(Cursor::new(bytes.get()))
        .with_guessed_format()
        .map_err(|e| fail(format!("cannot be read: {e}")))?;
    let format = match reader.format() {
        Some(f @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP)) => f,
        _ => {
            return Err(fail("is not a PNG, JPEG or WebP picture".into())
                .hint("convert the textures to PNG or JPEG; KTX2 and DDS are not supported"));
        }
    };
    let (width, height) = reader.into_dimensions().map_err(|e| fail(format!("has a damaged header: {e}")))?;
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
    file.charge(pixels, 4).map_err(fail)?;
    Ok(Encoded { file_image: index, name, format, width, height, bytes })
}

/// Decodes pictures on threads of their own while `rest` runs here.
pub fn decode_beside<R>(entries: &[Encoded<'_>], rest: impl FnOnce() -> R) -> (Result<Vec<Arc<Image>>>, R) {
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let next = AtomicUsize::new(0);
    let slots: Vec<OnceLock<Result<Arc<Image>>>> = entries.iter().map(|_| OnceLock::new()).collect();
    let work = || {
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let (Some(entry), Some(slot)) = (entries.get(at), slots.get(at)) else { return };
            // Each number is given out once, so the slot is empty.
            let _ = slot.set(entry.decode());
        }
    };
    let rest = std::thread::scope(|scope| {
        let workers: Vec<_> =
            (0..cores.min(MAX_WORKERS).min(entries.len())).map(|_| scope.spawn(work)).collect();
        let rest = rest();
        // A decoder that panics leaves its slot empty, which is reported below.
        workers.into_iter().for_each(|w| drop(w.join()));
        rest
    });
    let failed = |entry: &Encoded<'_>| {
        Err(Problem::new(format!("images[{}]", entry.file_image), "the picture decoder failed")
            .hint("convert the picture to PNG"))
    };
    let images = slots.into_iter().zip(entries).map(|(s, e)| s.into_inner().unwrap_or_else(|| failed(e)));
    (images.collect(), rest)
}

impl Encoded<'_> {
    /// To 8-bit RGBA. Needs nothing of the file, so pictures can be decoded beside the rest of the import.
    pub fn decode(&self) -> Result<Arc<Image>> {
        let fail = |what: String| {
            Problem::new(
                format!("images[{}]", self.file_image),
                format!("\"{}\" cannot be decoded: {what}", self.name),
            )
        };
        let mut reader = ImageReader::with_format(Cursor::new(self.bytes.get()), self.format);
        let mut limits = image::Limits::default();
        limits.max_image_width = Some(MAX_IMAGE_SIDE);
        limits.max_image_height = Some(MAX_IMAGE_SIDE);
        // A 16-bit RGBA picture and the decoder's own rows.
        limits.max_alloc = Some(MAX_IMAGE_PIXELS * 16);
        reader.limits(limits);
        let decoded = reader.decode().map_err(|e| fail(e.to_string()))?;
        let rgba = decoded.into_rgba8();
        if (rgba.width(), rgba.height()) != (self.width, self.height) {
            return Err(fail("its size differs from its header".into()));
        }
        Ok(Arc::new(Image {
            name: self.name.clone(),
            width: self.width,
            height: self.height,
            rgba: rgba.into_raw(),
        }))
    }
}
