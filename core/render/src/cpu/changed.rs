//! Materials that the plan overrides in this frame.

use super::CpuRenderer;
use super::shade::ShadeMaterial;
use crate::plan::Plan;
use crate::scene_resources::material::MaterialResource;

impl CpuRenderer {
    /// Material overrides of the plan, with the textures of the materials that they replace.
    pub(super) fn changed_materials(&self, plan: &Plan) -> Vec<ShadeMaterial> {
        let draws = plan.draws.iter().chain(plan.shadow_draws());
        let mut of: Vec<Option<u32>> = vec![None; plan.material_overrides.len()];
        for draw in draws {
            if let Some(changed) = draw.material_override {
                of[changed as usize] = Some(draw.material);
            }
        }
        let textures =
            |m: Option<u32>| m.map(|m| self.materials[m as usize].textures.clone()).unwrap_or_default();
        let pairs = plan.material_overrides.iter().zip(of);
        pairs
            .map(|(now, m)| ShadeMaterial { factors: MaterialResource::clone(now), textures: textures(m) })
            .collect()
    }
}
