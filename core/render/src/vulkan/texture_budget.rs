//! The number of textures that a material may have on this device, and the textures that are left out of materials with more.

use super::VulkanRenderer;
use super::descriptors::images_beside_material;
use crate::commands::textures_beyond_limit;
use crate::scene_resources::material::MaterialResource;

impl VulkanRenderer {
    /// Largest number of textures of a material's shader on this device.
    pub(super) fn max_textures(&self) -> u32 {
        let limits = self.gpu.limits();
        let images = limits.max_per_stage_descriptor_sampled_images;
        let room =
            images.min(limits.max_per_stage_descriptor_samplers).saturating_sub(images_beside_material());
        self.texture_limit.map_or(room, |most| room.min(most))
    }

    /// A message for each material of the scene resources that has more textures than this device can bind.
    pub(super) fn textures_left_out(&self) -> Vec<String> {
        let most = self.max_textures();
        let line = |m: &MaterialResource| {
            let out = textures_beyond_limit(m, most);
            let text = "this device binds at most";
            (!out.is_empty()).then(|| {
                let name = &m.material.name;
                format!("material \"{name}\": {text} {most} textures; left out: {}", out.join(", "))
            })
        };
        self.scene_resources.materials.iter().filter_map(line).collect()
    }
}
