//! Constraints and spring bones that scripts add to the stage.

use crate::common::*;
use choreo_motion::Time;
use choreo_stage::*;
use glam::DVec3;

fn actor(script: &str) -> Actor {
    run_or_panic(&format!("let anna = cast(\"anna\", load(\"hero.toy\"));\n{script}")).stage.actors[0].clone()
}

#[test]
fn a_reach_bends_two_joints_or_the_chain_from_its_root() {
    let anna =
        actor("anna.reach(\"LeftHand\", [0.3, 1.0, 0.2]).from(1.0).until(2.0).fade(0.25).weight(0.5);");
    let goal = &anna.constraints[0];
    let secs = Time::from_secs;
    assert_eq!((goal.start, goal.end, goal.fade, goal.weight), (secs(1.0), Some(secs(2.0)), secs(0.25), 0.5));
    let ConstraintKind::Reach(reach) = &goal.kind else { panic!("{goal:?}") };
    assert_eq!(reach.joints, [0, 1, 3]);
    assert_eq!(reach.target, Target::Point(DVec3::new(0.3, 1.0, 0.2)));
    let anna = actor(
        "anna.reach(\"LeftHand\", anna.joint(\"Head\"), #{ root: \"Spine\", at: [0, 1, 0], keep: true });",
    );
    let ConstraintKind::Reach(reach) = &anna.constraints[0].kind else { panic!() };
    assert_eq!(
        (reach.joints.as_slice(), reach.offset, reach.keep_rotation),
        (&[1, 3][..], Some(DVec3::Y), true)
    );
}

#[test]
fn aims_are_shared_between_joints_and_limits_are_stored() {
    let anna = actor(
        "anna.aim(\"Head\", [0, 1, 3], #{ joints: 3, shares: [0.2, 0.3, 0.5], limit: 60 });
         anna.joint(\"Head\").limit(#{ swing: 30, twist: [-10, 20] });
         anna.joint(\"LeftHand\").limit(#{ hinge: [0, 90], axis: [2, 0, 0] });",
    );
    let ConstraintKind::Aim(aim) = &anna.constraints[0].kind else { panic!() };
    assert_eq!((aim.joints.as_slice(), aim.shares.as_slice()), (&[0, 1, 2][..], &[0.2, 0.3, 0.5][..]));
    assert!((aim.limit.to_degrees() - 60.0).abs() < 1e-9);
    assert_eq!(anna.limits.len(), 2);
    let Limit::Hinge { axis, angle } = anna.limits[1].1 else { panic!() };
    assert!(axis == DVec3::X && angle.0 == 0.0 && (angle.1.to_degrees() - 90.0).abs() < 1e-9);
}

#[test]
fn spring_bones_are_selected_by_patterns_and_can_be_turned_off() {
    let anna = actor(
        "anna.collider(\"Head\", #{ radius: 0.1 });
         anna.spring(\"*hand\", #{ frequency: 3.0, damping: 0.2, gravity: 0.5, radius: 0.02, center: \"Hips\" });
         anna.springs(#{ ground: 0.0, pre_roll: 2.0 });
         anna.wind(1, 0, 2);",
    );
    let springs = anna.springs.unwrap();
    let bones = springs.rig.bones();
    assert_eq!(bones.iter().map(|b| b.joint).collect::<Vec<_>>(), [3, 4]);
    assert_eq!(
        (bones[0].center, bones[0].colliders.as_slice(), bones[0].hit_radius),
        (Some(0), &[0][..], 0.02)
    );
    assert!((bones[0].gravity.y + 4.905).abs() < 1e-9);
    assert_eq!((springs.rig.ground, springs.wind), (Some(0.0), DVec3::new(1.0, 0.0, 2.0)));
    assert_eq!(springs.pre_roll, Time::from_secs(2.0));
    assert!(actor("anna.spring(\"Head\").springs(false);").springs.is_none());
    // A callback sets the wind for that frame.
    let script = run_or_panic(
        "let anna = cast(\"anna\", load(\"hero.toy\")); anna.spring(\"Head\"); on_frame(|t| anna.wind(t, 0.0, 0.0));",
    );
    script.stage.at(Time::from_secs(0.5)).unwrap();
}
