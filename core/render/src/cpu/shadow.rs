//! Shadow maps, drawn by the same rasterizer as images, and their lookup. CPU reference of shadow.wgsl.

use super::raster::{TILE_HEIGHT, TILE_PIXELS, TILE_WIDTH, cover};
use super::setup::Triangle;
use super::tile::{Batch, Paint};
use crate::lanes::{F4, V3, Weights};
use crate::plan::{Features, PlanLight, ShadowView};
use crate::shader::uniforms::ShadowUniform;
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
}

impl ShadowMaps {
    /// `batches`: who is drawn into each view, seen from its light.
    pub fn draw<'a>(
        views: &[ShadowView],
        image: [u32; 2],
        batches: impl Fn(&ShadowView) -> Vec<Batch<'a>>,
    ) -> ShadowMaps {
        let draw = |view: &ShadowView| Map {
            at: view.at,
            size: view.size,
            lookup: ShadowUniform::new(view, image),
            depth: depths(view.size, &batches(view)),
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
        if p.w > 0.0 && inside {
            return map.filtered(at);
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

/// Which of four texels in a row the alpha test keeps. Textures are filtered over quads, as the picture's are.
fn holes(batch: &Batch, triangle: &Triangle, at: [i32; 2], index: usize) -> [bool; 4] {
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
