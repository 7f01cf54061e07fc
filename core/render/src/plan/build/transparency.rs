//! Whether transparent surfaces can be sorted mesh by mesh, or must be depth-peeled pixel by pixel.
//!
//! Sorted, each copy is blended as a whole, by the depth of its bounds' center. This is correct if a plane separates each pair of
//! copies and the nearer one is drawn later. It fails if two copies intersect, if a large copy reaches in front of a small one
//! although its center is farther, and within a surface that is not flat and shows both faces. Skinned, morphed and displaced
//! copies count by their deformed bounds, actor against actor.

use crate::affine::Affine3x4;
use crate::plan::build::Planner;
use crate::plan::build::items::DrawItem;
use crate::plan::left_out::NotNeeded;
use crate::plan::{DepthPeeling, Glass, PeelCause, PipelineKey, TopologyKey};
use choreo_asset::Aabb;
use choreo_stage::{Cutouts, Transparency};
use glam::{Mat4, Vec3};

/// Largest number of layers, the farthest first; nearer surfaces are blended over them in sorted order.
const MOST_LAYERS: u32 = 8;
/// Largest number of copies whose pairs are tested.
const MOST_COPIES: usize = 128;
/// Layers of a copy with loose bounds (skinned, morphed, displaced).
const LAYERS_OF_LOOSE: u32 = 4;

/// One transparent copy.
pub(super) struct TransparentCopy {
    /// Corners of a box around the copy, camera-relative: bits 0 to 2 of the index are x, y, z of the mesh.
    corners: [Vec3; 8],
    /// Whether the box is oriented with the copy.
    rigid: bool,
    /// Largest number of the copy's surfaces along one ray, as far as known.
    layers: u32,
    actor: u32,
    /// Index among the actor's copies.
    copy: u32,
    setting: Transparency,
}

impl TransparentCopy {
    /// Screen rectangle: left, top, right and bottom in normalized device coordinates. Everything if a corner is not in front of
    /// the camera.
    fn on_screen(&self, clip_from_relative: &Mat4) -> [f32; 4] {
        let mut all = [f32::INFINITY, f32::INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY];
        for corner in self.corners {
            let c = *clip_from_relative * corner.extend(1.0);
            if !c.is_finite() || c.w <= 1e-6 {
                return [f32::NEG_INFINITY, f32::NEG_INFINITY, f32::INFINITY, f32::INFINITY];
            }
            let (x, y) = (c.x / c.w, c.y / c.w);
            all = [all[0].min(x), all[1].min(y), all[2].max(x), all[3].max(y)];
        }
        all
    }

    /// Normals of the box's faces; zero if it is a line or a point.
    fn normals(&self) -> [Vec3; 3] {
        let mut axes = [1, 2, 4].map(|axis| (self.corners[axis] - self.corners[0]).normalize_or_zero());
        // The third axis of a flat box is normal to the other two.
        if let Some(flat) = axes.iter().position(|a| *a == Vec3::ZERO) {
            axes[flat] = axes[(flat + 1) % 3].cross(axes[(flat + 2) % 3]);
        }
        let [x, y, z] = axes;
        [y.cross(z), z.cross(x), x.cross(y)].map(Vec3::normalize_or_zero)
    }

    /// Smallest and largest height over a plane through the camera.
    fn span(&self, normal: Vec3) -> [f32; 2] {
        let heights = self.corners.map(|c| c.dot(normal));
        [
            heights.into_iter().fold(f32::INFINITY, f32::min),
            heights.into_iter().fold(f32::NEG_INFINITY, f32::max),
        ]
    }
}

/// Whether `far` may be drawn before `near`: some plane separates them, and the camera is not on the side of `far`.
fn in_order(far: &TransparentCopy, near: &TransparentCopy, eye: &Eye) -> bool {
    let faces = far.normals().into_iter().chain(near.normals());
    faces.chain([eye.forward]).filter(|n| *n != Vec3::ZERO).any(|n| {
        let ([far_low, far_high], [near_low, near_high]) = (far.span(n), near.span(n));
        let slack = 1e-4 * (far_high - far_low).max(near_high - near_low).max(1e-6);
        let eye = eye.height(n);
        (far_high <= near_low + slack && eye.is_none_or(|eye| eye >= far_high - slack))
            || (far_low >= near_high - slack && eye.is_none_or(|eye| eye <= far_low + slack))
    })
}

/// The camera: at the origin, or infinitely far along a direction.
struct Eye {
    forward: Vec3,
    to_viewer: Option<Vec3>,
}

impl Eye {
    /// Height over a plane with this normal through the origin; `None` if rays are parallel to the plane.
    fn height(&self, normal: Vec3) -> Option<f32> {
        match self.to_viewer.map(|to_viewer| to_viewer.dot(normal)) {
            None => Some(0.0),
            Some(side) if side.abs() < 1e-6 => None,
            Some(side) => Some(side.signum() * f32::INFINITY),
        }
    }
}

/// Transparent copies in drawing order, tested pair by pair.
struct Pairs<'a> {
    copies: Vec<&'a TransparentCopy>,
    on_screen: Vec<[f32; 4]>,
    eye: Eye,
}

impl Pairs<'_> {
    fn overlap(&self, i: usize, k: usize) -> bool {
        let (a, b) = (self.on_screen[i], self.on_screen[k]);
        a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
    }

    /// Whether a copy may request peeling: not if its transparency is set to sorted.
    fn may_peel(&self, i: usize) -> bool {
        self.copies[i].setting != Transparency::Sorted
    }

    fn sorting_fails(&self, i: usize, k: usize) -> bool {
        let (a, b) = (self.copies[i], self.copies[k]);
        // The parts of one skinned copy have loose bounds, which cannot prove that sorting fails.
        let distinct = (a.rigid && b.rigid) || (a.actor, a.copy) != (b.actor, b.copy);
        distinct && self.may_peel(i) && self.may_peel(k) && self.overlap(i, k) && !in_order(a, b, &self.eye)
    }

    /// The largest number of overlapping layers, and why sorting fails. `requested`: a cause known already.
    fn layers(&self, requested: Option<PeelCause>) -> (u32, Option<PeelCause>) {
        let (mut cause, mut layers) = (requested, 1);
        let count = self.copies.len();
        for (i, copy) in self.copies.iter().enumerate() {
            let over_it = (0..count).filter(|k| *k == i || self.overlap(i, *k));
            layers = layers.max(over_it.map(|k| self.copies[k].layers).sum());
            if self.may_peel(i) && copy.rigid && copy.layers > 1 && cause.is_none() {
                cause = Some(PeelCause::SelfOverlap(copy.actor));
            }
            if cause.is_none()
                && let Some(k) = (i + 1..count).find(|k| self.sorting_fails(i, *k))
            {
                cause = Some(PeelCause::Order(copy.actor, self.copies[k].actor));
            }
        }
        (layers, cause)
    }
}

impl Planner<'_> {
    /// Whether cut-outs of a surface use alpha to coverage.
    pub(crate) fn smooth_cutouts(&self, actor: usize, material: Option<u32>) -> bool {
        let (actor, settings) = (&self.stage.actors[actor], &self.stage.settings);
        self.options.samples > 1 && actor.cutouts(material, settings) == Cutouts::Smooth
    }

    /// Adds a transparent copy and returns its index. `own`: bounds in mesh space and the transform from there, for a rigid copy.
    /// The last argument: actor and copy, and the asset's material.
    pub(crate) fn add_transparent(
        &mut self,
        bounds: Aabb,
        own: Option<(Aabb, &Affine3x4)>,
        key: &PipelineKey,
        ([actor, copy], material): ([usize; 2], Option<u32>),
    ) -> u32 {
        let (corners, layers) = match own {
            None => (bounds.corners(), LAYERS_OF_LOOSE),
            Some((b, transform)) => {
                let size = b.max - b.min;
                let flat =
                    size.min_element() <= size.max_element() * 1e-4 || key.topology != TopologyKey::Triangles;
                let layers = if key.double_sided && !flat { 2 } else { 1 };
                (b.corners().map(|c| transform.transform_point(c)), layers)
            }
        };
        self.transparent.push(TransparentCopy {
            corners,
            rigid: own.is_some(),
            layers,
            actor: actor as u32,
            copy: copy as u32,
            setting: self.stage.actors[actor].transparency(material, &self.stage.settings),
        });
        self.transparent.len() as u32 - 1
    }

    /// Whether to peel, and why; or why not. `first`: index of the first transparent item.
    pub(super) fn depth_peeling(&self, first: usize) -> Result<DepthPeeling, NotNeeded> {
        let items = &self.items[first..];
        if items.is_empty() {
            return Err("everything drawn is opaque".into());
        }
        let copy_of = |item: &DrawItem| item.transparent.and_then(|id| self.transparent.get(id as usize));
        let of_stage = self.stage.settings.transparency;
        if items.iter().filter_map(copy_of).all(|s| s.setting == Transparency::Sorted) {
            let whose = if of_stage == Transparency::Sorted { "the stage's" } else { "the actors'" };
            return Err(format!("{whose} transparency is \"sorted\"").into());
        }
        if items.iter().any(|i| i.pipeline.glass == Glass::Refract) {
            return Err(
                "refraction samples a copy of the image, so all transparent surfaces are sorted".into()
            );
        }
        let mut order: Vec<u32> = Vec::new();
        for item in items {
            let id = item.transparent.unwrap_or(0);
            if order.last() != Some(&id) && !order.contains(&id) {
                order.push(id);
            }
            if order.len() > MOST_COPIES {
                break;
            }
        }
        let independent = items.iter().filter_map(copy_of).find(|s| s.setting == Transparency::Independent);
        let requested = independent.map(|s| match of_stage {
            Transparency::Independent => PeelCause::Requested,
            _ => PeelCause::RequestedBy(s.actor),
        });
        if order.len() > MOST_COPIES {
            let why =
                format!("more than {MOST_COPIES} transparent copies are in view, too many to test each pair");
            return requested.map(|cause| DepthPeeling { layers: MOST_LAYERS, cause }).ok_or(why.into());
        }
        let copies: Vec<&TransparentCopy> = order.iter().map(|id| &self.transparent[*id as usize]).collect();
        let rows = self.view.view_from_relative.transpose();
        let eye = Eye {
            forward: -rows.z_axis.truncate(),
            to_viewer: (self.view.eye.w == 0.0).then(|| self.view.eye.truncate()),
        };
        let on_screen = copies.iter().map(|c| c.on_screen(&self.view.clip_from_relative)).collect();
        let (layers, cause) = Pairs { copies, on_screen, eye }.layers(requested);
        let sorted = "transparent surfaces can be sorted: no two copies intersect or are in the wrong order, and none overlaps itself";
        Ok(DepthPeeling { layers: layers.min(MOST_LAYERS), cause: cause.ok_or(sorted)? })
    }
}
