//! Draws the window without Vulkan: egui's triangles are rasterized and handed to the window system. It uses the window's thread and its own helper
//! threads, because the thread pool may be busy with a frame of the scene for a second.

use super::raster::{self, Texture, Textures};
use choreo_plugin::Frame;
use egui::{ClippedPrimitive, TextureId, TexturesDelta};
use softbuffer::{Context, SoftBufferError, Surface};
use std::collections::BTreeMap;
use std::num::NonZeroU32;
use std::sync::Arc;
use winit::window::Window;

/// Largest width or height of a texture, pixels: that of egui's font atlas.
pub(crate) const LARGEST_TEXTURE: usize = 4096;

pub(super) struct Software {
    surface: Surface<Arc<Window>, Arc<Window>>,
    textures: Textures,
    /// Texture with the last frame of each view, if it has one.
    view_textures: Vec<Option<TextureId>>,
}

impl Software {
    pub(super) fn new(window: &Arc<Window>) -> Result<Software, SoftBufferError> {
        let surface = Surface::new(&Context::new(window.clone())?, window.clone())?;
        let view_textures = vec![None; crate::state::view::MAX_VIEWS];
        Ok(Software { surface, textures: Textures::default(), view_textures })
    }

    pub(super) fn view_textures(&self) -> Vec<Option<TextureId>> {
        self.view_textures.clone()
    }

    /// Draws one frame of the window, like [`super::gpu::Gpu::draw`].
    pub(super) fn draw(
        &mut self,
        size: [u32; 2],
        primitives: &[ClippedPrimitive],
        pixels_per_point: f32,
        mut textures: TexturesDelta,
        frames: &BTreeMap<usize, Frame>,
        before_present: impl FnOnce(),
    ) -> Result<bool, SoftBufferError> {
        self.textures.apply_changes(&mut textures);
        for (view, frame) in frames {
            let id = TextureId::User(*view as u64);
            let texture = |old| Texture::opaque(old, frame.width, frame.height, &frame.rgba);
            self.textures.insert(id, texture);
            if let Some(view_texture) = self.view_textures.get_mut(*view) {
                *view_texture = Some(id);
            }
        }
        let drawn = self.present(size, primitives, pixels_per_point, before_present);
        self.textures.free(&mut textures);
        drawn
    }

    fn present(
        &mut self,
        [width, height]: [u32; 2],
        primitives: &[ClippedPrimitive],
        pixels_per_point: f32,
        before_present: impl FnOnce(),
    ) -> Result<bool, SoftBufferError> {
        let (Some(w), Some(h)) = (NonZeroU32::new(width), NonZeroU32::new(height)) else { return Ok(false) };
        self.surface.resize(w, h)?;
        let mut pixels = self.surface.buffer_mut()?;
        pixels.fill(0);
        raster::draw(&mut pixels, width as usize, primitives, pixels_per_point, &self.textures);
        before_present();
        pixels.present()?;
        Ok(true)
    }
}
