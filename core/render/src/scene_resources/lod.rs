//! Levels of detail (LOD): simplified versions of whole models, drawn for copies that are so small that the difference is not
//! visible.
//!
//! A level simplifies all primitives of a model together, so that one layer does not poke through another, and records the pixel
//! size from which it looks like the model (`appearance`). A plan takes the coarsest level whose pixel size is no larger than
//! that of the image. A simplified primitive keeps a subset of the vertices (`simplify`), so that joints, morph targets and
//! textures work as before.
//!
//! Levels are made only if they pay: if enough copies, over all frames of the stage, are so small that their triangles are
//! smaller than pixels. That is estimated from the placements of actors and the camera, and depends on the stage alone.

use crate::affine::{Affine3x4, to_f64};
use crate::scene_resources::SceneResources;
use crate::scene_resources::bounds::{is_outside_frustum, transformed};
use crate::view::View;
use choreo_asset::{Aabb, Asset};
use choreo_motion::Time;
use choreo_stage::{ActorState, Stage};
use glam::{Affine3A, DAffine3, Vec2};

/// Largest error of a drawn level in pixels.
pub const MAX_ERROR_PIXELS: f32 = 1.0;
/// Number of drawn small copies, over all frames, from which levels pay. On the CPU renderer's threads, making the levels of a
/// model takes as long as drawing it 150 times.
pub const MIN_SMALL_COPIES: f64 = 256.0;
/// Times at which the sizes of copies are estimated, spread over the stage.
const ESTIMATE_TIMES: i64 = 5;
/// Least number of triangles of a model with levels.
pub(super) const MIN_TRIANGLES: usize = 64;

/// A simplified version of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct LodLevel {
    /// Pixel size from which the level shows no visible difference, in metres of the model at rest.
    pub error: f32,
    /// Indices into `SceneResources::primitives`: `[mesh instance][primitive of its mesh]`; `None` where no triangle is left.
    pub primitives: Vec<Vec<Option<u32>>>,
}

/// Whether levels of detail pay for each asset of the resources.
pub(super) fn assets_worth_levels(resources: &SceneResources, stage: &Stage) -> Vec<bool> {
    let assets = resources.assets.len();
    let frames = stage.settings.fps.frames_in(stage.settings.length).max(1) as f64;
    // Largest number of times that each asset can be drawn.
    let mut copies = vec![0.0f64; assets];
    let mut triangles = vec![0usize; assets];
    for (index, actor) in stage.actors.iter().enumerate() {
        let asset = resources.asset_of_actor[index] as usize;
        copies[asset] += copies_of(&actor.asset) as f64;
        triangles[asset] = triangles_of(resources, asset);
    }
    let may = |asset: usize| copies[asset] * frames >= MIN_SMALL_COPIES && triangles[asset] >= MIN_TRIANGLES;
    let mut pays: Vec<bool> = (0..assets).map(may).collect();
    if !stage.settings.levels_of_detail || !pays.contains(&true) {
        return vec![false; assets];
    }
    let length = i128::from(stage.settings.length.0);
    let time = |i: i64| Time((length * i128::from(2 * i + 1) / i128::from(2 * ESTIMATE_TIMES)) as i64);
    let times: Vec<Time> = (0..ESTIMATE_TIMES).map(time).collect();
    let Ok(snapshots) = stage.evaluate_placements(&times) else { return vec![false; assets] };
    let mut small = vec![0.0f64; assets];
    for snapshot in &snapshots {
        let view = View::new(&snapshot.camera, stage.settings.size);
        for (index, state) in snapshot.actors.iter().enumerate().filter(|(_, state)| state.visible) {
            let asset = resources.asset_of_actor[index] as usize;
            if pays[asset] {
                let model = &stage.actors[index].asset;
                let count = small_copies(model, triangles[asset], state, &view, stage.settings.size);
                small[asset] += count as f64 * frames / ESTIMATE_TIMES as f64;
            }
        }
    }
    pays.iter_mut().zip(small).for_each(|(pays, small)| *pays &= small >= MIN_SMALL_COPIES);
    pays
}

/// Number of copies of the model; if only parts of it have copies, the number of the most frequent part.
fn copies_of(asset: &Asset) -> usize {
    asset.instances.iter().map(|instance| asset.times(instance)).max().unwrap_or(0)
}

/// Triangles of one copy of a model.
pub(crate) fn triangles_of(resources: &SceneResources, asset: usize) -> usize {
    let of = |p: u32| resources.primitives[p as usize].primitive().indices.len() / 3;
    resources.assets[asset].primitives.iter().flatten().map(|entry| of(entry.primitive)).sum()
}

/// Number of copies of an actor that are in view with triangles smaller than pixels.
pub(crate) fn small_copies(
    asset: &Asset,
    triangles: usize,
    state: &ActorState,
    view: &View,
    size: [u32; 2],
) -> usize {
    let relative_from_model = DAffine3 {
        translation: state.world_from_model.translation - view.position,
        ..state.world_from_model
    };
    let bounds = asset.rest_bounds();
    let count_parts = |instance: &choreo_asset::MeshInstance| instance.copies.len();
    // Copies of parts, such as blades of grass, are spread over their model.
    let parts = asset.instances.iter().map(count_parts).max().unwrap_or(0);
    let is_small = |place: &Affine3A| {
        let relative_from_place = Affine3x4::from_affine(relative_from_model * to_f64(*place));
        let here = transformed(bounds, &relative_from_place);
        !is_outside_frustum(here, &view.clip_from_relative, Vec2::ZERO)
            && (triangles as f32) > pixels_covered(here, view, size) / parts.max(1) as f32
    };
    asset.first_placements(state.copies).filter(is_small).count() * parts.max(1)
}

/// Pixels that the two largest sides of a box cover at its nearest point; infinite around the camera.
fn pixels_covered(bounds: Aabb, view: &View, size: [u32; 2]) -> f32 {
    let sides = bounds.max - bounds.min;
    let area = (sides.x * sides.y).max(sides.y * sides.z).max(sides.z * sides.x);
    let per_meter = view.pixels_per_meter(view.depth(bounds.center()) - sides.length() * 0.5, size);
    area * per_meter * per_meter
}
