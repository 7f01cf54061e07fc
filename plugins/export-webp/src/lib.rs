//! WebP animations: lossless, with alpha. Each frame holds only the rectangle of changed pixels. The container is our own;
//! `image-webp` encodes the images.

mod container;

use choreo_plugin::{ExportError, Exporter, Frame, FrameSink, Manifest, Mark, VideoInfo, changed_area};
use container::{FrameChunk, Header, chunk, frame_chunk, head};
use image_webp::{ColorType, WebPDecoder, WebPEncoder};
use std::io::{Cursor, Read, Write};
use std::sync::LazyLock;

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

pub static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("webp", env!("CARGO_PKG_VERSION"), "Lossless animations with alpha, for the web")
        .extensions(["webp"])
        .magic(b"RIFF")
        .number("plays", "how many times the animation plays; 0: forever", 0.0, 0.0..=65_535.0)
});

/// Longest side in pixels (RFC 9649, section 3.4).
const LONGEST_SIDE: u32 = 1 << 14;

pub struct WebpExporter;

impl Exporter for WebpExporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn one_frame_per_file(&self) -> bool {
        false
    }

    fn head_comes_last(&self) -> bool {
        true
    }

    fn notes(&self, info: &VideoInfo) -> Vec<String> {
        let exact = info.fps.num > 0 && (1000 * u64::from(info.fps.den)).is_multiple_of(info.fps.num.into());
        let note =
            "WebP counts milliseconds: a frame may last 1 ms more or less, but the total time is right";
        if exact { Vec::new() } else { vec![note.into()] }
    }

    fn begin(&self, info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError> {
        Ok(Box::new(WebpSink::new(info, out)?))
    }

    fn resume(
        &self,
        info: &VideoInfo,
        states: &[Vec<u8>],
        so_far: &mut dyn Read,
        out: Box<dyn Write + Send>,
    ) -> Result<Box<dyn FrameSink>, ExportError> {
        let mut sink = WebpSink::new(info, out)?;
        for _ in states {
            sink.load_previous_frames(so_far)?;
        }
        Ok(Box::new(sink))
    }
}

struct WebpSink {
    out: Box<dyn Write + Send>,
    info: VideoInfo,
    /// The pixels of the last frame, straight alpha.
    shown: Vec<u8>,
    frames: u64,
    /// Bytes of all frames so far.
    bytes: u64,
}

impl WebpSink {
    fn new(info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<WebpSink, ExportError> {
        if info.width.max(info.height) > LONGEST_SIDE {
            let (width, height) = (info.width, info.height);
            return Err(ExportError::Format(format!(
                "a WebP of {width}×{height}: its sides are at most {LONGEST_SIDE} pixels long"
            )));
        }
        Ok(WebpSink { out, info: info.clone(), shown: Vec::new(), frames: 0, bytes: 0 })
    }

    /// Duration of the next frame in milliseconds, such that each frame begins at the millisecond nearest to its time.
    fn duration(&self) -> u32 {
        let begins = |frame: u64| {
            let (num, den) = (u128::from(self.info.fps.num.max(1)), u128::from(self.info.fps.den));
            (2000 * u128::from(frame) * den + num) / (2 * num)
        };
        (begins(self.frames + 1) - begins(self.frames)).min(0xff_ffff) as u32
    }

    /// Reads back one frame of an earlier run.
    fn load_previous_frames(&mut self, so_far: &mut dyn Read) -> Result<(), ExportError> {
        let damaged = || ExportError::Format("the unfinished WebP is damaged".into());
        let FrameChunk { at: [left, top], size: [width, height], image, bytes } =
            container::read_frame(so_far)?.ok_or_else(damaged)?;
        let mut decoder =
            WebPDecoder::new(Cursor::new(container::still_webp(&image))).map_err(|_| damaged())?;
        let channels = if decoder.has_alpha() { 4 } else { 3 };
        let mut pixels = vec![0; decoder.output_buffer_size().ok_or_else(damaged)?];
        decoder.read_image(&mut pixels).map_err(|_| damaged())?;
        let whole = [self.info.width as usize, self.info.height as usize];
        self.shown.resize(4 * whole[0] * whole[1], 0);
        if pixels.len() != width * height * channels || left + width > whole[0] || top + height > whole[1] {
            return Err(damaged());
        }
        for (y, row) in pixels.chunks_exact(width * channels).enumerate() {
            let first = 4 * ((top + y) * whole[0] + left);
            let out = self.shown[first..first + 4 * width].as_chunks_mut::<4>().0;
            for (out, pixel) in out.iter_mut().zip(row.chunks_exact(channels)) {
                *out = [pixel[0], pixel[1], pixel[2], pixel.get(3).copied().unwrap_or(255)];
            }
        }
        self.frames += 1;
        self.bytes += bytes;
        Ok(())
    }
}

impl FrameSink for WebpSink {
    fn frame(&mut self, frame: &Frame) -> Result<(), ExportError> {
        let [width, height] = [self.info.width as usize, self.info.height as usize];
        if [frame.width, frame.height] != [self.info.width, self.info.height]
            || frame.rgba.len() != 4 * width * height
        {
            let what = format!("a frame of {}×{} in a WebP of {width}×{height}", frame.width, frame.height);
            return Err(ExportError::Format(what));
        }
        let rgba = frame.straight();
        let [left, top, right, bottom] = match self.shown.is_empty() {
            true => [0, 0, width, height],
            // An unchanged frame is written as a single pixel with the right duration.
            false => changed_area(&self.shown, &rgba, width).unwrap_or([0, 0, 1, 1]),
        };
        // Offsets are stored halved, so they must be even.
        let [left, top] = [left & !1, top & !1];
        let rows = rgba.chunks_exact(4 * width).skip(top).take(bottom - top);
        let part: Vec<u8> = rows.flat_map(|row| &row[4 * left..4 * right]).copied().collect();
        let size = [right - left, bottom - top];
        let mut still = Vec::new();
        let encoded =
            WebPEncoder::new(&mut still).encode(&part, size[0] as u32, size[1] as u32, ColorType::Rgba8);
        encoded.map_err(|error| ExportError::Format(format!("WebP: {error}")))?;
        let image = container::image_of(&still).ok_or(ExportError::Format("WebP: no image".into()))?;
        let bytes = frame_chunk([left, top], size, self.duration(), image);
        self.out.write_all(&bytes)?;
        self.shown.clear();
        self.shown.extend_from_slice(&rgba);
        self.frames += 1;
        self.bytes += bytes.len() as u64;
        Ok(())
    }

    fn mark(&mut self) -> Mark<'_> {
        Mark::Settled(Vec::new())
    }

    fn finish(mut self: Box<Self>) -> Result<Vec<u8>, ExportError> {
        if self.frames != self.info.frames {
            let (is, should) = (self.frames, self.info.frames);
            return Err(ExportError::Format(format!("the WebP needs {should} frames, but got {is}")));
        }
        let about = container::xmp(&self.info.provenance);
        let about =
            if self.info.provenance.is_empty() { Vec::new() } else { chunk(b"XMP ", about.as_bytes()) };
        self.out.write_all(&about)?;
        self.out.flush()?;
        head(&Header {
            size: [self.info.width, self.info.height],
            plays: self.info.options.number("plays").unwrap_or(0.0) as u16,
            has_about: !about.is_empty(),
            body: self.bytes + about.len() as u64,
        })
        .ok_or(ExportError::Format("a WebP holds at most 4 GB; make it shorter or smaller".into()))
    }
}
