//! A model file in place of a script: put on a stage of its own.

use choreo_motion::{Clip, Time};
use choreo_script::did_you_mean;
use choreo_stage::{Asset, Cue, Repeat, Stage};
use std::sync::Arc;

/// The asset alone on stage, framed and lit by the stage's defaults, playing one clip once through.
///
/// # Errors
/// It has no clip of that name; the text says which it has.
pub fn stage(asset: Arc<Asset>, clip: Option<&str>) -> Result<Stage, String> {
    let clip = match clip {
        None => asset.clips.first().cloned(),
        Some(name) => Some(find_clip(&asset, name)?.clone()),
    };
    let mut stage = Stage::default();
    // Something that stands still is one picture.
    stage.settings.length = stage.settings.fps.time_of(1);
    let actor = stage.cast("model", asset);
    if let Some(clip) = clip {
        if clip.duration > Time::ZERO {
            stage.settings.length = clip.duration;
        }
        stage.play(actor, Cue { repeat: Repeat::Once, ..Cue::new(clip) });
    }
    Ok(stage)
}

fn find_clip<'a>(asset: &'a Asset, name: &str) -> Result<&'a Arc<Clip>, String> {
    let names = || asset.clips.iter().map(|c| c.name.as_str());
    if let Some(clip) = asset.clips.iter().find(|c| c.name == name) {
        return Ok(clip);
    }
    if asset.clips.is_empty() {
        return Err(format!("{}: unknown clip \"{name}\"; the file has no clips", asset.name));
    }
    Err(format!(
        "{}: unknown clip \"{name}\"{}\n    hint: clips: {}",
        asset.name,
        did_you_mean(name, names()),
        list(names(), 100)
    ))
}

/// `a, b, c` of at most `most` names, then how many more.
pub fn list<'a>(names: impl Iterator<Item = &'a str> + Clone, most: usize) -> String {
    let shown: Vec<&str> = names.clone().take(most).collect();
    match names.count() - shown.len() {
        0 => shown.join(", "),
        more => format!("{}, and {more} more", shown.join(", ")),
    }
}
