//! Subtitles (SubRip): one for each text of the 2D layers.

use choreo_plugin::ExportedScene;
use choreo_plugin::motion::Time;
use choreo_plugin::stage::{Layer2d, Layer2dContent};
use std::io::Write;

/// A text and when it is shown.
pub struct Title<'a> {
    pub words: &'a str,
    pub from: Time,
    pub until: Time,
}

/// The texts of the scene by start. Those outside its length are left out.
pub fn titles(scene: &ExportedScene) -> Vec<Title<'_>> {
    let length = scene.stage.settings.length;
    let shown = |layer: &'_ Layer2d| (layer.start.max(Time::ZERO), layer.end.unwrap_or(length).min(length));
    let mut titles: Vec<Title<'_>> = Vec::new();
    for layer in &scene.stage.layers_2d {
        let (Layer2dContent::Text { words, .. }, (from, until)) = (&layer.content, shown(layer)) else {
            continue;
        };
        if from < until && !words.trim().is_empty() {
            titles.push(Title { words, from, until });
        }
    }
    titles.sort_by_key(|title| title.from);
    titles
}

/// `00:01:02,500`, rounded to milliseconds.
fn stamp(time: Time) -> String {
    let millis = (time.as_secs() * 1000.0).round() as i64;
    let secs = millis / 1000;
    format!("{:02}:{:02}:{:02},{:03}", secs / 3600, secs / 60 % 60, secs % 60, millis % 1000)
}

pub fn write(scene: &ExportedScene, out: &mut dyn Write) -> std::io::Result<()> {
    for (index, title) in titles(scene).iter().enumerate() {
        // An empty line would end the subtitle.
        let lines: Vec<&str> = title.words.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        writeln!(out, "{}\n{} --> {}", index + 1, stamp(title.from), stamp(title.until))?;
        writeln!(out, "{}\n", lines.join("\n"))?;
    }
    Ok(())
}
