//! Draws the window by Vulkan, or else on the CPU.

use super::gpu::Gpu;
use super::gpu_error::GpuError;
use super::software::{LARGEST_TEXTURE, Software};
use choreo_command_line::Device;
use choreo_plugin::Frame;
use egui::{ClippedPrimitive, TextureId, TexturesDelta};
use softbuffer::SoftBufferError;
use std::collections::BTreeMap;
use std::sync::Arc;
use winit::window::Window;

#[derive(Debug, thiserror::Error)]
pub(crate) enum PaintError {
    #[error(transparent)]
    Gpu(#[from] GpuError),
    #[error("cannot draw the window on the CPU: {0}")]
    Software(#[from] SoftBufferError),
    /// Neither Vulkan nor the CPU can draw the window.
    #[error("{gpu}; cannot draw the window on the CPU: {software}")]
    Neither { gpu: GpuError, software: SoftBufferError },
}

pub(crate) enum Painter {
    Vulkan(Box<Gpu>),
    Software(Box<Software>),
}

impl Painter {
    /// Also returns the reason if Vulkan was wanted but cannot draw the window.
    pub(super) fn new(
        window: &Arc<Window>,
        device: Device,
    ) -> Result<(Painter, Option<GpuError>), PaintError> {
        if device == Device::Cpu {
            return Ok((Painter::Software(Box::new(Software::new(window)?)), None));
        }
        let accepts_software = device == Device::Vulkan;
        match Gpu::new(window, accepts_software) {
            Ok(gpu) => Ok((Painter::Vulkan(Box::new(gpu)), None)),
            // Vulkan was requested by name, so there is no fallback.
            Err(gpu) if accepts_software => Err(gpu.into()),
            Err(gpu) => match Software::new(window) {
                Ok(software) => Ok((Painter::Software(Box::new(software)), Some(gpu))),
                Err(software) => Err(PaintError::Neither { gpu, software }),
            },
        }
    }

    /// Largest width or height of a texture, pixels.
    pub(crate) fn largest_texture(&self) -> usize {
        match self {
            Painter::Vulkan(gpu) => gpu.largest_texture(),
            Painter::Software(_) => LARGEST_TEXTURE,
        }
    }

    /// Texture with the last frame of each view, if it has one.
    pub(super) fn view_textures(&self) -> Vec<Option<TextureId>> {
        match self {
            Painter::Vulkan(gpu) => gpu.view_textures(),
            Painter::Software(software) => software.view_textures(),
        }
    }

    /// Draws one frame of the window. `frames`: new images of views; `before_present`: called directly before presenting. Returns whether the frame
    /// was drawn: a window without pixels, such as a minimized one, keeps its images waiting.
    pub(super) fn draw(
        &mut self,
        window: [u32; 2],
        primitives: &[ClippedPrimitive],
        pixels_per_point: f32,
        textures: TexturesDelta,
        frames: &BTreeMap<usize, Frame>,
        before_present: impl FnOnce(),
    ) -> Result<bool, PaintError> {
        match self {
            Painter::Vulkan(gpu) => {
                Ok(gpu.draw(window, primitives, pixels_per_point, textures, frames, before_present)?)
            }
            Painter::Software(software) => {
                Ok(software.draw(window, primitives, pixels_per_point, textures, frames, before_present)?)
            }
        }
    }
}
