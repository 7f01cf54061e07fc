//! A scene for exporters in WebAssembly: actors with their assets, cameras, times and options at the start, snapshots when they are asked
//! for. The program evaluates them, because cues, constraints and callbacks of scripts stay with it.

use super::{Bytes, Result, Transfer, Written, fields, to_bytes};
use crate::{ExportOptions, ExportedScene};
use choreo_asset::Asset;
use choreo_motion::{FrameRate, Time};
use choreo_stage::{ActorState, Camera, CameraState, LightState, Snapshot, Stage};
use std::sync::Arc;

/// The parts of a scene that an exporter in WebAssembly gets.
#[derive(Debug)]
pub struct TransferredScene {
    name: String,
    stem: String,
    extension: String,
    fps: FrameRate,
    times: Vec<Time>,
    provenance: Vec<(String, String)>,
    options: ExportOptions,
    size: [u32; 2],
    stage_fps: FrameRate,
    length: Time,
    /// The assets of the actors, each once.
    assets: Vec<Arc<Asset>>,
    /// Name, and index into the assets.
    actors: Vec<(String, usize)>,
    cameras: Vec<String>,
}

/// Error: an actor of the scene has no asset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoAsset {
    /// The actor's name.
    pub actor: String,
}

choreo_motion::error_texts! { NoAsset:
    Self { actor, .. } => "actor \"{actor}\" has no asset";
}

impl TransferredScene {
    /// The parts of a scene.
    pub fn new(scene: &ExportedScene) -> TransferredScene {
        let stage = &scene.stage;
        let mut assets: Vec<Arc<Asset>> = Vec::new();
        let mut index = |asset: &Arc<Asset>| {
            assets.iter().position(|known| Arc::ptr_eq(known, asset)).unwrap_or_else(|| {
                assets.push(asset.clone());
                assets.len() - 1
            })
        };
        let actors = stage.actors.iter().map(|actor| (actor.name.clone(), index(&actor.asset))).collect();
        TransferredScene {
            name: scene.name.clone(),
            stem: scene.stem.clone(),
            extension: scene.extension.clone(),
            fps: scene.fps,
            times: scene.times.clone(),
            provenance: scene.provenance.clone(),
            options: scene.options.clone(),
            size: stage.settings.size,
            stage_fps: stage.settings.fps,
            length: stage.settings.length,
            assets,
            actors,
            cameras: stage.cameras.iter().map(|camera| camera.name.clone()).collect(),
        }
    }

    /// A scene whose stage has only these parts. `snapshots` returns the state at a time.
    ///
    /// # Errors
    /// An actor without an asset.
    pub fn into_scene(self, snapshots: fn(Time) -> Snapshot) -> std::result::Result<ExportedScene, NoAsset> {
        let mut stage = Stage::default();
        stage.settings.size = self.size;
        stage.settings.fps = self.stage_fps;
        stage.settings.length = self.length;
        for (name, asset) in self.actors {
            let asset = self.assets.get(asset).ok_or_else(|| NoAsset { actor: name.clone() })?;
            stage.cast(&name, asset.clone());
        }
        let camera = |name: String| Camera { name, ..Camera::default() };
        stage.cameras.extend(self.cameras.into_iter().map(camera));
        Ok(ExportedScene {
            name: self.name,
            stem: self.stem,
            extension: self.extension,
            stage: Arc::new(stage),
            fps: self.fps,
            times: self.times,
            provenance: self.provenance,
            options: self.options,
            snapshots: Some(snapshots),
        })
    }
}

/// The bytes of a snapshot; it is read with [`super::from_bytes`].
pub fn snapshot_bytes(snapshot: &Snapshot) -> Vec<u8> {
    to_bytes(snapshot)
}

fields! {
    TransferredScene {
        name, stem, extension, fps, times, provenance, options, size, stage_fps, length, assets, actors, cameras,
    }
    FrameRate { num, den }
    Snapshot {
        time, actors, camera, lights;
        without dissolve, sky, layers_2d, background, ambient_up, ambient_down, effects
    }
    ActorState {
        visible, world_from_model, world_from_parent, model_from_joint, morph_weights, tint, line_width, copies, base_colors, culled;
        without skinning, materials
    }
    CameraState { camera, world_from_view, projection }
    LightState { light, position, direction, attenuation; without shadow }
}
