//! Saves the image of a viewport to a file, completely or not at all.

use super::error::SaveError;
use choreo_files::PartFile;
use choreo_plugin::{Frame, Registry, VideoInfo};
use std::path::Path;

pub(super) fn save_screenshot(
    plugins: &Registry,
    frame: &Frame,
    fps: choreo_motion::FrameRate,
    file: &Path,
) -> Result<(), SaveError> {
    let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let exporter = plugins.exporter_for(&name).ok_or(SaveError::NoExporter)?;
    let info = VideoInfo {
        width: frame.width,
        height: frame.height,
        fps,
        frames: 1,
        provenance: Vec::new(),
        options: Default::default(),
    };
    let part = PartFile::create(file)?;
    let mut sink = exporter.begin(&info, Box::new(part.writer()?))?;
    sink.frame(frame)?;
    sink.finish()?;
    Ok(part.commit()?)
}
