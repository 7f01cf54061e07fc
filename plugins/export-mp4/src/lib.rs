//! H.264 in MP4, with the built-in encoder OpenH264: constant quality, BT.709, index first, exact frame rates.

mod mux;

use choreo_plugin::yuv::{Matrix, Yuv420};
use choreo_plugin::{ExportError, Exporter, Frame, FrameSink, Manifest, Mark, VideoInfo};
use mux::Muxer;
use openh264::OpenH264API;
use openh264::encoder::{
    BitRate, Complexity, Encoder, EncoderConfig, FrameRate, IntraFramePeriod, QpRange, RateControlMode,
    VuiConfig,
};
use openh264::formats::YUVSource;
use std::io::{Read, Write};
use std::num::NonZeroU64;
use std::sync::LazyLock;

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

pub static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("mp4", env!("CARGO_PKG_VERSION"), "H.264 video for any player")
        .extensions(["mp4", "m4v"])
        .number(
            "quality",
            "0 = smallest file, 100 = visually lossless; the same for every frame",
            DEFAULT_QUALITY,
            0.0..=100.0,
        )
        .number("keyframes", "seconds between keyframes, at which a player can start", 4.0, 0.0..=60.0)
});

const DEFAULT_QUALITY: f64 = 75.0;

pub struct Mp4Exporter;

impl Exporter for Mp4Exporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn one_frame_per_file(&self) -> bool {
        false
    }

    fn notes(&self, info: &VideoInfo) -> Vec<String> {
        let (w, h) = padded(info);
        if (w, h) == (info.width, info.height) {
            return Vec::new();
        }
        vec![format!(
            "MP4 needs even sizes: {}×{} becomes {w}×{h}, the last column or row is repeated",
            info.width, info.height
        )]
    }

    fn head_comes_last(&self) -> bool {
        true
    }

    fn begin(&self, info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError> {
        Ok(Box::new(Mp4Sink::new(info, out)?))
    }

    fn piece(&self, info: &VideoInfo) -> Option<NonZeroU64> {
        NonZeroU64::new(segment(info).into())
    }

    fn resume(
        &self,
        info: &VideoInfo,
        states: &[Vec<u8>],
        _: &mut dyn Read,
        out: Box<dyn Write + Send>,
    ) -> Result<Box<dyn FrameSink>, ExportError> {
        let mut sink = Mp4Sink::new(info, out)?;
        for state in states {
            sink.muxer.add_state(state)?;
        }
        Ok(Box::new(sink))
    }
}

/// Settings of the encoder, of which each segment gets a new one.
struct Coding {
    qp: u8,
    /// Frames from one key frame to the next.
    keyframes: u32,
    fps: f32,
}

impl Coding {
    fn encoder(&self) -> Result<Encoder, ExportError> {
        let config = EncoderConfig::new()
            .skip_frames(false)
            // "Buffer based" rate control with a single allowed quantizer gives constant quality, because a bit rate would make
            // flat backgrounds pump.
            .rate_control_mode(RateControlMode::Bufferbased)
            .qp(QpRange::new(self.qp, self.qp))
            .adaptive_quantization(false)
            // Background detection expects camera noise: still backgrounds of renderings are exact already, and blocks skipped as
            // still leave trails behind slow limbs.
            .background_detection(false)
            .scene_change_detect(true)
            .complexity(Complexity::Medium)
            .bitrate(BitRate::from_bps(20_000_000))
            .max_frame_rate(FrameRate::from_hz(self.fps))
            .intra_frame_period(IntraFramePeriod::from_num_frames(self.keyframes))
            // One slice and one thread give the same bytes on every machine.
            .num_threads(1)
            .vui(VuiConfig::bt709());
        Encoder::with_api_config(OpenH264API::from_source(), config).map_err(convert)
    }
}

/// Quantizer of a quality: 42 … 18 … 17 … 12 on H.264's logarithmic scale, on which 6 steps double the error. The encoder only
/// takes integers of 12 or more (`GOM_MIN_QP_MODE` in its `rc.h`, to which `ParamValidation` raises the range of every rate
/// control). So each quality from 95 on has a quantizer of its own, and those from the default to 94 share two. Half steps were
/// tried, as a range of two quantizers of which each block takes one by its texture: the first frame gets the coarser one and
/// later frames repair it, which makes larger files than the finer quantizer alone.
fn quantizer(quality: f64) -> u8 {
    let quality = quality.clamp(0.0, 100.0);
    let to_default = 0.32 * quality.min(DEFAULT_QUALITY);
    let to_end =
        (quality.min(FINE_QUALITY_START) - DEFAULT_QUALITY).max(0.0) / (FINE_QUALITY_START - DEFAULT_QUALITY);
    (42.0 - to_default - to_end - (quality - FINE_QUALITY_START).max(0.0)).round() as u8
}

/// Quality from which on each integer has a quantizer of its own.
const FINE_QUALITY_START: f64 = 95.0;

/// Frames in a segment, which one encoder encodes. Its state cannot be stored, so each segment has a new encoder and does not
/// depend on frames outside: a killed render resumes after the last complete segment, from the kept frames of the next one. The
/// length is a multiple of the key frame distance, so that key frames stay regular. It is not short, because an encoder takes
/// time to start, and because two IDR images in a row must differ in `idr_pic_id` (H.264 §7.4.3), which starts at 0 in each
/// segment. It is limited so that a segment's kept frames fit into `KEPT_BYTES`, even if that means more key frames than
/// requested.
fn segment(info: &VideoInfo) -> u32 {
    const MIN_SEGMENT_FRAMES: u32 = 24;
    const KEPT_BYTES: u64 = 1 << 30;
    let (width, height) = padded(info);
    let frame_bytes = u64::from(width) * u64::from(height) * 3 / 2;
    let keyframes = keyframes(info);
    let most = u32::try_from(KEPT_BYTES / frame_bytes.max(1)).unwrap_or(u32::MAX).max(MIN_SEGMENT_FRAMES);
    (MIN_SEGMENT_FRAMES.div_ceil(keyframes) * keyframes).min(most)
}

/// Frames from one key frame to the next.
fn keyframes(info: &VideoInfo) -> u32 {
    let frames = info.options.number("keyframes").unwrap_or(4.0) * info.fps.as_fps();
    frames.clamp(1.0, 36_000.0) as u32
}

fn padded(info: &VideoInfo) -> (u32, u32) {
    (info.width.saturating_add(info.width & 1), info.height.saturating_add(info.height & 1))
}

struct Mp4Sink {
    coding: Coding,
    /// The encoder, made at the first frame of each segment.
    encoder: Option<Encoder>,
    /// Frames in a complete segment, and in the current one.
    segment: u32,
    in_segment: u32,
    muxer: Muxer,
    out: Box<dyn Write + Send>,
    size: (u32, u32),
    yuv: Yuv420,
}

impl Mp4Sink {
    fn new(info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Mp4Sink, ExportError> {
        let (width, height) = padded(info);
        let (long, short) = (width.max(height), width.min(height));
        // Limits of the encoder (H.264 level 5.2); it refuses less than one macroblock.
        if long > 3840 || !(16..=2160).contains(&short) {
            return Err(ExportError::Format(format!(
                "MP4: {}×{} is outside the sizes that the H.264 encoder accepts, 16×16 to 3840×2160 \
                 (or upright); pipe larger videos: -o - | ffmpeg -i - …",
                info.width, info.height
            )));
        }
        let quality = info.options.number("quality").unwrap_or(DEFAULT_QUALITY);
        Ok(Mp4Sink {
            segment: segment(info),
            coding: Coding {
                qp: quantizer(quality),
                keyframes: keyframes(info),
                fps: info.fps.as_fps() as f32,
            },
            encoder: None,
            in_segment: 0,
            muxer: Muxer::new(width as u16, height as u16, info.fps, info.provenance.clone()),
            out,
            size: (info.width, info.height),
            yuv: Yuv420::default(),
        })
    }

    /// Encodes the planes in `yuv`.
    fn encode(&mut self) -> Result<(), ExportError> {
        if self.in_segment == self.segment {
            // The old encoder is dropped first, so that there are never two in memory.
            self.encoder = None;
            self.in_segment = 0;
        }
        let encoder = match &mut self.encoder {
            Some(encoder) => encoder,
            none => none.insert(self.coding.encoder()?),
        };
        self.in_segment += 1;
        let stream = encoder.encode(&Planes(&self.yuv)).map_err(convert)?;
        for layer in (0..stream.num_layers()).filter_map(|l| stream.layer(l)) {
            for nal in (0..layer.nal_count()).filter_map(|n| layer.nal_unit(n)) {
                self.muxer.nal(nal, &mut self.out)?;
            }
        }
        match self.muxer.end_picture() {
            true => Ok(()),
            false => Err(ExportError::Format("the H.264 encoder dropped a frame".into())),
        }
    }
}

impl FrameSink for Mp4Sink {
    fn frame(&mut self, frame: &Frame) -> Result<(), ExportError> {
        let (width, height) = (frame.width as usize, frame.height as usize);
        if (frame.width, frame.height) != self.size || frame.rgba.len() != width * height * 4 {
            return Err(ExportError::Format(format!(
                "a frame of {width}×{height} ({} bytes) in a video of {}×{}",
                frame.rgba.len(),
                self.size.0,
                self.size.1
            )));
        }
        self.yuv.convert(&frame.rgba, width, height, Matrix::Bt709, true);
        self.encode()
    }

    /// Encodes the same planes again without converting them: the encoder needs every frame.
    fn repeat(&mut self, _: &Frame) -> Result<(), ExportError> {
        self.encode()
    }

    fn finish(mut self: Box<Self>) -> Result<Vec<u8>, ExportError> {
        self.out.flush()?;
        Ok(self.muxer.head()?)
    }

    fn mark(&mut self) -> Mark<'_> {
        if self.in_segment == self.segment {
            return Mark::Settled(self.muxer.take_state());
        }
        Mark::Open([&self.yuv.y, &self.yuv.u, &self.yuv.v])
    }

    fn again(&mut self, kept: &[u8]) -> Result<(), ExportError> {
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let (width, height) = (width.next_multiple_of(2), height.next_multiple_of(2));
        let (y, chroma) = kept.split_at(kept.len().min(width * height));
        let (u, v) = chroma.split_at(chroma.len() / 2);
        if y.len() != width * height || u.len() != y.len() / 4 || v.len() != u.len() {
            let bytes = kept.len();
            return Err(ExportError::Format(format!(
                "a saved frame of {bytes} bytes is not {width}×{height}"
            )));
        }
        (self.yuv.width, self.yuv.height) = (width, height);
        for (plane, bytes) in [(&mut self.yuv.y, y), (&mut self.yuv.u, u), (&mut self.yuv.v, v)] {
            plane.clear();
            plane.extend_from_slice(bytes);
        }
        self.encode()
    }
}

struct Planes<'a>(&'a Yuv420);

impl YUVSource for Planes<'_> {
    fn dimensions(&self) -> (usize, usize) {
        (self.0.width, self.0.height)
    }
    fn strides(&self) -> (usize, usize, usize) {
        (self.0.width, self.0.width / 2, self.0.width / 2)
    }
    fn y(&self) -> &[u8] {
        &self.0.y
    }
    fn u(&self) -> &[u8] {
        &self.0.u
    }
    fn v(&self) -> &[u8] {
        &self.0.v
    }
}

fn convert(error: openh264::Error) -> ExportError {
    ExportError::Format(format!("H.264 encoder: {error}"))
}
