//! Textures of effects on the device, created when a frame first requests one.

use super::VulkanRenderer;
use super::memory::Buffer;
use crate::commands::{Command, Recording};
use crate::error::RenderError;
use crate::shader::texture_bytes;
use ash::vk;
use choreo_plugin::Effect;
use gpu_allocator::MemoryLocation;

impl VulkanRenderer {
    /// Creates the buffer of effect textures, if the recording's effects have any.
    pub(super) fn prepare_texels(&mut self, recording: &Recording) -> Result<(), RenderError> {
        let effects = self.pipelines.effects();
        let has =
            |name: &String| effects.iter().any(|e| e.manifest().name == *name && !e.textures().is_empty());
        let in_post = recording.commands.iter().any(|command| match command {
            Command::PostPass { effect, .. } => has(effect),
            _ => false,
        });
        if self.texels.is_some()
            || !(in_post || recording.scene_effects.iter().any(|effect| has(&effect.name)))
        {
            return Ok(());
        }
        let bytes = texture_bytes(effects);
        let limit = u64::from(self.gpu.limits().max_storage_buffer_range);
        if bytes.len() as u64 > limit {
            let what = "size in bytes of all textures of effects".into();
            return Err(RenderError::Limit { what, value: bytes.len() as u64, limit });
        }
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER;
        let location = MemoryLocation::CpuToGpu;
        let mut buffer = Buffer::new(&self.gpu, "textures of effects", bytes.len() as u64, usage, location)?;
        buffer.mapped_mut()[..bytes.len()].copy_from_slice(&bytes);
        self.texels = Some(buffer);
        Ok(())
    }

    /// Destroys the buffer of effect textures if the new effects have different ones. No frame may be in flight.
    pub(super) fn forget_texels(&mut self, effects: &[Effect]) {
        let of = |all: &[Effect]| all.iter().flat_map(|e| e.textures().to_vec()).collect::<Vec<_>>();
        if self.texels.is_some()
            && of(self.pipelines.effects()) != of(effects)
            && let Some(mut old) = self.texels.take()
        {
            old.destroy(&self.gpu);
        }
    }
}
