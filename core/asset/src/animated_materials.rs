//! The materials of a file that change over time.

use crate::asset::Asset;
use crate::expression::Expression;
use crate::material::{Material, Shading};
use crate::toon::UvMotion;
use choreo_motion::PropertyTarget;
use std::collections::BTreeSet;

impl Asset {
    /// Whether each material can be changed by a clip, an expression or UV animation. Base color curves of clips do not count:
    /// see [`Asset::animated_base_colors`]. Empty if no material can be changed.
    pub fn changing_materials(&self) -> Vec<bool> {
        let mut changing: BTreeSet<u32> = BTreeSet::new();
        let properties = self.clips.iter().flat_map(|clip| clip.properties());
        changing.extend(properties.filter_map(|(target, _)| match target {
            PropertyTarget::Material(material, _) => Some(material),
            _ => None,
        }));
        changing.extend(self.expressions.iter().flat_map(Expression::changed_materials));
        changing.extend((0..).zip(&self.materials).filter(|(_, m)| m.has_uv_animation()).map(|(i, _)| i));
        let mut out = Vec::new();
        for material in changing.into_iter().filter(|m| (*m as usize) < self.materials.len()) {
            out.resize(self.materials.len(), false);
            out[material as usize] = true;
        }
        out
    }

    /// Whether a clip of the file animates each material's base color. Empty if none is animated.
    pub fn animated_base_colors(&self) -> Vec<bool> {
        let mut out = Vec::new();
        for (target, _) in self.clips.iter().flat_map(|clip| clip.properties()) {
            if let PropertyTarget::BaseColor(material) = target
                && (material as usize) < self.materials.len()
            {
                out.resize(self.materials.len(), false);
                out[material as usize] = true;
            }
        }
        out
    }
}

impl Expression {
    /// Materials whose colors or texture coordinates the expression changes.
    pub fn changed_materials(&self) -> impl Iterator<Item = u32> {
        let uvs = self.uvs.iter().map(|b| b.material);
        self.colors.iter().map(|b| b.material).chain(uvs)
    }
}

impl Material {
    /// UV animation that the material's shading model uses.
    pub fn active_uv_motion(&self) -> Option<UvMotion> {
        match self.shading {
            Shading::Toon => self.toon.as_ref()?.uv_motion,
            _ => self.uv_motion,
        }
    }

    /// Whether the material's textures move or play frames without any clip.
    pub fn has_uv_animation(&self) -> bool {
        self.active_uv_motion().is_some() || self.flipbook.is_some()
    }
}
