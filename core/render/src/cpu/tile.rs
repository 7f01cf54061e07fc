//! Drawing of one tile. Opaque triangles are drawn into a visibility buffer, and each visible triangle is shaded once per pixel. Then
//! alpha-tested and blended triangles are drawn in order, and the samples are resolved. The image is the same as if the triangles
//! were drawn one after the other, but hidden triangles are not shaded.

use super::background_effects::PixelBackground;
use super::image_passes::{ImagePass, pixel_uv};
use super::overlay;
use super::raster::{TILE_HEIGHT, TILE_PIXELS, TILE_WIDTH, rasterize};
use super::refraction::SceneColorCopy;
use super::setup::Triangle;
use super::shade::{Fragment, Shaded};
use super::surface::MAX_QUADS;
use super::target::{OutputPixel, Target};
use super::vertex::Vertex;
use crate::dither::{self, dither_to_codes};
use crate::effect_faults::EffectFaults;
use crate::lanes::{F4, Mask, Weights};
use crate::layers_2d::LayerImage;
use crate::plan::{Glass, OverlayVertex};
use choreo_plugin::{Effect, SurfaceSample};
use glam::Vec4;
use std::sync::Arc;

/// Inputs for the shading of a batch's triangles.
pub(crate) enum BatchShading<'a> {
    Surface(Fragment<'a>),
    Overlay {
        vertices: &'a [OverlayVertex],
        /// Whether the overlay is drawn over all surfaces, also nearer ones.
        over: bool,
    },
}

impl BatchShading<'_> {
    fn glass(&self) -> Glass {
        match self {
            BatchShading::Surface(fragment) => fragment.glass,
            BatchShading::Overlay { .. } => Glass::No,
        }
    }

    /// Sets the scene color copy for refraction.
    pub(crate) fn set_scene_color_copy(&mut self, copy: &Arc<SceneColorCopy>) {
        if let BatchShading::Surface(fragment) = self {
            fragment.scene_color = Some(copy.clone());
        }
    }

    fn is_over_everything(&self) -> bool {
        matches!(self, BatchShading::Overlay { over: true, .. })
    }
}

/// One instance of a draw: its screen triangles and their shading.
pub(super) struct Batch<'a> {
    pub shading: BatchShading<'a>,
    pub phase: DrawPhase,
    /// Whether the triangles are blended by depth peeling.
    pub peeled: bool,
    pub vertices: Vec<Vertex>,
    pub triangles: Vec<Triangle>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DrawPhase {
    Opaque,
    Mask,
    Blend,
}

/// Depth test that selects the samples of a triangle that are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SampleTest {
    /// Samples nearer than the scene.
    Scene,
    /// Samples at the depth of the peeled layer.
    Layer,
    /// Samples nearer than the peeled layer.
    Nearer,
}

/// Index of a batch, and index of a triangle in it.
pub(crate) type TriangleId = [u32; 2];

const NO_TRIANGLE: u32 = u32::MAX;

/// Sample buffers of one tile, reused for the next.
pub(crate) struct TileBuffers<T> {
    pub(super) depth: Vec<f32>,
    /// Index of the visible opaque triangle of each sample in the tile's triangle list.
    visible: Vec<u32>,
    color: Vec<T>,
    /// Depth test of the triangle that is being drawn (alpha-tested or blended): one bit of each sample that passed.
    passed: Vec<u8>,
    /// Depth of each sample that passed.
    passed_depth: Vec<f32>,
    /// Depths of transparent surfaces: a layer and the one before it.
    pub(super) layers: [Vec<f32>; 2],
}

impl<T: Target> TileBuffers<T> {
    pub(super) fn new(samples: usize) -> Self {
        TileBuffers {
            depth: vec![0.0; TILE_PIXELS * samples],
            visible: vec![NO_TRIANGLE; TILE_PIXELS * samples],
            color: vec![T::encode(Vec4::ZERO); TILE_PIXELS * samples],
            passed: vec![0; TILE_PIXELS],
            passed_depth: vec![0.0; TILE_PIXELS * samples],
            layers: [Vec::new(), Vec::new()],
        }
    }
}

pub(super) struct Tile<'a, 'b> {
    pub batches: &'a [Batch<'b>],
    pub list: &'a [TriangleId],
    /// First pixel.
    pub at: [i32; 2],
    /// Pixels of the image that lie in this tile.
    pub size: [usize; 2],
    pub image_size: [u32; 2],
    /// Linear RGBA background of each row.
    pub background: [Vec4; TILE_HEIGHT as usize],
    /// Whether the background differs between rows.
    pub gradient: bool,
    /// Background with a color for each pixel, which replaces `background`.
    pub pixel_background: Option<&'a PixelBackground<'a>>,
    /// 2D layers over the background.
    pub layers_behind: Option<&'a LayerImage>,
    /// Number of depth-peeling layers.
    pub layers: u32,
    /// Per-pixel image effects.
    pub post: &'a [ImagePass],
    pub faults: &'a EffectFaults,
}

impl Tile<'_, '_> {
    /// Draws the tile. `rows` starts at its first pixel; rows are `stride` pixels apart.
    pub(super) fn draw<T: Target, P: OutputPixel, const S: usize>(
        &self,
        b: &mut TileBuffers<T>,
        rows: &mut [P],
        stride: usize,
    ) {
        let rows_are_uniform = self.pixel_background.is_none() && self.layers_behind.is_none();
        if self.list.is_empty() && self.post.is_empty() && rows_are_uniform {
            // The most common tile: every sample of a row is the background.
            for y in 0..self.size[1] {
                let row = self.background_row::<T>(y);
                let pixels = rows[y * stride..y * stride + self.size[0]].iter_mut();
                pixels.zip(row.iter().cycle()).for_each(|(pixel, color)| *pixel = P::from_sample(*color));
            }
            return;
        }
        for (row, background) in self.background.iter().enumerate() {
            let first = row * TILE_WIDTH as usize * S;
            let colors = &mut b.color[first..first + TILE_WIDTH as usize * S];
            if rows_are_uniform || row >= self.size[1] {
                let row = self.background_row::<T>(row);
                let pixels = colors.chunks_exact_mut(S).zip(row.iter().cycle());
                pixels.for_each(|(samples, color)| samples.fill(*color));
                continue;
            }
            let y = self.at[1] + row as i32;
            let mut behind = [*background; TILE_WIDTH as usize];
            let behind = &mut behind[..self.size[0]];
            if let Some(pixel_background) = self.pixel_background {
                pixel_background.write_row(self.at[0], y, behind);
            }
            for ((samples, pixel), x) in colors.chunks_exact_mut(S).zip(behind).zip(self.at[0]..) {
                if T::DITHERED && (self.gradient || self.pixel_background.is_some()) {
                    *pixel = dither_to_codes(*pixel, x as usize, y as usize);
                }
                if let Some(layers) = self.layers_behind {
                    let over = layers.pixel(x as u32, y as u32);
                    *pixel = over + *pixel * (1.0 - over.w);
                }
                samples.fill(T::encode(*pixel));
            }
        }
        if !self.list.is_empty() {
            b.depth.fill(0.0);
            let phase = |id: &TriangleId| self.batches[id[0] as usize].phase;
            let opaque = self.list.iter().take_while(|id| phase(id) == DrawPhase::Opaque).count();
            if opaque > 0 {
                b.visible.fill(NO_TRIANGLE);
                for (i, id) in self.list[..opaque].iter().enumerate() {
                    self.draw_opaque::<T, S>(b, self.triangle(id), i as u32);
                }
                self.shade_visible::<T, S>(b);
            }
            let mut remaining = &self.list[opaque..];
            while let Some((id, after)) = remaining.split_first() {
                let peeled = |id: &&TriangleId| self.batches[id[0] as usize].peeled;
                let peeled_count = remaining.iter().take_while(peeled).count();
                if peeled_count > 0 {
                    self.peel::<T, S>(b, &remaining[..peeled_count]);
                    remaining = &remaining[peeled_count..];
                    continue;
                }
                self.draw_triangle::<T, S>(b, id, SampleTest::Scene);
                remaining = after;
            }
        }
        self.write_pixels::<T, P, S>(b, rows, stride);
    }

    /// Encoded background of a row, as a pattern that repeats after `dither::TABLE_SIDE` pixels.
    fn background_row<T: Target>(&self, row: usize) -> [T; dither::TABLE_SIDE] {
        let color = self.background[row];
        let [x, y] = [self.at[0] as usize, self.at[1] as usize + row];
        match T::DITHERED && self.gradient {
            true => std::array::from_fn(|i| T::encode(dither_to_codes(color, x + i, y))),
            false => [T::encode(color); dither::TABLE_SIDE],
        }
    }

    pub(super) fn triangle(&self, id: &TriangleId) -> &Triangle {
        &self.batches[id[0] as usize].triangles[id[1] as usize]
    }

    /// Draws an opaque triangle into the visibility buffer. Reversed Z: a nearer sample has a greater depth. Of samples with equal
    /// depths, the first one stays.
    fn draw_opaque<T, const S: usize>(&self, b: &mut TileBuffers<T>, t: &Triangle, id: u32) {
        let (depth, visible) = (&mut b.depth[..], &mut b.visible[..]);
        rasterize::<S>(t, self.at, |index, covered, z| {
            let depth: &mut [f32; 4] = (&mut depth[index..index + 4]).try_into().expect("four samples");
            let visible: &mut [u32; 4] = (&mut visible[index..index + 4]).try_into().expect("four samples");
            for i in 0..4 {
                let nearer = covered[i] & (z[i] > depth[i]);
                depth[i] = if nearer { z[i] } else { depth[i] };
                visible[i] = if nearer { id } else { visible[i] };
            }
        });
    }

    fn shade_visible<T: Target, const S: usize>(&self, b: &mut TileBuffers<T>) {
        let mut pending = PendingQuads::default();
        for qy in 0..self.size[1].div_ceil(2) {
            for qx in 0..self.size[0].div_ceil(2) {
                let first = quad_samples::<S>(qx, qy);
                let mut ids = [[NO_TRIANGLE; S]; 4];
                for (ids, first) in ids.iter_mut().zip(first) {
                    ids.copy_from_slice(&b.visible[first..first + S]);
                }
                while let Some(&id) = ids.iter().flatten().find(|id| **id != NO_TRIANGLE) {
                    for sample in ids.iter_mut().flatten().filter(|sample| **sample == id) {
                        *sample = NO_TRIANGLE;
                    }
                    self.shade_visible_quad::<T, S>(b, &mut pending, id, [qx, qy]);
                }
            }
        }
        self.apply_pending_effects::<T, S>(b, &mut pending);
    }

    /// Shades a quad of a visible triangle. A quad with surface effects becomes pending until more quads of its batch are shaded.
    fn shade_visible_quad<T: Target, const S: usize>(
        &self,
        b: &mut TileBuffers<T>,
        pending: &mut PendingQuads,
        id: u32,
        [qx, qy]: [usize; 2],
    ) {
        let triangle = &self.list[id as usize];
        let batch = &self.batches[triangle[0] as usize];
        let visible = quad_samples::<S>(qx, qy).map(|first| b.visible[first..first + S].contains(&id));
        match &batch.shading {
            BatchShading::Surface(fragment) if fragment.has_surface_effects() => {
                if pending.batch != triangle[0] || pending.quads.len() == MAX_QUADS {
                    self.apply_pending_effects::<T, S>(b, pending);
                }
                pending.batch = triangle[0];
                let t = &batch.triangles[triangle[1] as usize];
                let (weights, at) = self.quad_weights(t, [qx, qy], visible);
                let vertices = &batch.vertices;
                pending.quads.push(fragment.shade(vertices, t.vertices, t.front, &weights));
                pending.samples.extend(fragment.surface_samples(vertices, t.vertices, t.front, &weights, at));
                pending.positions.push((id, [qx, qy]));
            }
            _ => self.write_visible::<T, S>(b, id, [qx, qy], &self.shade_quad(triangle, [qx, qy], visible)),
        }
    }

    fn apply_pending_effects<T: Target, const S: usize>(
        &self,
        b: &mut TileBuffers<T>,
        pending: &mut PendingQuads,
    ) {
        if pending.quads.is_empty() {
            return;
        }
        if let BatchShading::Surface(fragment) = &self.batches[pending.batch as usize].shading {
            fragment.apply_surface_effects(&mut pending.quads, &pending.samples);
        }
        for ((id, at), shaded) in pending.positions.drain(..).zip(pending.quads.drain(..)) {
            self.write_visible::<T, S>(b, id, at, &shaded);
        }
        pending.samples.clear();
    }

    /// Draws an alpha-tested triangle, which writes depth, or a blended triangle, which does not.
    pub(super) fn draw_triangle<T: Target, const S: usize>(
        &self,
        b: &mut TileBuffers<T>,
        id: &TriangleId,
        test: SampleTest,
    ) {
        let t = self.triangle(id);
        let batch = &self.batches[id[0] as usize];
        let (blend, glass) = (batch.phase == DrawPhase::Blend, batch.shading.glass());
        let over = batch.shading.is_over_everything();
        let (depth, passed, passed_depth) = (&b.depth[..], &mut b.passed[..], &mut b.passed_depth[..]);
        let layer = &b.layers[0][..];
        let mut found = false;
        rasterize::<S>(t, self.at, |index, covered, z| {
            for i in 0..4 {
                let passes = match test {
                    SampleTest::Scene => over || z[i] > depth[index + i],
                    SampleTest::Layer => z[i] == layer[index + i],
                    SampleTest::Nearer => z[i] > layer[index + i],
                };
                if covered[i] && passes {
                    found = true;
                    passed[(index + i) / S] |= 1 << ((index + i) % S);
                    passed_depth[index + i] = z[i];
                }
            }
        });
        if !found {
            return;
        }
        let [x0, y0, x1, y1] = t.pixel_bounds();
        let range = |low: i32, high: i32, at: i32, size: i32| {
            ((low - at).max(0) as usize / 2, ((high - at).clamp(0, size) as usize).div_ceil(2))
        };
        let (qx0, qx1) = range(x0, x1, self.at[0], TILE_WIDTH);
        let (qy0, qy1) = range(y0, y1, self.at[1], TILE_HEIGHT);
        for qy in qy0..qy1 {
            for qx in qx0..qx1 {
                let first = quad_samples::<S>(qx, qy);
                let masks = first.map(|f| std::mem::take(&mut b.passed[f / S]));
                if masks == [0; 4] {
                    continue;
                }
                let shaded = self.shade_quad(id, [qx, qy], masks.map(|mask| mask != 0));
                for pixel in 0..4 {
                    let mask = masks[pixel] & shaded.kept_samples[pixel];
                    if mask == 0 {
                        continue;
                    }
                    let color = shaded.pixel(pixel);
                    self.record_fault(id, &shaded, pixel, [qx, qy]);
                    for s in (0..S).filter(|s| mask & (1 << s) != 0) {
                        let at = first[pixel] + s;
                        if blend {
                            b.color[at] = match glass {
                                Glass::No | Glass::Refract => b.color[at].blend_over(color),
                                Glass::Filter => b.color[at].filter_through_glass(color),
                                Glass::Light => b.color[at].add_glass_light(color),
                            };
                        } else {
                            b.color[at] = T::encode(color);
                            b.depth[at] = b.passed_depth[at];
                        }
                    }
                }
            }
        }
    }

    /// Shades a quad. Attributes are evaluated at the centers of its pixels, also outside the triangle. `visible`: the pixels that
    /// are drawn.
    fn shade_quad(&self, id: &TriangleId, quad: [usize; 2], visible: Mask) -> Shaded {
        let batch = &self.batches[id[0] as usize];
        let t = &batch.triangles[id[1] as usize];
        let (weights, at) = self.quad_weights(t, quad, visible);
        match &batch.shading {
            BatchShading::Surface(fragment) => {
                fragment.shade_with_effects(&batch.vertices, t.vertices, t.front, &weights, at)
            }
            BatchShading::Overlay { vertices, .. } => overlay::shade_overlay(vertices, t.vertices, &weights),
        }
    }

    /// Barycentric weights of a quad's pixels, and the first pixel of the quad.
    fn quad_weights(&self, t: &Triangle, [qx, qy]: [usize; 2], visible: Mask) -> (Weights, [i32; 2]) {
        let px = (self.at[0] + 2 * qx as i32 - t.origin[0]) as f32 + 0.5;
        let py = (self.at[1] + 2 * qy as i32 - t.origin[1]) as f32 + 0.5;
        let x = F4([px, px + 1.0, px, px + 1.0]);
        let y = F4([py, py, py + 1.0, py + 1.0]);
        let e = t.edges.map(|[a, b, c]| x * a + y * b + F4::splat(c));
        let scale = F4::ONE / (e[0] + e[1] + e[2]);
        let weights = Weights { values: e.map(|e| e * scale), visible };
        (weights, [self.at[0] + 2 * qx as i32, self.at[1] + 2 * qy as i32])
    }

    fn write_pixels<T: Target, P: OutputPixel, const S: usize>(
        &self,
        b: &TileBuffers<T>,
        rows: &mut [P],
        stride: usize,
    ) {
        for y in 0..self.size[1] {
            let first = y * TILE_WIDTH as usize * S;
            let samples = &b.color[first..first + self.size[0] * S];
            let row = &mut rows[y * stride..y * stride + self.size[0]];
            let resolved = samples.chunks_exact(S).map(T::resolve);
            if self.post.is_empty() {
                row.iter_mut().zip(resolved).for_each(|(out, resolved)| *out = P::from_sample(resolved));
                continue;
            }
            let uv = pixel_uv([self.at[0], self.at[1] + y as i32], self.size[0], self.image_size);
            let mut colors: Vec<Vec4> = resolved.map(|resolved| resolved.decode()).collect();
            for (number, pass) in self.post.iter().enumerate() {
                if number > 0 {
                    colors.iter_mut().for_each(|color| *color = T::encode(*color).decode());
                }
                if let Effect::Pixel(effect) = &pass.effect {
                    effect.pixels(&mut colors, &uv, &pass.parameters);
                    let [x0, y0] = self.at;
                    self.faults
                        .replace_faulty_colors(&pass.effect, &mut colors, |x| [x0 + x as i32, y0 + y as i32]);
                }
            }
            let [x, y] = [self.at[0] as usize, self.at[1] as usize + y];
            for ((out, color), x) in row.iter_mut().zip(colors).zip(x..) {
                *out = P::from_color(color, [x, y]);
            }
        }
    }
}

/// First sample of each of a quad's pixels: top left, top right, bottom left, bottom right.
#[inline(always)]
fn quad_samples<const S: usize>(qx: usize, qy: usize) -> [usize; 4] {
    let width = TILE_WIDTH as usize;
    let first = (2 * qy * width + 2 * qx) * S;
    [first, first + S, first + width * S, first + (width + 1) * S]
}

/// Bounds of the tiles that contain the triangle's pixels: [x0, x1) × [y0, y1), as x0, y0, x1, y1.
pub(crate) fn tile_bounds(t: &Triangle, size: [u32; 2]) -> [u16; 4] {
    let [x0, y0, x1, y1] = t.pixel_bounds();
    let [w, h] = size.map(|s| s as i32);
    let up = |v: i32, tile: i32| ((v + tile - 1) / tile) as u16;
    [
        (x0.clamp(0, w - 1) / TILE_WIDTH) as u16,
        (y0.clamp(0, h - 1) / TILE_HEIGHT) as u16,
        up(x1.clamp(0, w), TILE_WIDTH),
        up(y1.clamp(0, h), TILE_HEIGHT),
    ]
}

/// The triangles in each band of tiles, in the order of the batches.
pub(crate) fn triangles_by_band<'a, 'b: 'a>(
    batches: impl Iterator<Item = &'a Batch<'b>>,
    size: [u32; 2],
) -> Vec<Vec<TriangleId>> {
    let mut lists = vec![Vec::new(); size[1].div_ceil(TILE_HEIGHT as u32) as usize];
    for (b, batch) in batches.enumerate() {
        for (t, triangle) in batch.triangles.iter().enumerate() {
            let [_, y0, _, y1] = tile_bounds(triangle, size);
            lists[usize::from(y0)..usize::from(y1)]
                .iter_mut()
                .for_each(|list| list.push([b as u32, t as u32]));
        }
    }
    lists
}

/// Shaded quads of one batch to which the surface effects have not been applied yet.
#[derive(Default)]
struct PendingQuads {
    /// Index of the batch.
    batch: u32,
    quads: Vec<Shaded>,
    samples: Vec<SurfaceSample>,
    /// The triangle of each quad, and the quad's position in the tile.
    positions: Vec<(u32, [usize; 2])>,
}

impl Tile<'_, '_> {
    /// Writes a shaded quad into the samples in which its triangle is visible.
    fn write_visible<T: Target, const S: usize>(
        &self,
        b: &mut TileBuffers<T>,
        id: u32,
        at: [usize; 2],
        shaded: &Shaded,
    ) {
        for (pixel, first) in quad_samples::<S>(at[0], at[1]).into_iter().enumerate() {
            let visible = &b.visible[first..first + S];
            if visible.contains(&id) {
                self.record_fault(&self.list[id as usize], shaded, pixel, at);
                let color = T::encode(shaded.pixel(pixel));
                for (sample, _) in b.color[first..].iter_mut().zip(visible).filter(|(_, v)| **v == id) {
                    *sample = color;
                }
            }
        }
    }

    /// Records the fault of an effect at a pixel of a quad, if the pixel has one.
    fn record_fault(&self, id: &TriangleId, shaded: &Shaded, pixel: usize, [qx, qy]: [usize; 2]) {
        let Some(fault) = shaded.faults[pixel] else { return };
        if let BatchShading::Surface(fragment) = &self.batches[id[0] as usize].shading {
            let [x, y] = [2 * qx + pixel % 2, 2 * qy + pixel / 2];
            fragment.record_fault(self.faults, fault, [self.at[0] + x as i32, self.at[1] + y as i32]);
        }
    }
}
