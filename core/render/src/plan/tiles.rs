//! Pictures larger than a device draws at once, in parts: each tile is a plan of its own, of which the picture's plan is the whole.
//!
//! A tile sees the same camera through a part of its picture: clip space is cut out and made larger. What comes over the picture
//! runs on the whole, once all tiles are there; what lies under it is cut. Edges may differ where a corner is rounded otherwise.

use crate::layers_2d::FlatPicture;
use crate::plan::build::dirty_rect::Area;
use crate::plan::build::light_clusters::LightLists;
use crate::plan::{Features, View};
use crate::{Catalog, Plan, RenderError};
use choreo_stage::Background;
use glam::{DMat4, DVec4, Mat4, Vec4Swizzles};
use std::sync::Arc;

/// Pixels a side that are drawn in tiles at most: a frame of 4 GB.
pub const MOST: u32 = 32_768;

/// Pixels that are drawn at once at most, though a device could draw more: of colours, depths and the copy of them for the host, a
/// picture takes 12 bytes a pixel beside the frame itself, and 44 with four samples.
pub const AT_ONCE: u64 = 1 << 26;
/// Pixels a side of a tile of such a picture.
const SIDE: u32 = 4096;

/// Pixels a side of its tiles; `None` of a picture that is drawn as a whole. `longest`: what the device draws.
/// `whole`: it cannot be drawn in parts, and is so only where it must.
pub fn side_of_tiles(size: [u32; 2], longest: u32, whole: bool) -> Option<u32> {
    let many = u64::from(size[0]) * u64::from(size[1]) > AT_ONCE;
    match size.iter().any(|side| *side > longest) {
        _ if many && !whole => Some(longest.min(SIDE)),
        true => Some(longest),
        false => None,
    }
}

/// A part of a picture, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    pub at: [u32; 2],
    pub size: [u32; 2],
    /// So many columns and rows of it, from its left and top, lie in the picture.
    pub keep: [u32; 2],
}

/// Tiles of one size, no side of which is longer than the limit; the last of a row or column may reach beyond the picture.
/// They begin at multiples of four pixels where the limit allows: derivatives belong to squares of two by two.
pub fn tiles(size: [u32; 2], limit: u32) -> Vec<Tile> {
    let limit = if limit < 4 { limit.max(1) } else { limit / 4 * 4 };
    let side = size.map(|s| s.div_ceil(s.div_ceil(limit).max(1)).next_multiple_of(4).min(limit));
    let along = move |i: usize| (0..size[i].div_ceil(side[i])).map(move |n| n * side[i]);
    let tile = |at: [u32; 2]| Tile { at, size: side, keep: [0, 1].map(|i| side[i].min(size[i] - at[i])) };
    along(1).flat_map(|y| along(0).map(move |x| [x, y])).map(tile).collect()
}

impl Plan {
    /// What of it makes a tile, without passes and layers over it; an error where a tile does not know enough.
    pub fn tile(&self, tile: Tile, catalog: &Catalog) -> Result<Plan, RenderError> {
        if self.behind.is_some() {
            let text = format!(
                "a picture of {}×{} is drawn in tiles on this device, and glass that bends light shows what other tiles hold: \
                 make the picture smaller, or the glass thin (volume without thickness)",
                self.size[0], self.size[1]
            );
            return Err(RenderError::Usage(text));
        }
        let cut = cut(self.size, tile);
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
            under: self.under.as_ref().map(|under| Arc::new(under.part(tile))),
            area: Area::EVERYTHING,
            over: None,
            post: Vec::new(),
            exposed: Vec::new(),
            before: Vec::new(),
            ..self.clone()
        };
        if part.light_lists.is_some() {
            part.light_lists = Some(LightLists::new(&part.lights, &part.view, part.size));
        }
        for v in &mut part.overlay.vertices {
            let wide = cut * v.clip.as_dvec4();
            v.clip = wide.as_vec4().xy().extend(v.clip.z).extend(v.clip.w);
        }
        part.widen_outlines(self.size[1] as f32 / tile.size[1] as f32, catalog);
        Ok(part)
    }

    /// Outlines that are a share of the picture's height.
    fn widen_outlines(&mut self, factor: f32, catalog: &Catalog) {
        let views = self.shadows.iter_mut().flat_map(|s| &mut s.views).flat_map(|v| &mut v.draws);
        let hulls = self.draws.iter_mut().chain(views).filter(|d| d.pipeline.features.has(Features::OUTLINE));
        let mut wider: Vec<((u32, Option<u32>), u32)> = Vec::new();
        for draw in hulls {
            let of = (draw.material, draw.changed);
            if let Some((_, made)) = wider.iter().find(|(known, _)| *known == of) {
                draw.changed = Some(*made);
                continue;
            }
            let now = draw.changed.and_then(|at| self.materials.get(at as usize)).map(|m| &**m);
            let Some(now) = now.or_else(|| catalog.materials.get(draw.material as usize)) else { continue };
            let mut material = now.clone();
            let toon = material.material.toon.as_mut().map(Arc::make_mut);
            if let Some(outline) = toon.and_then(|t| t.outline.as_mut()).filter(|o| o.on_screen) {
                outline.width *= factor;
                self.materials.push(Arc::new(material));
                wider.push((of, self.materials.len() as u32 - 1));
                draw.changed = Some(self.materials.len() as u32 - 1);
            }
        }
    }
}

/// Clip space of a tile from that of the picture.
fn cut(whole: [u32; 2], tile: Tile) -> DMat4 {
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

impl FlatPicture {
    /// What of it lies in a tile.
    fn part(&self, tile: Tile) -> FlatPicture {
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
        FlatPicture {
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
    fn large_pictures_are_tiles_though_a_device_draws_them() {
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
    fn a_place_of_the_picture_is_the_same_place_of_its_tile() {
        let whole = [200u32, 150];
        for tile in tiles(whole, 64) {
            let clip = DVec4::new(0.3, -0.7, 0.2, 1.9);
            let pixel = |c: DVec4, size: [u32; 2]| {
                let size = glam::DVec2::new(f64::from(size[0]), f64::from(size[1]));
                (c.xy() / c.w * 0.5 + 0.5) * size
            };
            let there = pixel(cut(whole, tile) * clip, tile.size);
            let here = pixel(clip, whole) - glam::DVec2::new(f64::from(tile.at[0]), f64::from(tile.at[1]));
            assert!((there - here).length() < 1e-9);
        }
    }

    #[test]
    fn layers_are_cut() {
        let pixels: Vec<glam::Vec4> = (0..12).map(|i| glam::Vec4::splat(i as f32)).collect();
        let flat = FlatPicture { size: [10, 10], at: [3, 2], area: [4, 3], pixels, hash: [7; 32] };
        let part = flat.part(Tile { at: [5, 0], size: [5, 4], keep: [5, 4] });
        assert_eq!((part.at, part.area), ([0, 2], [2, 2]));
        assert_eq!(part.pixels.iter().map(|p| p.x).collect::<Vec<_>>(), [2.0, 3.0, 6.0, 7.0]);
        let beside = flat.part(Tile { at: [0, 6], size: [5, 4], keep: [5, 4] });
        assert_eq!((beside.area[0] * beside.area[1], beside.pixels.len()), (0, 0));
        assert_ne!(part.hash, beside.hash);
    }
}
