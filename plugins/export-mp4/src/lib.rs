//! H.264 in MP4 with the encoder built in: constant quality, BT.709, index first, exact frame rates.

mod mux;

use choreo_plugin::yuv::{Matrix, Yuv420};
use choreo_plugin::{ExportError, Exporter, Frame, FrameSink, Manifest, VideoInfo};
use mux::Muxer;
use openh264::OpenH264API;
use openh264::encoder::{
    BitRate, Complexity, Encoder, EncoderConfig, FrameRate, IntraFramePeriod, QpRange, RateControlMode,
    VuiConfig,
};
use openh264::formats::YUVSource;
use std::io::Write;
use std::sync::LazyLock;

pub static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("mp4", env!("CARGO_PKG_VERSION"), "H.264 video for any player")
        .extensions(["mp4", "m4v"])
        .number(
            "quality",
            "0 = smallest file, 100 = visually lossless; the same for every frame",
            DEFAULT_QUALITY,
            0.0..=100.0,
        )
        .number("keyframes", "seconds between pictures at which a player can start", 4.0, 0.0..=60.0)
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

    fn begin(&self, info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError> {
        let (width, height) = padded(info);
        let (long, short) = (width.max(height), width.min(height));
        // The encoder's own limits (H.264 level 5.2); it refuses less than one macroblock.
        if long > 3840 || !(16..=2160).contains(&short) {
            return Err(ExportError::Format(format!(
                "MP4: {}×{} is outside what the H.264 encoder takes, 16×16 to 3840×2160 (or upright); \
                 pipe larger videos: -o - | ffmpeg -i - …",
                info.width, info.height
            )));
        }
        let quality = info.options.number("quality").unwrap_or(DEFAULT_QUALITY);
        let keyframes = info.options.number("keyframes").unwrap_or(4.0) * info.fps.as_fps();
        // Quantiser 42 … 10, H.264's logarithmic scale: 6 steps double the error.
        let qp = (42.0 - 0.32 * quality.clamp(0.0, 100.0)).round() as u8;
        let config = EncoderConfig::new()
            .skip_frames(false)
            // "Buffer based" with one allowed quantiser is constant quality: animation is clean, and flat
            // backgrounds must not pump with a bit rate.
            .rate_control_mode(RateControlMode::Bufferbased)
            .qp(QpRange::new(qp, qp))
            .adaptive_quantization(false)
            // Both judge by camera noise: still backgrounds of renderings are exact already, and skipping what seems
            // to stand still leaves trails behind slow limbs.
            .background_detection(false)
            .scene_change_detect(true)
            .complexity(Complexity::Medium)
            .bitrate(BitRate::from_bps(20_000_000))
            .max_frame_rate(FrameRate::from_hz(info.fps.as_fps() as f32))
            .intra_frame_period(IntraFramePeriod::from_num_frames(keyframes.clamp(1.0, 36_000.0) as u32))
            // One slice, one thread: the same bytes on every machine.
            .num_threads(1)
            .vui(VuiConfig::bt709());
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config).map_err(convert)?;
        let muxer = Muxer::new(width as u16, height as u16, info.fps, info.provenance.clone());
        let size = (info.width, info.height);
        Ok(Box::new(Mp4Sink { encoder, muxer, out, size, yuv: Yuv420::default() }))
    }
}

fn padded(info: &VideoInfo) -> (u32, u32) {
    (info.width.saturating_add(info.width & 1), info.height.saturating_add(info.height & 1))
}

struct Mp4Sink {
    encoder: Encoder,
    muxer: Muxer,
    out: Box<dyn Write + Send>,
    size: (u32, u32),
    yuv: Yuv420,
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
        let stream = self.encoder.encode(&Planes(&self.yuv)).map_err(convert)?;
        for layer in (0..stream.num_layers()).filter_map(|l| stream.layer(l)) {
            for nal in (0..layer.nal_count()).filter_map(|n| layer.nal_unit(n)) {
                self.muxer.nal(nal)?;
            }
        }
        match self.muxer.end_picture() {
            true => Ok(()),
            false => Err(ExportError::Format("the H.264 encoder dropped a frame".into())),
        }
    }

    fn finish(mut self: Box<Self>) -> Result<(), ExportError> {
        Ok(self.muxer.finish(&mut self.out)?)
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
