//! Overdraw estimate: light evaluations that forward shading would waste on surfaces which later draws hide.
//!
//! The frame is divided into the screen tiles of clustered lighting. A box covers a share of a tile. Copies with one material are
//! drawn front to back, so that only the nearest of them is shaded, but materials come in any order. Of n surfaces in random
//! order 1 + 1/2 + … + 1/n are nearer than all before them: about 1 + ln n are shaded, and all but one are wasted.

use crate::plan::build::Planner;
use crate::plan::dirty_rect::{DirtyRect, MARGIN};
use crate::plan::light_clusters::{LightClusters, TILE, depth};
use crate::plan::options::PlanOptions;
use crate::plan::{Features, PipelineKey, View};
use choreo_asset::Aabb;
use choreo_stage::Pipeline;
use glam::Vec2;

/// Share of its screen rectangle that a mesh fills: a sphere 0.79, a quad that faces the camera 1, a person half.
const FILLED_SHARE: f32 = 0.7;
/// Number of depth slices that are sampled for a box.
const SLICE_SAMPLES: u32 = 4;

/// Copies that are drawn front to back together: pipeline, material, material override.
type Batch = (PipelineKey, u32, Option<u32>);

/// Bounds of lit opaque copies in view.
pub(super) struct OverdrawEstimate(Vec<(Batch, Aabb)>);

/// Means over the covered screen tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct WastedLights {
    /// Lights that each shaded surface evaluates.
    pub lights: f32,
    /// Number of overlapping surfaces in random order.
    pub surfaces: f32,
    /// Light evaluations per pixel that forward shading wastes.
    pub wasted: f32,
}

/// Coverage of a screen tile by boxes, as shares of its area.
#[derive(Clone, Copy, Default)]
struct TileCoverage {
    /// Sum over the batches, each at most 1.
    surfaces: f32,
    /// Sum over the boxes of the current batch.
    of_batch: f32,
    /// Sum over all boxes.
    all: f32,
    /// Sum over all boxes of their share times the lights that they evaluate.
    lights: f32,
}

impl OverdrawEstimate {
    /// An empty estimate; `None` if none is needed.
    pub(super) fn of(pipeline: Pipeline, options: &PlanOptions) -> Option<OverdrawEstimate> {
        (pipeline == Pipeline::Auto && options.samples == 1).then(|| OverdrawEstimate(Vec::new()))
    }

    /// Estimates the waste of forward shading. `lights`: their number, and the clusters of those with a range.
    pub(super) fn wasted(
        &self,
        view: &View,
        size: [u32; 2],
        lights: (usize, Option<&LightClusters>),
    ) -> WastedLights {
        let [across, down] = size.map(|s| s.div_ceil(TILE));
        let mut tiles = vec![TileCoverage::default(); (across * down) as usize];
        let mut touched: Vec<usize> = Vec::new();
        let mut boxes: Vec<&(Batch, Aabb)> = self.0.iter().collect();
        boxes.sort_by_key(|(batch, _)| *batch);
        for batch in boxes.chunk_by(|a, b| a.0 == b.0) {
            for (_, bounds) in batch {
                for ([column, row], share, evaluated) in tile_shares(*bounds, view, size, lights) {
                    let at = (row * across + column) as usize;
                    touched.push(at);
                    let tile = &mut tiles[at];
                    tile.of_batch += share;
                    tile.all += share;
                    tile.lights += share * evaluated;
                }
            }
            for at in touched.drain(..) {
                let tile = &mut tiles[at];
                tile.surfaces += std::mem::take(&mut tile.of_batch).min(1.0);
            }
        }
        let (mut covered, mut mean) = (0.0, WastedLights::default());
        for s in tiles.iter().filter(|s| s.all > 0.0) {
            let (share, lights) = (s.surfaces.min(1.0), s.lights / s.all);
            covered += share;
            mean.lights += share * lights;
            mean.surfaces += s.surfaces;
            mean.wasted += share * lights * libm::logf(s.surfaces.max(1.0));
        }
        let of = |sum: f32| if covered > 0.0 { sum / covered } else { 0.0 };
        WastedLights { lights: of(mean.lights), surfaces: of(mean.surfaces), wasted: of(mean.wasted) }
    }
}

/// The screen tiles that a box covers, the share that it covers of each, and the lights that it evaluates there.
fn tile_shares(
    bounds: Aabb,
    view: &View,
    size: [u32; 2],
    (lights, clusters): (usize, Option<&LightClusters>),
) -> Vec<([u32; 2], f32, f32)> {
    let clip = &view.clip_from_relative;
    let mut rect = DirtyRect::NOTHING;
    rect.add(bounds, clip, size, -MARGIN);
    let Some([from, to]) = rect.inside(size) else { return Vec::new() };
    let half = (bounds.max - bounds.min) * 0.5;
    let (middle, reach) = (depth(clip, bounds.center()), clip.row(3).truncate().abs().dot(half));
    let slices = clusters.map(|c| (c, [c.slice(middle - reach, 0.0), c.slice(middle + reach, 0.0)]));
    let evaluated = |tile: [u32; 2]| match slices {
        Some((clusters, [near, far])) => {
            let samples = (far - near + 1).min(SLICE_SAMPLES);
            let slice = |k: u32| near + (far - near) * k / (samples - 1).max(1);
            let sum: u32 = (0..samples).map(|k| clusters.count(tile, slice(k))).sum();
            clusters.unlimited() as f32 + sum as f32 / samples as f32
        }
        None => lights as f32,
    };
    let whole = Vec2::new(size[0] as f32, size[1] as f32);
    let side = TILE as f32;
    let [first, last] = [from, to].map(|p| (p / side).as_uvec2());
    let mut out = Vec::new();
    for row in first.y..=last.y.min(size[1].div_ceil(TILE) - 1) {
        for column in first.x..=last.x.min(size[0].div_ceil(TILE) - 1) {
            let start = Vec2::new(column as f32, row as f32) * side;
            let end = whole.min(start + side);
            let inside = (to.min(end) - from.max(start)).max(Vec2::ZERO);
            let share = FILLED_SHARE * inside.element_product() / (end - start).element_product();
            if share > 0.0 {
                out.push(([column, row], share, evaluated([column, row])));
            }
        }
    }
    out
}

impl Planner<'_> {
    /// Records the bounds of an actor's copy in view, if it is lit. `material`: its material and override.
    pub(crate) fn add_receiver(
        &mut self,
        actor: usize,
        bounds: Aabb,
        key: &PipelineKey,
        material: (u32, Option<u32>),
    ) {
        if !key.features.is_lit() || !bounds.min.is_finite() || !bounds.max.is_finite() {
            return;
        }
        if self.casting && self.stage.actors[actor].shadow.receive {
            self.receivers.push(bounds);
        }
        if let Some(overdraw) =
            self.overdraw.as_mut().filter(|_| !key.blend && !key.features.has(Features::TRANSMISSION))
        {
            overdraw.0.push(((*key, material.0, material.1), bounds));
        }
    }
}
