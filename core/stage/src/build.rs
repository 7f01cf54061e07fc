//! A stage from Rust: what tests and tools use, and the script does the same with.

use crate::stage::Stage;
use crate::stage::actor::{Actor, LookAt, Placement, Target};
use crate::stage::camera::{Camera, Rig};
use crate::stage::clips::{Cue, Layer};
use crate::stage::light::StageLight;
use crate::stage::springs::ActorSprings;
use choreo_asset::{Asset, Light, LightKind, Projection};
use choreo_motion::{Clip, Ease, Repeat, Skinning, Time};
use glam::{DQuat, DVec3, Vec3, Vec4};
use std::sync::Arc;

impl Stage {
    /// Puts an asset on stage, at the origin, at rest; the index of the new actor.
    pub fn cast(&mut self, name: &str, asset: Arc<Asset>) -> usize {
        self.actors.push(Actor::new(name, asset));
        self.actors.len() - 1
    }

    /// Adds a cue to the base layer of an actor, in its place by start time. Panics where there is no such actor.
    ///
    /// ```
    /// # use choreo_asset::*; use choreo_stage::*; use choreo_motion::{Clip, Ease, Repeat, Skinning, Time}; use std::sync::Arc;
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

    /// Adds a camera; its index. With several, [`Stage::cuts`] say which is on when.
    pub fn shoot(&mut self, camera: Camera) -> usize {
        self.cameras.push(camera);
        self.cameras.len() - 1
    }

    pub fn actor(&self, name: &str) -> Option<usize> {
        self.actors.iter().position(|a| a.name == name)
    }
}

impl Actor {
    /// At the origin, at rest; what swings in its file swings.
    pub fn new(name: &str, asset: Arc<Asset>) -> Actor {
        let springs = ActorSprings::of(&asset);
        Actor {
            name: name.to_string(),
            asset,
            transform: Placement::default(),
            parent: None,
            face: None,
            layers: Vec::new(),
            channels: Vec::new(),
            look_at: Vec::new(),
            goals: Vec::new(),
            limits: Vec::new(),
            springs,
            walk: None,
            visible: true,
            tint: Vec4::ONE,
            pen_width: None,
            copies: None,
            morphs: Vec::new(),
            expressions: Vec::new(),
            file_lights: true,
            skinning: Skinning::default(),
            surfaces: Vec::new(),
        }
    }
}

impl Layer {
    /// Adds a cue after those that start no later.
    pub fn add(&mut self, cue: Cue) {
        let place = self.cues.partition_point(|c| c.start <= cue.start);
        self.cues.insert(place, cue);
    }
}

impl Cue {
    /// All of a clip, looped from time zero on, without fades.
    pub fn new(clip: Arc<Clip>) -> Cue {
        Cue {
            start: Time::ZERO,
            end: None,
            fade_in: Time::ZERO,
            fade_out: Time::ZERO,
            ease: Ease::Linear,
            speed: 1.0,
            trim: (Time::ZERO, clip.duration),
            repeat: Repeat::Loop,
            weight: 1.0,
            weight_keys: None,
            warp: None,
            freezes: Vec::new(),
            in_step: [None, None],
            inertial: Time::ZERO,
            root: None,
            clip,
        }
    }
}

impl LookAt {
    /// From time zero on, without fades.
    pub fn new(joint: u32, target: Target) -> LookAt {
        LookAt { joint, target, start: Time::ZERO, end: None, fade: Time::ZERO, weight: 1.0 }
    }
}

impl Camera {
    /// Perspective, 0.7 rad high.
    pub fn new(name: &str, rig: Rig) -> Camera {
        Camera { name: name.to_string(), projection: Projection::default(), rig, channels: Vec::new() }
    }
}

impl StageLight {
    pub fn new(name: &str, light: Light) -> StageLight {
        StageLight {
            name: name.to_string(),
            light,
            position: DVec3::ZERO,
            direction: Vec3::NEG_Y,
            parent: None,
            channels: Vec::new(),
            shadow: None,
            attenuation: None,
        }
    }

    /// White, this many lux, along a direction (made unit).
    pub fn sun(name: &str, direction: Vec3, intensity: f32) -> StageLight {
        let light = Light { kind: LightKind::Directional, color: Vec3::ONE, intensity, range: None };
        StageLight { direction: direction.normalize_or(Vec3::NEG_Y), ..StageLight::new(name, light) }
    }

    /// White, this many candela.
    pub fn point(name: &str, position: DVec3, intensity: f32) -> StageLight {
        let light = Light { kind: LightKind::Point, color: Vec3::ONE, intensity, range: None };
        StageLight { position, ..StageLight::new(name, light) }
    }
}

impl Placement {
    pub fn at(x: f64, y: f64, z: f64) -> Placement {
        Placement { translation: DVec3::new(x, y, z), ..Placement::default() }
    }

    /// Turned about +Y before its own rotation.
    pub fn turned(self, angle_rad: f64) -> Placement {
        Placement { rotation: DQuat::from_rotation_y(angle_rad) * self.rotation, ..self }
    }
}
