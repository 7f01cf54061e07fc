//! How many textures a material may have on this device, and what is left out of those that have more.

use super::VulkanRenderer;
use crate::commands::textures_beyond;
use crate::scene_resources::material::MaterialResource;

impl VulkanRenderer {
    /// Textures that a material's shader may read here, beside the shadow map, the image behind glass, the sky's two and the layers under the scene.
    pub(super) fn textures(&self) -> u32 {
        let limits = self.gpu.limits();
        let images = limits.max_per_stage_descriptor_sampled_images;
        let room = images.min(limits.max_per_stage_descriptor_samplers).saturating_sub(5);
        self.most_textures.map_or(room, |most| room.min(most))
    }

    /// A line for each material of the scene resources that has more textures than this device can bind.
    pub(super) fn textures_left_out(&self) -> Vec<String> {
        let most = self.textures();
        let line = |m: &MaterialResource| {
            let out = textures_beyond(m, most);
            let text = "this device binds at most";
            (!out.is_empty()).then(|| {
                let name = &m.material.name;
                format!("material \"{name}\": {text} {most} textures; left out: {}", out.join(", "))
            })
        };
        self.scene_resources.materials.iter().filter_map(line).collect()
    }
}
