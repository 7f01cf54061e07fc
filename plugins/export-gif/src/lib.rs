//! Looping GIFs: 255 colors a frame by median cut, ordered dithering with a fixed pattern, and only the changed rectangle of each
//! frame.

mod palette;
mod resume;

use choreo_plugin::{ExportError, Exporter, Frame, FrameSink, Manifest, Mark, VideoInfo};
use palette::Quantizer;
use resume::{Gate, ResumeState};
use std::io::{Read, Write};
use std::sync::LazyLock;

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

pub static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("gif", env!("CARGO_PKG_VERSION"), "Looping GIF, 255 colors a frame")
        .extensions(["gif"])
        .magic(b"GIF87a")
        .magic(b"GIF89a")
        .number("colors", "colors a frame", 255.0, 2.0..=255.0)
        .number("dither", "strength of the dithering that hides color steps; 0 = none", 1.0, 0.0..=4.0)
});

/// The palette index of pixels that do not change from the frame before.
const UNCHANGED_INDEX: u8 = 255;

pub struct GifExporter;

impl Exporter for GifExporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn one_frame_per_file(&self) -> bool {
        false
    }

    fn notes(&self, info: &VideoInfo) -> Vec<String> {
        let mut notes = Vec::new();
        if info.fps.as_fps() > 50.0 {
            notes.push(format!(
                "GIF players slow down images shorter than 1/50 s: {:.3} frames a second will play slower; use --fps 50 or less",
                info.fps.as_fps()
            ));
        }
        notes
    }

    fn begin(&self, info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError> {
        Ok(Box::new(GifSink::new(info, out)?))
    }

    fn resume(
        &self,
        info: &VideoInfo,
        states: &[Vec<u8>],
        so_far: &mut dyn Read,
        out: Box<dyn Write + Send>,
    ) -> Result<Box<dyn FrameSink>, ExportError> {
        let cut = || ExportError::Format("the saved state of the GIF is incomplete".into());
        let state = states.last().and_then(|s| ResumeState::read(s)).ok_or_else(cut)?;
        let (gate, opener) = Gate::closed(out);
        let mut sink = GifSink::new(info, Box::new(gate))?;
        sink.shown = resume::canvas(so_far, sink.size, state.frames).map_err(ExportError::Format)?;
        // The encoder writes the header again; the file has it already, so the output is still discarded.
        let encoder = sink.output.open(sink.size, &[0; 256 * 3], "")?;
        encoder.get_mut().flush()?;
        opener.open();
        sink.frames = state.frames;
        sink.global_palette = state.global_palette;
        sink.quantizer.restore(state.palette, state.made_for);
        Ok(Box::new(sink))
    }
}

/// The encoder is made at the first frame, whose colors become the global table: frames that keep them need no table of their
/// own.
enum Output {
    Waiting(Box<dyn Write + Send>),
    Open(gif::Encoder<Box<dyn Write + Send>>),
    Failed,
}

struct GifSink {
    output: Output,
    size: (u16, u16),
    colors: usize,
    thresholds: [[i16; 8]; 8],
    fps: (u64, u64),
    frames: u64,
    quantizer: Quantizer,
    /// Whether the global color table of the file is still the palette.
    global_palette: bool,
    /// Colors on the player's canvas.
    shown: Vec<[u8; 3]>,
    indices: Vec<u8>,
    /// The provenance, for the comment extension.
    comment: String,
}

impl GifSink {
    fn new(info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<GifSink, ExportError> {
        let (Ok(width), Ok(height)) = (u16::try_from(info.width), u16::try_from(info.height)) else {
            return Err(ExportError::Format(format!(
                "GIF: {}×{} is too large, at most 65535 each way",
                info.width, info.height
            )));
        };
        let number = |name, default| info.options.number(name).unwrap_or(default);
        let made: Vec<String> = info.provenance.iter().map(|(k, v)| format!("{k}: {v}")).collect();
        Ok(GifSink {
            output: Output::Waiting(out),
            size: (width, height),
            colors: number("colors", 255.0) as usize,
            thresholds: thresholds(number("dither", 1.0)),
            fps: (u64::from(info.fps.num), u64::from(info.fps.den)),
            frames: 0,
            quantizer: Quantizer::new(),
            global_palette: true,
            shown: Vec::new(),
            indices: Vec::new(),
            comment: made.join("\n"),
        })
    }
}

impl FrameSink for GifSink {
    fn frame(&mut self, frame: &Frame) -> Result<(), ExportError> {
        let (w, h) = (usize::from(self.size.0), usize::from(self.size.1));
        if (frame.width as usize, frame.height as usize) != (w, h) || frame.rgba.len() != w * h * 4 {
            return Err(ExportError::Format(format!(
                "a frame of {}×{} ({} bytes) in a GIF of {w}×{h}",
                frame.width,
                frame.height,
                frame.rgba.len()
            )));
        }
        let first = self.shown.is_empty();
        let new_colors = self.quantizer.prepare(&frame.rgba, self.colors);
        self.global_palette &= first || !new_colors;
        self.shown.resize(w * h, [0; 3]);
        self.indices.clear();
        // Bounding box of the changed pixels.
        let (mut left, mut right, mut top, mut bottom) = (w, 0, h, 0);
        for (y, row) in frame.rgba.chunks_exact(w * 4).enumerate() {
            let thresholds = &self.thresholds[y & 7];
            for (x, p) in row.as_chunks::<4>().0.iter().enumerate() {
                let t = thresholds[x & 7];
                let c = |v: u8| (i16::from(v) + t).clamp(0, 255) as u8;
                let entry = self.quantizer.entry([c(p[0]), c(p[1]), c(p[2])]);
                let color = self.quantizer.palette[usize::from(entry)];
                let shown = &mut self.shown[y * w + x];
                if *shown == color && !first {
                    self.indices.push(UNCHANGED_INDEX);
                    continue;
                }
                *shown = color;
                self.indices.push(entry);
                (left, right) = (left.min(x), right.max(x + 1));
                (top, bottom) = (top.min(y), bottom.max(y + 1));
            }
        }
        if left >= right {
            return self.repeat(frame);
        }
        let mut part = Vec::with_capacity((right - left) * (bottom - top));
        for y in top..bottom {
            part.extend_from_slice(&self.indices[y * w + left..y * w + right]);
        }
        self.write_rectangle([left, top, right - left, bottom - top], part, first)
    }

    /// Writes an unchanged frame as a single pixel with the right duration.
    fn repeat(&mut self, _: &Frame) -> Result<(), ExportError> {
        self.write_rectangle([0, 0, 1, 1], vec![UNCHANGED_INDEX], false)
    }

    fn finish(self: Box<Self>) -> Result<Vec<u8>, ExportError> {
        match self.output {
            Output::Open(encoder) => {
                encoder.into_inner().map_err(convert)?.flush()?;
                Ok(Vec::new())
            }
            _ => Err(ExportError::Format("a GIF needs at least one image, and there was none".into())),
        }
    }

    fn mark(&mut self) -> Mark<'_> {
        let state = ResumeState {
            frames: self.frames,
            global_palette: self.global_palette,
            made_for: self.quantizer.made_for(),
            palette: self.quantizer.palette.clone(),
        };
        Mark::Settled(state.bytes())
    }
}

impl Output {
    /// Opens the encoder and writes the header, unless that is done.
    fn open(
        &mut self,
        (width, height): (u16, u16),
        table: &[u8],
        comment: &str,
    ) -> Result<&mut gif::Encoder<Box<dyn Write + Send>>, ExportError> {
        if let Output::Waiting(_) = self
            && let Output::Waiting(out) = std::mem::replace(self, Output::Failed)
        {
            let mut encoder = gif::Encoder::new(out, width, height, table).map_err(convert)?;
            encoder.set_repeat(gif::Repeat::Infinite).map_err(convert)?;
            if !comment.is_empty() {
                let kind = gif::AnyExtension::from(gif::Extension::Comment);
                encoder.write_raw_extension(kind, &[comment.as_bytes()]).map_err(convert)?;
            }
            *self = Output::Open(encoder);
        }
        match self {
            Output::Open(encoder) => Ok(encoder),
            _ => Err(ExportError::Format("GIF: writing failed before".into())),
        }
    }
}

impl GifSink {
    /// Writes the pixels of a rectangle, given as left, top, width and height.
    fn write_rectangle(
        &mut self,
        place: [usize; 4],
        pixels: Vec<u8>,
        first: bool,
    ) -> Result<(), ExportError> {
        let [left, top, width, height] = place.map(|pixels| pixels as u16);
        // Frame i is shown from round(100 i / fps) to round(100 (i + 1) / fps) hundredths of a second, so the average rate is
        // exact.
        let delay = self.hundredths(self.frames + 1) - self.hundredths(self.frames);
        self.frames += 1;
        // The table has all 256 entries, for decoders that check whether `UNCHANGED_INDEX` is one of them.
        let mut table = self.quantizer.palette.as_flattened().to_vec();
        table.resize(256 * 3, 0);
        let picture = gif::Frame {
            delay: delay.min(u64::from(u16::MAX)) as u16,
            dispose: gif::DisposalMethod::Keep,
            transparent: (!first).then_some(UNCHANGED_INDEX),
            left,
            top,
            width,
            height,
            palette: (!self.global_palette).then(|| table.clone()),
            buffer: pixels.into(),
            ..gif::Frame::default()
        };
        let encoder = self.output.open(self.size, &table, &self.comment)?;
        encoder.write_frame(&picture).map_err(convert)
    }

    fn hundredths(&self, frame: u64) -> u64 {
        let (num, den) = self.fps;
        (200 * frame * den + num) / (2 * num)
    }
}

/// Bayer's 8×8 matrix (1973) as offsets around zero. Unlike error diffusion, a fixed pattern keeps still parts still. Strength 1
/// spreads over ±6 levels, about half the distance between neighboring colors of a 255-color palette.
fn thresholds(strength: f64) -> [[i16; 8]; 8] {
    std::array::from_fn(|y| {
        std::array::from_fn(|x| {
            let (mut rank, mut bits) = (0, (x ^ y, y));
            for _ in 0..3 {
                rank = rank << 2 | (bits.0 & 1) << 1 | (bits.1 & 1);
                bits = (bits.0 >> 1, bits.1 >> 1);
            }
            ((rank as f64 - 31.5) / 31.5 * 6.0 * strength).round() as i16
        })
    })
}

fn convert(error: gif::EncodingError) -> ExportError {
    match error {
        gif::EncodingError::Io(e) => ExportError::Io(e),
        other => ExportError::Format(format!("GIF: {other}")),
    }
}
