//! Level of detail of each copy.

use crate::affine::Affine3x4;
use crate::plan::build::Planner;
use crate::scene_resources::PrimitiveEntry;
use crate::scene_resources::lod::{LodLevel, TOLERANCE};
use choreo_asset::Aabb;

impl Planner<'_> {
    /// The entry with the coarsest level whose geometric error does not show.
    pub(crate) fn level_of_detail(
        &mut self,
        entry: &PrimitiveEntry,
        bounds: Aabb,
        skin: Option<usize>,
        relative_from_mesh: &Affine3x4,
    ) -> PrimitiveEntry {
        let levels = self.resources.lods.get(entry.primitive as usize).map_or(&[][..], Vec::as_slice);
        if levels.is_empty() || self.options.full_detail {
            return *entry;
        }
        // Pixels that a meter of the mesh covers where the copy is nearest.
        let half = (bounds.max - bounds.min).length() * 0.5;
        let nearest = self.view.depth(bounds.center()) - half;
        let pixels_per_meter = self.view.pixels_per_meter(nearest, self.options.size);
        let scale = match skin.map(|s| &self.skins[s]) {
            Some(skin) => {
                let place = if skin.placed { relative_from_mesh.largest_stretch() } else { 1.0 };
                skin.matrices.iter().map(Affine3x4::largest_stretch).fold(0.0, f32::max) * place
            }
            None => relative_from_mesh.largest_stretch(),
        };
        let fits = |level: &&LodLevel| level.error * scale * pixels_per_meter <= TOLERANCE;
        match levels.iter().rev().find(fits) {
            Some(level) => {
                self.facts.coarse += 1;
                PrimitiveEntry { primitive: level.primitive, ..*entry }
            }
            None => *entry,
        }
    }
}
