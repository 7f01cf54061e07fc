//! The edit of a scene, for editing programs: shots, cues, markers and titles as OpenTimelineIO; shots as an EDL (CMX 3600);
//! titles as subtitles (SubRip).

mod edl;
mod otio;
mod shots;
mod srt;

use choreo_plugin::{ExportError, ExportedScene, Manifest, SceneExporter, SceneFiles};
use std::sync::LazyLock;

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    let about =
        "the edit: shots, cues, markers and titles as OpenTimelineIO, shots as EDL, titles as subtitles";
    let media = "file name of the rendered video; by default the name of the output with .mp4";
    let texts = "for .srt: only the texts at the position of subtitles, or all texts";
    let manifest = Manifest::new("edit", env!("CARGO_PKG_VERSION"), about).extensions(["otio", "edl", "srt"]);
    manifest.text("media", media, "", &[]).text("texts", texts, "subtitles", &["subtitles", "all"])
});

/// Writes OpenTimelineIO, which `cuts` in a script reads back; an edit decision list for `.edl`; subtitles for `.srt`.
#[derive(Clone, Copy, Debug, Default)]
pub struct EditExporter;

impl SceneExporter for EditExporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
        check_all_frames(scene)?;
        match scene.extension.as_str() {
            "edl" => {
                edl::write(scene, &media(scene), files.main())?;
                return Ok(vec!["the format has no cues, markers and titles; .otio has them".into()]);
            }
            "srt" => {
                let all = scene.options.text("texts") == Some("all");
                let left = srt::write(scene, all, files.main())?;
                let plural = if left == 1 {
                    "1 text is left out, as it is not a subtitle".into()
                } else {
                    format!("{left} texts are left out, as they are not subtitles")
                };
                let why = "at the top or a side, behind the scene, or visible all the time";
                let note = format!("{plural}: {why}; --export texts=all writes all texts");
                return Ok(if left > 0 { vec![note] } else { Vec::new() });
            }
            _ => {
                let timeline = otio::timeline(scene, &media(scene));
                serde_json::to_writer_pretty(files.main(), &timeline).map_err(std::io::Error::from)?;
            }
        }
        Ok(Vec::new())
    }
}

/// Checks that all frames of the scene are exported.
///
/// # Errors
/// Only some frames are exported.
fn check_all_frames(scene: &ExportedScene) -> Result<(), ExportError> {
    match scene.times.len() as i64 == shots::frame_count(scene) {
        true => Ok(()),
        false => Err(ExportError::Format("an edit holds the whole scene; remove --frames".into())),
    }
}

/// File name of the video that the shots are parts of.
fn media(scene: &ExportedScene) -> String {
    match scene.options.text("media").unwrap_or_default() {
        "" => format!("{}.mp4", scene.stem),
        given => given.to_string(),
    }
}
