//! The choice of the quality at which a frame is written as MP4.

use super::{MeasuredScene, SceneChoices};
use crate::error::BenchError;
use crate::moment::Moment;
use crate::plots::{Choice, Row};
use crate::video::{first_picture, to_rgb};
use choreo_image_diff::compare;
use choreo_plugin::yuv::{Matrix, Yuv420};
use choreo_plugin::{Exporter, Frame, OptionValue, VideoInfo};
use choreo_render::{CpuRenderer, Renderer};
use std::io::Write;
use std::sync::{Arc, Mutex, PoisonError};

const QUALITIES: [u32; 7] = [30, 50, 65, 75, 95, 97, 100];
const TOLERANCE: u8 = 8;

pub fn choices(scene: &MeasuredScene, moment: &Moment) -> Result<SceneChoices, BenchError> {
    let Some(exporter) = scene.registry.exporters().iter().find(|e| e.manifest().name == "mp4") else {
        return Ok(SceneChoices::None("this program has no exporter \"mp4\"".into()));
    };
    // The format needs even sides.
    let size = scene.size.map(|n| (n & !1).clamp(16, 1920));
    let mut renderer = CpuRenderer::new(&moment.effects);
    renderer.load(moment.resources.clone())?;
    let frame = moment.draw(&mut renderer, size, scene.stage.settings.samples.unwrap_or(4))?;
    Ok(SceneChoices::Choices(vec![video(&frame, exporter.as_ref())?]))
}

/// Compares qualities on this frame as the first of a video. Its sides are even.
pub fn video(frame: &Frame, exporter: &dyn Exporter) -> Result<Choice, BenchError> {
    let mut choice = Choice::new("video", "At which quality is a frame written as MP4?");
    choice.error_unit = "steps of 255";
    choice.by_mean = true;
    choice.reference =
        "the frame before encoding, against the decoded video (BT.709, chroma interpolated linearly, in f64)"
            .into();
    let row = |name: String, back: &Frame, bytes: usize| -> Result<Row, BenchError> {
        let c = compare(back, frame, TOLERANCE)?;
        let note =
            format!("PSNR {:.1} dB, {:.2} % of pixels beyond {TOLERANCE}", c.psnr, c.share_beyond * 100.0);
        let at = format!("pixel {}, {}", c.worst_at[0], c.worst_at[1]);
        Ok(Row::new(name).error(f64::from(c.worst), c.mean).at(at).bytes(bytes as f64).note(note))
    };
    for quality in QUALITIES {
        let mp4 = encoded(frame, exporter, quality)?;
        let back = to_rgb(&first_picture(&mp4)?, frame.width, frame.height);
        choice.rows.push(row(format!("quality {quality}"), &back, mp4.len())?);
    }
    let mut yuv = Yuv420::default();
    yuv.convert(&frame.rgba, frame.width as usize, frame.height as usize, Matrix::Bt709, true);
    let size = yuv.y.len() + yuv.u.len() + yuv.v.len();
    let planes = crate::video::Planes { width: yuv.width, height: yuv.height, y: yuv.y, u: yuv.u, v: yuv.v };
    let back = to_rgb(&planes, frame.width, frame.height);
    choice.rows.push(row("4:2:0, not compressed".into(), &back, size)?);
    choice.choose(
        "quality 75",
        "the default: most of the remaining error comes from 4:2:0 itself, see the last row",
    );
    Ok(choice)
}

#[derive(Clone, Default)]
struct Bytes(Arc<Mutex<Vec<u8>>>);

impl Write for Bytes {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
        Ok(bytes.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn encoded(frame: &Frame, exporter: &dyn Exporter, quality: u32) -> Result<Vec<u8>, BenchError> {
    let mut info = VideoInfo {
        width: frame.width,
        height: frame.height,
        fps: choreo_motion::FrameRate { num: 30, den: 1 },
        frames: 1,
        provenance: Vec::new(),
        options: Default::default(),
    };
    info.options.0.insert("quality".into(), OptionValue::Number(f64::from(quality)));
    let bytes = Bytes::default();
    let mut sink = exporter.begin(&info, Box::new(bytes.clone()))?;
    sink.frame(frame)?;
    // The head of the file is known only at the end.
    let mut file = sink.finish()?;
    file.append(&mut bytes.0.lock().unwrap_or_else(PoisonError::into_inner));
    Ok(file)
}
