//! How many lights forward shading would ask in vain: of surfaces that are drawn, and then hidden by what is drawn after them.
//!
//! The picture is divided as lists of lights divide it. A box covers a share of a square; copies with one material are drawn near
//! before far, so that of these only the nearest is shaded, but materials come in any order. Of n surfaces in any order 1 + 1/2 + … + 1/n
//! are nearer than all before them: about 1 + ln n are shaded, and all but one in vain.

use crate::plan::build::Planner;
use crate::plan::build::dirty_rect::Area;
use crate::plan::build::light_clusters::{LightLists, SQUARE, depth};
use crate::plan::options::PlanOptions;
use crate::plan::{PipelineKey, View};
use crate::scene_resources::bounds::Aabb;
use choreo_stage::Pipeline;
use glam::Vec2;

/// What a body fills of the rectangle around its box: a ball 0.79, a quad that faces the eye 1, a person half.
const FILLED: f32 = 0.7;
/// Slices of depth that are looked at for a box.
const LOOKS: u32 = 4;

/// What is drawn one after the other, near before far: the pipeline, the material, which of the changed ones.
type Batch = (PipelineKey, u32, Option<u32>);

/// Boxes of what is lit and opaque.
pub(crate) struct Overdraw(Vec<(Batch, Aabb)>);

/// Means over the squares that anything covers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct InVain {
    /// That a place asks.
    pub lights: f32,
    /// Over each other, in any order.
    pub surfaces: f32,
    /// Asked in vain by forward shading.
    pub in_vain: f32,
}

/// Of the picture.
#[derive(Clone, Copy, Default)]
struct Square {
    /// Of each batch no more than one.
    surfaces: f32,
    of_batch: f32,
    /// All boxes, and times the lights that each asks.
    all: f32,
    lights: f32,
}

impl Overdraw {
    /// `None` where the answer is known.
    pub fn of(pipeline: Pipeline, options: &PlanOptions) -> Option<Overdraw> {
        (pipeline == Pipeline::Auto && options.samples == 1).then(|| Overdraw(Vec::new()))
    }

    /// `lights`: all of them, and the lists of those that reach not everywhere.
    pub fn in_vain(&self, view: &View, size: [u32; 2], lights: (usize, Option<&LightLists>)) -> InVain {
        let [across, down] = size.map(|s| s.div_ceil(SQUARE));
        let mut squares = vec![Square::default(); (across * down) as usize];
        let mut touched: Vec<usize> = Vec::new();
        let mut boxes: Vec<&(Batch, Aabb)> = self.0.iter().collect();
        boxes.sort_by_key(|(batch, _)| *batch);
        for batch in boxes.chunk_by(|a, b| a.0 == b.0) {
            for (_, bounds) in batch {
                for ([column, row], share, asked) in shares(*bounds, view, size, lights) {
                    let at = (row * across + column) as usize;
                    touched.push(at);
                    let square = &mut squares[at];
                    square.of_batch += share;
                    square.all += share;
                    square.lights += share * asked;
                }
            }
            for at in touched.drain(..) {
                let square = &mut squares[at];
                square.surfaces += std::mem::take(&mut square.of_batch).min(1.0);
            }
        }
        let (mut covered, mut mean) = (0.0, InVain::default());
        for s in squares.iter().filter(|s| s.all > 0.0) {
            let (share, lights) = (s.surfaces.min(1.0), s.lights / s.all);
            covered += share;
            mean.lights += share * lights;
            mean.surfaces += s.surfaces;
            mean.in_vain += share * lights * libm::logf(s.surfaces.max(1.0));
        }
        let of = |sum: f32| if covered > 0.0 { sum / covered } else { 0.0 };
        InVain { lights: of(mean.lights), surfaces: of(mean.surfaces), in_vain: of(mean.in_vain) }
    }
}

/// The squares that a box covers, the share that it covers of each, and the lights that places of it ask there.
fn shares(
    bounds: Aabb,
    view: &View,
    size: [u32; 2],
    (lights, lists): (usize, Option<&LightLists>),
) -> Vec<([u32; 2], f32, f32)> {
    let clip = &view.clip_from_relative;
    let mut area = Area::NOTHING;
    // Without the margin around what is drawn.
    area.add(bounds, clip, size, -crate::plan::build::dirty_rect::MARGIN);
    let Some([from, to]) = area.inside(size) else { return Vec::new() };
    let half = (bounds.max - bounds.min) * 0.5;
    let (middle, reach) = (depth(clip, bounds.center()), clip.row(3).truncate().abs().dot(half));
    let slices = lists.map(|l| (l, [l.slice(middle - reach, 0.0), l.slice(middle + reach, 0.0)]));
    let asked = |square: [u32; 2]| match slices {
        Some((lists, [near, far])) => {
            let looks = (far - near + 1).min(LOOKS);
            let slice = |k: u32| near + (far - near) * k / (looks - 1).max(1);
            let sum: u32 = (0..looks).map(|k| lists.count(square, slice(k))).sum();
            lists.everywhere() as f32 + sum as f32 / looks as f32
        }
        None => lights as f32,
    };
    let whole = Vec2::new(size[0] as f32, size[1] as f32);
    let side = SQUARE as f32;
    let [first, last] = [from, to].map(|p| (p / side).as_uvec2());
    let mut out = Vec::new();
    for row in first.y..=last.y.min(size[1].div_ceil(SQUARE) - 1) {
        for column in first.x..=last.x.min(size[0].div_ceil(SQUARE) - 1) {
            let corner = Vec2::new(column as f32, row as f32) * side;
            let end = whole.min(corner + side);
            let inside = (to.min(end) - from.max(corner)).max(Vec2::ZERO);
            let share = FILLED * inside.element_product() / (end - corner).element_product();
            if share > 0.0 {
                out.push(([column, row], share, asked([column, row])));
            }
        }
    }
    out
}

impl Planner<'_> {
    /// A copy in view that is lit. `of`: its material, which of the changed ones.
    pub fn lit_box(&mut self, bounds: Aabb, key: &PipelineKey, of: (u32, Option<u32>), glass: bool) {
        if !key.features.is_lit() || !bounds.min.is_finite() || !bounds.max.is_finite() {
            return;
        }
        if self.casting {
            self.receivers.push(bounds);
        }
        if let Some(overdraw) = self.overdraw.as_mut().filter(|_| !key.blend && !glass) {
            overdraw.0.push(((*key, of.0, of.1), bounds));
        }
    }
}
