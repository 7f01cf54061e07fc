//! Fits shadow maps. A directional light gets maps that cover its visible shadows, and shadow cascades (cascaded shadow maps) if these
//! reach far; a spot light gets one map, a point light up to six.
//!
//! Texels of a directional light's map lie on a grid that is fixed in the world, and their size changes in steps, so that shadows
//! do not swim.

use crate::plan::build::shadow_volumes::{CasterBounds, ShadowVolume, shadow_volumes};
use crate::plan::shadow_maps::MAX_PENUMBRA;
use crate::plan::{PlanLight, View};
use crate::scene_resources::bounds::is_outside_frustum;
use choreo_asset::Aabb;
use choreo_stage::{SUN_ANGLE, Shadow};
use glam::{DMat4, DVec3, DVec4, Mat4, Vec2};

/// Largest number of shadow maps of a frame: the length of the shader's array.
pub(crate) const MAX_VIEWS: usize = 32;
/// Largest side of the image that all maps share, in texels: 256 MB.
const MAX_IMAGE: u32 = 8192;
const MAX_CASCADES: usize = 5;
/// Width of the filter in texels.
const FILTER_TEXELS: f64 = 3.0;
/// Margin on each side in texels: the filter's reach and the offset along the normal.
const MARGIN_TEXELS: f64 = 6.0;
/// Near plane of point and spot lights in metres. Casters nearer than this (the bulb) cast no shadow.
const NEAR_PLANE_METRES: f64 = 0.05;

/// Everything in view and everything that casts shadows, in camera-relative space.
pub(super) struct ShadowRegion<'a> {
    pub view: &'a View,
    /// Pixels.
    pub size: [u32; 2],
    /// Bounds of the lit copies in view.
    pub receivers: &'a [Aabb],
    pub casters: &'a [CasterBounds],
}

/// A shadow map before it is placed in the shared image.
pub(super) struct FittedMap {
    pub clip_from_relative: Mat4,
    pub size: [u32; 2],
    pub texel: f32,
    /// Width of the penumbra, as in [`crate::plan::ShadowView::penumbra`].
    pub penumbra: f32,
    /// Indices into `ShadowRegion::casters`.
    pub casters: Vec<usize>,
}

/// Shadow maps of one light; none if no caster shadows a receiver.
pub(super) fn fit(light: &PlanLight, shadow: Shadow, region: &ShadowRegion<'_>) -> Vec<FittedMap> {
    let direction = light.direction.as_dvec3().normalize_or(DVec3::NEG_Y);
    let most = f64::from(shadow.size.clamp(*Shadow::SIZES.start(), *Shadow::SIZES.end()) / 16 * 16);
    if region.receivers.is_empty() || region.casters.is_empty() {
        return Vec::new();
    }
    if light.is_local() {
        let softness = f64::from(shadow.softness.unwrap_or(Shadow::LAMP_SOFTNESS).max(0.0));
        perspective_maps(light, direction, most, softness, region)
    } else {
        cascades(Axes::along(direction), most, ShadowEdge::of(shadow), region)
    }
}

/// Right, up and forward axes of a light, orthonormal, as a camera's.
#[derive(Clone, Copy)]
pub(super) struct Axes {
    pub right: DVec3,
    pub up: DVec3,
    pub forward: DVec3,
}

impl Axes {
    fn along(forward: DVec3) -> Axes {
        let hint = if forward.y.abs() < 0.9 { DVec3::Y } else { DVec3::Z };
        let right = forward.cross(hint).normalize();
        Axes { right, up: right.cross(forward), forward }
    }
}

/// Interval along an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span(pub [f64; 2]);

impl Span {
    pub(super) const EMPTY: Span = Span([f64::INFINITY, f64::NEG_INFINITY]);

    pub(super) fn of(b: &Aabb, axis: DVec3) -> Span {
        let center = (b.min.as_dvec3() + b.max.as_dvec3()) * 0.5;
        let half = (b.max.as_dvec3() - b.min.as_dvec3()) * 0.5;
        let (middle, reach) = (axis.dot(center), axis.abs().dot(half));
        Span([middle - reach, middle + reach])
    }
    pub(super) fn union(self, o: Span) -> Span {
        Span([self.0[0].min(o.0[0]), self.0[1].max(o.0[1])])
    }
    pub(super) fn meet(self, o: Span) -> Span {
        Span([self.0[0].max(o.0[0]), self.0[1].min(o.0[1])])
    }
    pub(super) fn length(self) -> f64 {
        self.0[1] - self.0[0]
    }
    pub(super) fn grown(self, by: f64) -> Span {
        Span([self.0[0] - by, self.0[1] + by])
    }
    fn is_finite(self) -> bool {
        self.0.iter().all(|v| v.is_finite())
    }
}

/// Rounds up in steps of a quarter octave, so that small movements change nothing.
fn rounded_up_in_steps(v: f64) -> f64 {
    libm::exp2(libm::ceil(libm::log2(v) * 4.0) * 0.25)
}

/// Bounding sphere of the part of the view between two depths; rotating the camera does not change its radius.
fn bounding_sphere_of_slice(region: &ShadowRegion<'_>, from: f64, to: f64) -> (DVec3, f64) {
    let m = &region.view.clip_from_view;
    let back = region.view.view_from_relative.row(2).truncate().as_dvec3();
    let half = |scale: f32| 1.0 / f64::from(scale.abs()).max(1e-9);
    let (x, y) = (half(m.x_axis.x), half(m.y_axis.y));
    let k = x * x + y * y;
    let (depth, radius) = if region.view.eye.w == 0.0 {
        let half_depth = (to - from) * 0.5;
        ((from + to) * 0.5, (k + half_depth * half_depth).sqrt())
    } else {
        let depth = ((from + to) * 0.5 * (1.0 + k)).min(to);
        let far = (to - depth) * (to - depth) + to * to * k;
        let near = (from - depth) * (from - depth) + from * from * k;
        (depth, far.max(near).sqrt())
    };
    (back * -depth, radius)
}

/// Width of the shadow edges of a directional light.
#[derive(Clone, Copy)]
enum ShadowEdge {
    /// Fixed width in metres.
    Fixed(f64),
    /// Penumbra of the sun's disc: width per distance between caster and receiver.
    Sun(f64),
}

impl ShadowEdge {
    fn of(shadow: Shadow) -> ShadowEdge {
        match shadow.softness {
            Some(softness) => ShadowEdge::Fixed(f64::from(softness.max(0.0))),
            None => ShadowEdge::Sun(2.0 * libm::tan(0.5 * f64::from(SUN_ANGLE))),
        }
    }

    /// Texels around a map that its lookups reach: half the filter, and the offset along the normal.
    fn margin(self) -> f64 {
        match self {
            ShadowEdge::Fixed(_) => MARGIN_TEXELS,
            ShadowEdge::Sun(_) => MARGIN_TEXELS + 0.5 * f64::from(MAX_PENUMBRA),
        }
    }

    /// Finest useful texel size in metres. `pixel`: size of a pixel at the beginning of the map, in metres.
    fn finest(self, pixel: f64) -> f64 {
        match self {
            ShadowEdge::Fixed(softness) => softness / FILTER_TEXELS,
            ShadowEdge::Sun(_) => 0.75 * pixel,
        }
    }

    /// Coarsest texel size that a map may have before another cascade begins: edges of 6 pixels in the first cascade, of 12 in
    /// others.
    fn coarsest(self, cascade: usize, pixel: f64) -> f64 {
        let pixels = if cascade == 0 { 2.0 } else { 4.0 };
        (pixels * pixel).max(1.2 * self.finest(0.0))
    }
}

/// Depths beyond `from` at which a cascade may end, in fixed steps, so that small movements change nothing.
fn cascade_ends(from: f64, view: &View) -> impl Iterator<Item = f64> {
    let perspective = view.eye.w != 0.0;
    let start =
        if perspective { from } else { 2.0 / f64::from(view.clip_from_view.y_axis.y.abs()).max(1e-9) };
    let first = libm::floor(libm::log2(start) * 2.0);
    (1..).map(move |i| {
        let step = libm::exp2((first + f64::from(i)) * 0.5);
        if perspective { step } else { from + step }
    })
}

/// Cascades from near to far (Zhang et al., "Parallel-Split Shadow Maps for Large-scale Virtual Environments", 2006), fitted to
/// visible shadows. Sample distribution shadow maps (Lauritzen et al. 2010) fit to a depth buffer, which the planner does not
/// have. A cascade ends before its texels become too coarse for its near end, and the next one begins where a shadow volume
/// continues, so nothing farther away changes a cascade, however large the scene is.
fn cascades(axes: Axes, most: f64, edge: ShadowEdge, region: &ShadowRegion<'_>) -> Vec<FittedMap> {
    let spread = if let ShadowEdge::Sun(spread) = edge { spread } else { 0.0 };
    let volumes = shadow_volumes(&axes, spread, region);
    let perspective = region.view.eye.w != 0.0;
    let pixel = |depth: f64| {
        2.0 * if perspective { depth } else { 1.0 }
            / f64::from(region.view.clip_from_view.y_axis.y.abs()).max(1e-9)
            / f64::from(region.size[1].max(1))
    };
    let mut maps = Vec::new();
    let mut rest: Vec<&ShadowVolume> = volumes.iter().collect();
    let mut from = f64::NEG_INFINITY;
    for cascade in 0..MAX_CASCADES {
        let Some(nearest) = rest.iter().map(|v| v.view_depths.0[0]).reduce(f64::min) else { break };
        let farthest = rest.iter().map(|v| v.view_depths.0[1]).fold(nearest, f64::max);
        from = nearest.max(from);
        // A volume around the camera begins at the near plane, which would demand far finer texels than its visible part needs.
        let sharp =
            |v: &&ShadowVolume| v.view_depths.0[0] * if v.at_camera && perspective { 64.0 } else { 1.0 };
        let sharpest = rest.iter().map(sharp).fold(f64::INFINITY, f64::min).max(from);
        let coarsest = edge.coarsest(cascade, pixel(sharpest));
        let part = |to: f64| DepthRange::of(&axes, [from, to], &rest, region);
        let texel = |part: &DepthRange| part.side() / (most - 2.0 * edge.margin());
        let mut to = farthest;
        if cascade + 1 < MAX_CASCADES && texel(&part(to)) > coarsest {
            let fits = |to: &f64| *to < farthest && texel(&part(*to)) <= coarsest;
            to = cascade_ends(sharpest, region.view)
                .take_while(fits)
                .last()
                .unwrap_or(cascade_ends(sharpest, region.view).next().unwrap_or(to))
                .min(farthest);
        }
        let part = part(to);
        let texel =
            rounded_up_in_steps(texel(&part).max(edge.finest(pixel(sharpest))).max(f64::MIN_POSITIVE));
        maps.extend(part.map(&axes, texel, edge, region));
        rest.retain(|v| v.view_depths.0[1] > to);
        from = to;
    }
    maps
}

/// Extents of the shadow volumes between two depths, along the axes of the light.
struct DepthRange<'a> {
    across: Span,
    up: Span,
    deep: Span,
    volumes: Vec<&'a ShadowVolume>,
}

impl<'a> DepthRange<'a> {
    fn of(
        axes: &Axes,
        [from, to]: [f64; 2],
        volumes: &[&'a ShadowVolume],
        region: &ShadowRegion<'_>,
    ) -> DepthRange<'a> {
        let between = |v: &&&ShadowVolume| v.view_depths.0[0] <= to && v.view_depths.0[1] >= from;
        let volumes: Vec<&ShadowVolume> = volumes.iter().filter(between).copied().collect();
        let (middle, radius) = bounding_sphere_of_slice(region, from, to);
        let around = |axis: DVec3, extent: fn(&ShadowVolume) -> Span| {
            let sphere = Span([axis.dot(middle) - radius, axis.dot(middle) + radius]);
            volumes.iter().fold(Span::EMPTY, |all, v| all.union(extent(v))).meet(sphere)
        };
        DepthRange {
            across: around(axes.right, |v| v.across),
            up: around(axes.up, |v| v.up),
            deep: around(axes.forward, |v| v.deep),
            volumes,
        }
    }

    /// The longer side in metres.
    fn side(&self) -> f64 {
        self.across.length().max(self.up.length())
    }

    /// The map of this range; `None` if nothing casts a shadow in it.
    fn map(&self, axes: &Axes, texel: f64, edge: ShadowEdge, region: &ShadowRegion<'_>) -> Option<FittedMap> {
        if !(self.across.length() >= 0.0 && self.up.length() >= 0.0 && self.deep.length() >= 0.0) {
            return None;
        }
        // Texel borders lie at multiples of the texel size in world space.
        let margin = edge.margin() * texel;
        let grid = |v: f64, world: f64, round: fn(f64) -> f64| round((v + world) / texel) * texel - world;
        let (at_x, at_y) = (axes.right.dot(region.view.position), axes.up.dot(region.view.position));
        let left = grid(self.across.0[0] - margin, at_x, libm::floor);
        let top = grid(self.up.0[1] + margin, at_y, libm::ceil);
        let texels =
            |from_edge: f64| (libm::ceil((from_edge + margin) / texel / 16.0) * 16.0).clamp(16.0, 8192.0);
        let (w, h) = (texels(self.across.0[1] - left), texels(top - self.up.0[0]));
        let (right, bottom) = (left + w * texel, top - h * texel);
        let mut depth = self.deep;
        let mut casters = Vec::new();
        for v in &self.volumes {
            let beside =
                v.across.0[1] < left || v.across.0[0] > right || v.up.0[1] < bottom || v.up.0[0] > top;
            let z = Span::of(&region.casters[v.caster].bounds, axes.forward);
            // A caster behind all receivers shadows nothing.
            if beside || z.0[0] > self.deep.0[1] || !z.is_finite() {
                continue;
            }
            casters.push(v.caster);
            depth = depth.union(z);
        }
        casters.sort_unstable();
        if casters.is_empty() {
            return None;
        }
        let (near, far) = (depth.0[0] - margin, self.deep.0[1] + margin);
        let row = |axis: DVec3, scale: f64, offset: f64| (axis * scale).extend(offset);
        let rows = [
            row(axes.right, 2.0 / (w * texel), -2.0 * left / (w * texel) - 1.0),
            row(axes.up, -2.0 / (h * texel), 2.0 * top / (h * texel) - 1.0),
            row(axes.forward, -1.0 / (far - near), far / (far - near)),
            DVec4::W,
        ];
        let map = fitted_map(rows, [w as u32, h as u32], texel, casters)?;
        let penumbra = if let ShadowEdge::Sun(spread) = edge { spread * (far - near) / texel } else { 0.0 };
        Some(FittedMap { penumbra: penumbra as f32, ..map })
    }
}

fn fitted_map(rows: [DVec4; 4], size: [u32; 2], texel: f64, casters: Vec<usize>) -> Option<FittedMap> {
    let clip = DMat4::from_cols_array_2d(&rows.map(|r| r.to_array())).transpose().as_mat4();
    clip.is_finite().then_some(FittedMap {
        clip_from_relative: clip,
        size,
        texel: texel as f32,
        penumbra: 0.0,
        casters,
    })
}

/// Maps of a spot light's cone, or of the cube faces of a light in which casters lie.
fn perspective_maps(
    light: &PlanLight,
    direction: DVec3,
    most: f64,
    softness: f64,
    region: &ShadowRegion<'_>,
) -> Vec<FittedMap> {
    let position = light.position.as_dvec3();
    let cos_outer = f64::from(light.cos_outer()).clamp(-1.0, 1.0);
    // Texel sizes are chosen for the distance to the center of the receivers.
    let middle = region.receivers.iter().fold(DVec3::ZERO, |sum, b| sum + b.center().as_dvec3())
        / region.receivers.len() as f64;
    let distance = middle.distance(position).max(0.1);
    let side = |tan: f64| {
        let wanted = 2.0 * tan * distance * FILTER_TEXELS / softness.max(1e-6);
        (libm::ceil(rounded_up_in_steps(wanted.clamp(128.0, 8192.0)) / 16.0) * 16.0).clamp(64.0, most)
    };
    // Casters beyond everything lit or beyond the light's range have no effect.
    let farthest = |b: &Aabb| {
        b.corners().map(|c| c.as_dvec3().distance_squared(position)).into_iter().fold(0.0, f64::max)
    };
    let lit = region.receivers.iter().map(farthest).fold(0.0, f64::max);
    let range = match light.inverse_range_squared {
        0.0 => f64::INFINITY,
        inverse => 1.0 / f64::from(inverse),
    };
    let reaches = |b: &Aabb| {
        let nearest = position.clamp(b.min.as_dvec3(), b.max.as_dvec3());
        nearest.distance_squared(position) <= lit.min(range)
    };
    let map = |axes: Axes, tan: f64, side: f64| {
        // Widened by the margin, so that the filter finds texels at the edge of the cone or face.
        let tan = tan * side / (side - 2.0 * MARGIN_TEXELS);
        let row = |axis: DVec3| axis.extend(-axis.dot(position));
        let depth = DVec4::new(0.0, 0.0, 0.0, NEAR_PLANE_METRES);
        let rows = [row(axes.right) / tan, -row(axes.up) / tan, depth, row(axes.forward)];
        let clip = DMat4::from_cols_array_2d(&rows.map(|r| r.to_array())).transpose().as_mat4();
        let seen = |b: &Aabb| reaches(b) && !is_outside_frustum(*b, &clip, Vec2::ZERO);
        let casters: Vec<usize> =
            (0..region.casters.len()).filter(|i| seen(&region.casters[*i].bounds)).collect();
        if casters.is_empty() || !region.receivers.iter().any(seen) {
            return None;
        }
        fitted_map(rows, [side as u32; 2], 2.0 * tan / side, casters)
    };
    // One map suffices for cones up to 60° to each side; a wider one would spend its texels on the rim.
    if cos_outer >= 0.5 {
        let tan = (1.0 - cos_outer * cos_outer).sqrt() / cos_outer;
        return map(Axes::along(direction), tan.max(1e-3), side(tan)).into_iter().collect();
    }
    let faces = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let side = side(1.0);
    faces.into_iter().filter_map(|face| map(Axes::along(face), 1.0, side)).collect()
}

/// Packs maps in rows of an image: the position of each, and the size used; `None` if they do not fit.
pub(super) fn pack(sizes: &[[u32; 2]]) -> Option<(Vec<[u32; 2]>, [u32; 2])> {
    let width = sizes.iter().map(|s| s[0]).max()?.max(4096);
    let (mut x, mut y, mut row, mut used) = (0, 0, 0, [0, 0]);
    let mut places = Vec::with_capacity(sizes.len());
    for &[w, h] in sizes {
        if x + w > width {
            (x, y, row) = (0, y + row, 0);
        }
        places.push([x, y]);
        x += w;
        row = row.max(h);
        used = [used[0].max(x), used[1].max(y + h)];
    }
    used.iter().all(|s| *s <= MAX_IMAGE).then_some((places, used))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::LightType;
    use choreo_asset::Projection;
    use choreo_stage::CameraState;
    use glam::{DAffine3, Vec3, Vec4};

    fn view(x: f64) -> View {
        let projection = Projection::Perspective { yfov: 0.7, near: 0.1, far: None };
        let world_from_view = DAffine3::from_translation(DVec3::new(x, 1.0, 8.0));
        View::new(&CameraState { camera: None, world_from_view, projection }, [1280, 720])
    }

    fn around(view: &View, at: DVec3, half: f32) -> Aabb {
        let c = (at - view.position).as_vec3();
        Aabb { min: c - half, max: c + half }
    }

    fn caster(bounds: Aabb) -> CasterBounds {
        CasterBounds { bounds, filled: None }
    }

    fn light(kind: LightType, direction: Vec3, position: Vec3, cone: Vec2) -> PlanLight {
        PlanLight {
            position,
            kind,
            direction,
            shadow_views: [0; 2],
            color: Vec3::ONE,
            inverse_range_squared: 0.0,
            cone,
            polynomial: PlanLight::INVERSE_SQUARE,
        }
    }

    fn a_sun() -> PlanLight {
        light(LightType::Directional, Vec3::new(-0.4, -0.8, -0.45), Vec3::ZERO, Vec2::ZERO)
    }

    fn fit_in(view: &View, light: &PlanLight, receiver: f32) -> Vec<FittedMap> {
        let receivers = [around(view, DVec3::ZERO, receiver)];
        let casters =
            [around(view, DVec3::Y, 0.5), around(view, DVec3::new(900.0, 0.0, 0.0), 1.0)].map(caster);
        let region = ShadowRegion { view, size: [1280, 720], receivers: &receivers, casters: &casters };
        fit(light, Shadow::default(), &region)
    }

    #[test]
    fn maps_contain_visible_shadows_and_skip_far_casters() {
        let v = view(0.0);
        let sun = a_sun();
        let maps = fit_in(&v, &sun, 3.0);
        assert_eq!(maps.len(), 1, "a small scene needs no cascades");
        assert_eq!(maps[0].casters, [0]);
        let place = |p: DVec3| maps[0].clip_from_relative * (p - v.position).as_vec3().extend(1.0);
        for vertex in around(&v, DVec3::Y, 0.5).corners() {
            // The vertex, and where its shadow meets y = -3.
            let vertex = vertex.as_dvec3() + v.position;
            let direction = sun.direction.as_dvec3();
            for p in [vertex, vertex + direction * ((-3.0 - vertex.y) / direction.y)].map(place) {
                assert!(p.x.abs() < 1.0 && p.y.abs() < 1.0 && (0.0..=1.0).contains(&p.z), "{p}");
            }
        }
        // Reversed Z: a place nearer to the light has a greater depth.
        assert!(place(DVec3::Y).z > place(DVec3::ZERO).z);
    }

    #[test]
    fn a_far_view_gets_cascades_from_fine_to_coarse() {
        let sun = a_sun();
        let v = view(0.0);
        let receivers = [around(&v, DVec3::new(0.0, -500.0, 0.0), 500.0)];
        let row = |i: i32| caster(around(&v, DVec3::new(0.0, 1.0, 4.0 - 10.0 * f64::from(i)), 1.0));
        let fit_first = |count: i32| {
            let casters: Vec<CasterBounds> = (0..count).map(row).collect();
            let region =
                ShadowRegion { view: &v, size: [1280, 720], receivers: &receivers, casters: &casters };
            fit(&sun, Shadow { softness: Some(0.0), ..Shadow::default() }, &region)
        };
        let maps = fit_first(40);
        assert!(maps.len() > 2, "{}", maps.len());
        assert!(maps.windows(2).all(|m| m[0].texel < m[1].texel));
        assert!(maps[0].casters.len() < 20, "each map has its own casters");
        assert!(maps.iter().all(|m| m.size.iter().all(|s| *s <= 2048)));
        // Objects farther away change no nearer cascade.
        let more = fit_first(400);
        assert_eq!(more[0].clip_from_relative, maps[0].clip_from_relative);
        assert_eq!((more[0].texel, more[0].size), (maps[0].texel, maps[0].size));
    }

    #[test]
    fn a_ground_of_any_size_is_no_caster_and_changes_no_map() {
        let v = view(0.0);
        let fit_on = |half: f32, feet: f64| {
            let ground = Aabb { min: Vec3::new(-half, -1.0, -half), max: Vec3::new(half, -1.0, half) };
            let axes = [DVec3::ZERO, DVec3::X * f64::from(half), DVec3::ZERO, DVec3::Z * f64::from(half)];
            let center = DVec3::NEG_Y;
            let filled = Some([center, axes[1], axes[2], axes[3]]);
            // Feet dip into the ground, which the ground itself hides.
            let figure = around(&v, DVec3::new(0.0, 0.9 - feet, 0.0), 0.9);
            let region = ShadowRegion {
                view: &v,
                size: [1280, 720],
                receivers: &[ground, figure],
                casters: &[CasterBounds { bounds: ground, filled }, caster(figure)],
            };
            fit(&a_sun(), Shadow::default(), &region)
        };
        for feet in [0.0, 0.02] {
            let small = fit_on(10.0, feet);
            assert_eq!(small.len(), 1);
            assert_eq!(small[0].casters, [1], "the ground is not drawn");
            for half in [50.0, 500.0, 5e3, 5e4] {
                let large = fit_on(half, feet);
                assert_eq!(large[0].casters, [1]);
                assert_eq!((large.len(), large[0].texel, large[0].size), (1, small[0].texel, small[0].size));
            }
        }
        // A `shelf` at the same height shades the floor under it, which is visible.
        let shelf = Aabb { min: Vec3::new(-0.5, -0.5, -8.5), max: Vec3::new(0.5, -0.5, -7.5) };
        let filled = Some([shelf.center().as_dvec3(), DVec3::X * 0.5, DVec3::ZERO, DVec3::Z * 0.5]);
        let floor = Aabb { min: Vec3::new(-9.0, -1.0, -19.0), max: Vec3::new(9.0, -1.0, 9.0) };
        let region = ShadowRegion {
            view: &v,
            size: [1280, 720],
            receivers: &[shelf, floor],
            casters: &[CasterBounds { bounds: shelf, filled }],
        };
        assert_eq!(fit(&a_sun(), Shadow::default(), &region).len(), 1);
    }

    #[test]
    fn shadow_cascades_do_not_depend_on_the_scale_of_the_scene() {
        let fit_at = |scale: f64| {
            let projection = Projection::Perspective { yfov: 0.7, near: (0.1 * scale) as f32, far: None };
            let world_from_view = DAffine3::from_translation(DVec3::new(0.3, 1.0, 8.0) * scale);
            let v = View::new(&CameraState { camera: None, world_from_view, projection }, [1280, 720]);
            let s = scale as f32;
            let ground =
                Aabb { min: Vec3::new(-50.0, -1.0, -50.0) * s, max: Vec3::new(50.0, -1.0, 50.0) * s };
            let casters: Vec<CasterBounds> = (0..20)
                .map(|i| caster(around(&v, DVec3::new(0.0, 0.9, -4.0 * f64::from(i)) * scale, 0.9 * s)))
                .collect();
            let region =
                ShadowRegion { view: &v, size: [1280, 720], receivers: &[ground], casters: &casters };
            let maps = fit(&a_sun(), Shadow::default(), &region);
            maps.iter().map(|m| (m.size, m.casters.clone())).collect::<Vec<_>>()
        };
        assert!(fit_at(1.0).len() > 1);
        for exponent in [-10, -3, 7, 10] {
            assert_eq!(fit_at(libm::exp2(f64::from(exponent))), fit_at(1.0), "2^{exponent}");
        }
    }

    /// The map that a shader samples on the ground ahead is fine enough, or as fine as with a smaller shadow map.
    #[test]
    fn a_larger_shadow_map_is_nowhere_coarser() {
        let sun = a_sun();
        let v = view(0.0);
        // The ground continues under the camera.
        let ground = Aabb { min: Vec3::new(-6.0, -0.4, -11.0), max: Vec3::new(6.0, -0.4, 3.0) };
        let region =
            ShadowRegion { view: &v, size: [2560, 1440], receivers: &[ground], casters: &[caster(ground)] };
        let depths: Vec<f32> = (0..97).map(|i| 1.2 + 0.1 * i as f32).collect();
        let softness = 0.01;
        let texels = |size: u32| -> Vec<f32> {
            let maps = fit(&sun, Shadow { size, softness: Some(softness) }, &region);
            let at = |depth: &f32| {
                let inside = |m: &&FittedMap| {
                    let p = m.clip_from_relative * Vec4::new(0.0, -0.4, -depth, 1.0);
                    p.x.abs() < 1.0 && p.y.abs() < 1.0
                };
                maps.iter().find(inside).map_or(f32::INFINITY, |m| m.texel)
            };
            depths.iter().map(at).collect()
        };
        let of_size: Vec<Vec<f32>> = [256, 384, 512, 640, 768, 1024, 2048, 4096].map(texels).into();
        for (smaller, larger) in of_size.iter().zip(&of_size[1..]) {
            for (i, (depth, many)) in depths.iter().zip(larger).enumerate() {
                // A map with coarser texels has a wider margin, so that it ends a little later.
                let near = &smaller[i.saturating_sub(3)..(i + 4).min(smaller.len())];
                let few = near.iter().copied().fold(0.0, f32::max);
                // Fine enough is eight pixels, or nearly a texel of the softness; sizes increase in steps of a quarter octave.
                let pixel = 2.0 * depth * libm::tanf(0.35) / 1440.0;
                let fine = (8.0 * pixel).max(1.2 * softness / 3.0) * 1.19;
                assert!(*many <= few.max(fine), "at {depth} m {many}, with fewer {few}, fine is {fine}");
            }
        }
        assert!(of_size[0].iter().any(|t| *t > 0.02) && of_size[7].iter().all(|t| *t < 0.01));
    }

    #[test]
    fn camera_motion_moves_maps_by_whole_texels() {
        let sun = a_sun();
        let world = DVec3::new(0.3, 0.2, 0.1);
        let place = |x: f64| {
            let v = view(x);
            let map = fit_in(&v, &sun, 3.0).remove(0);
            let p = map.clip_from_relative * (world - v.position).as_vec3().extend(1.0);
            let texel = |c: f32, size: u32| (f64::from(c) * 0.5 + 0.5) * f64::from(size);
            (map.texel, [texel(p.x, map.size[0]), texel(p.y, map.size[1])])
        };
        let (texel, at) = place(0.0);
        for i in 1..30 {
            let (other, moved) = place(0.0137 * f64::from(i));
            assert_eq!(texel, other);
            for (a, b) in at.iter().zip(moved) {
                let off = (a - b) - (a - b).round();
                assert!(off.abs() < 2e-3, "{a} {b}");
            }
        }
    }

    #[test]
    fn point_lights_have_maps_for_faces_with_casters_only() {
        let v = view(0.0);
        let at = (DVec3::new(0.0, 4.0, 0.0) - v.position).as_vec3();
        // 30° to each side.
        let (cos_in, cos_out) = (0.9f32, 0.8660254f32);
        let scale = 1.0 / (cos_in - cos_out);
        let cone = Vec2::new(scale, -cos_out * scale);
        let maps = fit_in(&v, &light(LightType::Spot, Vec3::NEG_Y, at, cone), 3.0);
        assert_eq!(maps.len(), 1);
        let p = maps[0].clip_from_relative * (DVec3::Y - v.position).as_vec3().extend(1.0);
        assert!((p.x / p.w).abs() < 1e-5 && (p.w - 3.0).abs() < 1e-4, "{p}");
        let lamp = fit_in(&v, &light(LightType::Point, Vec3::NEG_Y, at, Vec2::ZERO), 3.0);
        assert_eq!(lamp.len(), 1, "the caster is below; nothing else is in reach of the other faces");
        // No caster counts beyond the light's range.
        let lamp = light(LightType::Point, Vec3::NEG_Y, at, Vec2::ZERO);
        let short = PlanLight { inverse_range_squared: 1.0, ..lamp };
        assert!(fit_in(&v, &short, 3.0).is_empty());
    }

    #[test]
    fn packed_maps_do_not_overlap() {
        let sizes = [[2048, 1024], [2048, 2048], [1024, 512], [4096, 16]];
        let (places, used) = pack(&sizes).unwrap();
        for (i, (a, s)) in places.iter().zip(sizes).enumerate() {
            assert!(a[0] + s[0] <= used[0] && a[1] + s[1] <= used[1]);
            for (b, t) in places[..i].iter().zip(sizes) {
                let apart =
                    a[0] + s[0] <= b[0] || b[0] + t[0] <= a[0] || a[1] + s[1] <= b[1] || b[1] + t[1] <= a[1];
                assert!(apart, "{i}");
            }
        }
        assert_eq!(pack(&[[4096, 4096]; 8]), None);
    }
}
