//! Level of detail of each copy.

use crate::affine::{Affine3x4, to_f64};
use crate::plan::build::Planner;
use crate::plan::build::mesh::MeshContext;
use crate::scene_resources::bounds::transformed;
use crate::scene_resources::lod::{LodLevel, MAX_ERROR_PIXELS, small_copies, triangles_of};
use crate::scene_resources::{AssetEntry, PrimitiveEntry};
use choreo_asset::{Aabb, Asset};
use choreo_stage::ActorState;
use glam::{Affine3A, DAffine3};

/// The levels of an actor's model.
#[derive(Clone, Default)]
pub(super) struct ActorLevels<'a> {
    pub levels: &'a [LodLevel],
    /// Index into `levels` for each placement of the model; `None`: full detail.
    of_places: Vec<Option<usize>>,
    /// Largest stretch of the pose relative to the rest pose.
    stretch: f32,
}

impl<'a> Planner<'a> {
    /// Chooses one level for the whole model at each placement: parts at different levels could intersect.
    pub(super) fn actor_levels(
        &mut self,
        index: usize,
        entry: &'a AssetEntry,
        state: &ActorState,
        relative_from_model: DAffine3,
    ) -> ActorLevels<'a> {
        let asset = &*self.stage.actors[index].asset;
        if self.options.full_detail {
            return ActorLevels::default();
        }
        if entry.wants_levels {
            let triangles = triangles_of(self.resources, self.resources.asset_of_actor[index] as usize);
            let small = small_copies(asset, triangles, state, &self.view, self.options.size);
            self.facts.small += small;
        }
        if entry.levels.is_empty() {
            return ActorLevels::default();
        }
        let mut levels = ActorLevels {
            levels: &entry.levels,
            of_places: Vec::new(),
            stretch: stretch_of_pose(asset, &state.model_from_joint),
        };
        let posed = (asset.instance_bounds().iter().enumerate()).fold(Aabb::EMPTY, |all, (i, bounds)| {
            let weights = state.morph_weights.get(i).map_or(&[][..], Vec::as_slice);
            all.union(bounds.posed(&state.model_from_joint, weights))
        });
        let level = |place: Affine3A| {
            let relative_from_place = Affine3x4::from_affine(relative_from_model * to_f64(place));
            let bounds = transformed(posed, &relative_from_place);
            self.level_of(&levels, bounds, relative_from_place.largest_stretch())
        };
        levels.of_places = asset.first_placements(state.copies).map(level).collect();
        levels
    }

    /// The coarsest level whose error is not visible within these bounds.
    fn level_of(&self, levels: &ActorLevels, bounds: Aabb, stretch: f32) -> Option<usize> {
        if bounds.is_empty() {
            return None;
        }
        // Pixels that a metre of the model covers at the copy's nearest point.
        let nearest = self.view.depth(bounds.center()) - (bounds.max - bounds.min).length() * 0.5;
        let pixels_per_meter = self.view.pixels_per_meter(nearest, self.options.size);
        let scale = stretch * levels.stretch * pixels_per_meter;
        levels.levels.iter().rposition(|level| level.error * scale <= MAX_ERROR_PIXELS)
    }

    /// A primitive at the level of one copy; `None` if that level has no triangles of it.
    pub(super) fn at_level(
        &mut self,
        entry: &PrimitiveEntry,
        mesh: &MeshContext,
        (place, primitive): (usize, usize),
        (bounds, relative_from_mesh): (Aabb, &Affine3x4),
    ) -> Option<PrimitiveEntry> {
        let levels = &self.levels;
        let level = match mesh.instance.copies.is_empty() {
            true => levels.of_places.get(place).copied().flatten(),
            // Instanced parts are spread over the model, so each copy gets its own level.
            false => self.level_of(levels, bounds, relative_from_mesh.largest_stretch()),
        };
        let Some(level) = level else { return Some(*entry) };
        self.facts.coarse += 1;
        let primitive = levels.levels[level].primitives[mesh.index][primitive]?;
        Some(PrimitiveEntry { primitive, ..*entry })
    }
}

/// Largest scale of a joint's space relative to the rest pose.
fn stretch_of_pose(asset: &Asset, model_from_joint: &[Affine3A]) -> f32 {
    let square = |a: &Affine3A| {
        let m = a.matrix3;
        m.x_axis.length_squared().max(m.y_axis.length_squared()).max(m.z_axis.length_squared())
    };
    let joints = model_from_joint.iter().zip(asset.rest_model_from_joint());
    let ratios = joints.map(|(now, rest)| (square(now), square(rest))).filter(|(_, rest)| *rest > 0.0);
    ratios.map(|(now, rest)| now / rest).fold(1.0f32, f32::max).sqrt()
}
