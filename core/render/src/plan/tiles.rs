//! Tiles: an image larger than a device can draw at once is drawn in parts, each with its own plan.
//!
//! Each tile enlarges its part of the camera's clip space. Full-screen passes and layers in front run on the whole image once all
//! tiles are drawn; layers behind are cut into tiles. Edges may differ by the rounding of a vertex.

use crate::error::RenderError;
use crate::layers_2d::LayerImage;
use crate::plan::Plan;
use crate::plan::dirty_rect::DirtyRect;
use crate::plan::light_clusters::LightClusters;
use crate::plan::{Features, View};
use crate::scene_resources::SceneResources;
use choreo_stage::Background;
use glam::{DMat4, DVec4, Mat4, Vec4Swizzles};
use std::sync::Arc;

/// Largest side of an image that is drawn in tiles, in pixels: a frame of 4 GB.
pub const MAX_TILED_SIDE: u32 = 32_768;

/// Largest number of pixels that are drawn at once, even if a device could draw more: color, depth and the copy for the host
/// take 12 bytes per pixel beside the frame itself, and 44 with four samples.
const MAX_PIXELS_AT_ONCE: u64 = 1 << 26;
/// Side of a tile of such an image in pixels.
const TILE_SIDE: u32 = 4096;

/// Side of an image's tiles in pixels; `None` if it is drawn as a whole. `longest`: the device's largest image side. `whole`: the
/// image should not be drawn in tiles, so it is only if the device's limit requires it.
pub(crate) fn side_of_tiles(size: [u32; 2], longest: u32, whole: bool) -> Option<u32> {
    let many = u64::from(size[0]) * u64::from(size[1]) > MAX_PIXELS_AT_ONCE;
    match size.iter().any(|side| *side > longest) {
        _ if many && !whole => Some(longest.min(TILE_SIDE)),
        true => Some(longest),
        false => None,
    }
}

/// A part of an image, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    pub at: [u32; 2],
    pub size: [u32; 2],
    /// Number of the tile's columns and rows, from its left and top, that lie in the image.
    pub keep: [u32; 2],
}

/// Tiles of one size, whose sides are at most `limit` long; the last of a row or column may reach beyond the image. They begin at
/// multiples of 16 pixels, or of four, if the limit allows: dithering repeats after 16 pixels, and derivatives are computed in
/// quads of two by two.
pub fn tiles(size: [u32; 2], limit: u32) -> Vec<Tile> {
    let step = [crate::dither::TABLE_SIDE as u32, 4, 1].into_iter().find(|step| *step <= limit).unwrap_or(1);
    let limit = (limit / step * step).max(1);
    let side = size.map(|s| s.div_ceil(s.div_ceil(limit).max(1)).next_multiple_of(step).min(limit));
    let along = move |i: usize| (0..size[i].div_ceil(side[i])).map(move |n| n * side[i]);
    let tile = |at: [u32; 2]| Tile { at, size: side, keep: [0, 1].map(|i| side[i].min(size[i] - at[i])) };
    along(1).flat_map(|y| along(0).map(move |x| [x, y])).map(tile).collect()
}

impl Plan {
    /// The plan of a tile, without full-screen passes and layers in front. Fails if the tile would need pixels of other tiles.
    pub fn tile(&self, tile: Tile, resources: &SceneResources) -> Result<Plan, RenderError> {
        if self.scene_color_copy.is_some() {
            let text = format!(
                "an image of {}×{} is drawn in tiles on this device, and refraction would show what is in other tiles: make the image \
                 smaller, or the refracting material thin (volume without thickness)",
                self.size[0], self.size[1]
            );
            return Err(RenderError::Usage(text));
        }
        let cut = tile_from_image(self.size, tile);
        let clip = |m: Mat4| (cut * m.as_dmat4()).as_mat4();
        let view = View {
            clip_from_view: clip(self.view.clip_from_view),
            clip_from_relative: clip(self.view.clip_from_relative),
            ..self.view
        };
        let mut part = Plan {
            size: tile.size,
            view,
            background: gradient_of(self.background, self.size, tile),
            layers_behind: self.layers_behind.as_ref().map(|layers| Arc::new(layers.part(tile))),
            dirty_rect: DirtyRect::EVERYTHING,
            layers_in_front: None,
            post: Vec::new(),
            scene_inputs: self.scene_inputs.clone().filter(|_| self.inputs_only),
            subframes: Vec::new(),
            history: Vec::new(),
            dissolve: None,
            ..self.clone()
        };
        if let Some(inputs) = &mut part.scene_inputs {
            inputs.clip_before = clip(inputs.clip_before);
        }
        if part.light_clusters.is_some() {
            part.light_clusters = Some(LightClusters::new(&part.lights, &part.view, part.size));
        }
        for v in &mut part.overlay.vertices {
            let wide = cut * v.clip.as_dvec4();
            v.clip = wide.as_vec4().xy().extend(v.clip.z).extend(v.clip.w);
        }
        part.widen_outlines(self.size[1] as f32 / tile.size[1] as f32, resources);
        Ok(part)
    }

    /// Scales the width of outlines that is a share of the image's height.
    fn widen_outlines(&mut self, factor: f32, resources: &SceneResources) {
        let views = self.shadow_maps.iter_mut().flat_map(|s| &mut s.views).flat_map(|v| &mut v.draws);
        let outlines =
            self.draws.iter_mut().chain(views).filter(|d| d.pipeline.features.has(Features::OUTLINE));
        let mut wider: Vec<((u32, Option<u32>), u32)> = Vec::new();
        for draw in outlines {
            let of = (draw.material, draw.material_override);
            if let Some((_, made)) = wider.iter().find(|(known, _)| *known == of) {
                draw.material_override = Some(*made);
                continue;
            }
            let now =
                draw.material_override.and_then(|at| self.material_overrides.get(at as usize)).map(|m| &**m);
            let Some(now) = now.or_else(|| resources.materials.get(draw.material as usize)) else { continue };
            let mut material = now.clone();
            let toon = material.material.toon.as_mut().map(Arc::make_mut);
            if let Some(outline) = toon.and_then(|t| t.outline.as_mut()).filter(|o| o.on_screen) {
                outline.width *= factor;
                self.material_overrides.push(Arc::new(material));
                wider.push((of, self.material_overrides.len() as u32 - 1));
                draw.material_override = Some(self.material_overrides.len() as u32 - 1);
            }
        }
    }
}

/// clip-of-tile-from-clip-of-image.
fn tile_from_image(whole: [u32; 2], tile: Tile) -> DMat4 {
    let row = |i: usize| {
        let (whole, at, side) = (f64::from(whole[i]), f64::from(tile.at[i]), f64::from(tile.size[i]));
        (whole / side, (whole - 2.0 * at) / side - 1.0)
    };
    let ((x, across), (y, down)) = (row(0), row(1));
    DMat4::from_cols(DVec4::X * x, DVec4::Y * y, DVec4::Z, DVec4::new(across, down, 0.0, 1.0))
}

fn gradient_of(background: Background, whole: [u32; 2], tile: Tile) -> Background {
    match background {
        Background::Gradient { top, bottom } => {
            let at = |y: u32| top.lerp(bottom, y as f32 / whole[1] as f32);
            Background::Gradient { top: at(tile.at[1]), bottom: at(tile.at[1] + tile.size[1]) }
        }
        color => color,
    }
}

impl LayerImage {
    /// The part that lies in a tile.
    fn part(&self, tile: Tile) -> LayerImage {
        let from = [0, 1].map(|i| self.at[i].max(tile.at[i]));
        let to = [0, 1].map(|i| (self.at[i] + self.area[i]).min(tile.at[i] + tile.size[i]).max(from[i]));
        let area = [0, 1].map(|i| to[i] - from[i]);
        let row = |y: u32| {
            let first = (y - self.at[1]) as usize * self.area[0] as usize + (from[0] - self.at[0]) as usize;
            &self.pixels[first..first + area[0] as usize]
        };
        let mut hasher = blake3::Hasher::new();
        hasher.update(&self.hash);
        hasher.update(format!("{:?} {:?}", tile.at, tile.size).as_bytes());
        LayerImage {
            size: tile.size,
            at: [0, 1].map(|i| from[i].saturating_sub(tile.at[i]).min(tile.size[i])),
            area,
            pixels: if area[0] == 0 { Vec::new() } else { (from[1]..to[1]).flat_map(row).copied().collect() },
            hash: *hasher.finalize().as_bytes(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_images_are_tiled_on_any_device() {
        let side = |size: [u32; 2], whole| side_of_tiles(size, 16384, whole);
        assert_eq!([[8192, 8192], [16384, 4096], [1, 1]].map(|size| side(size, false)), [None; 3]);
        assert_eq!(side([8192, 8193], false), Some(4096));
        assert_eq!([side([16384, 16384], true), side([20000, 1], true)], [None, Some(16384)]);
        assert_eq!(side_of_tiles([16384, 16384], 100, false), Some(100));
    }

    #[test]
    fn tiles_cover_each_pixel_once() {
        for (size, limit) in
            [([200, 150], 64), ([64, 64], 64), ([65, 1], 64), ([16_384, 9216], 8192), ([7, 7], 1)]
        {
            let all = tiles(size, limit);
            let mut seen = 0u64;
            for t in &all {
                assert!(t.size.iter().all(|s| *s <= limit) && t.size == all[0].size, "{t:?}");
                assert!((0..2).all(|i| t.at[i] + t.keep[i] <= size[i] && t.keep[i] > 0), "{t:?}");
                assert!(limit < 4 || t.at.iter().all(|at| at % 4 == 0), "{t:?}");
                seen += t.keep.map(u64::from).iter().product::<u64>();
            }
            assert_eq!(seen, u64::from(size[0]) * u64::from(size[1]), "{size:?}");
            let last = all[all.len() - 1];
            assert_eq!([0, 1].map(|i| last.at[i] + last.keep[i]), size);
        }
    }

    #[test]
    fn points_project_to_the_same_pixel_in_their_tile() {
        let whole = [200u32, 150];
        for tile in tiles(whole, 64) {
            let clip = DVec4::new(0.3, -0.7, 0.2, 1.9);
            let pixel = |c: DVec4, size: [u32; 2]| {
                let size = glam::DVec2::new(f64::from(size[0]), f64::from(size[1]));
                (c.xy() / c.w * 0.5 + 0.5) * size
            };
            let there = pixel(tile_from_image(whole, tile) * clip, tile.size);
            let here = pixel(clip, whole) - glam::DVec2::new(f64::from(tile.at[0]), f64::from(tile.at[1]));
            assert!((there - here).length() < 1e-9);
        }
    }

    #[test]
    fn layers_behind_are_cut_into_tiles() {
        let pixels: Vec<glam::Vec4> = (0..12).map(|i| glam::Vec4::splat(i as f32)).collect();
        let flat = LayerImage { size: [10, 10], at: [3, 2], area: [4, 3], pixels, hash: [7; 32] };
        let part = flat.part(Tile { at: [5, 0], size: [5, 4], keep: [5, 4] });
        assert_eq!((part.at, part.area), ([0, 2], [2, 2]));
        assert_eq!(part.pixels.iter().map(|p| p.x).collect::<Vec<_>>(), [2.0, 3.0, 6.0, 7.0]);
        let beside = flat.part(Tile { at: [0, 6], size: [5, 4], keep: [5, 4] });
        assert_eq!((beside.area[0] * beside.area[1], beside.pixels.len()), (0, 0));
        assert_ne!(part.hash, beside.hash);
    }
}
