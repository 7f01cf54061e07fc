//! One PNG a frame, with 8 or 16 bits: RGB where nothing is transparent, else RGBA; an sRGB chunk; provenance as text chunks.

use choreo_plugin::{
    ExportError, ExportOptions, Exporter, FloatFrame, Frame, FrameSink, FrameWish, Manifest, VideoInfo,
};
use std::io::Write;
use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

pub static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("png", env!("CARGO_PKG_VERSION"), "Lossless images, one file a frame")
        .extensions(["png"])
        .magic(b"\x89PNG\r\n\x1a\n")
        .text(
            "compression",
            "fast: a few milliseconds a frame; small: two thirds of the size, nineteen times the time",
            "fast",
            &["fast", "small"],
        )
        .text("depth", "Bits of a channel", "8", &["8", "16"])
        .text(
            "alpha",
            "straight: colors as they are, the standard of PNG; premultiplied: light times alpha, for compositors",
            "straight",
            &["straight", "premultiplied"],
        )
});

pub struct PngExporter;

impl Exporter for PngExporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn one_frame_per_file(&self) -> bool {
        true
    }

    fn wish(&self, options: &ExportOptions) -> Result<FrameWish, ExportError> {
        Ok(if options.text("depth") == Some("16") { FrameWish::Finished } else { FrameWish::Bytes })
    }

    fn begin(&self, info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError> {
        Ok(Box::new(PngSink::new(info, Some(out))))
    }

    fn with_provenance(
        &self,
        info: &VideoInfo,
        made: &[u8],
        mut out: Box<dyn Write + Send>,
    ) -> Result<bool, ExportError> {
        // Byte 24 of a PNG is the bit depth and byte 25 the color type: IHDR is the first chunk.
        let (Some(pixels), Some([bits, color])) = (pixels_of(made), made.get(24..26)) else {
            return Ok(false);
        };
        let color = if *color == 2 { png::ColorType::Rgb } else { png::ColorType::Rgba };
        let depth = if *bits == 16 { png::BitDepth::Sixteen } else { png::BitDepth::Eight };
        let mut head = Vec::new();
        // Dropping the writer also writes the final chunk, which is cut off below.
        drop(PngSink::new(info, None).head(&mut head, [info.width, info.height], (color, depth))?);
        let head = head
            .strip_suffix(&IEND_CHUNK)
            .ok_or(ExportError::Format("PNG: the header is incomplete".into()))?;
        out.write_all(head)?;
        out.write_all(pixels)?;
        out.flush()?;
        Ok(true)
    }
}

struct PngSink {
    /// `None` once the image is written.
    out: Option<Box<dyn Write + Send>>,
    provenance: Vec<(String, String)>,
    small: bool,
    straight: bool,
}

impl PngSink {
    fn new(info: &VideoInfo, out: Option<Box<dyn Write + Send>>) -> PngSink {
        let small = info.options.text("compression") == Some("small");
        let straight = info.options.text("alpha") != Some("premultiplied");
        PngSink { out, provenance: info.provenance.clone(), small, straight }
    }

    /// Writes everything before the pixels.
    fn head<W: Write>(
        &self,
        out: W,
        [width, height]: [u32; 2],
        (color, depth): (png::ColorType, png::BitDepth),
    ) -> Result<png::Writer<W>, ExportError> {
        let mut encoder = png::Encoder::new(out, width, height);
        encoder.set_depth(depth);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        if self.small {
            encoder.set_compression(png::Compression::Balanced);
        } else {
            // The ultra fast level finds no repetitions, so a dithered gradient would be five times as large. See the README.
            encoder.set_deflate_compression(png::DeflateCompression::Level(1));
            encoder.set_filter(png::Filter::Paeth);
        }
        for (keyword, text) in &self.provenance {
            let latin1 = keyword.chars().chain(text.chars()).all(|c| matches!(c, ' '..='~' | '\n'));
            if latin1 {
                encoder.add_text_chunk(keyword.clone(), text.clone()).map_err(convert)?;
            } else {
                encoder.add_itxt_chunk(keyword.clone(), text.clone()).map_err(convert)?;
            }
        }
        encoder.set_color(color);
        encoder.write_header().map_err(convert)
    }
}

impl PngSink {
    /// Takes the output. Fails after the first image.
    fn out(&mut self) -> Result<Box<dyn Write + Send>, ExportError> {
        let taken = || ExportError::Format("a PNG holds one image, and this one has it already".into());
        self.out.take().ok_or_else(taken)
    }
}

impl FrameSink for PngSink {
    fn frame(&mut self, frame: &Frame) -> Result<(), ExportError> {
        let out = self.out()?;
        let pixels = frame.width as usize * frame.height as usize;
        if frame.rgba.len() != pixels * 4 {
            return Err(ExportError::Format(format!(
                "a frame of {}×{} has {} bytes, must have {}",
                frame.width,
                frame.height,
                frame.rgba.len(),
                pixels * 4
            )));
        }
        let mut rgb = spare_buffers().pop().unwrap_or_default();
        let opaque = opaque_rgb(&frame.rgba, &mut rgb);
        let color = if opaque { png::ColorType::Rgb } else { png::ColorType::Rgba };
        let mut writer = self.head(out, [frame.width, frame.height], (color, png::BitDepth::Eight))?;
        let written = match self.straight {
            _ if opaque => writer.write_image_data(&rgb),
            true => writer.write_image_data(&frame.straight()),
            false => writer.write_image_data(&frame.rgba),
        };
        written.map_err(convert)?;
        spare_buffers().push(rgb);
        writer.finish().map_err(convert)
    }

    fn float_frame(&mut self, frame: &FloatFrame) -> Result<(), ExportError> {
        let out = self.out()?;
        let opaque = frame.color.iter().all(|color| color.w >= 1.0);
        let (color, channels) = if opaque { (png::ColorType::Rgb, 3) } else { (png::ColorType::Rgba, 4) };
        let codes = frame.codes_16(self.straight);
        let of_pixels = codes.as_chunks::<4>().0.iter().flat_map(|pixel| &pixel[..channels]);
        let bytes: Vec<u8> = of_pixels.flat_map(|code| code.to_be_bytes()).collect();
        let mut writer = self.head(out, [frame.width, frame.height], (color, png::BitDepth::Sixteen))?;
        writer.write_image_data(&bytes).map_err(convert)?;
        writer.finish().map_err(convert)
    }

    fn finish(self: Box<Self>) -> Result<Vec<u8>, ExportError> {
        match self.out {
            None => Ok(Vec::new()),
            Some(_) => Err(ExportError::Format("a PNG needs one image, and there was none".into())),
        }
    }
}

/// The chunk IEND.
const IEND_CHUNK: [u8; 12] = *b"\0\0\0\0IEND\xae\x42\x60\x82";

/// The bytes of a PNG from its first IDAT chunk on.
fn pixels_of(png: &[u8]) -> Option<&[u8]> {
    let mut rest = png.get(8..)?;
    while rest.get(4..8)? != b"IDAT" {
        let length = u32::from_be_bytes(rest.get(..4)?.try_into().ok()?) as usize;
        rest = rest.get(length.checked_add(12)?..)?;
    }
    Some(rest)
}

/// Pool of pixel buffers, because fresh memory pages cost more time than filling them. It grows to the number of images that are
/// encoded at once.
fn spare_buffers() -> MutexGuard<'static, Vec<Vec<u8>>> {
    static SPARE_BUFFERS: Mutex<Vec<Vec<u8>>> = Mutex::new(Vec::new());
    SPARE_BUFFERS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Fills `rgb` with the pixels without alpha. False, with incomplete pixels, where any alpha is not 255.
fn opaque_rgb(rgba: &[u8], rgb: &mut Vec<u8>) -> bool {
    let pixels = rgba.as_chunks::<4>().0;
    rgb.resize(pixels.len() * 3, 0);
    // Tests 4 kB at a time, so that the pixels are still cached when they are copied.
    for (out, part) in rgb.chunks_mut(3 * 1024).zip(pixels.chunks(1024)) {
        if part.iter().fold(u32::MAX, |all, p| all & u32::from_le_bytes(*p)) >> 24 != 255 {
            return false;
        }
        for (out, p) in out.as_chunks_mut::<3>().0.iter_mut().zip(part) {
            *out = [p[0], p[1], p[2]];
        }
    }
    true
}

fn convert(error: png::EncodingError) -> ExportError {
    match error {
        png::EncodingError::IoError(e) => ExportError::Io(e),
        other => ExportError::Format(format!("PNG: {other}")),
    }
}
