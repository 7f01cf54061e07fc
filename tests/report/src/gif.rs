//! GIF: number of colors, and strength of dithering.

use crate::{Section, scenes};
use choreo_bench::moment::Moment;
use choreo_bench::plots::{Choice, Row, quantity};
use choreo_image_diff::flip;
use choreo_importer_kit_testing::export::SharedBytes;
use choreo_motion::{FrameRate, Time};
use choreo_plugin::{Exporter, Frame, OptionValue, VideoInfo};
use choreo_render::{CpuRenderer, Renderer};

/// Options `colors` and `dither`; the last pair is the default.
const METHODS: [(u32, f64); 8] =
    [(16, 1.0), (32, 1.0), (64, 1.0), (128, 1.0), (255, 0.0), (255, 0.5), (255, 2.0), (255, 1.0)];
/// Side in pixels of the blocks whose averages are compared: the eye averages the dots of dithering.
const BLOCK_SIDE: usize = 4;

pub(crate) fn section() -> Result<Section, String> {
    let registry = choreo::registry();
    let stage = scenes::stage_of_script("01_first_dance.rhai", &registry)?;
    let moment = Moment::new(&stage, Time::from_secs(5.0), registry.effects()).map_err(|e| e.to_string())?;
    let mut renderer = CpuRenderer::new(registry.effects());
    renderer.load(moment.resources.clone()).map_err(|e| e.to_string())?;
    let frame = moment.draw(&mut renderer, [640, 360], 4).map_err(|e| e.to_string())?;
    let mut choice = Choice::new(
        "gif",
        "With how many colors and how much dithering is a frame written as GIF? (the first dance, 640×360)",
    );
    choice.error_unit = "steps of 255";
    choice.by_mean = true;
    choice.reference = format!(
        "the frame before it was encoded; means of {BLOCK_SIDE} × {BLOCK_SIDE} pixels, the file read by a decoder"
    );
    for (colors, dither) in METHODS {
        let file = encode_gif(&frame, colors, dither)?;
        let back = decode_gif(&file)?;
        let (worst, mean) = worst_and_mean_error(&frame, &back);
        let plain = block_errors(&frame, &back, 1);
        let seen = flip(&back, &frame).map_err(|e| e.to_string())?;
        let note = format!("single pixels: mean {}; ꟻLIP mean {}", quantity(plain.1), quantity(seen.mean));
        choice
            .rows
            .push(Row::new(name(colors, dither)).error(worst, mean).bytes(file.len() as f64).note(note));
    }
    choice
        .choose(&name(255, 1.0), "the default: colors between two of the palette are right from a distance");
    Ok(Section {
        title: "Palettes of GIFs",
        text: "A frame of a GIF has 255 colors, which a median cut takes from the frame, and one for pixels \
               that do not change. Ordered dithering mixes the colors in between: each single pixel is \
               farther off than without it, but the mean of a few is closer. Dithering costs bytes, since \
               fewer runs of pixels are equal."
            .into(),
        choices: vec![choice],
        tables: Vec::new(),
        off_front: vec![(
            "gif",
            "without dithering smooth surfaces break up into bands, which hardly change the means of few \
             pixels but are clearly visible.",
        )],
    })
}

fn name(colors: u32, dither: f64) -> String {
    format!("{colors} colors, dither {dither}")
}

/// Worst and mean error of a channel's average over blocks.
fn worst_and_mean_error(frame: &Frame, back: &Frame) -> (f64, f64) {
    block_errors(frame, back, BLOCK_SIDE)
}

fn block_errors(frame: &Frame, back: &Frame, block: usize) -> (f64, f64) {
    let (width, height) = (frame.width as usize, frame.height as usize);
    let mean = |of: &Frame, x: usize, y: usize, channel: usize| {
        let pixels = (0..block * block).map(|i| (y + i / block) * width + x + i % block);
        pixels.map(|pixel| f64::from(of.rgba[4 * pixel + channel])).sum::<f64>() / (block * block) as f64
    };
    let (mut worst, mut sum, mut count) = (0.0f64, 0.0, 0.0);
    for y in (0..height / block * block).step_by(block) {
        for x in (0..width / block * block).step_by(block) {
            for channel in 0..3 {
                let difference = (mean(frame, x, y, channel) - mean(back, x, y, channel)).abs();
                worst = worst.max(difference);
                sum += difference;
                count += 1.0;
            }
        }
    }
    (worst, sum / count)
}

fn encode_gif(frame: &Frame, colors: u32, dither: f64) -> Result<Vec<u8>, String> {
    let mut info = VideoInfo {
        width: frame.width,
        height: frame.height,
        fps: FrameRate { num: 25, den: 1 },
        frames: 1,
        provenance: Vec::new(),
        options: Default::default(),
    };
    info.options.0.insert("colors".into(), OptionValue::Number(f64::from(colors)));
    info.options.0.insert("dither".into(), OptionValue::Number(dither));
    let bytes = SharedBytes::default();
    let sink = export_gif::GifExporter.begin(&info, Box::new(bytes.clone()));
    let mut sink = sink.map_err(|e| e.to_string())?;
    sink.frame(frame).map_err(|e| e.to_string())?;
    let head = sink.finish().map_err(|e| e.to_string())?;
    Ok([head, bytes.bytes()].concat())
}

fn decode_gif(file: &[u8]) -> Result<Frame, String> {
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(file).map_err(|e| e.to_string())?;
    let (width, height) = (u32::from(decoder.width()), u32::from(decoder.height()));
    let frame = decoder.read_next_frame().map_err(|e| e.to_string())?.ok_or("the GIF has no frame")?;
    Ok(Frame { width, height, rgba: frame.buffer.to_vec() })
}
