//! Which lights reach where: many lamps of limited range cost a pixel only those that can reach it.
//!
//! The picture is divided into squares, and the depth before the eye into slices, each farther reaching than the one before
//! (O. Olsson, M. Billeter, U. Assarsson, "Clustered Deferred and Forward Shading", HPG 2012). Each such cell lists the lamps
//! whose sphere or cone may touch it. What a list leaves out would add exactly nothing, so that lists change no pixel.

use crate::plan::build::dirty_rect::Area;
use crate::plan::{LightType, PlanLight, View};
use crate::scene_resources::bounds::Aabb;
use crate::{Plan, RenderError};
use choreo_stage::Shadow;
use glam::{Mat4, Vec3, Vec4Swizzles};

/// Fewer lamps with a range are not worth their lists.
pub const MANY: usize = 8;
/// Lights of a frame at most.
pub const MOST: usize = crate::commands::MAX_LIGHTS;
/// Pixels of a square's side.
pub const SQUARE: u32 = 64;
const SLICES: u32 = 16;
/// Before the lists: squares across and down, slices, lights that reach everywhere, scale and offset of the slices, two unused.
pub const HEADER: usize = 8;
/// Of a slice: more than logarithms of devices are off.
const SLACK: f32 = 0.02;

/// As shaders read them: the header; of each cell where its list begins, and where the last one ends; the lists, indices of
/// lights in rising order. Lights before those that have a range are in no list: they reach everywhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightLists(pub Vec<u32>);

/// Metres; `None`: without end.
fn range(light: &PlanLight) -> Option<f32> {
    (light.inverse_range_squared > 0.0).then(|| 1.0 / light.inverse_range_squared.sqrt())
}

/// A sphere around all that a light with a range reaches.
fn reach(light: &PlanLight, range: f32) -> (Vec3, f32) {
    let at = light.position;
    // cos(outer) from clamp(cos · scale + offset).
    let cos_outer = -light.cone.y / light.cone.x;
    if light.kind != LightType::Spot || cos_outer.is_nan() || cos_outer < std::f32::consts::FRAC_1_SQRT_2 {
        return (at, range);
    }
    // Through the tip and the rim of a narrow cone.
    let radius = range / (2.0 * cos_outer.min(1.0));
    (at + light.direction * radius, radius)
}

/// Where enough lamps have a range: those without to the front, each with what stands beside it.
pub fn sort(lights: &mut Vec<PlanLight>, shadows: &mut Vec<Option<Shadow>>) -> bool {
    if lights.iter().filter(|l| range(l).is_some()).count() < MANY {
        return false;
    }
    let all = std::mem::take(lights).into_iter().zip(std::mem::take(shadows));
    let (near, everywhere): (Vec<_>, Vec<_>) = all.partition(|(light, _)| range(light).is_some());
    (*lights, *shadows) = everywhere.into_iter().chain(near).unzip();
    true
}

/// Both renderers draw as many.
pub fn check(plan: &Plan) -> Result<(), RenderError> {
    let count = plan.lights.len();
    if count > MOST {
        let text = format!(
            "{count} lights shine at once; {MOST} are drawn at most (those whose intensity is 0 do not count)"
        );
        return Err(RenderError::Usage(text));
    }
    Ok(())
}

impl LightLists {
    /// Of lights that [`sort`] has sorted.
    pub fn new(lights: &[PlanLight], view: &View, size: [u32; 2]) -> LightLists {
        let clip = &view.clip_from_relative;
        let [across, down] = size.map(|s| s.div_ceil(SQUARE));
        let everywhere = lights.iter().take_while(|l| range(l).is_none()).count();
        let spheres: Vec<(u32, Vec3, f32)> = (0..)
            .zip(lights)
            .skip(everywhere)
            .filter_map(|(i, light)| {
                range(light).map(|r| (i, reach(light, r))).map(|(i, (at, r))| (i, at, r))
            })
            .collect();
        let depths = |at: Vec3, r: f32| {
            let (middle, reach) = (depth(clip, at), clip.row(3).truncate().length() * r);
            [middle - reach, middle + reach]
        };
        let far = spheres.iter().map(|(_, at, r)| depths(*at, *r)[1]).fold(1.0, f32::max);
        // The nearest slice reaches to a hundredth of the farthest light's end.
        let near = far * 0.01;
        let scale = (SLICES - 1) as f32 / libm::log2f(far / near);
        let offset = 1.0 - libm::log2f(near) * scale;
        let mut lists = LightLists(vec![
            across,
            down,
            SLICES,
            everywhere as u32,
            scale.to_bits(),
            offset.to_bits(),
            0,
            0,
        ]);
        let mut cells: Vec<Vec<u32>> = vec![Vec::new(); (across * down * SLICES) as usize];
        for (index, at, r) in spheres {
            let mut area = Area::NOTHING;
            area.add(Aabb { min: at - r, max: at + r }, clip, size, 0.0);
            let Some([columns, rows]) = area.squares(size, SQUARE) else { continue };
            let [from, to] = depths(at, r);
            let slices = lists.slice(from, -SLACK)..=lists.slice(to, SLACK);
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
            lists.0.push(end);
            end += cell.len() as u32;
        }
        lists.0.push(end);
        lists.0.extend(cells.into_iter().flatten());
        lists
    }

    /// Lights that are in no list.
    pub fn everywhere(&self) -> usize {
        self.0[3] as usize
    }

    /// How many lights such a cell lists.
    pub(crate) fn count(&self, [column, row]: [u32; 2], slice: u32) -> u32 {
        let cell = HEADER + ((slice * self.0[1] + row) * self.0[0] + column) as usize;
        self.0[cell + 1] - self.0[cell]
    }

    pub(crate) fn slice(&self, depth: f32, slack: f32) -> u32 {
        let [scale, offset] = [4, 5].map(|i| f32::from_bits(self.0[i]));
        let at = libm::log2f(depth.max(1e-6)) * scale + offset + slack;
        at.floor().clamp(0.0, (SLICES - 1) as f32) as u32
    }

    /// Indices of the lights that may reach a place in camera-relative space, beside those that reach everywhere. Twin of
    /// `light_list` in scene.wgsl.
    pub fn of(&self, relative: Vec3, clip_from_relative: &Mat4, size: [u32; 2]) -> &[u32] {
        let clip = *clip_from_relative * relative.extend(1.0);
        let pixel = (clip.xy() / clip.w * 0.5 + 0.5) * glam::Vec2::new(size[0] as f32, size[1] as f32);
        let [across, down] = [self.0[0], self.0[1]];
        let square = |v: f32, count: u32| ((v.max(0.0) as u32) / SQUARE).min(count - 1);
        let (column, row) = (square(pixel.x, across), square(pixel.y, down));
        let cell = HEADER + ((self.slice(clip.w, 0.0) * down + row) * across + column) as usize;
        &self.0[self.0[cell] as usize..self.0[cell + 1] as usize]
    }
}

/// Metres before the eye; 1 of orthographic views.
pub(crate) fn depth(clip_from_relative: &Mat4, at: Vec3) -> f32 {
    clip_from_relative.row(3).dot(at.extend(1.0))
}
