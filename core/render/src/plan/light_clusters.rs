//! Clustered lighting: point and spot lights with a range are binned into clusters of the view, so that a pixel evaluates only
//! the lights that can reach it.
//!
//! The frame is divided into screen tiles, and the depth into slices, each longer than the one before (O. Olsson, M. Billeter,
//! U. Assarsson, "Clustered Deferred and Forward Shading", HPG 2012). Each cluster lists the lights whose sphere or cone may
//! touch it. Other lights would add exactly nothing, so clusters change no pixel.

use crate::error::RenderError;
use crate::plan::dirty_rect::DirtyRect;
use crate::plan::{Plan, PlanLight, View};
use choreo_asset::Aabb;
use choreo_stage::Shadow;
use glam::{Mat4, Vec3, Vec4Swizzles};

/// Number of lights with a range from which clusters are worth their cost.
pub const MIN_RANGED_LIGHTS: usize = 8;
/// Largest number of lights in a frame: those that fit the smallest uniform buffer range that Vulkan guarantees (16 384 bytes of
/// 64 each).
pub const MAX_LIGHTS: usize = 256;
/// Side of a screen tile in pixels.
pub(crate) const TILE: u32 = 64;
const SLICES: u32 = 16;
/// Words before the clusters: tiles across and down, slices, lights without a range, scale and offset of the slices, two unused.
const HEADER: usize = 8;
/// Tolerance in slices: larger than the error of any device's logarithm.
const SLACK: f32 = 0.02;

/// Clusters as shaders read them: the header; the start of each cluster's list, then the end of the last list; the lists of light
/// indices in ascending order. Lights without a range come first in `Plan::lights` and are in no list: they reach everywhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightClusters(pub Vec<u32>);

/// Bounding sphere of the volume that a light with a range reaches.
fn reach(light: &PlanLight, range: f32) -> (Vec3, f32) {
    let at = light.position;
    let cos_outer = light.cos_outer();
    let narrow = cos_outer >= std::f32::consts::FRAC_1_SQRT_2;
    if !narrow {
        return (at, range);
    }
    // The sphere through the tip and the rim of a narrow cone.
    let radius = range / (2.0 * cos_outer.min(1.0));
    (at + light.direction * radius, radius)
}

/// Sorts lights without a range to the front, together with their shadows. Returns false if too few have a range for clusters to
/// pay.
pub(crate) fn sort(lights: &mut Vec<PlanLight>, shadows: &mut Vec<Option<Shadow>>) -> bool {
    if lights.iter().filter(|l| l.range().is_some()).count() < MIN_RANGED_LIGHTS {
        return false;
    }
    let all = std::mem::take(lights).into_iter().zip(std::mem::take(shadows));
    let (ranged, unlimited): (Vec<_>, Vec<_>) = all.partition(|(light, _)| light.range().is_some());
    (*lights, *shadows) = unlimited.into_iter().chain(ranged).unzip();
    true
}

/// Fails if a plan has more lights than renderers draw.
pub(crate) fn check(plan: &Plan) -> Result<(), RenderError> {
    let count = plan.lights.len();
    if count > MAX_LIGHTS {
        let text = format!(
            "{count} lights shine at once; {MAX_LIGHTS} are drawn at most (those whose intensity is 0 do not count)"
        );
        return Err(RenderError::Usage(text));
    }
    Ok(())
}

impl LightClusters {
    /// Bins lights in the order of `sort`.
    pub fn new(lights: &[PlanLight], view: &View, size: [u32; 2]) -> LightClusters {
        let clip = &view.clip_from_relative;
        let [across, down] = size.map(|s| s.div_ceil(TILE));
        let unlimited = lights.iter().take_while(|l| l.range().is_none()).count();
        let spheres: Vec<(u32, Vec3, f32)> = (0..)
            .zip(lights)
            .skip(unlimited)
            .filter_map(|(i, light)| {
                let (at, r) = reach(light, light.range()?);
                Some((i, at, r))
            })
            .collect();
        let depths = |at: Vec3, r: f32| {
            let (middle, reach) = (depth(clip, at), clip.row(3).truncate().length() * r);
            [middle - reach, middle + reach]
        };
        let far = spheres.iter().map(|(_, at, r)| depths(*at, *r)[1]).fold(1.0, f32::max);
        // The nearest slice ends at a hundredth of the farthest light's reach.
        let near = far * 0.01;
        let scale = (SLICES - 1) as f32 / libm::log2f(far / near);
        let offset = 1.0 - libm::log2f(near) * scale;
        let mut clusters = LightClusters(vec![
            across,
            down,
            SLICES,
            unlimited as u32,
            scale.to_bits(),
            offset.to_bits(),
            0,
            0,
        ]);
        let mut cells: Vec<Vec<u32>> = vec![Vec::new(); (across * down * SLICES) as usize];
        for (index, at, r) in spheres {
            let mut rect = DirtyRect::NOTHING;
            rect.add(Aabb { min: at - r, max: at + r }, clip, size, 0.0);
            let Some([columns, rows]) = rect.tiles(size, TILE) else { continue };
            let [from, to] = depths(at, r);
            let slices = clusters.slice(from, -SLACK)..=clusters.slice(to, SLACK);
            for slice in slices {
                for row in rows[0]..=rows[1] {
                    for column in columns[0]..=columns[1] {
                        cells[((slice * down + row) * across + column) as usize].push(index);
                    }
                }
            }
        }
        let mut end = (HEADER + cells.len() + 1) as u32;
        for cell in &cells {
            clusters.0.push(end);
            end += cell.len() as u32;
        }
        clusters.0.push(end);
        clusters.0.extend(cells.into_iter().flatten());
        clusters
    }

    /// Number of lights without a range, which are in no list.
    pub fn unlimited(&self) -> usize {
        self.0[3] as usize
    }

    /// Number of lights of a cluster.
    pub(crate) fn count(&self, [column, row]: [u32; 2], slice: u32) -> u32 {
        let cell = HEADER + ((slice * self.0[1] + row) * self.0[0] + column) as usize;
        self.0[cell + 1] - self.0[cell]
    }

    pub(crate) fn slice(&self, depth: f32, slack: f32) -> u32 {
        let [scale, offset] = [4, 5].map(|i| f32::from_bits(self.0[i]));
        let at = libm::log2f(depth.max(1e-6)) * scale + offset + slack;
        at.floor().clamp(0.0, (SLICES - 1) as f32) as u32
    }

    /// Indices of the lights with a range that may reach a camera-relative position. CPU reference of `light_list` in scene.wgsl.
    pub fn of(&self, relative: Vec3, clip_from_relative: &Mat4, size: [u32; 2]) -> &[u32] {
        let clip = *clip_from_relative * relative.extend(1.0);
        let pixel = (clip.xy() / clip.w * 0.5 + 0.5) * glam::Vec2::new(size[0] as f32, size[1] as f32);
        let [across, down] = [self.0[0], self.0[1]];
        let square = |v: f32, count: u32| ((v.max(0.0) as u32) / TILE).min(count - 1);
        let (column, row) = (square(pixel.x, across), square(pixel.y, down));
        let cell = HEADER + ((self.slice(clip.w, 0.0) * down + row) * across + column) as usize;
        &self.0[self.0[cell] as usize..self.0[cell + 1] as usize]
    }
}

/// Depth of a camera-relative point in metres in front of the camera; 1 in orthographic views.
pub(crate) fn depth(clip_from_relative: &Mat4, at: Vec3) -> f32 {
    clip_from_relative.row(3).dot(at.extend(1.0))
}
