//! Frustum culling of actors: finds those that are certainly outside the image, before any pose is computed.
//!
//! A joint is never farther from its parent than the longest translation of its curves, however it turns. Summed along the skeleton, this
//! is the radius of a bounding sphere about the actor's origin that holds every vertex in every pose of its layers. An actor needs neither
//! a pose nor a draw if its sphere, and everything that its shadow could fall on, is outside the view frustum. Constraints and springs turn
//! joints within the sphere and are not solved without a pose; foot locking can lower the hips, by a known share of a leg. If this cannot
//! be decided (feet on uneven ground, mirrored poses, splines, cameras attached to joints …), the actors concerned count as visible. An
//! effect that can need actors outside the image states which ones are kept ([`OffScreenActors`]).
//!
//! [`OffScreenActors`]: crate::OffScreenActors

use crate::morph_range::largest_morph_weights;
use crate::snapshot::{ActorState, CameraState};
use crate::stage::Stage;
use crate::stage::actor::{Actor, Target};
use crate::stage::camera::Rig;
use crate::stage::channel::Property;
use crate::stage::clips::LayerMode;
use crate::stage::constraint::{ConstraintKind, FootLock};
use crate::stage::edits::FrameEdits;
use crate::stage::light::{SUN_ANGLE, Shadow};
use crate::stage::parenting::ParentScale;
use crate::transforms::order::PlacementStep;
use crate::transforms::parents::{ActiveParent, ActiveParents};
use choreo_asset::{Aabb, Projection};
use choreo_motion::{Clip, Interpolation, Path, Skinning, Time};
use glam::{DMat3, DVec3, Vec3};

/// Bounds of each actor of a stage that hold at any time; `None` if there are none.
#[derive(Debug)]
pub(crate) struct PoseBounds(Vec<Option<PoseRadius>>);

/// Bounds of all poses of an actor, in model units.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PoseRadius {
    /// Distance from the model's origin to the farthest vertex or joint.
    radius: f64,
    /// The largest scale of a joint's space.
    scale: f64,
}

impl PoseBounds {
    pub(crate) fn new(stage: &Stage) -> PoseBounds {
        PoseBounds(stage.actors.iter().map(|actor| pose_radius(stage, actor)).collect())
    }
}

/// Bounds of all poses of an actor; `None` if no bounds are known in advance.
fn pose_radius(stage: &Stage, actor: &Actor) -> Option<PoseRadius> {
    let asset = &actor.asset;
    let lit_by_file = actor.file_lights && !asset.lights.is_empty();
    let outlined = asset.materials.iter().any(|m| m.toon.as_ref().is_some_and(|t| t.outline.is_some()));
    // Line widths in pixels have no fixed size in metres.
    let outlined = outlined || asset.materials.iter().any(|m| m.line_style.is_some());
    // Dual-quaternion skinning moves vertices outside the convex hull of their positions under each joint's matrix.
    if lit_by_file || outlined || actor.skinning != Skinning::Linear {
        return None;
    }
    let lowered = constraint_growth(stage, actor)?;
    // Largest distance from the parent, and largest scale, by joint; then the distance that additive layers add.
    let mut far: Vec<f64> =
        asset.skeleton.rest().iter().map(|t| vector_length(&t.translation.to_array())).collect();
    let mut scale: Vec<f64> = asset.skeleton.rest().iter().map(|t| max_abs(&t.scale.to_array())).collect();
    let mut added = vec![0.0f64; far.len()];
    for layer in &actor.layers {
        let additive = layer.mode != LayerMode::Override;
        let mut more = vec![0.0f64; far.len()];
        for cue in &layer.cues {
            if cue.inertialization > Time::ZERO {
                return None;
            }
            let of_layer = if additive { &mut more } else { &mut far };
            let how = (additive, cue.root.is_some());
            widen_by_clip(&cue.clip, how, of_layer, &mut scale)?;
        }
        added.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
    }
    let mut places: Vec<(f64, f64)> = Vec::with_capacity(far.len());
    let mut all = PoseRadius { radius: 0.0, scale: 1.0 };
    for (joint, parent) in asset.skeleton.parents().iter().enumerate() {
        let (distance, above) = parent.map_or((0.0, 1.0), |p| places[p as usize]);
        let here = (distance + above * (far[joint] + added[joint]), above * scale[joint]);
        all = PoseRadius { radius: all.radius.max(here.0), scale: all.scale.max(here.1) };
        places.push(here);
    }
    for (index, instance) in asset.instance_bounds().iter().enumerate() {
        let moves = |m: &Aabb| m.min != Vec3::ZERO || m.max != Vec3::ZERO;
        let weights = match instance.parts.iter().any(|part| part.morphs.iter().any(moves)) {
            true => largest_morph_weights(stage, actor, index)?,
            false => Vec::new(),
        };
        for part in &instance.parts {
            let (distance, scale) = places.get(part.joint as usize)?;
            let mut corner = part.reach.min.abs().max(part.reach.max.abs()).as_dvec3();
            for (morph, weight) in part.morphs.iter().zip(&weights) {
                corner += morph.min.abs().max(morph.max.abs()).as_dvec3() * *weight;
            }
            all.radius = all.radius.max(distance + scale * corner.length());
        }
    }
    let (radius, larger) = asset.farthest(all.radius * lowered);
    (all.radius, all.scale) = (radius, all.scale * larger);
    // Margin for rounding in f32.
    all.radius = all.radius * 1.001 + 1e-5;
    (all.radius.is_finite() && all.scale.is_finite()).then_some(all)
}

/// Factor by which constraints enlarge the bounding sphere; `None` if there is no bound. Foot locking lowers the hips by a share of a leg,
/// which is no longer than the sphere's radius as long as the actor's scale does not change.
fn constraint_growth(stage: &Stage, actor: &Actor) -> Option<f64> {
    let scaled = || actor.channels.iter().any(|channel| channel.property == Property::Scale);
    let steady = || stage.frame_callbacks.is_empty() && actor.parents.is_empty() && !scaled();
    actor.constraints.iter().try_fold(1.0, |factor, constraint| match &constraint.kind {
        ConstraintKind::Reach(_) | ConstraintKind::Aim(_) => Some(factor),
        ConstraintKind::FootLock(feet) if feet.hips.is_none() => Some(factor),
        ConstraintKind::FootLock(feet) if feet.ground.is_empty() && steady() => {
            Some(factor * (1.0 + FootLock::MAX_HIP_DROP_SHARE))
        }
        ConstraintKind::FootLock(_) | ConstraintKind::Mirror(_) => None,
    })
}

/// Widens the joints' largest distances and scales by the curves of a clip; `None` for splines, which overshoot, and for additive scales.
fn widen_by_clip(
    clip: &Clip,
    (additive, carries): (bool, bool),
    far: &mut [f64],
    scale: &mut [f64],
) -> Option<()> {
    for curve in clip.curves() {
        let joint = curve.joint as usize;
        if !matches!(curve.path, Path::Translation | Path::Scale) {
            continue;
        }
        if curve.interpolation == Interpolation::CubicSpline {
            return None;
        }
        let keys = || curve.values.chunks_exact(3);
        if curve.path == Path::Translation {
            let most = keys().map(vector_length).fold(0.0, f64::max);
            let away = |key: &[f32]| {
                let first = &curve.values[..3];
                vector_length(&[key[0] - first[0], key[1] - first[1], key[2] - first[2]])
            };
            let here = match carries {
                // An additive clip adds the difference of two of its poses.
                _ if additive => 2.0 * most,
                // Root motion moves the pose back by the distance traveled and turns it about its anchor; the bound allows for twice that
                // distance.
                true => most + 2.0 * keys().map(away).fold(0.0, f64::max),
                false => most,
            };
            far[joint] = far[joint].max(here);
        } else if additive {
            return None;
        } else {
            scale[joint] = scale[joint].max(keys().map(max_abs).fold(0.0, f64::max));
        }
    }
    Some(())
}

fn vector_length(v: &[f32]) -> f64 {
    v.iter().map(|c| f64::from(*c) * f64::from(*c)).sum::<f64>().sqrt()
}

fn max_abs(v: &[f32]) -> f64 {
    v.iter().fold(0.0, |most, c| f64::from(c.abs()).max(most))
}

/// Bounding sphere: center and radius.
type BoundingSphere = (DVec3, f64);

/// The view frustum as half spaces (n, d), inside where n · p + d ≥ 0.
struct ViewFrustum([(DVec3, f64); 5]);

impl ViewFrustum {
    /// The view frustum of an image with this aspect ratio; a little wider than exact, since lines and points extend beyond
    /// their boxes.
    fn new(camera: &CameraState, aspect: f64) -> ViewFrustum {
        const FRUSTUM_MARGIN: f64 = 1.05;
        let (x, y) = (aspect * FRUSTUM_MARGIN, FRUSTUM_MARGIN);
        let planes = match camera.projection {
            Projection::Perspective { yfov, .. } => {
                let half = libm::tan(f64::from(yfov) * 0.5);
                let side = |axis: DVec3, half: f64| ((-axis - DVec3::Z * half).normalize(), 0.0);
                [
                    side(DVec3::X, x * half),
                    side(-DVec3::X, x * half),
                    side(DVec3::Y, y * half),
                    side(-DVec3::Y, y * half),
                    (-DVec3::Z, 0.0),
                ]
            }
            Projection::Orthographic { height, near, .. } => {
                let half = f64::from(height) * 0.5;
                [
                    (-DVec3::X, x * half),
                    (DVec3::X, x * half),
                    (-DVec3::Y, y * half),
                    (DVec3::Y, y * half),
                    (-DVec3::Z, -f64::from(near).min(0.0)),
                ]
            }
        };
        let (rotation, at) = (camera.world_from_view.matrix3, camera.world_from_view.translation);
        ViewFrustum(planes.map(|(n, d)| {
            let n = rotation * n;
            (n, d - n.dot(at))
        }))
    }

    /// Whether a bounding sphere is outside one of the half spaces and, for each light, so is everything that it could shade.
    fn excludes(&self, (center, radius): BoundingSphere, casting: &[CastingLight]) -> bool {
        let outside = |(n, d): &(DVec3, f64)| n.dot(center) + d < -radius;
        // The shadow extends away from the light and must not approach the half space.
        let shades = |n: &DVec3, casting: &CastingLight| match casting {
            CastingLight::Point(light) => n.dot(center - *light) + radius > 0.0,
            // A penumbra widens by half of the sun's disc to each side.
            CastingLight::Directional(direction) => n.dot(*direction) > -0.5 * f64::from(SUN_ANGLE),
        };
        let shadow_outside =
            |plane: &(DVec3, f64), casting: &CastingLight| outside(plane) && !shades(&plane.0, casting);
        self.0.iter().any(outside)
            && casting.iter().all(|casting| self.0.iter().any(|plane| shadow_outside(plane, casting)))
    }
}

/// A light that casts shadows.
enum CastingLight {
    Point(DVec3),
    Directional(DVec3),
}

/// Finds the actors that the image does not need. All actors are placed, but joints are not posed yet, so actors on joints may be
/// misplaced; their own positions are not used.
pub(crate) struct Culling<'a> {
    pub stage: &'a Stage,
    pub pose_bounds: &'a PoseBounds,
    pub camera: Option<CameraState>,
    /// Aspect ratio of the image: width over height.
    pub aspect: f64,
    pub edits: &'a FrameEdits,
    pub time: Time,
    /// Order of placement: parents come before their children.
    pub order: &'a [PlacementStep],
    pub parents: &'a ActiveParents,
    pub actors: &'a [ActorState],
}

impl Culling<'_> {
    /// Fills `out` with one flag per actor: whether it is culled.
    pub(crate) fn run(&self, out: &mut Vec<bool>) {
        out.clear();
        out.resize(self.actors.len(), false);
        let (Some(camera), Some((casting, softness))) = (&self.camera, self.shadow_casting_lights()) else {
            return;
        };
        if !self.aspect.is_finite() {
            return;
        }
        let frustum = ViewFrustum::new(camera, self.aspect);
        // The bounding sphere of each actor, and the largest scale from its joints' spaces to the world.
        let mut spheres: Vec<Option<(BoundingSphere, f64)>> = vec![None; self.actors.len()];
        for step in self.order {
            let PlacementStep::World(index) = *step else { continue };
            let state = &self.actors[index];
            let sphere = self.pose_bounds.0.get(index).copied().flatten().and_then(|pose_radius| {
                let world = &state.world_from_model;
                let (parent, to) = match self.parents.of(index) {
                    [parent] => (parent, parent.to),
                    [] => {
                        let scale = norm_bound(&world.matrix3);
                        let sphere = (world.translation, pose_radius.radius * scale);
                        return Some((sphere, pose_radius.scale * scale));
                    }
                    // During a blend the actor is somewhere between several parents.
                    _ => return None,
                };
                // The parent's joint may be anywhere in the parent's sphere.
                let ((center, radius), above) = match to {
                    Some(to) => (*spheres.get(to.actor)?)?,
                    None => ((DVec3::ZERO, 0.0), 1.0),
                };
                let above = if parent.scale == ParentScale::Inherit { above } else { 1.0 };
                let (distance, scale) = self.distance_and_scale(index, parent)?;
                let scale = above * scale;
                Some((
                    (center, radius + above * distance + scale * pose_radius.radius),
                    pose_radius.scale * scale,
                ))
            });
            spheres[index] = sphere;
            let needed = self.stage.effects.iter().any(|used| used.needs_off_screen(index));
            out[index] = !needed
                && sphere.is_some_and(|(sphere, _)| {
                    // The soft edge of a shadow extends beyond its caster.
                    let sphere = (sphere.0, 1.02 * sphere.1 + 2.0 * softness);
                    let casting = if self.stage.actors[index].shadow.cast { &casting[..] } else { &[] };
                    sphere.0.is_finite() && sphere.1.is_finite() && frustum.excludes(sphere, casting)
                });
        }
    }

    /// Distance of an actor from its parent's joint, and its scale; `None` if keys, edits or a path move the actor.
    fn distance_and_scale(&self, index: usize, parent: &ActiveParent) -> Option<(f64, f64)> {
        let actor = &self.stage.actors[index];
        let moved = self.edits.actors.iter().any(|(of, _)| *of == index);
        if moved || !actor.channels.is_empty() || actor.path_following.is_some() {
            return None;
        }
        let local = parent.local_placement(&actor.transform, [].iter());
        let distance = parent.offset.transform_point3(local.translation).length();
        Some((distance, norm_bound(&parent.offset.matrix3) * local.scale.abs().max_element()))
    }

    /// The lights that cast shadows, and the width of the softest edge; `None` if the position of a light depends on a pose.
    fn shadow_casting_lights(&self) -> Option<(Vec<CastingLight>, f64)> {
        let (mut casting, mut softness) = (Vec::new(), 0.0f64);
        for (index, light) in self.stage.lights.iter().enumerate() {
            let Some(shadow) = light.shadow else { continue };
            softness = softness.max(f64::from(shadow.softness.unwrap_or(Shadow::LAMP_SOFTNESS)));
            if light.parent.is_some() {
                return None;
            }
            let Some(state) =
                crate::lights::stage_light(self.stage, light, index, self.edits, self.time, self.actors)
            else {
                continue;
            };
            casting.push(match state.light.kind.is_directional() {
                true => CastingLight::Directional(state.direction.as_dvec3()),
                false => CastingLight::Point(state.position),
            });
        }
        Some((casting, softness))
    }
}

/// An upper bound of the factor by which a matrix lengthens a vector.
fn norm_bound(m: &DMat3) -> f64 {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis];
    let lengths = [x.length_squared(), y.length_squared(), z.length_squared()];
    let most = lengths.iter().fold(0.0f64, |a, b| a.max(*b));
    let crooked = x.dot(y).abs().max(y.dot(z).abs()).max(z.dot(x).abs());
    if crooked <= 1e-9 * most { (most * (1.0 + 1e-6)).sqrt() } else { lengths.iter().sum::<f64>().sqrt() }
}

/// Whether a camera's transform follows from the actors' placements, without poses.
pub(crate) fn is_independent_of_poses(stage: &Stage, camera: Option<usize>) -> bool {
    let placed = |target: &Target| match *target {
        Target::Point(_) => true,
        Target::Actor(actor) => stage.actors.get(actor).is_some_and(|a| a.parents.is_empty()),
        Target::Joint { .. } => false,
    };
    let camera = camera.and_then(|c| stage.cameras.get(c));
    let mut looks = camera.iter().flat_map(|camera| &camera.looks);
    if !looks.all(|look| look.target.as_ref().is_none_or(placed)) {
        return false;
    }
    match camera.map(|c| &c.rig) {
        Some(Rig::Fixed { look_at, .. }) => look_at.as_ref().is_none_or(placed),
        Some(Rig::Follow { target, .. } | Rig::Orbit { target, .. }) => placed(target),
        Some(Rig::File { .. } | Rig::Frame { .. }) | None => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DQuat};

    /// A view along −Z from the origin, 90° high and wide.
    fn square_frustum() -> ViewFrustum {
        let projection = Projection::Perspective { yfov: std::f32::consts::FRAC_PI_2, near: 0.1, far: None };
        ViewFrustum::new(&CameraState { projection, ..CameraState::default() }, 1.0)
    }

    #[test]
    fn spheres_beside_and_behind_the_frustum_are_excluded() {
        let excludes =
            |x: f64, y: f64, z: f64, radius| square_frustum().excludes((DVec3::new(x, y, z), radius), &[]);
        assert!(
            !excludes(0.0, 0.0, -5.0, 0.1)
                && !excludes(5.0, 0.0, -5.0, 0.1)
                && !excludes(0.0, -5.0, -5.0, 0.1)
        );
        // The edge is at 1.05 times z, so 7 to the side it is (7 − 5.25) / √(1 + 1.05²) = 1.207 away.
        for sphere in [(7.0, 0.0), (-7.0, 0.0), (0.0, 7.0), (0.0, -7.0)] {
            assert!(
                excludes(sphere.0, sphere.1, -5.0, 1.206) && !excludes(sphere.0, sphere.1, -5.0, 1.208),
                "{sphere:?}"
            );
        }
        assert!(excludes(0.0, 0.0, 1.0, 0.9) && !excludes(0.0, 0.0, 1.0, 1.1));
        // The same, turned and far away.
        let world_from_view = DAffine3::from_rotation_translation(
            DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2),
            DVec3::new(1e7, 0.0, 0.0),
        );
        let projection = Projection::Orthographic { height: 2.0, near: 0.0, far: 10.0 };
        let frustum = ViewFrustum::new(&CameraState { camera: None, world_from_view, projection }, 2.0);
        assert!(!frustum.excludes((DVec3::new(1e7 - 5.0, 0.0, 2.0), 0.1), &[]));
        assert!(frustum.excludes((DVec3::new(1e7 - 5.0, 0.0, 2.3), 0.1), &[]));
        assert!(frustum.excludes((DVec3::new(1e7 + 5.0, 0.0, 0.0), 0.1), &[]));
    }

    #[test]
    fn shadow_casters_are_kept_if_their_shadow_enters_the_frustum() {
        let beside = (DVec3::new(9.0, 0.0, -5.0), 1.0);
        let excludes = |casting| square_frustum().excludes(beside, &[casting]);
        assert!(
            excludes(CastingLight::Directional(DVec3::X))
                && !excludes(CastingLight::Directional(DVec3::NEG_X))
        );
        assert!(excludes(CastingLight::Point(DVec3::new(0.0, 0.0, -5.0))));
        assert!(!excludes(CastingLight::Point(DVec3::new(20.0, 0.0, -5.0))));
    }
}
