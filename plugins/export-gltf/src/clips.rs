//! The actors' clips, retargeted and edited, as one animation each: for game engines, which have timelines of their own.

use crate::actors::{ActorNodes, Parts};
use crate::animations::{Builder, actor_channel, still_channels, weight_channels, write_set};
use choreo_exporter_kit::bake::{self, Baked, Style, check};
use choreo_plugin::motion::{Clip, RootMotion, RootParts, Time};
use choreo_plugin::stage::{Actor, Cue, CueRootMotion, Layer, Repeat, Stage, StageError};
use choreo_plugin::{ExportDeviation, ExportedScene};
use std::collections::BTreeSet;
use std::sync::Arc;

/// A scene in which one actor plays one clip.
pub(crate) struct ClipScene {
    /// Index of the actor in the stage.
    actor: usize,
    name: String,
    scene: ExportedScene,
}

/// The scene with all actors at rest, placed as at the start.
pub(crate) fn at_rest(scene: &ExportedScene) -> ExportedScene {
    let mut stage = Stage::clone(&scene.stage);
    stage.frame_callbacks = Vec::new();
    for actor in &mut stage.actors {
        *actor = Actor { parents: actor.parents.clone(), tint: actor.tint, ..without_motion(actor) };
    }
    let mut out = scene.clone();
    out.stage = Arc::new(stage);
    out.times.truncate(1);
    out
}

/// The actor without its layers, channels, springs and constraints.
fn without_motion(actor: &Actor) -> Actor {
    let (transform, skinning, file_lights) = (actor.transform, actor.skinning, actor.file_lights);
    let copies = actor.copies;
    Actor {
        transform,
        skinning,
        file_lights,
        copies,
        springs: None,
        ..Actor::new(&actor.name, actor.asset.clone())
    }
}

/// Each clip once for each asset that plays it. `root` is the root motion option: "clip" keeps it, "in_place" removes it,
/// "traveling" moves it to the actor's node.
pub(crate) fn of_stage(scene: &ExportedScene, root: &str) -> Vec<ClipScene> {
    let mut seen = BTreeSet::new();
    let mut names = BTreeSet::new();
    let mut out = Vec::new();
    for (index, actor) in scene.stage.actors.iter().enumerate() {
        for cue in actor.layers.iter().flat_map(|layer| &layer.cues) {
            let key = (Arc::as_ptr(&actor.asset) as usize, Arc::as_ptr(&cue.clip) as usize);
            let fits = cue.clip.joint_count() == actor.asset.skeleton.len() && cue.clip.duration > Time::ZERO;
            if !fits || !seen.insert(key) {
                continue;
            }
            let mut free = [cue.clip.name.clone(), format!("{} {}", actor.name, cue.clip.name)]
                .into_iter()
                .chain((2..).map(|n| format!("{} {} {n}", actor.name, cue.clip.name)));
            let name = free.find(|name| names.insert(name.clone())).unwrap_or_default();
            out.push(ClipScene { actor: index, name, scene: clip_scene(scene, actor, &cue.clip, root) });
        }
    }
    out
}

fn clip_scene(scene: &ExportedScene, actor: &Actor, clip: &Arc<Clip>, root: &str) -> ExportedScene {
    let whole = (Time::ZERO, clip.duration);
    let motion = (root != "clip")
        .then(|| RootMotion::new(&actor.asset.skeleton, clip, None, RootParts::default(), whole))
        .flatten();
    let carries = root == "traveling";
    let root = motion.map(|motion| Arc::new(CueRootMotion { motion, carries }));
    let cue = Cue { repeat: Repeat::Once, root, ..Cue::new(clip.clone()) };
    let mut stage = Stage::default();
    (stage.settings.fps, stage.settings.length) = (scene.fps, clip.duration);
    let layers = vec![Layer { cues: vec![cue], ..Layer::default() }];
    stage.actors.push(Actor { layers, ..without_motion(actor) });
    ExportedScene::new(&scene.name, Arc::new(stage))
}

/// Bakes all clips. Returns the largest error too, with its time in the clip.
pub(crate) fn bake<'a>(
    clips: &'a [ClipScene],
    tolerance: f64,
) -> Result<(Vec<Baked<'a>>, ExportDeviation), StageError> {
    let (mut out, mut worst) = (Vec::new(), ExportDeviation::default());
    for clip in clips {
        let baked = bake::bake(&clip.scene, tolerance, Style::Separate)?;
        let own = check::largest_deviation(&clip.scene, &baked, &check::SINGLE_SECONDS)?;
        if own.metres > worst.metres {
            worst = own;
        }
        out.push(baked);
    }
    Ok((out, worst))
}

/// Adds an animation for each clip.
pub(crate) fn add<'a>(
    parts: &mut Parts<'a>,
    clips: &'a [ClipScene],
    baked: Vec<Baked<'a>>,
    nodes: &[Option<ActorNodes>],
) {
    for (clip, mut baked) in clips.iter().zip(baked) {
        let Some(of) = &nodes[clip.actor] else { continue };
        let actor = &clip.scene.stage.actors[0];
        let mut builder = Builder::default();
        // Joints that this clip holds still may move in another one, so their pose gets a key.
        let still = baked.still_rig(actor, 0);
        still_channels(parts, &mut builder, of, actor.asset.skeleton.rest(), &still[1..]);
        for set in std::mem::take(&mut baked.sets) {
            for (joint, path, sampler) in write_set(parts, set, baked.start) {
                actor_channel(&mut builder, &actor.asset.instances, of, (joint, path), sampler);
            }
        }
        weight_channels(parts, &mut builder, &baked, 0, of);
        builder.finish(&clip.name, parts);
    }
}
