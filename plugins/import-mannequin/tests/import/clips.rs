//! Motion of the figure: loop points, foot contacts, and joints within human limits.

use crate::common::{import, joints_at, pose_at, vertices_at};
use choreo_asset::Asset;
use choreo_motion::Clip;
use glam::{Quat, Vec3};

/// Speed of the floor under the feet, metres per second, as stated in the README.
const SPEEDS: [(&str, f32); 2] = [("Walk", 1.2), ("Run", 2.7)];

const NAMES: [&str; 8] = ["Idle", "Walk", "Run", "Wave", "Dance_Groove", "Dance_Spin", "Bow", "Jump"];

fn speed(clip: &Clip) -> f32 {
    SPEEDS.iter().find(|(name, _)| *name == clip.name).map_or(0.0, |s| s.1)
}

fn joint(asset: &Asset, name: &str) -> usize {
    asset.skeleton.find(name).unwrap_or_else(|| panic!("no joint {name}"))
}

/// Greatest distance of any joint's place between two times, metres.
fn largest_movement(asset: &Asset, clip: &Clip, from: f64, to: f64) -> f32 {
    let (a, b) = (joints_at(asset, clip, from), joints_at(asset, clip, to));
    a.iter().zip(&b).map(|(a, b)| a.translation.distance(b.translation)).fold(0.0, f32::max)
}

/// Greatest change of any joint's speed over one key interval on either side of `at`, metres a second; `at` wraps.
fn velocity_jump(asset: &Asset, clip: &Clip, at: f64) -> f32 {
    let step = 1.0 / 30.0;
    let wrapped = |secs: f64| joints_at(asset, clip, secs.rem_euclid(clip.duration.as_secs()));
    let (before, here, after) = (wrapped(at - step), wrapped(at), wrapped(at + step));
    let change = |i: usize| {
        let [p, q, r] = [&before, &here, &after].map(|m| m[i].translation);
        ((r - q) - (q - p)).length() / step as f32
    };
    (0..here.len()).map(change).fold(0.0, f32::max)
}

#[test]
fn all_clips_exist_and_name_joints_of_the_skeleton() {
    let asset = import();
    assert_eq!(asset.clips.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), NAMES);
    for clip in &asset.clips {
        assert!(clip.curves().len() == asset.skeleton.len() + 1, "{}: every joint has a rotation", clip.name);
        assert!(clip.duration.as_secs() > 0.6);
    }
}

#[test]
fn every_clip_loops_in_position_and_speed() {
    let asset = import();
    for clip in &asset.clips {
        let end = clip.duration.as_secs();
        assert!(largest_movement(&asset, clip, 0.0, end) < 1e-6, "{}: jumps at the seam", clip.name);
        let within = (1..(end * 30.0) as i32).map(|k| velocity_jump(&asset, clip, f64::from(k) / 30.0));
        let within = within.fold(0.0, f32::max);
        let seam = velocity_jump(&asset, clip, 0.0);
        println!("{}: change of speed {seam:.2} m/s at the seam, {within:.2} at most elsewhere", clip.name);
        assert!(seam <= within.max(0.3), "{}: jolts at the seam", clip.name);
    }
}

#[test]
fn the_loop_check_detects_a_truncated_clip() {
    let asset = import();
    let walk = &asset.clips[1];
    assert!(largest_movement(&asset, walk, 0.0, walk.duration.as_secs() - 0.1) > 0.05);
}

/// The points of a foot that may carry it: heel and ball, in model space, and the joint that each moves with.
fn soles(asset: &Asset) -> Vec<(usize, Vec3)> {
    let mut points = Vec::new();
    for side in ["Left", "Right"] {
        let (foot, toes) = (joint(asset, &format!("{side}Foot")), joint(asset, &format!("{side}ToeBase")));
        let rest = asset.rest_model_from_joint();
        let ankle = Vec3::from(rest[foot].translation);
        let ball = Vec3::from(rest[toes].translation);
        let heel = Vec3::new(ankle.x, 0.0, ankle.z - 0.045);
        points.push((foot, rest[foot].inverse().transform_point3(heel)));
        points.push((toes, rest[toes].inverse().transform_point3(ball.with_y(0.0))));
    }
    points
}

/// Largest foot sliding: distance in metres that a point of a sole moves over the floor while in contact (within 2 mm).
fn foot_sliding(asset: &Asset, clip: &Clip, floor_speed: f32) -> f32 {
    let step = 1.0 / 120.0;
    let mut worst: f32 = 0.0;
    for (joint, local) in soles(asset) {
        let mut touched: Option<Vec3> = None;
        for k in 0..=(clip.duration.as_secs() / step) as i64 {
            let secs = k as f64 * step;
            let p = joints_at(asset, clip, secs)[joint].transform_point3(local);
            // The position relative to the floor, which moves backwards under the figure.
            let on_floor = p + Vec3::Z * floor_speed * secs as f32;
            if p.y > 0.002 {
                touched = None;
                continue;
            }
            let first = *touched.get_or_insert(on_floor);
            worst = worst.max((on_floor - first).with_y(0.0).length());
        }
    }
    worst
}

#[test]
fn planted_feet_do_not_slide() {
    let asset = import();
    for clip in &asset.clips {
        let slide = foot_sliding(&asset, clip, speed(clip));
        println!("{}: planted feet slide {:.1} mm at most", clip.name, slide * 1e3);
        assert!(slide <= 0.01, "{}: a planted foot slides {slide} m", clip.name);
    }
}

#[test]
fn the_foot_sliding_check_detects_a_wrong_floor_speed() {
    let asset = import();
    assert!(foot_sliding(&asset, &asset.clips[1], 1.1) > 0.01);
}

#[test]
fn feet_touch_the_floor_and_nothing_penetrates_it() {
    let asset = import();
    for clip in &asset.clips {
        let frames = (clip.duration.as_secs() * 15.0) as i64;
        let lowest = |secs| vertices_at(&asset, clip, secs).iter().map(|p| p.y).fold(f64::MAX, f64::min);
        let heights: Vec<f64> = (0..frames).map(|k| lowest(k as f64 / 15.0)).collect();
        let deepest = heights.iter().copied().fold(f64::MAX, f64::min);
        println!("{}: lowest point {:.1} mm", clip.name, deepest * 1e3);
        assert!(deepest >= -0.01, "{}: sinks to {deepest} m", clip.name);
        assert!(deepest <= 0.005, "{}: floats at {deepest} m", clip.name);
    }
}

/// (bend in degrees, how far out of the hinge's plane) of a hinge: the direction of the limb's Y axis in its parent's
/// axes, where `forwards` is where it may go.
fn hinge(rotation: Quat, forwards: Vec3) -> (f32, f32) {
    let y = rotation * Vec3::Y;
    let across = forwards.cross(Vec3::Y);
    let angle = y.dot(forwards).atan2(y.y).to_degrees();
    (angle, y.dot(across).abs())
}

#[test]
fn elbows_and_knees_stay_within_human_limits() {
    let asset = import();
    // mixamorig axes: the left elbow bends to −X, the right one to +X, knees to −Z.
    let hinges = [
        ("LeftForeArm", Vec3::NEG_X),
        ("RightForeArm", Vec3::X),
        ("LeftLeg", Vec3::NEG_Z),
        ("RightLeg", Vec3::NEG_Z),
    ];
    for clip in &asset.clips {
        for (name, forwards) in hinges {
            let joint = joint(&asset, name);
            let (mut least, mut most) = (f32::MAX, f32::MIN);
            for k in 0..=(clip.duration.as_secs() * 60.0) as i64 {
                let (bend, aside) =
                    hinge(pose_at(&asset, clip, k as f64 / 60.0).get(joint).rotation, forwards);
                // Between two keys, flexion and twist are interpolated as one rotation, which deviates by up to half a degree.
                assert!(aside < 0.01, "{} {name}: bends sideways by {aside}", clip.name);
                (least, most) = (least.min(bend), most.max(bend));
            }
            assert!(least >= -0.1 && most <= 150.0, "{} {name}: {least} to {most} degrees", clip.name);
        }
    }
    // The check sees a knee that bends forwards.
    assert!(hinge(Quat::from_rotation_x(0.5), Vec3::NEG_Z).0 < 0.0);
}

#[test]
fn other_joints_stay_within_human_limits() {
    // Degrees from rest, after Kapandji, "The Physiology of the Joints" (2007), with the spine's share for each third.
    let limits = [
        ("Spine", 30.0),
        ("Spine1", 30.0),
        ("Spine2", 30.0),
        ("Neck", 45.0),
        ("Head", 55.0),
        ("LeftHand", 60.0),
        ("RightHand", 60.0),
        ("LeftShoulder", 45.0),
        ("RightShoulder", 45.0),
        ("LeftFoot", 75.0),
        ("RightFoot", 75.0),
        ("LeftToeBase", 65.0),
        ("RightToeBase", 65.0),
        ("LeftUpLeg", 115.0),
        ("RightUpLeg", 115.0),
    ];
    let asset = import();
    for clip in &asset.clips {
        for (name, limit) in limits {
            let joint = joint(&asset, name);
            let rest = asset.skeleton.rest()[joint].rotation;
            let bend = |k: i64| {
                pose_at(&asset, clip, k as f64 / 30.0).get(joint).rotation.angle_between(rest).to_degrees()
            };
            let most = (0..=(clip.duration.as_secs() * 30.0) as i64).map(bend).fold(0.0, f32::max);
            assert!(most <= limit, "{} {name}: turned by {most} degrees", clip.name);
        }
    }
}
