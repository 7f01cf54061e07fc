//! Methods that build a stage in Rust code, for tests and tools.

use crate::stage::Stage;
use crate::stage::actor::{Actor, LookAt, Placement, Target};
use crate::stage::camera::{Camera, Rig};
use crate::stage::clips::{Cue, Layer};
use choreo_asset::Asset;
use choreo_motion::Time;
use glam::{DQuat, DVec3};
use std::sync::Arc;

impl Stage {
    /// Adds an actor with this asset, at the origin and in its rest pose. Returns the index of the actor.
    pub fn cast(&mut self, name: &str, asset: Arc<Asset>) -> usize {
        self.actors.push(Actor::new(name, asset));
        self.actors.len() - 1
    }

    /// Adds a cue to the base layer of an actor, sorted by start time. Panics if there is no such actor.
    ///
    /// ```
    /// # use choreo_asset::*; use choreo_stage::*; use choreo_motion::{Clip, Time}; use std::sync::Arc;
    /// # let asset = Arc::new(Asset { clips: vec![Arc::new(Clip::new("Walk".into(), 0, vec![]).unwrap())], ..Asset::default() });
    /// let mut stage = Stage::default();
    /// let anna = stage.cast("anna", asset.clone());
    /// stage.play(anna, Cue::new(asset.clips[0].clone()));
    /// stage.play(anna, Cue {
    ///     start: Time::from_secs(2.0),
    ///     fade_in: Time::from_secs(0.5),
    ///     speed: 1.1,
    ///     ..Cue::new(asset.clips[0].clone())
    /// });
    /// assert!(stage.check().is_empty());
    /// ```
    pub fn play(&mut self, actor: usize, cue: Cue) {
        let layers = &mut self.actors[actor].layers;
        if layers.is_empty() {
            layers.push(Layer::default());
        }
        layers[0].add(cue);
    }

    /// Adds a camera and returns its index. If there are several cameras, [`Stage::cuts`] select the active one over time.
    pub fn shoot(&mut self, camera: Camera) -> usize {
        self.cameras.push(camera);
        self.cameras.len() - 1
    }

    /// The index of the first actor of that name.
    pub fn actor(&self, name: &str) -> Option<usize> {
        self.actors.iter().position(|a| a.name == name)
    }
}

impl Layer {
    /// Inserts a cue by its start time, after cues that start at the same time.
    pub fn add(&mut self, cue: Cue) {
        let place = self.cues.partition_point(|c| c.start <= cue.start);
        self.cues.insert(place, cue);
    }
}

impl LookAt {
    /// A look-at constraint from time zero on, without fades.
    pub fn new(joint: u32, target: Target) -> LookAt {
        LookAt { joint, target, start: Time::ZERO, end: None, fade: Time::ZERO, weight: 1.0 }
    }
}

impl Camera {
    /// A camera with the default projection: perspective, with a vertical field of view of 0.7 rad.
    pub fn new(name: &str, rig: Rig) -> Camera {
        Camera { name: name.to_string(), rig, ..Camera::default() }
    }
}

impl Placement {
    /// A placement at a position in metres, without rotation, at scale 1.
    pub fn at(x: f64, y: f64, z: f64) -> Placement {
        Placement { translation: DVec3::new(x, y, z), ..Placement::default() }
    }

    /// The placement rotated about the parent's +Y axis by an angle in radians, after its own rotation.
    pub fn turned(self, angle_rad: f64) -> Placement {
        Placement { rotation: DQuat::from_rotation_y(angle_rad) * self.rotation, ..self }
    }
}
