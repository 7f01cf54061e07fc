//! Textures that are there only as long as frames show them.

use super::context::Context;
use super::resources::{Resources, TextureKey, texture_key};
use crate::commands::{Command, Recording};
use crate::scene_resources::SceneResources;

/// More than there are frames in flight, parts of an exposure included: what was last used that many frames ago is used no longer.
const KEPT: u64 = 8;

#[derive(Default)]
pub struct Streams {
    frame: u64,
    /// Texture, material that shows it, and when it was last used.
    used: Vec<(TextureKey, [u8; 16], u64)>,
}

impl Resources {
    /// After a frame's resources were prepared.
    pub(super) fn age(&mut self, gpu: &Context, scene_resources: &SceneResources, recording: &Recording) {
        self.streams.frame += 1;
        let frame = self.streams.frame;
        for command in &recording.commands {
            let Command::BindMaterial { material, .. } = command else { continue };
            for (_, texture) in scene_resources.streamed(*material) {
                let (key, hash) = (
                    texture_key(scene_resources, texture),
                    scene_resources.materials[*material as usize].hash,
                );
                match self.streams.used.iter_mut().find(|(k, h, _)| (*k, *h) == (key, hash)) {
                    Some((.., used)) => *used = frame,
                    None => self.streams.used.push((key, hash, frame)),
                }
            }
        }
        let old = |used: u64| used + KEPT < frame;
        let gone: Vec<_> = self.streams.used.iter().filter(|(.., used)| old(*used)).copied().collect();
        self.streams.used.retain(|(.., used)| !old(*used));
        for (key, hash, _) in gone {
            self.forget_material(gpu, hash);
            if !self.streams.used.iter().any(|(k, ..)| *k == key) {
                self.forget_texture(gpu, &key);
            }
        }
    }

    /// New scene resources: what they do not hold is gone already.
    pub(super) fn keep_streams(&mut self, held: impl Fn(&TextureKey) -> bool) {
        self.streams.used.retain(|(key, ..)| held(key));
    }
}
