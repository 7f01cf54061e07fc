//! Shadow maps, drawn by the same rasterizer as images, and their lookup. CPU reference of shadow.wgsl.

use super::raster::{TILE_HEIGHT, TILE_PIXELS, TILE_WIDTH, rasterize};
use super::setup::Triangle;
use super::tile::{Batch, BatchShading, triangles_by_band};
use crate::lanes::{ALL_LANES, F4, Mask, NO_LANES, V3, Weights, select};
use crate::plan::map_key::MapKey;
use crate::plan::shadow_maps::MAX_PENUMBRA;
use crate::plan::{self, Features, PlanLight, ShadowView};
use crate::shader::uniforms::ShadowUniform;
use glam::Vec4Swizzles;
use rayon::prelude::*;
use std::collections::HashMap;

/// The shadow maps of a frame.
#[derive(Default)]
pub(super) struct ShadowMaps {
    maps: Vec<ShadowMap>,
}

struct ShadowMap {
    /// Key of all inputs of the map; `None` if the map is not kept for the next frame.
    key: Option<MapKey>,
    at: [u32; 2],
    size: [u32; 2],
    uniform: ShadowUniform,
    /// Reversed-Z depth, row by row; 0 where nothing is drawn.
    depth: Vec<f32>,
    /// Least and greatest depth in each block of texels and its neighbors, row by row; empty for a map with edges of a fixed
    /// width.
    ranges: Vec<[f32; 2]>,
}

/// Side of a block of texels, in texels.
const BLOCK_SIDE: usize = 8;
/// Largest distance of a texel that a lookup with a penumbra reads, in texels.
const LOOKUP_RADIUS: f32 = 0.5 * MAX_PENUMBRA + 2.0;
const _: () = assert!(LOOKUP_RADIUS <= BLOCK_SIDE as f32);

impl ShadowMaps {
    /// Draws the maps of a frame. `keys`: one for each view; `before`: maps of the previous frame, of which those with equal keys
    /// are kept; `batches`: the casters of a view, projected from its light.
    pub(super) fn draw<'a>(
        plan: &plan::ShadowMaps,
        keys: Vec<Option<MapKey>>,
        before: ShadowMaps,
        batches: impl Fn(&ShadowView) -> Vec<Batch<'a>>,
    ) -> ShadowMaps {
        // Maps that are not kept are freed before new ones need their memory.
        let kept = before.maps.into_iter().filter(|map| keys.contains(&map.key));
        let mut kept: HashMap<MapKey, ShadowMap> = kept.filter_map(|map| Some((map.key?, map))).collect();
        let draw = |(view, key): (&ShadowView, Option<MapKey>)| {
            let (at, size, uniform) = (view.at, view.size, ShadowUniform::new(view, plan.image));
            if let Some(map) = key.and_then(|key| kept.remove(&key)) {
                return ShadowMap { at, uniform, ..map };
            }
            let depth = draw_depths(size, &batches(view));
            let ranges = if view.penumbra > 0.0 { block_depth_ranges(size, &depth) } else { Vec::new() };
            ShadowMap { key, at, size, uniform, depth, ranges }
        };
        ShadowMaps { maps: plan.views.iter().zip(keys).map(draw).collect() }
    }

    /// Share of a light that reaches four points, 0 to 1, in the lanes that `lanes` selects. `n`: normal without the normal map;
    /// `l`: direction to the light.
    pub(super) fn unshadowed_share(&self, light: &PlanLight, [relative, n, l]: [V3; 3], lanes: Mask) -> F4 {
        let [first, count] = light.shadow_views.map(usize::from);
        let Some(maps) = self.maps.get(first..first + count).filter(|m| !m.is_empty()) else {
            return F4::ONE;
        };
        let nl = n.dot(l).clamp(0.0, 1.0);
        // Normal offset (Holbert, "Saying Goodbye to Shadow Acne", GDC 2011): the depth of a slope changes by tan over a texel.
        // An offset along the normal by the filter's reach in texels, times the sine, compensates this at every angle.
        let slope = (F4::ONE - nl * nl).sqrt() * 3.0;
        let (mut share, mut remaining) = (F4::ONE, lanes);
        for map in maps {
            if remaining == NO_LANES {
                break;
            }
            let (at, inside) = map.project([relative, n, l], slope);
            let inside_lanes: Mask = std::array::from_fn(|i| remaining[i] & inside[i]);
            let Some(first_inside) = inside_lanes.iter().position(|inside| *inside) else { continue };
            // Lanes outside the map copy the position of a lane inside, so that all lookups stay in bounds.
            let inside_or_first = |v: F4| select(inside_lanes, v, F4::splat(v.0[first_inside]));
            let [at, n] = [at, n].map(|v| V3 {
                x: inside_or_first(v.x),
                y: inside_or_first(v.y),
                z: inside_or_first(v.z),
            });
            let lit_share =
                if map.uniform.texel.y == 0.0 { map.box_filtered(at) } else { map.with_penumbra(at, n) };
            share = select(inside_lanes, lit_share, share);
            remaining = std::array::from_fn(|i| remaining[i] & !inside[i]);
        }
        share
    }
}

impl ShadowMap {
    /// Texel and depth of four points in this map, and the lanes that lie inside it.
    fn project(&self, [relative, n, l]: [V3; 3], slope: F4) -> (V3, Mask) {
        let view = &self.uniform;
        let m = &view.texel_from_relative;
        let row = |i: usize, p: V3| {
            p.x * m.x_axis[i] + p.y * m.y_axis[i] + p.z * m.z_axis[i] + F4::splat(m.w_axis[i])
        };
        let texel = row(3, relative) * view.texel.x;
        let offset_position = relative + n * (slope * texel) + l * (texel * 0.25);
        let w = row(3, offset_position);
        let [x, y, z] = [0, 1, 2].map(|i| row(i, offset_position) / w.max(F4::splat(1e-6)));
        let [low, high] = [view.inside.xy(), view.inside.zw()];
        // A point beyond the depth range of this map lies in a later map.
        let inside = std::array::from_fn(|i| {
            let (x, y) = (x.0[i], y.0[i]);
            let inside = (x >= low.x) & (y >= low.y) & (x <= high.x) & (y <= high.y);
            inside & (w.0[i] > 0.0) & (z.0[i] >= 0.0)
        });
        (V3 { x, y, z }, inside)
    }

    /// Columns and rows of texels in this map, for places in the shared image.
    fn texel_indices(&self, position: [F4; 2]) -> [[usize; 4]; 2] {
        let texel =
            |k: usize| (position[k] - F4::splat(self.at[k] as f32)).0.map(|t| t.max(0.0) as i32 as usize);
        [texel(0), texel(1)]
    }

    /// Depths of `N` texels in a row; 0 beyond the map.
    fn depth_row<const N: usize>(&self, x: usize, y: usize) -> [f32; N] {
        let first = y * self.size[0] as usize + x;
        match self.depth.get(first..first + N) {
            Some(row) => row.try_into().expect("the slice has N elements"),
            None => std::array::from_fn(|i| self.depth.get(first + i).copied().unwrap_or(0.0)),
        }
    }

    /// Lit share by a box filter of 3 × 3 texels: 4 × 4 depth comparisons with the weights 1 − f, 1, 1, f in each direction.
    fn box_filtered(&self, at: V3) -> F4 {
        let half = F4::splat(0.5);
        let [x, y] = [at.x - half, at.y - half];
        let base = [x, y].map(floor_to_texel);
        let depth = at.z.max(F4::ZERO);
        let [x0, y0] = self.texel_indices(base.map(|c| c - F4::ONE));
        let weights = |f: F4| [F4::ONE - f, F4::ONE, F4::ONE, f];
        let (wx, wy) = (weights(x - base[0]), weights(y - base[1]));
        let mut sum = F4::ZERO;
        for (y, wy) in wy.into_iter().enumerate() {
            let rows: [[f32; 4]; 4] = std::array::from_fn(|i| self.depth_row(x0[i], y0[i] + y));
            let lit = |x: usize| select(std::array::from_fn(|i| depth.0[i] >= rows[i][x]), wx[x], F4::ZERO);
            sum += wy * (lit(0) + lit(1) + lit(2) + lit(3));
        }
        sum / F4::splat(9.0)
    }

    fn with_penumbra(&self, at: V3, n: V3) -> F4 {
        let slope = self.depth_slope(n);
        let [lit, dark] = self.fully_lit_or_dark(at, slope);
        let all = select(lit, F4::ONE, F4::ZERO);
        if (0..4).all(|i| lit[i] | dark[i]) {
            return all;
        }
        let width = self.penumbra_width(at, slope);
        let narrow = width.0.map(|width| width <= 3.0);
        let filtered = match narrow {
            ALL_LANES => self.box_filtered(at),
            NO_LANES => self.penumbra_filtered(at, slope, width),
            _ => select(narrow, self.box_filtered(at), self.penumbra_filtered(at, slope, width)),
        };
        select(std::array::from_fn(|i| lit[i] | dark[i]), all, filtered)
    }

    /// Change of a surface's depth per texel in x and y, limited to that of a surface at 79° to the light.
    fn depth_slope(&self, n: V3) -> [F4; 2] {
        let m = &self.uniform.texel_from_relative;
        let [x, y, z] = [0, 1, 2].map(|i| m.row(i).xyz());
        let nz = n.dot(V3::splat(z)).max(F4::splat(0.2 * z.length()));
        let steepness = F4::splat(self.uniform.texel.x * self.uniform.texel.x * z.dot(z)) / nz;
        [x, y].map(|axis| -n.dot(V3::splat(axis)) * steepness)
    }

    /// Width of the penumbra in texels, from the mean distance of the blockers among 4 × 4 texels (Fernando, "Percentage-Closer
    /// Soft Shadows", 2005). The 4 × 4 texels span the widest penumbra, so that no penumbra begins with a step. The result is
    /// the narrowest width, 3, if all or none of the texels are blockers.
    fn penumbra_width(&self, at: V3, slope: [F4; 2]) -> F4 {
        const TEXEL_STEP: usize = MAX_PENUMBRA as usize / 3;
        let first = [at.x, at.y].map(|v| floor_to_texel(v) - F4::splat(1.5 * TEXEL_STEP as f32));
        let [x0, y0] = self.texel_indices(first);
        let half = F4::splat(0.5);
        let depth = at.z + (slope[0] * (first[0] + half - at.x) + slope[1] * (first[1] + half - at.y));
        let (mut sum, mut count) = (F4::ZERO, F4::ZERO);
        for y in 0..4 {
            let depth = depth + slope[1] * (y * TEXEL_STEP) as f32;
            for x in 0..4 {
                let map_depth = F4(std::array::from_fn(|i| {
                    self.depth_row::<1>(x0[i] + x * TEXEL_STEP, y0[i] + y * TEXEL_STEP)[0]
                }));
                let offset = map_depth - (depth + slope[0] * (x * TEXEL_STEP) as f32);
                let nearer = offset.0.map(|offset| offset > 0.0);
                sum += select(nearer, offset, F4::ZERO);
                count += select(nearer, F4::ONE, F4::ZERO);
            }
        }
        let width = (sum / count * self.uniform.texel.y).clamp(3.0, MAX_PENUMBRA);
        select(count.0.map(|count| count == 0.0 || count == 16.0), F4::splat(3.0), width)
    }

    /// Lit share by a box filter of width × width texels. The compared depth follows the surface in steps of 2 × 2 texels.
    fn penumbra_filtered(&self, at: V3, slope: [F4; 2], width: F4) -> F4 {
        /// Texels that the widest box touches, rounded up to an even number.
        const MAX_TEXELS: usize = MAX_PENUMBRA as usize + 2;
        let half = width * 0.5;
        let (low, high) = ([at.x - half, at.y - half], [at.x + half, at.y + half]);
        let first = low.map(floor_to_texel);
        let [x0, y0] = self.texel_indices(first);
        // Weights are 0 beyond the box of a lane that is smaller than the largest.
        let touched = |k: usize| {
            let counts = (floor_to_texel(high[k]) - first[k]).0.map(|t| t as i32 as usize + 1);
            counts.into_iter().fold(0, usize::max)
        };
        let inside = |k: usize, i: usize| {
            let texel = first[k] + F4::splat(i as f32);
            ((texel + F4::ONE).min(high[k]) - texel.max(low[k])).clamp(0.0, 1.0)
        };
        let weights: [[F4; MAX_TEXELS]; 2] = [0, 1].map(|k| std::array::from_fn(|i| inside(k, i)));
        let depth = at.z + (slope[0] * (first[0] + F4::ONE - at.x) + slope[1] * (first[1] + F4::ONE - at.y));
        let mut sum = F4::ZERO;
        for y in (0..touched(1)).step_by(2) {
            for x in (0..touched(0)).step_by(2) {
                let depth = (depth + slope[0] * x as f32 + slope[1] * y as f32).max(F4::ZERO);
                let row = |y: usize| {
                    let row: [[f32; 2]; 4] = std::array::from_fn(|i| self.depth_row(x0[i] + x, y0[i] + y));
                    let lit = |k: usize| {
                        let lit = std::array::from_fn(|i| depth.0[i] >= row[i][k]);
                        select(lit, weights[0][x + k], F4::ZERO)
                    };
                    lit(0) + lit(1)
                };
                sum += weights[1][y] * row(y) + weights[1][y + 1] * row(y + 1);
            }
        }
        sum / (width * width)
    }

    /// Lanes whose whole lookup area is lit, and lanes whose whole area is in shadow, by the depth ranges of blocks. Most lanes
    /// are in one of the two masks, and need no filter.
    fn fully_lit_or_dark(&self, at: V3, slope: [F4; 2]) -> [Mask; 2] {
        let around = (slope[0].map(f32::abs) + slope[1].map(f32::abs)) * LOOKUP_RADIUS;
        let (lowest, highest) = ((at.z - around).max(F4::ZERO), at.z + around);
        let blocks = self.size.map(|s| (s as usize).div_ceil(BLOCK_SIDE));
        let ranges: [[f32; 2]; 4] = std::array::from_fn(|i| {
            let block = |position: f32, k: usize| {
                let block = (position - self.at[k] as f32) * (1.0 / BLOCK_SIDE as f32);
                (block as i32 as usize).min(blocks[k] - 1)
            };
            self.ranges[block(at.y.0[i], 1) * blocks[0] + block(at.x.0[i], 0)]
        });
        let lit = std::array::from_fn(|i| lowest.0[i] >= ranges[i][1]);
        [lit, std::array::from_fn(|i| highest.0[i] < ranges[i][0])]
    }
}

/// Rounds down to whole texels, for positions inside a map, which are never negative.
fn floor_to_texel(v: F4) -> F4 {
    v.map(|v| v as i32 as f32)
}

/// Least and greatest depth of each block of texels and its neighboring blocks, which contain all texels that a lookup in the
/// block reads.
fn block_depth_ranges(size: [u32; 2], depth: &[f32]) -> Vec<[f32; 2]> {
    let [width, height] = size.map(|s| s as usize);
    let blocks = [width.div_ceil(BLOCK_SIDE), height.div_ceil(BLOCK_SIDE)];
    let merge = |a: [f32; 2], b: [f32; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    const EMPTY_RANGE: [f32; 2] = [f32::INFINITY, 0.0];
    let mut ranges = vec![EMPTY_RANGE; blocks[0] * blocks[1]];
    for (y, row) in depth.chunks_exact(width).enumerate() {
        for (x, part) in row.chunks(BLOCK_SIDE).enumerate() {
            let [least, most] = &mut ranges[y / BLOCK_SIDE * blocks[0] + x];
            for d in part {
                (*least, *most) = (least.min(*d), most.max(*d));
            }
        }
    }
    let mut ranges_in_rows = ranges.clone();
    for (row, out) in ranges.chunks_exact(blocks[0]).zip(ranges_in_rows.chunks_exact_mut(blocks[0])) {
        for (x, out) in out.iter_mut().enumerate() {
            *out = row[x.saturating_sub(1)..(x + 2).min(row.len())].iter().copied().fold(EMPTY_RANGE, merge);
        }
    }
    let at = |x: usize, y: usize| ranges_in_rows[y * blocks[0] + x];
    let with_neighbors = |i: usize| {
        let (x, y) = (i % blocks[0], i / blocks[0]);
        (y.saturating_sub(1)..(y + 2).min(blocks[1])).map(|y| at(x, y)).fold(EMPTY_RANGE, merge)
    };
    (0..ranges.len()).map(with_neighbors).collect()
}

/// The greatest depth of each texel: the surface nearest to the light.
fn draw_depths(size: [u32; 2], batches: &[Batch]) -> Vec<f32> {
    let [width, height] = size.map(|s| s as usize);
    let lists = triangles_by_band(batches.iter(), size);
    let mut out = vec![0.0; width * height];
    out.par_chunks_mut(width * TILE_HEIGHT as usize).zip(lists).enumerate().for_each(
        |(band, (rows, list))| {
            if list.is_empty() {
                return;
            }
            let mut tiles = vec![0.0; width.div_ceil(TILE_WIDTH as usize) * TILE_PIXELS];
            for [b, t] in list {
                let batch = &batches[b as usize];
                let triangle = &batch.triangles[t as usize];
                let [x0, _, x1, _] = triangle.pixel_bounds();
                let (first, last) = (x0.clamp(0, width as i32 - 1), (x1 - 1).clamp(0, width as i32 - 1));
                for column in first / TILE_WIDTH..=last / TILE_WIDTH {
                    let depth = &mut tiles[column as usize * TILE_PIXELS..][..TILE_PIXELS];
                    let at = [column * TILE_WIDTH, band as i32 * TILE_HEIGHT];
                    rasterize::<1>(triangle, at, |index, covered, z| {
                        let kept = kept_texels(batch, triangle, at, index);
                        for i in 0..4 {
                            if covered[i] && kept[i] && z[i] > depth[index + i] {
                                depth[index + i] = z[i];
                            }
                        }
                    });
                }
            }
            for (y, row) in rows.chunks_exact_mut(width).enumerate() {
                for (x, out) in row.iter_mut().enumerate() {
                    let (column, x) = (x / TILE_WIDTH as usize, x % TILE_WIDTH as usize);
                    *out = tiles[column * TILE_PIXELS + y * TILE_WIDTH as usize + x];
                }
            }
        },
    );
    out
}

/// Whether the alpha test keeps each of four texels in a row. Textures are filtered over quads, as for the image.
pub(super) fn kept_texels(batch: &Batch, triangle: &Triangle, at: [i32; 2], index: usize) -> [bool; 4] {
    let BatchShading::Surface(fragment) = &batch.shading else { return [true; 4] };
    if !fragment.features.has(Features::ALPHA_MASK) {
        return [true; 4];
    }
    let (x, y) = (index as i32 % TILE_WIDTH + at[0], index as i32 / TILE_WIDTH + at[1]);
    let mut kept = [true; 4];
    for pair in 0..2 {
        let px = (x + 2 * pair - triangle.origin[0]) as f32 + 0.5;
        let py = (y / 2 * 2 - triangle.origin[1]) as f32 + 0.5;
        let xs = F4([px, px + 1.0, px, px + 1.0]);
        let ys = F4([py, py, py + 1.0, py + 1.0]);
        let e = triangle.edges.map(|[a, b, c]| xs * a + ys * b + F4::splat(c));
        let scale = F4::ONE / (e[0] + e[1] + e[2]);
        let weights = Weights { values: e.map(|e| e * scale), visible: ALL_LANES };
        let shaded = fragment.shade(&batch.vertices, triangle.vertices, triangle.front, &weights);
        let row = 2 * (y % 2) as usize;
        kept[2 * pair as usize] = shaded.kept_samples[row] != 0;
        kept[2 * pair as usize + 1] = shaded.kept_samples[row + 1] != 0;
    }
    kept
}
