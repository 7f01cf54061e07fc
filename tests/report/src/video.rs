//! Quality of encoded videos.

use crate::{Section, scenes};
use choreo_bench::moment::Moment;
use choreo_bench::scene::video::video;
use choreo_motion::Time;
use choreo_render::{CpuRenderer, Renderer};

pub(crate) fn section() -> Result<Section, String> {
    let registry = choreo::registry();
    let stage = scenes::stage_of_script("01_first_dance.rhai", &registry)?;
    let moment = Moment::new(&stage, Time::from_secs(5.0), registry.effects()).map_err(|e| e.to_string())?;
    let mut renderer = CpuRenderer::new(registry.effects());
    renderer.load(moment.resources.clone()).map_err(|e| e.to_string())?;
    let frame = moment.draw(&mut renderer, [1280, 720], 4).map_err(|e| e.to_string())?;
    let mut choice = video(&frame, &export_mp4::Mp4Exporter)?;
    choice.question =
        "At which quality is a frame written as MP4? (the first dance, 1280×720, its first image)".into();
    Ok(Section {
        title: "Video quality",
        text: "The last row is the loss of 4:2:0 alone: thin colored edges. From quality 65 on the encoder \
               adds less than that to the mean, and above 75 each further quarter of bytes gains less."
            .into(),
        choices: vec![choice],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}
