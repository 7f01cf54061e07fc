//! Materials that the plan overrides in this frame.

use super::CpuRenderer;
use super::shade::ShadeMaterial;
use crate::plan::Plan;
use crate::scene_resources::material::MaterialResource;

impl CpuRenderer {
    /// The plan's material overrides, each with the textures of the material that it replaces.
    pub(super) fn override_materials(&self, plan: &Plan) -> Vec<ShadeMaterial> {
        let draws = plan.draws.iter().chain(plan.shadow_draws());
        let mut replaced: Vec<Option<u32>> = vec![None; plan.material_overrides.len()];
        for draw in draws {
            if let Some(index) = draw.material_override {
                replaced[index as usize] = Some(draw.material);
            }
        }
        let textures =
            |m: Option<u32>| m.map(|m| self.materials[m as usize].textures.clone()).unwrap_or_default();
        let pairs = plan.material_overrides.iter().zip(replaced);
        pairs
            .map(|(factors, m)| ShadeMaterial {
                factors: MaterialResource::clone(factors),
                textures: textures(m),
            })
            .collect()
    }
}
