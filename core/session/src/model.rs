//! Stages for model files that are opened without a script.

use choreo_asset::{Aabb, Asset};
use choreo_motion::{Clip, Time};
use choreo_script::{BUILT_IN, did_you_mean};
use choreo_stage::{Cue, Repeat, Stage};
use std::path::Path;
use std::sync::Arc;

/// The file has no clip with this name; the message lists its clips.
#[derive(Debug, thiserror::Error)]
#[error("{asset}: unknown clip \"{name}\"{known}")]
pub struct UnknownClip {
    asset: String,
    name: String,
    known: String,
}

/// A stage with the asset alone, with default framing and lights, that plays one clip once. `clip`: name of the clip; `None`: the first.
pub fn stage(asset: Arc<Asset>, clip: Option<&str>) -> Result<Stage, UnknownClip> {
    let clip = match clip {
        None => asset.clips.first().cloned(),
        Some(name) => Some(find_clip(&asset, name)?.clone()),
    };
    let mut stage = Stage::default();
    // The stage is one frame long if nothing moves.
    stage.settings.length = stage.settings.fps.time_of(1);
    add_actor(&mut stage, "model", asset, clip);
    Ok(stage)
}

/// A stage with the assets in a row along x, each playing its first clip once. The first stands at the origin; the gap to the next on its right is
/// a tenth of the larger width. Positions are rounded up to whole centimetres, so that a person can write them down.
pub fn side_by_side(assets: &[(String, Arc<Asset>)]) -> Stage {
    let mut stage = Stage::default();
    stage.settings.length = stage.settings.fps.time_of(1);
    // Right edge and width of the previous asset, metres.
    let mut before: Option<(f64, f64)> = None;
    for (name, asset) in assets {
        let taken = |name: &str| stage.actors.iter().any(|a| a.name == name);
        let mut free = (1..).map(|n| if n == 1 { name.clone() } else { format!("{name} {n}") });
        let name = free.find(|name| !taken(name)).unwrap_or_default();
        let actor = add_actor(&mut stage, &name, asset.clone(), asset.clips.first().cloned());
        let bounds = bounds(asset);
        let (left, right) = (f64::from(bounds.min.x), f64::from(bounds.max.x));
        let width = right - left;
        // Rounds up, but ignores rounding errors.
        let whole = |metres: f64| (metres * 100.0 - 1e-6).ceil() / 100.0;
        let x = before.map_or(0.0, |(end, other)| whole(end + width.max(other) * 0.1 - left));
        stage.actors[actor].transform.translation.x = x;
        before = Some((x + right, width));
    }
    stage
}

/// Adds an actor and returns its index. The stage becomes as long as the longest clip.
fn add_actor(stage: &mut Stage, name: &str, asset: Arc<Asset>, clip: Option<Arc<Clip>>) -> usize {
    let actor = stage.cast(name, asset);
    stage.use_ambient_light_of_files();
    if let Some(clip) = clip {
        if clip.duration > Time::ZERO {
            let others = if actor == 0 { Time::ZERO } else { stage.settings.length };
            stage.settings.length = others.max(clip.duration);
        }
        stage.play(actor, Cue { repeat: Repeat::Once, ..Cue::new(clip) });
    }
    actor
}

/// Bounds of the mesh in the rest pose, or of the joints if there is no mesh.
fn bounds(asset: &Asset) -> Aabb {
    let bounds = asset.rest_bounds();
    if !bounds.is_empty() {
        return bounds;
    }
    let joints = Aabb::of(asset.rest_model_from_joint().iter().map(|j| j.translation.into()));
    if joints.is_empty() { Aabb::of([Default::default()]) } else { joints }
}

/// Whether the input is built in ("choreo:mannequin") and not a file.
pub fn is_built_in(path: &Path) -> bool {
    path.to_str().is_some_and(|p| p.starts_with(BUILT_IN))
}

/// File name without its extension.
pub fn name(path: &Path) -> String {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}

fn find_clip<'a>(asset: &'a Asset, name: &str) -> Result<&'a Arc<Clip>, UnknownClip> {
    let names = || asset.clips.iter().map(|c| c.name.as_str());
    asset.clips.iter().find(|c| c.name == name).ok_or_else(|| {
        let known = match asset.clips.is_empty() {
            true => "; the file has no clips".to_string(),
            false => format!("{}\n    hint: clips: {}", did_you_mean(name, names()), list(names(), 100)),
        };
        UnknownClip { asset: asset.name.clone(), name: name.to_string(), known }
    })
}

/// `a, b, c` of at most `max_names` names, then how many more.
pub fn list<'a>(names: impl Iterator<Item = &'a str> + Clone, max_names: usize) -> String {
    let shown: Vec<&str> = names.clone().take(max_names).collect();
    match names.count() - shown.len() {
        0 => shown.join(", "),
        more => format!("{}, and {more} more", shown.join(", ")),
    }
}
