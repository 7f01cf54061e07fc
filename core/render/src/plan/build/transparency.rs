//! Whether what is seen through can be sorted: mesh by mesh back to front, or pixel by pixel.
//!
//! Sorted, each copy is mixed as a whole, by the depth of its box's middle. That is right wherever a plane parts two copies and the
//! nearer side is drawn later; it fails where they cross, where a large one's middle is farther than its part in front of a
//! small one, and within a bent surface that both faces are seen of. Bodies that are skinned, morphed or moved by effects count
//! by the boxes around them as posed, body against body.

use crate::plan::build::Planner;
use crate::plan::build::items::Item;
use crate::plan::{Glass, PipelineKey, Rows, TopologyKey};
use choreo_asset::Aabb;
use choreo_stage::{Cutouts, Transparency};
use glam::{Mat4, Vec3};

/// Layers that are told apart at most, the farthest first; nearer ones are sorted over them.
pub const MOST_LAYERS: u32 = 8;
/// Copies of which pairs are looked at.
pub const MOST_COPIES: usize = 128;
/// What a box that cannot be followed closely (skins, effects that move corners) may have on each other.
const LAYERS_OF_LOOSE: u32 = 4;

/// Transparency that does not depend on the order of draws, by depth peeling (C. Everitt, "Interactive Order-Independent
/// Transparency", 2001) from the back: the farthest surfaces at each sample are found, then mixed; then the next ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peel {
    /// So many are told apart. Nearer ones are sorted over them.
    pub layers: u32,
    pub cause: PeelCause,
}

/// Why sorting does not do. Indices into `Stage::actors`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PeelCause {
    /// The stage asks for it.
    Asked,
    /// An actor does, for itself.
    AskedBy(u32),
    /// Copies of two actors, or of one, cross or stand in the wrong order.
    Each(u32, u32),
    /// It is bent, and both its faces are seen.
    Itself(u32),
}

/// One copy that is seen through.
pub(crate) struct SeenThrough {
    /// Of its box, camera-relative: bits 0 to 2 of the index are x, y, z of the mesh.
    corners: [Vec3; 8],
    /// The box turns and stretches with the copy.
    rigid: bool,
    /// How often one line of sight meets it, as far as that is known.
    layers: u32,
    actor: u32,
    /// Which of the actor's copies.
    copy: u32,
    how: Transparency,
}

impl SeenThrough {
    /// `own`: the box in mesh space and the map from there, where the copy is rigid.
    pub fn new(
        bounds: Aabb,
        own: Option<(Aabb, &Rows)>,
        topology: TopologyKey,
        double_sided: bool,
        [actor, copy]: [u32; 2],
        how: Transparency,
    ) -> SeenThrough {
        let Some((b, rows)) = own else {
            let (corners, layers) = (bounds.corners(), LAYERS_OF_LOOSE);
            return SeenThrough { corners, rigid: false, layers, actor, copy, how };
        };
        let size = b.max - b.min;
        let flat = size.min_element() <= size.max_element() * 1e-4 || topology != TopologyKey::Triangles;
        let corners = b.corners().map(|c| rows.transform_point(c));
        let layers = if double_sided && !flat { 2 } else { 1 };
        SeenThrough { corners, rigid: true, layers, actor, copy, how }
    }

    /// Left, top, right and bottom in clip space over w; everything where a corner is not before the eye.
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

    /// Normals of the box's faces; none where it is a line or a point.
    fn normals(&self) -> [Vec3; 3] {
        let mut axes = [1, 2, 4].map(|axis| (self.corners[axis] - self.corners[0]).normalize_or_zero());
        // A flat box has its third axis across the other two.
        if let Some(flat) = axes.iter().position(|a| *a == Vec3::ZERO) {
            axes[flat] = axes[(flat + 1) % 3].cross(axes[(flat + 2) % 3]);
        }
        let [x, y, z] = axes;
        [y.cross(z), z.cross(x), x.cross(y)].map(Vec3::normalize_or_zero)
    }

    /// Smallest and largest height over a plane through the origin.
    fn span(&self, normal: Vec3) -> [f32; 2] {
        let heights = self.corners.map(|c| c.dot(normal));
        [
            heights.into_iter().fold(f32::INFINITY, f32::min),
            heights.into_iter().fold(f32::NEG_INFINITY, f32::max),
        ]
    }
}

/// Whether `far` may be drawn before `near`: a plane lies between them, and the eye not on the far one's side.
fn in_order(far: &SeenThrough, near: &SeenThrough, eye: &Eye) -> bool {
    let faces = far.normals().into_iter().chain(near.normals());
    faces.chain([eye.forward]).filter(|n| *n != Vec3::ZERO).any(|n| {
        let ([far_low, far_high], [near_low, near_high]) = (far.span(n), near.span(n));
        let slack = 1e-4 * (far_high - far_low).max(near_high - near_low).max(1e-6);
        let eye = eye.height(n);
        (far_high <= near_low + slack && eye.is_none_or(|eye| eye >= far_high - slack))
            || (far_low >= near_high - slack && eye.is_none_or(|eye| eye <= far_low + slack))
    })
}

/// Where the eye is: at the origin, or infinitely far along a direction.
struct Eye {
    forward: Vec3,
    to_viewer: Option<Vec3>,
}

impl Eye {
    /// Over a plane through the origin; `None` where it lies in every plane of that normal.
    fn height(&self, normal: Vec3) -> Option<f32> {
        match self.to_viewer.map(|to_viewer| to_viewer.dot(normal)) {
            None => Some(0.0),
            Some(side) if side.abs() < 1e-6 => None,
            Some(side) => Some(side.signum() * f32::INFINITY),
        }
    }
}

impl Planner<'_> {
    /// Whether a surface's cut-outs keep samples.
    pub(crate) fn smooth_cutouts(&self, actor: usize, material: Option<u32>) -> bool {
        let (actor, settings) = (&self.stage.actors[actor], &self.stage.settings);
        self.options.samples > 1 && actor.cutouts(material, settings) == Cutouts::Smooth
    }

    /// Notes a copy of a surface; gives its place. `of`: actor and copy, the asset's material.
    pub(crate) fn see_through(
        &mut self,
        bounds: Aabb,
        own: Option<(Aabb, &Rows)>,
        key: &PipelineKey,
        ([actor, copy], material): ([usize; 2], Option<u32>),
    ) -> u32 {
        let how = self.stage.actors[actor].transparency(material, &self.stage.settings);
        let body = [actor as u32, copy as u32];
        self.seen_through.push(SeenThrough::new(bounds, own, key.topology, key.double_sided, body, how));
        self.seen_through.len() as u32 - 1
    }

    /// Layers to peel, and why; or why not. `first`: of what is seen through among the items, sorted back to front.
    pub(crate) fn peel(&self, first: usize) -> Result<Peel, String> {
        let items = &self.items[first..];
        if items.is_empty() {
            return Err("everything drawn is opaque".into());
        }
        let of = |item: &Item| item.seen_through.and_then(|id| self.seen_through.get(id as usize));
        let said = |how: Transparency| items.iter().filter_map(of).find(move |s| s.how == how);
        let of_stage = self.stage.settings.transparency;
        if items.iter().filter_map(of).all(|s| s.how == Transparency::Sorted) {
            let who = if of_stage == Transparency::Sorted { "the stage's" } else { "the actors'" };
            return Err(format!("{who} transparency is \"sorted\""));
        }
        if items.iter().any(|i| i.pipeline.glass == Glass::Refract) {
            return Err("glass that bends light shows a copy of the picture, so all is sorted".into());
        }
        let mut order: Vec<u32> = Vec::new();
        for item in items {
            let id = item.seen_through.unwrap_or(0);
            if order.last() != Some(&id) && !order.contains(&id) {
                order.push(id);
            }
            if order.len() > MOST_COPIES {
                break;
            }
        }
        let asked = said(Transparency::Independent).map(|s| match of_stage {
            Transparency::Independent => PeelCause::Asked,
            _ => PeelCause::AskedBy(s.actor),
        });
        if order.len() > MOST_COPIES {
            let why =
                format!("more than {MOST_COPIES} copies are seen through, too many to look at pair by pair");
            return asked.map(|cause| Peel { layers: MOST_LAYERS, cause }).ok_or(why);
        }
        let copies: Vec<&SeenThrough> = order.iter().map(|id| &self.seen_through[*id as usize]).collect();
        let rows = self.view.view_from_relative.transpose();
        let eye = Eye {
            forward: -rows.z_axis.truncate(),
            to_viewer: (self.view.eye.w == 0.0).then(|| self.view.eye.truncate()),
        };
        let on_screen: Vec<[f32; 4]> =
            copies.iter().map(|c| c.on_screen(&self.view.clip_from_relative)).collect();
        let meet = |i: usize, k: usize| {
            let (a, b) = (on_screen[i], on_screen[k]);
            a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
        };
        let mut cause = asked;
        // Who is to be sorted is no reason to do more.
        let may = |i: usize| copies[i].how != Transparency::Sorted;
        let mut layers = 1;
        for i in 0..copies.len() {
            let over_it = (0..copies.len()).filter(|k| *k == i || meet(i, *k));
            layers = layers.max(over_it.map(|k| copies[k].layers).sum());
            let bent = may(i) && copies[i].rigid && copies[i].layers > 1;
            if bent && cause.is_none() {
                cause = Some(PeelCause::Itself(copies[i].actor));
            }
            let fails = |k: &usize| {
                // Of one body whose parts are posed, the boxes say too little.
                let (a, b) = (copies[i], copies[*k]);
                let apart = (a.rigid && b.rigid) || (a.actor, a.copy) != (b.actor, b.copy);
                apart && may(i) && may(*k) && meet(i, *k) && !in_order(a, b, &eye)
            };
            if let (None, Some(k)) = (cause, (i + 1..copies.len()).find(fails)) {
                cause = Some(PeelCause::Each(copies[i].actor, copies[k].actor));
            }
        }
        let sorted = "what is seen through can be sorted: no two copies cross or stand in the wrong order, and none folds over itself";
        let cause = cause.ok_or(sorted)?;
        Ok(Peel { layers: layers.min(MOST_LAYERS), cause })
    }
}
