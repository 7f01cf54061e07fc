//! Subtitles (SubRip): the texts of 2D layers that stand where subtitles do.

use choreo_plugin::ExportedScene;
use choreo_plugin::motion::Time;
use choreo_plugin::stage::{Layer2d, Layer2dContent};
use std::io::Write;

/// Position of subtitles, as fractions of the frame: the lower third, and the middle half of the width. Speakers' names and
/// credits stand at the sides, titles higher.
const LOWER_THIRD_TOP: f64 = 2.0 / 3.0;
const SIDE_MARGIN: f64 = 0.25;

/// A text, and when it is shown.
pub(crate) struct Title<'a> {
    pub words: &'a str,
    pub from: Time,
    pub until: Time,
    /// Whether the text is a subtitle: placed like one, in front of the scene, and not shown all the time.
    pub is_subtitle: bool,
}

/// The texts of the scene by start time. Texts outside its length are left out.
pub(crate) fn titles(scene: &ExportedScene) -> Vec<Title<'_>> {
    let length = scene.stage.settings.length;
    let shown = |layer: &'_ Layer2d| (layer.start.max(Time::ZERO), layer.end.unwrap_or(length).min(length));
    let mut titles: Vec<Title<'_>> = Vec::new();
    for layer in &scene.stage.layers_2d {
        let (Layer2dContent::Text { words, .. }, (from, until)) = (&layer.content, shown(layer)) else {
            continue;
        };
        if from < until && !words.trim().is_empty() {
            let stays = (from, until) == (Time::ZERO, length);
            let place =
                layer.at.y >= LOWER_THIRD_TOP && (SIDE_MARGIN..=1.0 - SIDE_MARGIN).contains(&layer.at.x);
            titles.push(Title { words, from, until, is_subtitle: place && !stays && !layer.under });
        }
    }
    titles.sort_by_key(|title| title.from);
    titles
}

/// A time as `00:01:02,500`, rounded to milliseconds.
fn srt_time(time: Time) -> String {
    let millis = (time.as_secs() * 1000.0).round() as i64;
    let secs = millis / 1000;
    format!("{:02}:{:02}:{:02},{:03}", secs / 3600, secs / 60 % 60, secs % 60, millis % 1000)
}

/// Writes the subtitles, or `all` texts. Returns the number of texts left out.
pub(crate) fn write(scene: &ExportedScene, all: bool, out: &mut dyn Write) -> std::io::Result<usize> {
    let (subtitles, others): (Vec<_>, Vec<_>) =
        titles(scene).into_iter().partition(|title| all || title.is_subtitle);
    for (index, title) in subtitles.iter().enumerate() {
        // Empty lines are dropped, because one would end the subtitle.
        let lines: Vec<&str> = title.words.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        writeln!(out, "{}\n{} --> {}", index + 1, srt_time(title.from), srt_time(title.until))?;
        writeln!(out, "{}\n", lines.join("\n"))?;
    }
    Ok(others.len())
}
