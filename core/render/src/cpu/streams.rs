//! Streamed textures, which are in memory only while a frame shows them.

use super::CpuRenderer;
use super::texture::Texture;
use crate::error::RenderError;
use crate::plan::Plan;
use std::collections::BTreeSet;
use std::sync::Arc;

impl CpuRenderer {
    /// Loads the streamed textures that the plan shows, and drops all others.
    pub(super) fn load_streamed_textures(&mut self, plan: &Plan) -> Result<(), RenderError> {
        if self.resources.textures.iter().all(|t| t.streamed.is_none()) {
            return Ok(());
        }
        let plans = std::iter::once(plan).chain(plan.sub_plans());
        let shown = plans.flat_map(|p| p.draws.iter().chain(p.shadow_draws()).map(|d| d.material));
        let shown: BTreeSet<u32> = shown.collect();
        for material in 0..self.materials.len() as u32 {
            for (slot, texture) in self.resources.streamed(material) {
                let loaded = &mut self.materials[material as usize].textures[slot];
                if !shown.contains(&material) {
                    *loaded = None;
                } else if loaded.is_none() {
                    *loaded = Some(Arc::new(Texture::new(
                        &self.resources.textures[texture as usize].with_loaded_pixels()?,
                    )));
                }
            }
        }
        Ok(())
    }
}
