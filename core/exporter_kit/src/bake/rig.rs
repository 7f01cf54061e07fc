//! Poses of actors as rows of numbers: translation, rotation and scale of each joint of the rig, ten numbers each.

use choreo_plugin::asset::widen;
use choreo_plugin::glam::{Affine3A, DAffine3, DQuat, DVec3, Quat, Vec3};
use choreo_plugin::motion::{Skeleton, Transform};
use choreo_plugin::stage::{Actor, ActorState};

/// Numbers of a joint in a row.
pub const STRIDE: usize = 10;

/// Smallest distance, in metres, of the points that show the rotation of a joint: fingertips and a hat turn with it, too.
const SHELL: f32 = 0.1;

/// Appends the rig's transforms: world-from-actor, then, with `pose`, parent-from-joint of each joint.
pub fn append(actor: &Actor, state: &ActorState, pose: bool, out: &mut Vec<f32>) {
    // Hidden actors have a scale of zero: glTF has no visibility, and importers of other formats ignore it.
    let mut world = decompose(&state.world_from_model, &Transform::IDENTITY);
    if !state.visible {
        world.scale = Vec3::ZERO;
    }
    push(&world, out);
    if !pose {
        return;
    }
    let skeleton = &actor.asset.skeleton;
    let posed = &state.model_from_joint;
    if posed.len() != skeleton.len() {
        skeleton.rest().iter().for_each(|rest| push(rest, out));
        return;
    }
    for (joint, (parent, rest)) in skeleton.parents().iter().zip(skeleton.rest()).enumerate() {
        let own = widen(&posed[joint]);
        let local = parent.map_or(own, |parent| widen(&posed[parent as usize]).inverse() * own);
        push(&decompose(&local, rest), out);
    }
}

/// Translation, rotation and scale of an affine map; `otherwise` if the map has none, because a parent has the scale zero.
pub fn decompose(map: &DAffine3, otherwise: &Transform) -> Transform {
    let (scale, rotation, translation) = map.to_scale_rotation_translation();
    let out = Transform {
        translation: translation.as_vec3(),
        rotation: rotation.normalize().as_quat(),
        scale: scale.as_vec3(),
    };
    if out.is_finite() { out } else { Transform { translation: finite(translation), ..*otherwise } }
}

fn finite(v: DVec3) -> Vec3 {
    if v.is_finite() { v.as_vec3() } else { Vec3::ZERO }
}

fn push(t: &Transform, out: &mut Vec<f32>) {
    out.extend(t.translation.to_array());
    out.extend(t.rotation.to_array());
    out.extend(t.scale.to_array());
}

pub fn transform(row: &[f32]) -> Transform {
    Transform {
        translation: Vec3::from_slice(&row[0..3]),
        rotation: Quat::from_slice(&row[3..7]),
        scale: Vec3::from_slice(&row[7..10]),
    }
}

/// Transform of a joint between two rows: LINEAR interpolation, as in glTF.
fn interpolate_rows(a: &[f32], b: &[f32], t: f32) -> Transform {
    let (a, b) = (transform(a), transform(b));
    Transform {
        translation: a.translation.lerp(b.translation, t),
        rotation: a.rotation.slerp(b.rotation, t),
        scale: a.scale.lerp(b.scale, t),
    }
}

/// The largest distance between the row `truth` and the interpolation of the rows `a` and `b` at `t`, in metres: of any joint, or of a
/// point that turns with it. `reach`: metres to the farthest vertex, for a rig of the actor alone.
pub fn max_distance(
    parents: &[Option<u32>],
    [a, b, truth]: [&[f32]; 3],
    t: f32,
    reach: f32,
    spaces: &mut Spaces,
) -> f32 {
    if a == b && a == truth {
        return 0.0;
    }
    let joints = truth.len() / STRIDE;
    let mut worst: f32 = 0.0;
    spaces.0.clear();
    for joint in 0..joints {
        let row = |row: &'_ [f32]| -> [f32; STRIDE] {
            let mut out = [0.0; STRIDE];
            out.copy_from_slice(&row[joint * STRIDE..][..STRIDE]);
            out
        };
        let parent = if joint == 0 { None } else { Some(parents[joint - 1].map_or(0, |p| p as usize + 1)) };
        let (one, other) =
            (interpolate_rows(&row(a), &row(b), t).to_affine(), transform(&row(truth)).to_affine());
        // The actor's position is subtracted, so that f32 is as accurate far from the origin.
        let (one, other) = match parent {
            Some(parent) => (spaces.0[parent].0 * one, spaces.0[parent].1 * other),
            None => {
                let origin = other.translation;
                let moved = |m: Affine3A| Affine3A { translation: m.translation - origin, ..m };
                (moved(one), moved(other))
            }
        };
        let arm = if joints == 1 { reach.max(SHELL) } else { SHELL };
        let moved = |point: Vec3| (one.transform_point3(point) - other.transform_point3(point)).length();
        let scale = Vec3::from(other.matrix3.x_axis).length().max(1e-6);
        // The points have a fixed distance in the world, whatever the scale.
        let arm = if joint == 0 { arm } else { arm / scale };
        for point in [Vec3::ZERO, Vec3::X * arm, Vec3::Y * arm, Vec3::Z * arm] {
            worst = worst.max(moved(point));
        }
        spaces.0.push((one, other));
    }
    worst
}

/// Buffer of [`max_distance`].
#[derive(Default)]
pub struct Spaces(Vec<(Affine3A, Affine3A)>);

/// The skeleton of a rig: joint 0 is the actor with the transform `world`; the joints of its own skeleton are below.
pub fn skeleton(actor: &Actor, world: Transform) -> Option<Skeleton> {
    let own = &actor.asset.skeleton;
    let names = std::iter::once(String::new()).chain(own.names().iter().cloned()).collect();
    let above = |parent: &Option<u32>| Some(parent.map_or(0, |p| p + 1));
    let parents = std::iter::once(None).chain(own.parents().iter().map(above)).collect();
    let rest = std::iter::once(world).chain(own.rest().iter().copied()).collect();
    Skeleton::new(names, parents, rest).ok()
}

/// World-from-joint transforms of a rig, in f64.
pub fn world_from_joints(skeleton: &Skeleton, local: impl Iterator<Item = Transform>) -> Vec<DAffine3> {
    let mut out: Vec<DAffine3> = Vec::with_capacity(skeleton.len());
    for (joint, t) in local.enumerate() {
        let rotation: DQuat = t.rotation.as_dquat().normalize();
        let own =
            DAffine3::from_scale_rotation_translation(t.scale.as_dvec3(), rotation, t.translation.as_dvec3());
        out.push(skeleton.parents()[joint].map_or(own, |p| out[p as usize] * own));
    }
    out
}
