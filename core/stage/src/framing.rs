//! Framing camera: fits everything visible into the image.
//!
//! The camera is static for the whole length of the stage, so that a character that walks is in the image from the first step to the
//! last. Bounds of all visible actors are computed once, at a number of times; a camera is then fitted to them at little cost.

use crate::camera::orbit_rotation;
use crate::constraints::foot_lock_cache::FootLocks;
use crate::constraints::{ConstrainedScratch, evaluate_actors};
use crate::pose::posed_mesh::posed_meshes;
use crate::pose::posed_mesh::posed_meshes_in_model_space;
use crate::snapshot::{ActorState, CameraState, Snapshot};
use crate::stage::camera::Rig;
use crate::stage::{Stage, StageError};
use choreo_asset::VertexTransforms;
use choreo_asset::{Aabb, Asset, DAabb, InstanceBounds, MeshInstance, PosedInstance, Projection};
use choreo_motion::{Skinning, Time};
use glam::{DAffine3, DQuat, DVec3};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Largest number of poses that framing may compute, and the range of the number of intervals over which they are distributed.
const MAX_POSES: usize = 2000;
const INTERVALS: std::ops::RangeInclusive<usize> = 6..=48;
/// Largest ratio of height to width of flat ground, whose edges need not be in the image.
const MAX_FLAT_RATIO: f32 = 0.01;
/// Margin on each side, as a share of half of the image.
const FRAME_MARGIN: f64 = 0.06;
/// Bounds that frame an empty scene: the space of one standing person.
const EMPTY_ROOM: (DVec3, DVec3) = (DVec3::new(-1.0, 0.0, -1.0), DVec3::new(1.0, 2.0, 1.0));

type FramedBoxes = Result<Vec<DAabb>, StageError>;

/// Largest number of views of callbacks whose bounds are cached.
const MAX_VIEWS: usize = 16;

/// Bounds that the cameras of one stage frame, computed once.
#[derive(Debug)]
pub(crate) struct FramingCache {
    /// One entry per camera; the last is for a stage without cameras.
    boxes: Vec<OnceLock<FramedBoxes>>,
    /// Cached bounds of views that callbacks ask for, by the bits of azimuth and elevation.
    views: Mutex<BTreeMap<[u64; 2], Arc<FramedBoxes>>>,
    foot_locks: FootLocks,
}

impl FramingCache {
    pub(crate) fn new(stage: &Stage, foot_locks: FootLocks) -> FramingCache {
        let boxes = (0..=stage.cameras.len()).map(|_| OnceLock::new()).collect();
        FramingCache { boxes, views: Mutex::default(), foot_locks }
    }

    /// State of a camera that frames the stage from an azimuth and elevation in radians.
    pub(crate) fn frame_camera(
        &self,
        stage: &Stage,
        index: Option<usize>,
        azimuth: f64,
        elevation: f64,
        projection: Projection,
    ) -> Result<CameraState, StageError> {
        let rotation = orbit_rotation(azimuth, elevation);
        let rig = index.and_then(|index| stage.cameras.get(index)).map(|camera| &camera.rig);
        let of_callback;
        let boxes = if rig.is_none_or(|rig| *rig == Rig::Frame { azimuth, elevation }) {
            let slot = &self.boxes[index.unwrap_or(self.boxes.len() - 1)];
            slot.get_or_init(|| visible_boxes(stage, &self.foot_locks, rotation))
        } else {
            of_callback = self.boxes_of_view(stage, [azimuth, elevation]);
            &*of_callback
        };
        let boxes = boxes.as_ref().map_err(Clone::clone)?;
        let [width, height] = stage.settings.size.map(|n| f64::from(n.max(1)));
        let (position, projection) = fit_camera(boxes, width / height, projection);
        let world_from_view = DAffine3::from_rotation_translation(rotation, rotation * position);
        Ok(CameraState { camera: index, world_from_view, projection })
    }

    /// The bounds of a view that a callback asks for.
    fn boxes_of_view(&self, stage: &Stage, angles: [f64; 2]) -> Arc<FramedBoxes> {
        let known = || self.views.lock().unwrap_or_else(PoisonError::into_inner);
        let key = angles.map(f64::to_bits);
        if let Some(boxes) = known().get(&key) {
            return boxes.clone();
        }
        let rotation = orbit_rotation(angles[0], angles[1]);
        let boxes = Arc::new(visible_boxes(stage, &self.foot_locks, rotation));
        let mut known = known();
        if known.len() >= MAX_VIEWS {
            known.clear();
        }
        known.insert(key, boxes.clone());
        boxes
    }
}

/// Bounds of everything visible at a number of times, one box per actor and time, in view axes (right, up, back).
fn visible_boxes(
    stage: &Stage,
    foot_locks: &FootLocks,
    world_from_axes: DQuat,
) -> Result<Vec<DAabb>, StageError> {
    let axes_from_world = DAffine3::from_quat(world_from_axes.inverse());
    let intervals = (MAX_POSES / stage.actors.len().max(1)).clamp(*INTERVALS.start(), *INTERVALS.end());
    // More than 48 samples per second show nothing new.
    let length = stage.settings.length.max(Time::ZERO);
    let intervals = intervals.min((length.as_secs() * 48.0) as usize).max(1);
    let (mut boxes, mut ground) = (Vec::new(), Vec::new());
    let (mut scratch, mut snapshot) = (ConstrainedScratch::default(), Snapshot::default());
    // Springs are left out: flying hair does not matter for framing.
    for i in 0..=intervals {
        let time = Time((i128::from(length.0) * i as i128 / intervals as i128) as i64);
        evaluate_actors(stage, &mut scratch, time, foot_locks, None, &mut snapshot)?;
        for (actor, state) in stage.actors.iter().zip(&snapshot.actors).filter(|(_, s)| s.visible) {
            let mut bounds = DAabb::EMPTY;
            let axes_from_model = axes_from_world * state.world_from_model;
            for (index, reach) in actor.asset.instance_bounds().iter().enumerate() {
                if !reach.outline.is_empty() {
                    let mesh_instance = &actor.asset.instances[index];
                    add_outline(&mut bounds, &actor.asset, mesh_instance, reach, state, &axes_from_model);
                    continue;
                }
                if state.skinning != Skinning::Linear {
                    // Limbs do not lose volume as with linear skinning, and reach beyond the boxes of their joints.
                    add_vertices(&mut bounds, &actor.asset, index, state, &axes_from_model);
                    continue;
                }
                let weights = state.morph_weights.get(index).map_or(&[][..], Vec::as_slice);
                let add = |model_from_part: &DAffine3, part: &Aabb| {
                    bounds.add_box(&(axes_from_model * *model_from_part), part);
                };
                actor.asset.posed_boxes(index, &state.model_from_joint, weights, add);
            }
            // Bounds beyond `MAX_FRAMED_EXTENT` cannot be framed, neither with anything else nor alone.
            let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
            if !bounds.is_empty() && reach < MAX_FRAMED_EXTENT {
                (if is_flat(&actor.asset) { &mut ground } else { &mut boxes }).push(bounds);
            }
        }
        if length == Time::ZERO {
            break;
        }
    }
    if boxes.is_empty() {
        boxes = ground;
    }
    if boxes.is_empty() {
        let mut room = DAabb::EMPTY;
        let (min, max) = (EMPTY_ROOM.0.as_vec3(), EMPTY_ROOM.1.as_vec3());
        room.add_box(&axes_from_world, &Aabb { min, max });
        boxes.push(room);
    }
    Ok(boxes)
}

/// Adds all posed vertices of an instance to the bounds.
fn add_vertices(
    bounds: &mut DAabb,
    asset: &Asset,
    instance: usize,
    state: &ActorState,
    axes_from_model: &DAffine3,
) {
    let in_model = ActorState { world_from_model: *axes_from_model, ..state.clone() };
    let add = |posed: PosedInstance, add: &mut dyn FnMut(DVec3)| {
        posed.primitives.iter().flat_map(|p| &p.positions).for_each(|p| add(*p));
    };
    if asset.placements.is_empty() {
        let own = posed_meshes(asset, &in_model).into_iter().filter(|p| p.instance == instance);
        own.for_each(|posed| add(posed, &mut |p| bounds.add(p)));
        return;
    }
    let mut own_bounds = Aabb::EMPTY;
    let own = posed_meshes_in_model_space(asset, state).into_iter().filter(|p| p.instance == instance);
    own.for_each(|posed| add(posed, &mut |p| own_bounds.add(p.as_vec3())));
    bounds.add_box(axes_from_model, &asset.spread(&own_bounds));
}

/// Adds the posed vertices of an instance that reach farthest from their joints (`reach.outline`) to the bounds.
fn add_outline(
    bounds: &mut DAabb,
    asset: &Asset,
    instance: &MeshInstance,
    reach: &InstanceBounds,
    state: &ActorState,
    axes_from_model: &DAffine3,
) {
    let Some(mesh) = asset.meshes.get(instance.mesh as usize) else { return };
    let transforms = VertexTransforms::new(state.skinning, asset, instance, &state.model_from_joint);
    for (primitive, vertex) in &reach.outline {
        let (primitive, vertex) = (&mesh.primitives[*primitive as usize], *vertex as usize);
        let in_model =
            transforms.at_vertex(primitive, vertex).transform_point3(primitive.positions[vertex].as_dvec3());
        bounds.add(axes_from_model.transform_point3(in_model));
    }
}

fn is_flat(asset: &Asset) -> bool {
    let bounds = asset.rest_bounds();
    let size = bounds.max - bounds.min;
    !bounds.is_empty() && size.y <= MAX_FLAT_RATIO * size.x.max(size.z)
}

/// Largest extent that can be framed, metres: a camera farther away would have coordinates that f32 cannot hold.
const MAX_FRAMED_EXTENT: f64 = 1e30;

/// Camera position in view axes, and the projection with a near plane in front of everything.
///
/// A point (x, y, z) is in the image of a camera at (cx, cy, cz) looking along −z where |x − cx| ≤ tx (cz − z), so
/// cx + tx cz ≥ max(x + tx z) and −cx + tx cz ≥ max(−x + tx z): the closest camera solves both with equality.
pub(crate) fn fit_camera(boxes: &[DAabb], aspect: f64, projection: Projection) -> (DVec3, Projection) {
    let all = boxes.iter().fold(DAabb::EMPTY, |a, b| DAabb { min: a.min.min(b.min), max: a.max.max(b.max) });
    // A minimum distance, in case everything is one point.
    let size = (all.max - all.min).length().max(1e-6);
    match projection {
        Projection::Perspective { yfov, .. } => {
            let ty = libm::tan(f64::from(yfov) / 2.0) * (1.0 - FRAME_MARGIN);
            let tx = libm::tan(f64::from(yfov) / 2.0) * aspect * (1.0 - FRAME_MARGIN);
            let mut right = f64::NEG_INFINITY;
            let (mut left, mut up, mut down) = (right, right, right);
            for b in boxes {
                // The nearest face decides: t z is largest there.
                right = right.max(b.max.x + tx * b.max.z);
                left = left.max(-b.min.x + tx * b.max.z);
                up = up.max(b.max.y + ty * b.max.z);
                down = down.max(-b.min.y + ty * b.max.z);
            }
            let z = ((right + left) / (2.0 * tx)).max((up + down) / (2.0 * ty)).max(all.max.z + size * 0.01);
            let position = DVec3::new((right - left) / 2.0, (up - down) / 2.0, z);
            // The near plane is well in front of everything, so that the ground, and motion between the sampled times, are not clipped.
            let near = ((z - all.max.z) * 0.5).min((z - all.min.z) * 0.01).max(1e-9);
            (position, Projection::Perspective { yfov, near: near as f32, far: None })
        }
        Projection::Orthographic { .. } => {
            let middle = (all.min + all.max) * 0.5;
            let extent = all.max - all.min;
            let height = extent.y.max(extent.x / aspect).max(1e-6) / (1.0 - FRAME_MARGIN);
            let position = DVec3::new(middle.x, middle.y, all.max.z + size);
            let far = extent.z + 2.0 * size;
            (position, Projection::Orthographic { height: height as f32, near: 0.0, far: far as f32 })
        }
    }
}
