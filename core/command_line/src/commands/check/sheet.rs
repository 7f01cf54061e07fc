//! Cue sheet of a stage: cues of all actors over time, active cameras, and marks where something was found.

use choreo_bench::plots::{Bar, Mark, Timeline, Track};
use choreo_motion::Time;
use choreo_stage::{Cue, Layer, Stage, Subject};

/// Largest number of actors in the chart: a crowd would make it too tall.
const MAX_ACTORS: usize = 60;
const COLORS: [&str; 8] =
    ["#2b6cb0", "#2f855a", "#b7791f", "#6b46c1", "#b83280", "#2c7a7b", "#c05621", "#4a5568"];

pub(super) fn cue_sheet(name: &str, stage: &Stage, marks: &[(Subject, Time, &'static str)]) -> Timeline {
    let length = stage.settings.length;
    let marks_of = |wanted: &dyn Fn(&Subject) -> bool| -> Vec<Mark> {
        let found = marks.iter().filter(|(subject, ..)| wanted(subject));
        found.map(|(_, at, rule)| Mark { at: at.as_secs(), label: rule.replace('_', " ") }).collect()
    };
    let mut tracks = vec![Track {
        name: "camera".into(),
        bars: camera_bars(stage),
        marks: marks_of(&|s| matches!(s, Subject::Camera(_) | Subject::Cut(_) | Subject::Stage)),
    }];
    let mut clips: Vec<&str> = Vec::new();
    for (index, actor) in stage.actors.iter().enumerate() {
        let marks = marks_of(&|s| match s {
            Subject::Actor(a) => *a == index,
            Subject::Look { actor, .. } | Subject::Constraint { actor, .. } => *actor == index,
            _ => false,
        });
        let plays = actor.layers.iter().any(|l| !l.cues.is_empty());
        // Props without cues would hide actors with cues.
        if tracks.len() > MAX_ACTORS || (!plays && marks.is_empty()) {
            continue;
        }
        let mut marks = Some(marks);
        for (number, layer) in actor.layers.iter().enumerate() {
            let name = if number == 0 { actor.name.clone() } else { format!("{} +{number}", actor.name) };
            let bars = cue_bars(layer, length, &mut clips);
            tracks.push(Track { name, bars, marks: marks.take().unwrap_or_default() });
        }
        if let Some(marks) = marks {
            tracks.push(Track { name: actor.name.clone(), bars: Vec::new(), marks });
        }
    }
    let lights = marks_of(&|s| matches!(s, Subject::Light(_)));
    if !lights.is_empty() {
        tracks.push(Track { name: "lights".into(), bars: Vec::new(), marks: lights });
    }
    if !stage.effects.is_empty() {
        let bar = |e: &choreo_stage::EffectUse| Bar {
            label: e.plugin.clone(),
            start: e.start.as_secs(),
            end: e.end.unwrap_or(length).as_secs(),
            fade: 0.0,
            color: COLORS[7],
        };
        let marks = marks_of(&|s| matches!(s, Subject::Effect(_)));
        tracks.push(Track { name: "effects".into(), bars: stage.effects.iter().map(bar).collect(), marks });
    }
    Timeline { title: name.to_string(), length: length.as_secs(), tracks }
}

fn camera_bars(stage: &Stage) -> Vec<Bar> {
    let starts = std::iter::once((Time::ZERO, 0)).chain(stage.cuts.iter().map(|c| (c.at, c.camera)));
    let ends = stage.cuts.iter().map(|c| c.at).chain([stage.settings.length]);
    let bar = |((start, camera), end): ((Time, usize), Time)| Bar {
        label: stage.cameras.get(camera).map_or("everything", |c| c.name.as_str()).to_string(),
        start: start.as_secs(),
        end: end.as_secs(),
        fade: 0.0,
        color: COLORS[camera % COLORS.len()],
    };
    starts.zip(ends).map(bar).collect()
}

/// Bars of the cues of a layer. Each clip has its own color, the same on every track.
fn cue_bars<'a>(layer: &'a Layer, length: Time, clips: &mut Vec<&'a str>) -> Vec<Bar> {
    let bar = |(index, cue): (usize, &'a Cue)| {
        let next = layer.cues.get(index + 1).map(|n| n.start);
        let end = cue.end.unwrap_or(length).min(next.unwrap_or(length));
        let color = clips.iter().position(|c| *c == cue.clip.name).unwrap_or_else(|| {
            clips.push(&cue.clip.name);
            clips.len() - 1
        });
        Bar {
            label: cue.clip.name.clone(),
            start: cue.start.max(Time::ZERO).as_secs(),
            end: end.as_secs(),
            fade: cue.fade_in.as_secs(),
            color: COLORS[color % COLORS.len()],
        }
    };
    layer.cues.iter().enumerate().map(bar).collect()
}
