//! Errors of measuring a choice.

use choreo_image_diff::CompareError;
use choreo_plugin::ExportError;
use choreo_render::RenderError;
use choreo_stage::StageError;
use thiserror::Error;

/// An error of the scene, of a renderer or of a video.
#[derive(Debug, Error)]
pub enum BenchError {
    #[error(transparent)]
    Stage(#[from] StageError),
    #[error(transparent)]
    Render(#[from] RenderError),
    #[error(transparent)]
    Compare(#[from] CompareError),
    #[error(transparent)]
    Export(#[from] ExportError),
    #[error("H.264 decoder: {0}")]
    Decoder(#[from] openh264::Error),
    #[error("{0}")]
    Video(&'static str),
}

impl From<BenchError> for String {
    fn from(error: BenchError) -> String {
        error.to_string()
    }
}
