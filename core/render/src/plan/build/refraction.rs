//! The copy of the picture that glass sees which bends light: whether a frame needs it, and how far it must be blurred.

use crate::plan::build::Planner;
use crate::plan::{Behind, Glass};
use crate::scene_resources::mipmap::level_count;

/// How much of a surface's roughness blurs what is seen through it: none at an index of 1, all from 1.5 on
/// (glTF-Sample-Viewer, `applyIorToRoughness`). Times log₂ of the picture's height it is the level of the copy.
pub fn blur(roughness: f32, ior: f32) -> f32 {
    roughness * (2.0 * ior - 2.0).clamp(0.0, 1.0)
}

impl Planner<'_> {
    pub(crate) fn behind(&self) -> Option<Behind> {
        let glass = self.items.iter().filter(|i| i.pipeline.glass == Glass::Refract);
        let blurs = glass.map(|item| {
            let material = match item.changed {
                Some(changed) => &self.materials[changed as usize].material,
                None => &self.catalog.materials[item.entry.material as usize].material,
            };
            // A texture of roughness makes it less.
            material.layers.as_deref().map_or(0.0, |l| blur(material.roughness, l.iors().max_element()))
        });
        let most = blurs.reduce(f32::max)?;
        let [width, height] = self.options.size;
        let lod = libm::log2f(height.max(1) as f32) * most.clamp(0.0, 1.0);
        Some(Behind { levels: (lod.ceil() as u32 + 1).min(level_count(width, height)) })
    }
}
