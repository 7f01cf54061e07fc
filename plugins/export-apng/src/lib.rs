//! Animated PNG: lossless, with alpha, for the web. Each frame holds only the rectangle of changed pixels.

use choreo_plugin::{ExportError, Exporter, Frame, FrameSink, Manifest, VideoInfo, changed_area};
use std::io::Write;
use std::sync::LazyLock;

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("apng", env!("CARGO_PKG_VERSION"), "Animated PNG: lossless, with alpha, for the web")
        .extensions(["apng"])
        .integer("plays", "how many times the animation plays; 0: forever", 0, 0..=65_535)
});

/// Writes animated PNG.
#[derive(Clone, Copy, Debug, Default)]
pub struct ApngExporter;

impl Exporter for ApngExporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn one_frame_per_file(&self) -> bool {
        false
    }

    fn begin(&self, info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError> {
        let mut encoder = png::Encoder::new(out, info.width, info.height);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let frames =
            u32::try_from(info.frames).map_err(|_| ExportError::Format("APNG: too many frames".into()))?;
        encoder.set_animated(frames, info.options.number("plays").unwrap_or(0.0) as u32).map_err(convert)?;
        let (Ok(num), Ok(den)) = (u16::try_from(info.fps.den), u16::try_from(info.fps.num)) else {
            let fps = info.fps.as_fps();
            return Err(ExportError::Format(format!(
                "APNG: {fps} frames a second cannot be written as a fraction of two 16-bit numbers"
            )));
        };
        encoder.set_frame_delay(num, den).map_err(convert)?;
        // Makes the encoder fail where frames are missing at the end.
        encoder.validate_sequence(true);
        encoder.set_blend_op(png::BlendOp::Source).map_err(convert)?;
        encoder.set_dispose_op(png::DisposeOp::None).map_err(convert)?;
        for (keyword, text) in &info.provenance {
            encoder.add_itxt_chunk(keyword.clone(), text.clone()).map_err(convert)?;
        }
        let writer = encoder.write_header().map_err(convert)?;
        Ok(Box::new(ApngSink { writer, size: [info.width, info.height], shown: Vec::new() }))
    }
}

struct ApngSink {
    writer: png::Writer<Box<dyn Write + Send>>,
    size: [u32; 2],
    /// The pixels of the last frame.
    shown: Vec<u8>,
}

impl FrameSink for ApngSink {
    fn frame(&mut self, frame: &Frame) -> Result<(), ExportError> {
        let bytes = self.size[0] as usize * self.size[1] as usize * 4;
        if [frame.width, frame.height] != self.size || frame.rgba.len() != bytes {
            let [width, height] = self.size;
            let what = format!("a frame of {}×{} in an APNG of {width}×{height}", frame.width, frame.height);
            return Err(ExportError::Format(what));
        }
        let rgba = &*frame.straight();
        let first = self.shown.is_empty();
        let [left, top, right, bottom] = match first {
            true => [0, 0, self.size[0] as usize, self.size[1] as usize],
            // An unchanged frame is written as a single pixel with the right duration.
            false => changed_area(&self.shown, rgba, self.size[0] as usize).unwrap_or([0, 0, 1, 1]),
        };
        if !first {
            self.writer.set_frame_position(0, 0).map_err(convert)?;
            let size = [right - left, bottom - top].map(|pixels| pixels as u32);
            self.writer.set_frame_dimension(size[0], size[1]).map_err(convert)?;
            self.writer.set_frame_position(left as u32, top as u32).map_err(convert)?;
        }
        let rows = rgba.chunks_exact(self.size[0] as usize * 4).skip(top).take(bottom - top);
        let part: Vec<u8> = rows.flat_map(|row| &row[left * 4..right * 4]).copied().collect();
        self.writer.write_image_data(&part).map_err(convert)?;
        self.shown.clear();
        self.shown.extend_from_slice(rgba);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Vec<u8>, ExportError> {
        self.writer.finish().map_err(convert)?;
        Ok(Vec::new())
    }
}

fn convert(error: png::EncodingError) -> ExportError {
    match error {
        png::EncodingError::IoError(e) => ExportError::Io(e),
        other => ExportError::Format(format!("APNG: {other}")),
    }
}
