//! OpenTimelineIO, schemas `Timeline.1`, `Track.1`, `Clip.2`, `Transition.1`. Times are whole frames at the scene's rate.

use crate::shots::{Shot, frame_count, shots};
use crate::srt::{Title, titles};
use choreo_plugin::ExportedScene;
use choreo_plugin::motion::Time;
use choreo_plugin::stage::{Actor, Cue, Layer};
use serde_json::{Value, json};

/// Builds OTIO objects whose times have the scene's rate.
struct Objects {
    rate: f64,
}

impl Objects {
    fn time(&self, frames: f64) -> Value {
        json!({ "OTIO_SCHEMA": "RationalTime.1", "rate": self.rate, "value": frames })
    }

    fn range(&self, from: f64, length: f64) -> Value {
        let (start, duration) = (self.time(from), self.time(length));
        json!({ "OTIO_SCHEMA": "TimeRange.1", "start_time": start, "duration": duration })
    }

    fn track(&self, name: &str, kind: &str, children: Vec<Value>) -> Value {
        let mut track = schema_item("Track.1", name);
        track["kind"] = kind.into();
        track["children"] = children.into();
        track
    }

    fn gap(&self, frames: i64) -> Value {
        let mut gap = schema_item("Gap.1", "");
        gap["source_range"] = self.range(0.0, frames as f64);
        gap
    }

    /// A clip of `length` frames of a medium, beginning at frame `from`.
    fn clip(&self, name: &str, from: f64, length: f64, media: Value) -> Value {
        let mut clip = schema_item("Clip.2", name);
        clip["source_range"] = self.range(from, length);
        clip["media_references"] = json!({ "DEFAULT_MEDIA": media });
        clip["active_media_reference_key"] = "DEFAULT_MEDIA".into();
        clip
    }

    /// A dissolve that begins at the boundary of two clips and ends in the second.
    fn dissolve(&self, frames: i64) -> Value {
        json!({
            "OTIO_SCHEMA": "Transition.1", "name": "", "metadata": {},
            "in_offset": self.time(0.0), "out_offset": self.time(frames as f64),
            "transition_type": "SMPTE_Dissolve",
        })
    }
}

/// An item with the members that all items have.
fn schema_item(schema: &str, name: &str) -> Value {
    json!({
        "OTIO_SCHEMA": schema, "name": name, "metadata": {}, "source_range": null,
        "effects": [], "markers": [], "enabled": true,
    })
}

/// A media reference without a file.
fn missing_media(name: &str) -> Value {
    json!({ "OTIO_SCHEMA": "MissingReference.1", "name": name, "metadata": {}, "available_range": null })
}

/// The scene as a timeline: a track of shots, tracks of titles, and a track for each animation layer of each actor.
pub(crate) fn timeline(scene: &ExportedScene, media: &str) -> Value {
    let make = Objects { rate: scene.fps.as_fps() };
    let mut tracks = vec![shots_track(&make, scene, media)];
    for (index, lane) in non_overlapping_lanes(titles(scene)).iter().enumerate() {
        let name = if index == 0 { "titles".to_string() } else { format!("titles {}", index + 1) };
        tracks.push(make.track(&name, "Titles", title_clips(&make, scene, lane)));
    }
    for actor in &scene.stage.actors {
        for (index, layer) in actor.layers.iter().enumerate().filter(|(_, layer)| !layer.cues.is_empty()) {
            let name = match index {
                0 => actor.name.clone(),
                _ => format!("{}, layer {index}", actor.name),
            };
            tracks.push(make.track(&name, "Animation", cue_clips(&make, scene, (actor, layer))));
        }
    }
    let mut stack = schema_item("Stack.1", "tracks");
    stack["children"] = tracks.into();
    stack["markers"] = markers(&make, scene).into();
    let provenance: serde_json::Map<String, Value> =
        scene.provenance.iter().map(|(key, text)| (key.clone(), text.as_str().into())).collect();
    json!({
        "OTIO_SCHEMA": "Timeline.1", "name": scene.name, "metadata": { "choreo": provenance },
        "global_start_time": null, "tracks": stack,
    })
}

/// The track of shots. They are parts of the rendered video, which contains the dissolves already, so a dissolve between two clips
/// changes no image; it keeps the length for `cuts`.
fn shots_track(make: &Objects, scene: &ExportedScene, media: &str) -> Value {
    let video = json!({
        "OTIO_SCHEMA": "ExternalReference.1", "name": media, "metadata": {}, "target_url": media,
        "available_range": make.range(0.0, frame_count(scene) as f64),
    });
    let mut children = Vec::new();
    for Shot { camera, frames: (from, to), dissolve } in shots(scene) {
        if dissolve > 0 {
            children.push(make.dissolve(dissolve));
        }
        children.push(make.clip(&camera, from as f64, (to - from) as f64, video.clone()));
    }
    make.track("shots", "Video", children)
}

/// The markers by time, without duration.
fn markers(make: &Objects, scene: &ExportedScene) -> Vec<Value> {
    let mut markers: Vec<&(String, Time)> = scene.stage.markers.iter().collect();
    markers.sort_by_key(|(_, time)| *time);
    let marker = |(name, time): &(String, Time)| {
        json!({
            "OTIO_SCHEMA": "Marker.2", "name": name, "metadata": {}, "color": "GREEN", "comment": "",
            "marked_range": make.range(time.as_secs() * make.rate, 0.0),
        })
    };
    markers.into_iter().map(marker).collect()
}

/// Distributes titles over rows so that none overlap in a row.
fn non_overlapping_lanes(titles: Vec<Title<'_>>) -> Vec<Vec<Title<'_>>> {
    let mut lanes: Vec<Vec<Title<'_>>> = Vec::new();
    for title in titles {
        let free = |lane: &&mut Vec<Title<'_>>| lane.last().is_none_or(|last| last.until <= title.from);
        match lanes.iter_mut().find(free) {
            Some(lane) => lane.push(title),
            None => lanes.push(vec![title]),
        }
    }
    lanes
}

fn title_clips(make: &Objects, scene: &ExportedScene, titles: &[Title<'_>]) -> Vec<Value> {
    let (mut children, mut end) = (Vec::new(), 0);
    for title in titles {
        let [from, to] = [title.from, title.until].map(|time| scene.fps.frames_in(time));
        if from.max(end) >= to {
            continue;
        }
        let from = from.max(end);
        if from > end {
            children.push(make.gap(from - end));
        }
        let text = json!({
            "OTIO_SCHEMA": "GeneratorReference.1", "name": "text", "metadata": {}, "available_range": null,
            "generator_kind": "text", "parameters": { "text": title.words },
        });
        children.push(make.clip(title.words, 0.0, (to - from) as f64, text));
        end = to;
    }
    children
}

/// The cues of a layer. A cue lasts until it ends or the next one begins; the next one's fade becomes a dissolve.
fn cue_clips(make: &Objects, scene: &ExportedScene, (actor, layer): (&Actor, &Layer)) -> Vec<Value> {
    let (mut children, mut end) = (Vec::new(), 0);
    for (index, cue) in layer.cues.iter().enumerate() {
        let next = layer.cues.get(index + 1).map_or(scene.stage.settings.length, |next| next.start);
        let from = scene.fps.frames_in(cue.start).max(end);
        let to = scene.fps.frames_in(cue.end.unwrap_or(next).min(next));
        if from >= to.min(frame_count(scene)) {
            continue;
        }
        let to = to.min(frame_count(scene));
        let fade = scene.fps.frames_in(cue.fade_in).min(to - from);
        if from > end {
            children.push(make.gap(from - end));
        } else if fade > 0 && index > 0 {
            children.push(make.dissolve(fade));
        }
        children.push(cue_clip(make, (from, to), cue, &actor.asset.name));
        end = to;
    }
    children
}

fn cue_clip(make: &Objects, (from, to): (i64, i64), cue: &Cue, asset: &str) -> Value {
    let first = if cue.speed < 0.0 { cue.trim.1 } else { cue.trim.0 };
    let mut clip =
        make.clip(&cue.clip.name, first.as_secs() * make.rate, (to - from) as f64, missing_media(asset));
    if cue.speed != 1.0 {
        clip["effects"] = json!([{
            "OTIO_SCHEMA": "LinearTimeWarp.1", "name": "", "metadata": {}, "effect_name": "LinearTimeWarp",
            "time_scalar": cue.speed,
        }]);
    }
    clip
}
