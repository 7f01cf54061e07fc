//! The edit of a scene for editing programs: shots between cuts, cues, markers and titles as OpenTimelineIO, shots as an EDL
//! (CMX 3600), titles as subtitles (SubRip).

mod edl;
mod otio;
mod shots;
mod srt;

use choreo_plugin::{ExportError, ExportedScene, Manifest, SceneExporter, SceneFiles};
use std::sync::LazyLock;

static OTIO: LazyLock<Manifest> = LazyLock::new(|| {
    let about = "OpenTimelineIO: shots, cues, markers and titles";
    Manifest::new("otio", env!("CARGO_PKG_VERSION"), about).extensions(["otio"]).text("media", MEDIA, "", &[])
});
static EDL: LazyLock<Manifest> = LazyLock::new(|| {
    let about = "edit decision list (CMX 3600): shots and dissolves";
    Manifest::new("edl", env!("CARGO_PKG_VERSION"), about).extensions(["edl"]).text("media", MEDIA, "", &[])
});
static SRT: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("srt", env!("CARGO_PKG_VERSION"), "titles as subtitles (SubRip)").extensions(["srt"])
});
const MEDIA: &str = "file name of the rendered video; by default that of the output with .mp4";

/// Writes OpenTimelineIO, which `cuts` in a script reads back.
#[derive(Clone, Copy, Debug, Default)]
pub struct OtioExporter;

/// Writes an edit decision list.
#[derive(Clone, Copy, Debug, Default)]
pub struct EdlExporter;

/// Writes titles as subtitles.
#[derive(Clone, Copy, Debug, Default)]
pub struct SrtExporter;

impl SceneExporter for OtioExporter {
    fn manifest(&self) -> &Manifest {
        &OTIO
    }

    fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
        whole(scene)?;
        let timeline = otio::timeline(scene, &media(scene));
        serde_json::to_writer_pretty(files.main(), &timeline).map_err(std::io::Error::from)?;
        Ok(Vec::new())
    }
}

impl SceneExporter for EdlExporter {
    fn manifest(&self) -> &Manifest {
        &EDL
    }

    fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
        whole(scene)?;
        edl::write(scene, &media(scene), files.main())?;
        Ok(vec!["the format has no cues, markers and titles; .otio has them".into()])
    }
}

impl SceneExporter for SrtExporter {
    fn manifest(&self) -> &Manifest {
        &SRT
    }

    fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
        whole(scene)?;
        srt::write(scene, files.main())?;
        Ok(Vec::new())
    }
}

/// # Errors
/// Only some frames are exported: an edit is of the whole scene.
fn whole(scene: &ExportedScene) -> Result<(), ExportError> {
    match scene.times.len() as i64 == shots::total(scene) {
        true => Ok(()),
        false => Err(ExportError::Format("an edit is of the whole scene; leave --frames out".into())),
    }
}

/// Name of the video that the shots are parts of.
fn media(scene: &ExportedScene) -> String {
    match scene.options.text("media").unwrap_or_default() {
        "" => format!("{}.mp4", scene.stem),
        given => given.to_string(),
    }
}
