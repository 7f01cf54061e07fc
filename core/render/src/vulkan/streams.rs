//! Streamed textures, which stay on the device only while recent frames show them.

use super::context::Context;
use super::resources::{Resources, TextureKey, texture_key};
use crate::commands::{Command, Recording};
use crate::scene_resources::SceneResources;

/// Number of frames for which an unused texture is kept: more than can be in flight, sub-frames included.
const KEPT_FRAMES: u64 = 8;

#[derive(Default)]
pub(super) struct Streams {
    frame: u64,
    /// Texture, material that shows it, and number of the frame that used it last.
    used: Vec<(TextureKey, [u8; 16], u64)>,
}

impl Resources {
    /// Counts a frame and drops textures that have not been used recently. Call it after the frame's resources are prepared.
    pub(super) fn drop_unused_textures(
        &mut self,
        gpu: &Context,
        scene_resources: &SceneResources,
        recording: &Recording,
    ) {
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
        let old = |used: u64| used + KEPT_FRAMES < frame;
        let gone: Vec<_> = self.streams.used.iter().filter(|(.., used)| old(*used)).copied().collect();
        self.streams.used.retain(|(.., used)| !old(*used));
        for (key, hash, _) in gone {
            self.forget_material(gpu, hash);
            if !self.streams.used.iter().any(|(k, ..)| *k == key) {
                self.forget_texture(gpu, &key);
            }
        }
    }

    /// Drops the records of textures that new scene resources do not contain; the textures have been destroyed already.
    pub(super) fn keep_streams(&mut self, held: impl Fn(&TextureKey) -> bool) {
        self.streams.used.retain(|(key, ..)| held(key));
    }
}
