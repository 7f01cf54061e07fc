//! Shadow maps, drawn by the same rasterizer as images, and their lookup. CPU reference of shadow.wgsl.

use super::raster::{TILE_HEIGHT, TILE_PIXELS, TILE_WIDTH, cover};
use super::setup::Triangle;
use super::tile::{Batch, Paint};
use crate::lanes::{F4, V3, Weights};
use crate::plan::{Features, PlanLight, ShadowView};
use crate::shader::uniforms::{MAX_PENUMBRA, ShadowUniform};
use glam::{Vec2, Vec3, Vec3Swizzles, Vec4Swizzles};
use rayon::prelude::*;

/// All maps of a frame, drawn.
#[derive(Default)]
pub struct ShadowMaps {
    maps: Vec<Map>,
}

struct Map {
    at: [u32; 2],
    size: [u32; 2],
    lookup: ShadowUniform,
    /// Row by row; 0 where nothing is.
    depth: Vec<f32>,
    /// Least and greatest depth of each block, row by row, if its penumbras differ in width.
    ranges: Vec<[f32; 2]>,
}

/// Side of a block of texels.
const BLOCK: usize = 8;

impl ShadowMaps {
    /// `batches`: what is drawn into each view, seen from its light.
    pub fn draw<'a>(
        views: &[ShadowView],
        image: [u32; 2],
        batches: impl Fn(&ShadowView) -> Vec<Batch<'a>>,
    ) -> ShadowMaps {
        let draw = |view: &ShadowView| {
            let depth = depths(view.size, &batches(view));
            let ranges = if view.penumbra > 0.0 { ranges(view.size, &depth) } else { Vec::new() };
            Map { at: view.at, size: view.size, lookup: ShadowUniform::new(view, image), depth, ranges }
        };
        ShadowMaps { maps: views.iter().map(draw).collect() }
    }

    /// How much of a light arrives at four places, 0 to 1. `n`: the surface's own normal; `l`: to the light.
    pub fn share(&self, light: &PlanLight, relative: V3, n: V3, l: V3) -> F4 {
        let [first, count] = light.shadow_views.map(usize::from);
        let Some(maps) = self.maps.get(first..first + count).filter(|m| !m.is_empty()) else {
            return F4::ONE;
        };
        let nl = n.dot(l).clamp(0.0, 1.0);
        F4(std::array::from_fn(|i| {
            let at = |v: V3| Vec3::new(v.x.0[i], v.y.0[i], v.z.0[i]);
            share(maps, at(relative), at(n), at(l), nl.0[i])
        }))
    }
}

fn share(maps: &[Map], relative: Vec3, n: Vec3, l: Vec3, nl: f32) -> f32 {
    // A slope's depth changes by tan over a texel; a step of as many texels as the filter reaches along the normal, times
    // the sine, makes up for it at every angle (Holbert, "Saying Goodbye to Shadow Acne", GDC 2011).
    let slope = 3.0 * (1.0 - nl * nl).sqrt();
    for map in maps {
        let view = &map.lookup;
        let here = view.texel_from_relative * relative.extend(1.0);
        let texel = view.texel.x * here.w;
        let moved = relative + n * (slope * texel) + l * (0.25 * texel);
        let p = view.texel_from_relative * moved.extend(1.0);
        let at = p.truncate() / p.w.max(1e-6);
        let inside = at.xy().cmpge(view.inside.xy()).all() && at.xy().cmple(view.inside.zw()).all();
        // A point behind the depth range of this map lies in a later one.
        if p.w > 0.0 && at.z >= 0.0 && inside {
            return if view.texel.y == 0.0 { map.filtered(at) } else { map.with_penumbra(at, n) };
        }
    }
    1.0
}

impl Map {
    /// A box of 3 × 3 texels moved over the depth comparisons of 4 × 4: weights 1 − f, 1, 1, f.
    fn filtered(&self, at: Vec3) -> f32 {
        let corner = (at.xy() - 0.5).floor();
        let f = at.xy() - 0.5 - corner;
        let depth = at.z.max(0.0);
        let first = corner - Vec2::new(self.at[0] as f32, self.at[1] as f32) - 1.0;
        let (x0, y0) = (first.x.max(0.0) as usize, first.y.max(0.0) as usize);
        let (wx, wy) = ([1.0 - f.x, 1.0, 1.0, f.x], [1.0 - f.y, 1.0, 1.0, f.y]);
        let mut sum = 0.0;
        for (y, wy) in wy.into_iter().enumerate() {
            let row = (y0 + y) * self.size[0] as usize + x0;
            let lit =
                |x: usize| if depth >= self.depth.get(row + x).copied().unwrap_or(0.0) { wx[x] } else { 0.0 };
            sum += wy * (lit(0) + lit(1) + lit(2) + lit(3));
        }
        sum / 9.0
    }
}

impl Map {
    /// `x`, `y`: texel of the image, which lies in this map.
    fn depth_at(&self, x: usize, y: usize) -> f32 {
        self.depth.get(y * self.size[0] as usize + x).copied().unwrap_or(0.0)
    }

    /// The texel of this map at a place of the image.
    fn texel(&self, place: Vec2) -> [usize; 2] {
        let texel = place - Vec2::new(self.at[0] as f32, self.at[1] as f32);
        [texel.x.max(0.0) as usize, texel.y.max(0.0) as usize]
    }

    fn with_penumbra(&self, at: Vec3, n: Vec3) -> f32 {
        if let Some(all) = self.uniform_around(at, n) {
            return all;
        }
        let slope = self.slope(n);
        let width = self.penumbra_width(at, slope);
        if width <= 3.0 { self.filtered(at) } else { self.penumbra_filtered(at, slope, width) }
    }

    /// How much the depth of a surface changes from texel to texel, at most as if it stood 79° to the light.
    fn slope(&self, n: Vec3) -> Vec2 {
        let m = &self.lookup.texel_from_relative;
        let [x, y, z] = [0, 1, 2].map(|i| m.row(i).xyz());
        let nz = n.dot(z).max(0.2 * z.length());
        -Vec2::new(n.dot(x), n.dot(y)) * (self.lookup.texel.x * self.lookup.texel.x * z.dot(z) / nz)
    }

    /// Width of the penumbra in texels, from the mean depth of what is nearer to the light among 4 × 4 texels (Fernando,
    /// "Percentage-Closer Soft Shadows", 2005), which span the widest one, so that none begins with a step. 3, the narrowest, where
    /// all or none of them are nearer.
    fn penumbra_width(&self, at: Vec3, slope: Vec2) -> f32 {
        const STEP: usize = MAX_PENUMBRA as usize / 3;
        let middle = at.xy().floor();
        let first = middle - 1.5 * STEP as f32;
        let [x0, y0] = self.texel(first);
        let depth = at.z + slope.dot(first + 0.5 - at.xy());
        let (mut sum, mut count) = (0.0, 0.0);
        for y in 0..4 {
            let depth = depth + slope.y * (y * STEP) as f32;
            for x in 0..4 {
                let off = self.depth_at(x0 + x * STEP, y0 + y * STEP) - (depth + slope.x * (x * STEP) as f32);
                if off > 0.0 {
                    sum += off;
                    count += 1.0;
                }
            }
        }
        if count == 0.0 || count == 16.0 {
            return 3.0;
        }
        (sum / count * self.lookup.texel.y).clamp(3.0, MAX_PENUMBRA)
    }

    /// A box of width × width texels; the depth follows the surface, in steps of 2 × 2 texels.
    fn penumbra_filtered(&self, at: Vec3, slope: Vec2, width: f32) -> f32 {
        /// Texels that the widest box touches, to an even number.
        const MOST: usize = MAX_PENUMBRA as usize + 2;
        let (low, high) = (at.xy() - 0.5 * width, at.xy() + 0.5 * width);
        let first = low.floor();
        let [x0, y0] = self.texel(first);
        let [columns, rows] = (high.floor() - first).to_array().map(|t| t as usize + 1);
        let inside = |i: usize| {
            let texel = first + i as f32;
            ((texel + 1.0).min(high) - texel.max(low)).clamp(Vec2::ZERO, Vec2::ONE)
        };
        let weights: [Vec2; MOST] = std::array::from_fn(inside);
        let depth = at.z + slope.dot(first + 1.0 - at.xy());
        let mut sum = 0.0;
        for y in (0..rows).step_by(2) {
            for x in (0..columns).step_by(2) {
                let depth = (depth + slope.x * x as f32 + slope.y * y as f32).max(0.0);
                let row = |y: usize| {
                    let lit = |x: usize| f32::from(u8::from(depth >= self.depth_at(x0 + x, y0 + y)));
                    weights[x].x * lit(x) + weights[x + 1].x * lit(x + 1)
                };
                sum += weights[y].y * row(y) + weights[y + 1].y * row(y + 1);
            }
        }
        sum / (width * width)
    }

    /// 1 or 0 if every texel that a lookup may read is lit or in shadow, by the ranges of its blocks: most places are.
    fn uniform_around(&self, at: Vec3, n: Vec3) -> Option<f32> {
        let reach = 0.5 * MAX_PENUMBRA + 2.0;
        let first = Vec2::new(self.at[0] as f32, self.at[1] as f32);
        let block = |v: f32| (v / BLOCK as f32).max(0.0) as usize;
        let (low, high) = (at.xy() - reach - first, at.xy() + reach - first);
        let blocks = self.size.map(|s| (s as usize).div_ceil(BLOCK));
        let (mut nearest, mut farthest) = (0.0f32, f32::INFINITY);
        for y in block(low.y)..=block(high.y).min(blocks[1] - 1) {
            for x in block(low.x)..=block(high.x).min(blocks[0] - 1) {
                let [least, most] = self.ranges[y * blocks[0] + x];
                (nearest, farthest) = (nearest.max(most), farthest.min(least));
            }
        }
        let slope = self.slope(n).abs();
        let around = reach * (slope.x + slope.y);
        if (at.z - around).max(0.0) >= nearest {
            Some(1.0)
        } else if at.z + around < farthest {
            Some(0.0)
        } else {
            None
        }
    }
}

/// Least and greatest depth of each block of texels.
fn ranges(size: [u32; 2], depth: &[f32]) -> Vec<[f32; 2]> {
    let [width, height] = size.map(|s| s as usize);
    let blocks = [width.div_ceil(BLOCK), height.div_ceil(BLOCK)];
    let mut out = vec![[f32::INFINITY, 0.0]; blocks[0] * blocks[1]];
    for (y, row) in depth.chunks_exact(width).enumerate() {
        for (x, part) in row.chunks(BLOCK).enumerate() {
            let [least, most] = &mut out[y / BLOCK * blocks[0] + x];
            for d in part {
                (*least, *most) = (least.min(*d), most.max(*d));
            }
        }
    }
    out
}

/// The greatest depth of each texel: what is nearest to the light.
fn depths(size: [u32; 2], batches: &[Batch]) -> Vec<f32> {
    let [width, height] = size.map(|s| s as usize);
    let bands = height.div_ceil(TILE_HEIGHT as usize);
    let mut lists: Vec<Vec<[u32; 2]>> = vec![Vec::new(); bands];
    for (b, batch) in batches.iter().enumerate() {
        for (t, triangle) in batch.triangles.iter().enumerate() {
            let [_, y0, _, y1] = triangle.pixels();
            let band = |y: i32| (y.clamp(0, height as i32) / TILE_HEIGHT) as usize;
            for list in &mut lists[band(y0).min(bands)..(band(y1 - 1) + 1).min(bands)] {
                list.push([b as u32, t as u32]);
            }
        }
    }
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
                let [x0, _, x1, _] = triangle.pixels();
                let (first, last) = (x0.clamp(0, width as i32 - 1), (x1 - 1).clamp(0, width as i32 - 1));
                for column in first / TILE_WIDTH..=last / TILE_WIDTH {
                    let depth = &mut tiles[column as usize * TILE_PIXELS..][..TILE_PIXELS];
                    let at = [column * TILE_WIDTH, band as i32 * TILE_HEIGHT];
                    cover::<1>(triangle, at, |index, covered, z| {
                        let kept = holes(batch, triangle, at, index);
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

/// Whether the alpha test keeps each of four texels in a row. Textures are filtered over quads, as the image's are.
pub(super) fn holes(batch: &Batch, triangle: &Triangle, at: [i32; 2], index: usize) -> [bool; 4] {
    let Paint::Surface(fragment) = &batch.paint else { return [true; 4] };
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
        let weights = Weights(e.map(|e| e * scale));
        let shaded = fragment.shade(&batch.vertices, triangle.vertices, triangle.front, &weights);
        let row = 2 * (y % 2) as usize;
        kept[2 * pair as usize] = shaded.kept[row] != 0;
        kept[2 * pair as usize + 1] = shaded.kept[row + 1] != 0;
    }
    kept
}
