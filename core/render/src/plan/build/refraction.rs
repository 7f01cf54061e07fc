//! The scene color copy of a frame: whether one is needed, and its number of mip levels.

use crate::plan::build::Planner;
use crate::plan::scene_color_copy::blur;
use crate::plan::{Glass, SceneColorCopy};
use crate::scene_resources::mipmap::level_count;

impl Planner<'_> {
    pub(super) fn scene_color_copy(&self) -> Option<SceneColorCopy> {
        let refracting = self.items.iter().filter(|i| i.pipeline.glass == Glass::Refract);
        let blurs = refracting.map(|item| {
            let material = &self.material(item.entry.material, item.material_override).material;
            // A roughness texture can only reduce the roughness.
            material.layers.as_deref().map_or(0.0, |l| blur(material.roughness, l.iors().max_element()))
        });
        let most = blurs.reduce(f32::max)?;
        let [width, height] = self.options.size;
        let lod = libm::log2f(height.max(1) as f32) * most.clamp(0.0, 1.0);
        Some(SceneColorCopy { levels: (lod.ceil() as u32 + 1).min(level_count(width, height)) })
    }
}
