//! Cuts from an edit list in OpenTimelineIO.

use crate::build::check_limit;
use crate::call::{ApiError, Call, Reply, api, unknown};
use choreo_motion::Time;
use choreo_stage::Cut;
use rhai::Dynamic;
use serde_json::Value;

api! {
    /// Cuts between cameras according to an edit list: an OpenTimelineIO file (.otio), in which the clips of the first
    /// video track are named as cameras of the script. Dissolves between clips are kept. An editing program changes the
    /// file that `choreo export` has written.
    cuts("file") -> () = cuts;
}

fn cuts(c: &mut Call) -> Reply {
    let name = c.text(0)?;
    let bytes = c.context.read_file(&name)?;
    let list =
        clips_of_timeline(&bytes).map_err(|e| ApiError::new(format!("cuts: \"{name}\" {e}")).focus(&name))?;
    let place = c.place.clone();
    let mut stage_draft = c.stage_draft();
    for clip in list {
        check_limit(stage_draft.cuts.len(), "cuts", &c.context.limits)?;
        let camera = stage_draft.cameras.iter().position(|camera| camera.camera.name == clip.name);
        let camera = camera.ok_or_else(|| {
            let known: Vec<&str> =
                stage_draft.cameras.iter().map(|camera| camera.camera.name.as_str()).collect();
            unknown("camera", &clip.name, &format!(" in \"{name}\""), known).focus(&name)
        })?;
        stage_draft.cuts.push((Cut { at: clip.at, camera, dissolve: clip.dissolve }, place.clone()));
    }
    drop(stage_draft);
    Ok(Dynamic::UNIT)
}

/// A clip of the edit list: camera name, time of the cut, and duration of the dissolve.
struct ListedClip {
    name: String,
    at: Time,
    dissolve: Time,
}

/// The error that an edit list cannot be read.
#[derive(Debug, thiserror::Error)]
enum CutListError {
    #[error("is not an OpenTimelineIO file: {0}")]
    Json(#[from] serde_json::Error),
    #[error("is not an OpenTimelineIO timeline")]
    NoTimeline,
    #[error("has no video track with clips")]
    NoClips,
    #[error("has no duration for item {0} of the video track")]
    NoDuration(usize),
}

/// The clips of the first track of kind "Video" that has clips.
fn clips_of_timeline(bytes: &[u8]) -> Result<Vec<ListedClip>, CutListError> {
    let timeline: Value = serde_json::from_slice(bytes)?;
    let has_schema = |value: &Value, name: &str| {
        value["OTIO_SCHEMA"].as_str().is_some_and(|s| s.split('.').next() == Some(name))
    };
    if !has_schema(&timeline, "Timeline") {
        return Err(CutListError::NoTimeline);
    }
    let tracks = timeline["tracks"]["children"].as_array().map_or(&[][..], Vec::as_slice);
    let children = |track: &Value| track["children"].as_array().cloned().unwrap_or_default();
    let track = tracks
        .iter()
        .filter(|track| track["kind"] == "Video")
        .map(children)
        .find(|children| children.iter().any(|child| has_schema(child, "Clip")))
        .ok_or(CutListError::NoClips)?;
    let (mut list, mut now, mut offsets) = (Vec::new(), 0.0, (0.0, 0.0));
    for (number, child) in track.iter().enumerate() {
        let no_duration = || CutListError::NoDuration(number + 1);
        if has_schema(child, "Transition") {
            let offset = |name: &str| seconds(&child[name]).ok_or_else(no_duration);
            offsets = (offset("in_offset")?, offset("out_offset")?);
            continue;
        }
        let media = child["active_media_reference_key"].as_str().unwrap_or("DEFAULT_MEDIA");
        let available = [&child["media_references"][media], &child["media_reference"]];
        let duration = seconds(&child["source_range"]["duration"])
            .or_else(|| available.iter().find_map(|media| seconds(&media["available_range"]["duration"])))
            .ok_or_else(no_duration)?;
        if has_schema(child, "Clip") {
            list.push(ListedClip {
                name: child["name"].as_str().unwrap_or_default().to_string(),
                at: Time::from_secs(f64::max(now - offsets.0, 0.0)),
                dissolve: Time::from_secs(offsets.0 + offsets.1),
            });
        }
        now += duration;
        offsets = (0.0, 0.0);
    }
    Ok(list)
}

/// Seconds of a `RationalTime`; `None` outside 0 to ten million.
fn seconds(time: &Value) -> Option<f64> {
    let (value, rate) = (time["value"].as_f64()?, time["rate"].as_f64()?);
    Some(value / rate).filter(|secs| (0.0..=1e7).contains(secs))
}
