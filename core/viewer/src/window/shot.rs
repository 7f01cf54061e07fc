//! A viewport's image as a file, whole or not at all.

use choreo_files::PartFile;
use choreo_plugin::{Frame, Registry, VideoInfo};
use std::path::Path;

pub fn save(
    plugins: &Registry,
    frame: &Frame,
    fps: choreo_motion::FrameRate,
    file: &Path,
) -> Result<(), String> {
    let shown = file.display();
    let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let exporter =
        plugins.exporter_for(&name).ok_or_else(|| format!("{shown}: no exporter writes such files"))?;
    let info = VideoInfo {
        width: frame.width,
        height: frame.height,
        fps,
        frames: 1,
        provenance: Vec::new(),
        options: Default::default(),
    };
    let write = || -> Result<(), String> {
        let part = PartFile::create(file).map_err(|e| e.to_string())?;
        let out = part.writer().map_err(|e| e.to_string())?;
        let mut sink = exporter.begin(&info, Box::new(out)).map_err(|e| e.to_string())?;
        sink.frame(frame).map_err(|e| e.to_string())?;
        sink.finish().map_err(|e| e.to_string())?;
        part.commit().map_err(|e| e.to_string())
    };
    write().map_err(|e| format!("{shown}: cannot write: {e}"))
}
