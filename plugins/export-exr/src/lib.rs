//! One OpenEXR file a frame: scene-linear color with alpha, and the render passes (AOVs), as layers of one part.

mod cryptomatte;
mod header;

use choreo_plugin::{
    ExportError, ExportOptions, Exporter, FloatFrame, Frame, FrameSink, FrameWish, Manifest, Passes,
    VideoInfo,
};
use cryptomatte::Cryptomatte;
use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer};
use exr::meta::attribute::{AttributeValue, Chromaticities, Text};
use exr::meta::header::LayerAttributes;
use exr::prelude::{Compression, LineOrder, Vec2, WritableImage, f16};
use std::io::{Cursor, Write};
use std::sync::LazyLock;

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

pub static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("exr", env!("CARGO_PKG_VERSION"), "Light for compositors: scene-linear images with passes")
        .extensions(["exr"])
        .magic(b"\x76\x2f\x31\x01")
        .text(
            PASSES,
            "Passes in the file, separated by commas: color, depth, normal, motion, albedo, id",
            "color",
            &[],
        )
        .text(
            "pixels",
            "half: 16 bits a channel; float: 32. Depth and ids always have 32",
            "half",
            &["half", "float"],
        )
        .text(
            ID_SAMPLES,
            "Samples per pixel of the ids; frame: as many as color has",
            "frame",
            &["frame", "1", "4", "16"],
        )
        .text(
            "compression",
            "zip: 16 rows together; zips: row by row, which some compositors read faster; none",
            "zip",
            &["zip", "zips", "none"],
        )
});

const PASSES: &str = "passes";
const ID_SAMPLES: &str = "id_samples";

pub struct ExrExporter;

impl Exporter for ExrExporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn one_frame_per_file(&self) -> bool {
        true
    }

    fn wish(&self, options: &ExportOptions) -> Result<FrameWish, ExportError> {
        let passes = Passes::parse(options.text(PASSES).unwrap_or("color"));
        let passes = passes.map_err(|unknown| ExportError::Format(format!("{PASSES}: {unknown}")))?;
        // The option is a number or "frame", which means as many samples as color has, and gives 0 here.
        let id_samples = options.text(ID_SAMPLES).and_then(|text| text.parse().ok()).unwrap_or(0);
        Ok(FrameWish::Scene(Passes { id_samples, ..passes }))
    }

    fn begin(&self, info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError> {
        Ok(Box::new(ExrSink { out: Some(out), info: info.clone() }))
    }
}

struct ExrSink {
    /// `None` once the image is written.
    out: Option<Box<dyn Write + Send>>,
    info: VideoInfo,
}

impl FrameSink for ExrSink {
    fn frame(&mut self, _: &Frame) -> Result<(), ExportError> {
        Err(ExportError::Format("OpenEXR needs a frame of floats, but this one has bytes".into()))
    }

    fn float_frame(&mut self, frame: &FloatFrame) -> Result<(), ExportError> {
        let Some(mut out) = self.out.take() else {
            return Err(ExportError::Format("an EXR holds one image, and this one has it already".into()));
        };
        out.write_all(&encode(frame, &self.info)?)?;
        Ok(out.flush()?)
    }

    fn finish(self: Box<Self>) -> Result<Vec<u8>, ExportError> {
        match self.out {
            None => Ok(Vec::new()),
            Some(_) => Err(ExportError::Format("an EXR needs one image, and there was none".into())),
        }
    }
}

/// The channels of a file, in any order.
struct Channels {
    half: bool,
    all: Vec<AnyChannel<FlatSamples>>,
}

impl Channels {
    /// Adds a channel with the chosen number of bits.
    fn add(&mut self, name: &str, values: impl Iterator<Item = f32>) {
        let samples = match self.half {
            true => FlatSamples::F16(values.map(f16::from_f32).collect()),
            false => FlatSamples::F32(values.collect()),
        };
        self.all.push(AnyChannel::new(name, samples));
    }

    /// Adds a channel of 32-bit floats.
    fn add_float(&mut self, name: &str, values: impl Iterator<Item = f32>) {
        self.all.push(AnyChannel::new(name, FlatSamples::F32(values.collect())));
    }
}

fn encode(frame: &FloatFrame, info: &VideoInfo) -> Result<Vec<u8>, ExportError> {
    let mut channels = Channels { half: info.options.text("pixels") != Some("float"), all: Vec::new() };
    if !frame.color.is_empty() {
        for (i, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
            channels.add(name, frame.color.iter().map(|color| color[i]));
        }
    }
    if !frame.depth.is_empty() {
        channels.add_float("Z", frame.depth.iter().copied());
    }
    if !frame.normal.is_empty() {
        for (i, name) in ["N.X", "N.Y", "N.Z"].into_iter().enumerate() {
            channels.add(name, frame.normal.iter().map(|normal| normal[i]));
        }
    }
    if !frame.motion.is_empty() {
        channels.add("motion.X", frame.motion.iter().map(|moved| moved.x));
        // Motion vectors point up in compositors, and down here.
        channels.add("motion.Y", frame.motion.iter().map(|moved| -moved.y));
    }
    if !frame.albedo.is_empty() {
        for (i, name) in ["albedo.R", "albedo.G", "albedo.B", "albedo.A"].into_iter().enumerate() {
            channels.add(name, frame.albedo.iter().map(|color| color[i]));
        }
    }
    let mattes = [("CryptoObject", &frame.actors), ("CryptoMaterial", &frame.materials)];
    let mattes =
        mattes.into_iter().filter_map(|(layer, matte)| Some(Cryptomatte { layer, matte: matte.as_ref()? }));
    let mattes: Vec<Cryptomatte> = mattes.collect();
    for (name, values) in mattes.iter().flat_map(Cryptomatte::channels) {
        channels.add_float(&name, values.into_iter());
    }
    let mut attributes =
        LayerAttributes { frames_per_second: rate(info), software_name: None, ..LayerAttributes::default() };
    let text = |text: &str| Text::from_slice_unchecked(text.as_bytes());
    let of_mattes: Vec<(String, String)> = mattes.iter().flat_map(Cryptomatte::attributes).collect();
    for (keyword, value) in info.provenance.iter().chain(&of_mattes) {
        attributes.other.insert(text(keyword), AttributeValue::Text(text(value)));
    }
    let compression = match info.options.text("compression") {
        Some("zips") => Compression::ZIP1,
        Some("none") => Compression::Uncompressed,
        _ => Compression::ZIP16,
    };
    let encoding = Encoding { compression, line_order: LineOrder::Increasing, ..Encoding::UNCOMPRESSED };
    let size = (frame.width as usize, frame.height as usize);
    let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(channels.all.into()));
    let mut image = Image::from_layer(layer);
    image.attributes.chromaticities = Some(REC_709);
    let mut bytes = Cursor::new(Vec::new());
    let written = image.write().non_parallel().to_buffered(&mut bytes);
    written.map_err(|error| ExportError::Format(format!("OpenEXR: {error}")))?;
    let mut bytes = bytes.into_inner();
    header::sort(&mut bytes);
    Ok(bytes)
}

/// Primaries and white point of sRGB.
const REC_709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.3, 0.6),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.329),
};

fn rate(info: &VideoInfo) -> Option<(i32, u32)> {
    Some((i32::try_from(info.fps.num).ok()?, info.fps.den))
}
