//! Where actors stand: placements, parents, hands, keys, callbacks, facing, visibility.

use crate::support::*;
use choreo_asset::*;
use choreo_motion::{Interpolation, Time};
use choreo_stage::*;
use glam::{DQuat, DVec3, Quat, Vec4};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

fn actor_position(snapshot: &Snapshot, actor: usize) -> DVec3 {
    snapshot.actors[actor].world_from_model.translation
}

fn actor_direction(snapshot: &Snapshot, actor: usize) -> DVec3 {
    snapshot.actors[actor].world_from_model.transform_vector3(DVec3::Z)
}

#[test]
fn actors_face_each_other_also_below_a_rotated_parent() {
    let mut stage = Stage::default();
    let asset = Arc::new(Asset::default());
    let [anna, boris, cart] = ["anna", "boris", "cart"].map(|name| stage.cast(name, asset.clone()));
    stage.actors[anna].transform = Placement::at(-1.0, 0.0, 0.0);
    stage.actors[boris].transform = Placement::at(1.0, 3.0, 1.0);
    stage.actors[anna].face = Some(boris);
    stage.actors[boris].face = Some(anna);
    stage.actors[cart].transform = Placement::at(0.0, 0.0, 0.0).turned(1.0);
    let snapshot = stage.at(Time::ZERO).unwrap();
    let way = v(2.0, 0.0, 1.0).normalize();
    assert_close(actor_direction(&snapshot, anna), way, 1e-12);
    assert_close(actor_direction(&snapshot, boris), -way, 1e-12);
    // She still faces him on a turned cart at another place.
    stage.actors[anna].parents = vec![Parenting::always(Attachment { actor: cart, joint: None })];
    stage.actors[boris].face = None;
    let snapshot = stage.at(Time::ZERO).unwrap();
    let way = actor_position(&snapshot, boris) - actor_position(&snapshot, anna);
    assert_close(actor_direction(&snapshot, anna), v(way.x, 0.0, way.z).normalize(), 1e-12);
    // Her own rotation comes first: a quarter turn more.
    stage.actors[anna].transform = stage.actors[anna].transform.turned(FRAC_PI_2);
    let turned = actor_direction(&stage.at(Time::ZERO).unwrap(), anna);
    assert!(turned.dot(v(way.x, 0.0, way.z)).abs() < 1e-9, "{turned}");
    // Straight above there is no direction to face: nothing turns.
    stage.actors[boris].transform.translation = actor_position(&snapshot, anna) + v(0.0, 5.0, 0.0);
    assert!(actor_direction(&stage.at(Time::ZERO).unwrap(), anna).is_finite());
}

#[test]
fn cycles_of_parents_and_of_facing_are_errors() {
    let mut stage = Stage::default();
    let asset = Arc::new(Asset::default());
    let [a, b, c] = ["a", "b", "c"].map(|name| stage.cast(name, asset.clone()));
    let on = |actor| vec![Parenting::always(Attachment { actor, joint: None })];
    stage.actors[a].parents = on(b);
    stage.actors[b].parents = on(c);
    stage.actors[c].parents = on(a);
    let text = "actor \"a\" is attached to itself, through \"b\", \"c\"";
    assert_eq!(stage.at(Time::ZERO).unwrap_err().to_string(), text);
    assert_eq!(stage.check().iter().map(ToString::to_string).collect::<Vec<_>>(), [text]);
    stage.actors[c].parents = on(c);
    let text = "actor \"c\" is attached to itself, through nothing else";
    assert_eq!(stage.at(Time::ZERO).unwrap_err().to_string(), text);
    // c, carried by a, is what a faces: turning a moves c.
    stage.actors[a].parents.clear();
    stage.actors[c].parents = on(a);
    stage.actors[a].face = Some(c);
    let error = stage.at(Time::ZERO).unwrap_err().to_string();
    assert!(error.starts_with("actor \"a\" cannot face \"c\": the position of \"c\" depends on"), "{error}");
}

#[test]
fn parent_chain_of_10000_actors_does_not_overflow_the_stack() {
    let mut stage = Stage::default();
    let asset = Arc::new(Asset::default());
    for i in 0..10_000usize {
        let actor = stage.cast("link", asset.clone());
        stage.actors[actor].transform = Placement::at(1.0, 0.0, 0.0);
        // Each hangs on the next: the worst order.
        let next = Attachment { actor: i + 1, joint: None };
        stage.actors[actor].parents = (i < 9_999).then(|| Parenting::always(next)).into_iter().collect();
    }
    assert_close(actor_position(&stage.at(Time::ZERO).unwrap(), 0), v(10_000.0, 0.0, 0.0), 1e-9);
    stage.actors[9_999].parents = vec![Parenting::always(Attachment { actor: 3, joint: None })];
    let error = stage.at(Time::ZERO).unwrap_err().to_string();
    assert!(error.ends_with("\"link\", and 9988 more"), "{error}");
}

fn channel(property: Property, interpolation: Interpolation, times: &[f64], values: &[f64]) -> Channel {
    let times = times.iter().map(|t| secs(*t)).collect();
    Channel { property, interpolation, times, values: values.to_vec() }
}

#[test]
fn keyed_properties_follow_their_closed_forms() {
    let mut stage = Stage::default();
    let a = stage.cast("a", Arc::new(Asset::default()));
    let set = |stage: &mut Stage, channels: Vec<Channel>| {
        stage.actors[a].channels = channels;
        assert_eq!(stage.check().len(), 0, "{:?}", stage.check());
    };
    let at = |stage: &Stage, t: f64| stage.at(secs(t)).unwrap();
    set(
        &mut stage,
        vec![
            channel(
                Property::Translation,
                Interpolation::Linear,
                &[1.0, 3.0],
                &[0.0, 0.0, 0.0, 4.0, -2.0, 8.0],
            ),
            channel(Property::Scale, Interpolation::Step, &[0.0, 2.0], &[1.0, 1.0, 1.0, 3.0, 3.0, 3.0]),
            channel(Property::Visible, Interpolation::Step, &[0.0, 2.5], &[1.0, 0.0]),
            channel(
                Property::Tint,
                Interpolation::Linear,
                &[0.0, 2.0],
                &[1.0, 1.0, 1.0, 1.0, 0.0, 0.5, 1.0, 1.0],
            ),
        ],
    );
    for (t, expected) in [(0.0, v(0.0, 0.0, 0.0)), (1.5, v(1.0, -0.5, 2.0)), (9.0, v(4.0, -2.0, 8.0))] {
        assert_close(actor_position(&at(&stage, t), a), expected, 1e-12);
    }
    let scale = |t: f64| at(&stage, t).actors[a].world_from_model.matrix3.x_axis.length();
    assert_eq!((scale(1.999), scale(2.0)), (1.0, 3.0));
    assert!(at(&stage, 2.49).actors[a].visible && !at(&stage, 2.5).actors[a].visible);
    assert_eq!(at(&stage, 1.0).actors[a].tint, Vec4::new(0.5, 0.75, 1.0, 1.0));

    // Hermite, tangents per second, over 2 s: x(t) = t³ has value and slope (1, 3) at 1 and (27, 27) at 3.
    let spline = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3.0, 0.0, 0.0, 27.0, 0.0, 0.0, 27.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    set(&mut stage, vec![channel(Property::Translation, Interpolation::CubicSpline, &[1.0, 3.0], &spline)]);
    for t in [1.0, 1.3, 2.0, 2.9, 3.0] {
        assert_close(actor_position(&at(&stage, t), a), v(t * t * t, 0.0, 0.0), 1e-8);
    }
    // With tangents per key interval, as some tools write them, x(2) would differ from 8.0: the test can fail.
    let halved: Vec<f64> =
        spline.iter().enumerate().map(|(i, v)| if (i / 3) % 3 == 1 { *v } else { v / 2.0 }).collect();
    set(&mut stage, vec![channel(Property::Translation, Interpolation::CubicSpline, &[1.0, 3.0], &halved)]);
    assert!((actor_position(&at(&stage, 1.5), a).x - 3.375).abs() > 0.1);
}

#[test]
fn keyed_rotations_turn_at_constant_speed_along_the_shortest_arc() {
    let mut stage = Stage::default();
    let a = stage.cast("a", Arc::new(Asset::default()));
    for (degrees, sign) in [(170.0f64, 1.0), (170.0, -1.0), (90.0, 1.0), (1e-3, 1.0), (1e-7, -1.0)] {
        let end = DQuat::from_rotation_y(degrees.to_radians()) * sign;
        let mut values = DQuat::IDENTITY.to_array().to_vec();
        values.extend(end.to_array());
        stage.actors[a].channels =
            vec![channel(Property::Rotation, Interpolation::Linear, &[0.0, 2.0], &values)];
        for share in [0.25, 0.5, 0.9] {
            let z = actor_direction(&stage.at(secs(2.0 * share)).unwrap(), a);
            let error = z.x.atan2(z.z) - (degrees * share).to_radians();
            assert!(error.abs() < 1e-13, "{degrees}° at {share}: {error}");
        }
    }
}

#[derive(Debug)]
struct Callback(fn(f64, &mut FrameEdits) -> Result<(), StageError>);
impl FrameCallback for Callback {
    fn run(&self, time: Time, edits: &mut FrameEdits) -> Result<(), StageError> {
        self.0(time.as_secs(), edits)
    }
}

#[test]
fn callbacks_edit_keyed_values_in_their_order() {
    let mut stage = Stage::default();
    let a = stage.cast("a", figure());
    stage.actors[a].channels = vec![channel(
        Property::Translation,
        Interpolation::Linear,
        &[0.0, 1.0],
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
    )];
    stage.frame_callbacks.push(Arc::new(Callback(|t, edits| {
        edits.actors.push((0, ActorEdit::MoveBy(v(0.0, t, 0.0))));
        edits.actors.push((0, ActorEdit::Scale(DVec3::splat(2.0))));
        edits.actors.push((0, ActorEdit::Tint(Vec4::splat(0.5))));
        edits.actors.push((0, ActorEdit::Turn(DQuat::from_rotation_y(FRAC_PI_2))));
        edits.actors.push((0, ActorEdit::TurnJoint { joint: ARM, rotation: Quat::from_rotation_z(1.0) }));
        edits.actors.push((77, ActorEdit::MoveBy(v(9.0, 9.0, 9.0))));
        edits.ambient = Some((glam::Vec3::ONE, glam::Vec3::ZERO));
        Ok(())
    })));
    let snapshot = stage.at(secs(0.5)).unwrap();
    assert_close(actor_position(&snapshot, a), v(0.5, 0.5, 0.0), 1e-12);
    assert_eq!(snapshot.actors[a].tint, Vec4::splat(0.5));
    assert_eq!(snapshot.ambient_up, glam::Vec3::ONE);
    let hand = v(0.3 + 0.6 * 1f64.cos(), 1.4 + 0.6 * 1f64.sin(), 0.0);
    assert_close(joint_world(&snapshot, a, HAND), v(0.5, 0.5 + 2.0 * hand.y, -2.0 * hand.x), 1e-6);
    // Turned about the parent's axes, after its own rotation: an actor tipped on its back has +Z up, and keeps it up.
    stage.actors[a].transform.rotation = DQuat::from_rotation_x(-FRAC_PI_2);
    assert_close(actor_direction(&stage.at(secs(0.5)).unwrap(), a), v(0.0, 2.0, 0.0), 1e-12);
    stage.actors[a].transform.rotation = DQuat::IDENTITY;
    stage.frame_callbacks.push(Arc::new(Callback(|_, edits| {
        edits.actors.push((0, ActorEdit::MoveTo(v(7.0, 0.0, 0.0))));
        edits.actors.push((0, ActorEdit::MoveBy(v(0.0, 0.0, 1.0))));
        Ok(())
    })));
    assert_close(actor_position(&stage.at(secs(0.5)).unwrap(), a), v(7.0, 0.0, 1.0), 1e-12);
    stage.frame_callbacks.push(Arc::new(Callback(|_, _| {
        Err(StageError::Callback { error: Arc::from(Box::from("walk.rhai:3:1: no")), time: secs(0.5) })
    })));
    assert_eq!(stage.at(secs(0.5)).unwrap_err().to_string(), "walk.rhai:3:1: no\n    at 0.5 s");
}

#[test]
fn culled_actors_are_not_posed() {
    let mut stage = Stage::default();
    let [anna, sword, boris] =
        [("anna", figure()), ("sword", stick()), ("boris", figure())].map(|(n, a)| stage.cast(n, a));
    stage.actors[sword].parents = vec![Parenting::always(Attachment { actor: anna, joint: Some(HAND) })];
    let poses = |stage: &Stage| {
        let mut evaluator = Evaluator::new(Arc::new(stage.clone()));
        let snapshot = evaluator.at(secs(0.5)).unwrap();
        (evaluator.poses(), snapshot)
    };
    // A camera that frames nothing in particular.
    stage.shoot(Camera::new("c", Rig::Follow { target: Target::Point(DVec3::ZERO), offset: DVec3::Z }));
    assert_eq!(poses(&stage).0, 3);
    stage.actors[boris].visible = false;
    let (count, snapshot) = poses(&stage);
    assert_eq!(count, 2);
    assert!(snapshot.actors[boris].model_from_joint.is_empty() && !snapshot.actors[boris].visible);
    // Unless joints are requested, not images.
    let all = Evaluator::new(Arc::new(stage.clone())).posing_hidden().at(secs(0.5)).unwrap();
    assert_eq!(all.actors[boris].model_from_joint.len(), stage.actors[boris].asset.skeleton.len());
    assert!(!all.actors[boris].visible);
    // Hiding the carrier hides what is carried.
    stage.actors[anna].visible = false;
    let (count, snapshot) = poses(&stage);
    assert_eq!(count, 0);
    assert!(!snapshot.actors[sword].visible);
    // Something that looks at a joint needs its pose.
    stage.cameras[0].rig =
        Rig::Follow { target: Target::Joint { actor: anna, joint: HAND }, offset: DVec3::Z };
    assert_eq!(poses(&stage).0, 1);
    stage.cameras[0].rig = Rig::Follow { target: Target::Actor(sword), offset: DVec3::Z };
    let (count, snapshot) = poses(&stage);
    assert_eq!(count, 1, "the hand that carries the sword");
    assert_close(snapshot.camera.world_from_view.translation, v(0.9, 1.9, 1.0), 1e-6);
    stage.cameras[0].rig = Rig::Follow { target: Target::Actor(boris), offset: DVec3::Z };
    assert_eq!(poses(&stage).0, 0, "the middle of the rest bounds needs no pose");
}
