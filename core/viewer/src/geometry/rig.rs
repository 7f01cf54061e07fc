//! Positions of cameras that are fixed, follow or circle a target, and their rigs after a move.

use choreo_stage::{Camera, Property, Rig, Snapshot, Stage, Target};
use glam::{DQuat, DVec3};
use std::f64::consts::{PI, TAU};

/// Distance to the assumed target of a camera without one, metres.
const DEFAULT_TARGET_DISTANCE: f64 = 3.0;
/// Largest elevation of an orbit, radians: one degree below 90°, where the up direction of the image is undefined.
const MAX_ELEVATION: f64 = PI * 89.0 / 180.0;

/// World position of a target in a snapshot. `None` if it does not exist there.
fn target_position(stage: &Stage, shown: &Snapshot, target: &Target) -> Option<DVec3> {
    match *target {
        Target::Point(point) => Some(point),
        Target::Actor(actor) => {
            let middle = stage.actors.get(actor)?.asset.rest_bounds().center();
            Some(shown.actors.get(actor)?.world_from_model.transform_point3(middle.as_dvec3()))
        }
        Target::Joint { actor, joint } => {
            let state = shown.actors.get(actor)?;
            let joint = state.model_from_joint.get(joint as usize)?;
            Some(state.world_from_model.transform_point3(joint.translation.as_dvec3()))
        }
    }
}

/// World positions of a camera and of its target, ignoring shakes and keyed targets. `None` for a camera of a file, for one that frames a set of
/// objects, and if the target has no position.
pub fn rig_points(stage: &Stage, shown: &Snapshot, camera: &Camera) -> Option<[DVec3; 2]> {
    let keyed = camera.channels.iter().rev().find(|c| c.property == Property::Translation);
    let keyed = keyed.and_then(|c| c.at(shown.time)).map(|[x, y, z, _]| DVec3::new(x, y, z));
    match &camera.rig {
        Rig::Fixed { position: stated, rotation, look_at } => {
            let at = keyed.unwrap_or(*stated);
            let target = look_at.as_ref().and_then(|target| target_position(stage, shown, target));
            Some([at, target.unwrap_or(at + *rotation * (DVec3::NEG_Z * DEFAULT_TARGET_DISTANCE))])
        }
        Rig::Follow { target, offset } => {
            let center = target_position(stage, shown, target)?;
            Some([center + keyed.unwrap_or(*offset), center])
        }
        Rig::Orbit { target, distance, elevation, azimuth, speed } => {
            let center = target_position(stage, shown, target)?;
            let azimuth = azimuth + speed * shown.time.as_secs();
            let rotation = DQuat::from_rotation_y(azimuth) * DQuat::from_rotation_x(-elevation);
            Some([center + rotation * (DVec3::Z * *distance), center])
        }
        Rig::File { .. } | Rig::Frame { .. } => None,
    }
}

/// The rig of a camera moved to `to` at the time of a snapshot: with a new position, a new offset from its target, or a new distance and angles of
/// its orbit. `None` in the cases of [`rig_points`].
pub fn move_rig(stage: &Stage, shown: &Snapshot, rig: &Rig, to: DVec3) -> Option<Rig> {
    match rig {
        Rig::Fixed { rotation, look_at, .. } => {
            Some(Rig::Fixed { position: to, rotation: *rotation, look_at: *look_at })
        }
        Rig::Follow { target, .. } => {
            Some(Rig::Follow { target: *target, offset: to - target_position(stage, shown, target)? })
        }
        Rig::Orbit { target, azimuth, speed, .. } => {
            let offset = to - target_position(stage, shown, target)?;
            let distance = offset.length();
            let elevation = libm::asin((offset.y / distance).clamp(-1.0, 1.0));
            let wanted = libm::atan2(offset.x, offset.z) - speed * shown.time.as_secs();
            // The equivalent azimuth that is nearest to the stated one.
            let turn = (wanted - azimuth + PI).rem_euclid(TAU) - PI;
            (distance > 0.0).then(|| Rig::Orbit {
                target: *target,
                distance,
                elevation: elevation.clamp(-MAX_ELEVATION, MAX_ELEVATION),
                azimuth: azimuth + turn,
                speed: *speed,
            })
        }
        Rig::File { .. } | Rig::Frame { .. } => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_motion::Time;

    /// A moved camera is at its new position at that time, with any kind of rig.
    #[test]
    fn moving_a_rig_places_the_camera_at_the_target_point() {
        let center = Target::Point(DVec3::new(1.0, 1.0, -2.0));
        let rigs = [
            Rig::Fixed { position: DVec3::ZERO, rotation: DQuat::IDENTITY, look_at: Some(center) },
            Rig::Follow { target: center, offset: DVec3::Z },
            Rig::Orbit { target: center, distance: 4.0, elevation: 0.2, azimuth: -2.9, speed: 0.5 },
        ];
        let (stage, mut shown) = (Stage::default(), Snapshot::default());
        for secs in [0.0, 2.5, 40.0] {
            shown.time = Time::from_secs(secs);
            for rig in &rigs {
                for to in [DVec3::new(3.0, 2.0, 1.0), DVec3::new(-5.0, 0.5, -6.0)] {
                    let rig = move_rig(&stage, &shown, rig, to).unwrap();
                    if let Rig::Orbit { azimuth, .. } = rig {
                        assert!((azimuth + 2.9).abs() <= PI, "{azimuth}");
                    }
                    let camera = Camera { rig, ..Camera::default() };
                    let [at, target] = rig_points(&stage, &shown, &camera).unwrap();
                    assert!((at - to).length() < 1e-9, "{at} is not {to}");
                    assert!((target - DVec3::new(1.0, 1.0, -2.0)).length() < 1e-9);
                }
            }
        }
        let frame = Rig::Frame { azimuth: 0.0, elevation: 0.0 };
        assert_eq!(move_rig(&stage, &shown, &frame, DVec3::ONE), None);
    }
}
