//! Shadow volumes of a directional light: where in view each caster's shadow can fall.
//!
//! Each caster's box is swept along the light through the bounds of all receivers. The visible part of this volume must lie in a
//! shadow map; nothing else needs texels, however large the ground is.

use crate::plan::View;
use crate::plan::build::shadow_cascades::{Axes, ShadowRegion, Span};
use crate::scene_resources::bounds::is_outside_frustum;
use choreo_asset::Aabb;
use glam::{DVec2, DVec3, DVec4, Vec2};
use std::ops::{Add, Mul, Sub};

/// Bounds of a caster, camera-relative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CasterBounds {
    pub bounds: Aabb,
    /// Center and half axes, if it is a filled rectangle or box (`PrimitiveInfo::covers_bounding_box`).
    pub filled: Option<[DVec3; 4]>,
}

/// The part of one caster's shadow volume that is in view.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShadowVolume {
    /// Index into `ShadowRegion::casters`.
    pub caster: usize,
    /// Extents along the light's right, up and forward axes.
    pub across: Span,
    pub up: Span,
    pub deep: Span,
    /// Depths of the visible part, in metres in front of the camera.
    pub view_depths: Span,
    /// Whether the volume reaches the near plane.
    pub at_camera: bool,
}

/// Volumes of all casters with a visible shadow, the nearest first. `spread`: width of a penumbra per distance.
pub(super) fn shadow_volumes(axes: &Axes, spread: f64, region: &ShadowRegion<'_>) -> Vec<ShadowVolume> {
    let lit = region.receivers.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
    let lit_across = Span::of(&lit, axes.right);
    let lit_up = Span::of(&lit, axes.up);
    // Most casters that shade other objects shade the largest one, such as a floor, so large receivers are tested first.
    let mut receivers: Vec<&Aabb> = region.receivers.iter().collect();
    receivers.sort_by(|a, b| (b.max - b.min).length().total_cmp(&(a.max - a.min).length()));
    let volume = |(caster, c): (usize, &CasterBounds)| {
        let (swept, distance) = swept_bounds(&c.bounds, axes.forward, &lit)?;
        let edge = 0.5 * spread * distance;
        let swept = Aabb { min: swept.min - edge as f32, max: swept.max + edge as f32 };
        let (view_depths, at_camera) = visible_depths(&swept, region.view)?;
        if c.filled
            .is_some_and(|filled| !shades_others(&filled, &c.bounds, -axes.forward, &receivers, region.view))
        {
            return None;
        }
        Some(ShadowVolume {
            caster,
            across: Span::of(&c.bounds, axes.right).grown(edge).meet(lit_across.grown(edge)),
            up: Span::of(&c.bounds, axes.up).grown(edge).meet(lit_up.grown(edge)),
            deep: Span::of(&swept, axes.forward),
            view_depths,
            at_camera,
        })
    };
    let mut all: Vec<ShadowVolume> = region.casters.iter().enumerate().filter_map(volume).collect();
    all.sort_by(|a, b| a.view_depths.0[0].total_cmp(&b.view_depths.0[0]));
    all
}

/// Bounds of a box swept along a direction through another box, and the swept distance; `None` if it misses that box.
fn swept_bounds(b: &Aabb, forward: DVec3, within: &Aabb) -> Option<(Aabb, f64)> {
    let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
    let (low, high) = (within.min.as_dvec3(), within.max.as_dvec3());
    let mut way = Span([0.0, f64::INFINITY]);
    for k in 0..3 {
        if forward[k].abs() < 1e-12 {
            if max[k] < low[k] || min[k] > high[k] {
                return None;
            }
            continue;
        }
        let ends = [(low[k] - max[k]) / forward[k], (high[k] - min[k]) / forward[k]];
        way = way.meet(Span([ends[0].min(ends[1]), ends[0].max(ends[1])]));
    }
    let [from, to] = way.0;
    if !(from <= to && to.is_finite()) {
        return None;
    }
    let start = min.min(min + forward * (to - from)) + forward * from;
    let end = max.max(max + forward * (to - from)) + forward * from;
    Some((Aabb { min: start.max(low).as_vec3(), max: end.min(high).as_vec3() }, to))
}

/// Faces of a box as vertex indices, whose bits 0 to 2 select the maximum along x, y and z.
pub(crate) const FACES: [[usize; 4]; 6] =
    [[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]];

/// Depth of the near plane.
pub(crate) fn near_depth(view: &View) -> f64 {
    let m = view.clip_from_view.as_dmat4();
    // Reversed Z: 1 at the near plane.
    if view.eye.w == 0.0 { (m.w_axis.z - 1.0) / m.z_axis.z } else { m.w_axis.z / (1.0 + m.z_axis.z) }
}

/// Depths between which a box is in view, and whether it reaches the near plane; `None` if it is outside the view.
fn visible_depths(b: &Aabb, view: &View) -> Option<(Span, bool)> {
    if is_outside_frustum(*b, &view.clip_from_relative, Vec2::ZERO) {
        return None;
    }
    let near = near_depth(view);
    let depths = Span::of(b, -view.view_from_relative.row(2).truncate().as_dvec3());
    // The exact intersection does not pay for a box that is short in depth.
    if depths.0[0] > near && depths.0[1] < 2.0 * depths.0[0] {
        return Some((depths, false));
    }
    let clip = view.clip_from_relative.as_dmat4();
    let depth = -view.view_from_relative.as_dmat4().row(2);
    let corners = b.corners().map(|c| {
        let c = c.as_dvec3().extend(1.0);
        (clip * c, depth.dot(c))
    });
    let mut seen = Span::EMPTY;
    for face in FACES {
        for (_, depth) in in_frustum(face.map(|i| corners[i]).to_vec()) {
            seen = seen.union(Span([depth, depth]));
        }
    }
    let around = corner_of_near_plane(view, near, b);
    if around {
        seen = seen.union(Span([near, near]));
    }
    (seen.length() >= 0.0).then_some((seen, around || seen.0[0] <= near * 1.001))
}

/// Whether the box contains a corner of the near plane.
fn corner_of_near_plane(view: &View, near: f64, b: &Aabb) -> bool {
    let m = &view.clip_from_view;
    let scale = if view.eye.w == 0.0 { 1.0 } else { near };
    let half = DVec2::new(f64::from(m.x_axis.x), f64::from(m.y_axis.y)).abs().recip() * scale;
    let relative_from_view = view.view_from_relative.as_dmat4().transpose();
    [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]].into_iter().any(|[x, y]| {
        let p = relative_from_view.transform_point3(DVec3::new(x * half.x, y * half.y, -near));
        p.cmpge(b.min.as_dvec3()).all() && p.cmple(b.max.as_dvec3()).all()
    })
}

/// The part of a polygon that is in view: clip coordinates of its vertices, each with a value that is linear on the polygon
/// (Sutherland & Hodgman 1974).
pub(crate) fn in_frustum<T>(mut polygon: Vec<(DVec4, T)>) -> Vec<(DVec4, T)>
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>,
{
    let inside: [fn(DVec4) -> f64; 5] =
        [|p| p.w - p.x, |p| p.w + p.x, |p| p.w - p.y, |p| p.w + p.y, |p| p.w - p.z];
    for inside in inside {
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (i, a) in polygon.iter().enumerate() {
            let b = polygon[(i + 1) % polygon.len()];
            let (of_a, of_b) = (inside(a.0), inside(b.0));
            if of_a >= 0.0 {
                kept.push(*a);
            }
            if (of_a >= 0.0) != (of_b >= 0.0) {
                let t = of_a / (of_a - of_b);
                kept.push((a.0 + (b.0 - a.0) * t, a.1 + (b.1 - a.1) * t));
            }
        }
        polygon = kept;
    }
    polygon
}

/// Whether a filled rectangle or box casts a visible shadow on anything but itself. It is convex, so that its lit faces are not
/// in its own shadow. Everything that it shades lies behind one of these faces, and is hidden if the camera sees that face in
/// front of it: a ground that shades the soles dipping into it needs no shadow map.
fn shades_others(filled: &[DVec3; 4], own: &Aabb, to_light: DVec3, receivers: &[&Aabb], view: &View) -> bool {
    let faces = LitFace::of(filled, to_light);
    let hidden =
        |r: &Aabb| faces.iter().all(|face| !face.shades(r, to_light) || face.hides_what_is_behind(r, view));
    faces.is_empty() || receivers.iter().any(|r| *r != own && !hidden(r))
}

/// A parallelogram that faces the light.
struct LitFace {
    center: DVec3,
    /// Half vectors of its sides.
    sides: [DVec3; 2],
    /// Unit, towards the light.
    normal: DVec3,
}

impl LitFace {
    fn of([center, half @ ..]: &[DVec3; 4], to_light: DVec3) -> Vec<LitFace> {
        let flat = half.iter().position(|h| *h == DVec3::ZERO);
        let face = |k: usize| {
            let sides = [half[(k + 1) % 3], half[(k + 2) % 3]];
            let normal = sides[0].cross(sides[1]).try_normalize()?;
            let normal = normal * if normal.dot(to_light) < 0.0 { -1.0 } else { 1.0 };
            let center = *center + half[k] * if half[k].dot(normal) < 0.0 { -1.0 } else { 1.0 };
            Some(LitFace { center, sides, normal })
        };
        (0..3).filter(|k| flat.is_none_or(|flat| flat == *k)).filter_map(face).collect()
    }

    /// Heights of a box's vertices over a plane through a point of the face, raised by the rounding error, so that a touching
    /// vertex counts as above.
    fn heights(&self, b: &Aabb, normal: DVec3, through: DVec3) -> [f64; 8] {
        let rounding = 1e-5 * b.min.abs().max(b.max.abs()).max_element() as f64;
        b.corners().map(|c| normal.dot(c.as_dvec3() - through) + rounding)
    }

    /// Whether the face can shade the box; false if the box lies beside its shadow.
    fn shades(&self, b: &Aabb, to_light: DVec3) -> bool {
        let [u, v] = self.sides;
        let side = |along: DVec3, out: DVec3| {
            let normal = along.cross(to_light).normalize_or_zero();
            (normal * normal.dot(out).signum(), self.center + out)
        };
        let planes = [(self.normal, self.center), side(u, v), side(u, -v), side(v, u), side(v, -u)];
        planes.iter().all(|(normal, through)| self.heights(b, *normal, *through).iter().any(|h| *h < 0.0))
    }

    /// Whether the face hides from the camera the part of the box behind its plane.
    fn hides_what_is_behind(&self, b: &Aabb, view: &View) -> bool {
        let corners = b.corners().map(|c| c.as_dvec3());
        let heights = self.heights(b, self.normal, self.center);
        let behind = (0..8).filter(|i| heights[*i] < 0.0).map(|i| corners[i]);
        let edges = (0..8).flat_map(|i| [1, 2, 4].map(|bit| (i, i ^ bit))).filter(|(a, b)| a < b);
        let crossing = edges.filter(|(a, b)| (heights[*a] < 0.0) != (heights[*b] < 0.0)).map(|(a, b)| {
            let t = heights[a] / (heights[a] - heights[b]);
            corners[a] + (corners[b] - corners[a]) * t
        });
        behind.chain(crossing).all(|p| self.hides_point(p, view))
    }

    /// Whether the face hides a point from the camera.
    fn hides_point(&self, p: DVec3, view: &View) -> bool {
        // The direction from the point to the camera.
        let way = if view.eye.w == 0.0 { view.eye.truncate().as_dvec3() } else { -p };
        let (height, rise) = (self.normal.dot(p - self.center), self.normal.dot(way));
        let above = rise > 0.0 && (view.eye.w == 0.0 || height + rise > 0.0);
        let hit = p + way * (-height / rise).max(0.0) - self.center;
        let [u, v] = self.sides;
        let (uu, uv, vv) = (u.dot(u), u.dot(v), v.dot(v));
        let (hu, hv) = (hit.dot(u), hit.dot(v));
        let determinant = uu * vv - uv * uv;
        let at = DVec2::new(hu * vv - hv * uv, hv * uu - hu * uv) / determinant;
        above && at.abs().max_element() <= 1.0
    }
}
