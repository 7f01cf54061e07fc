//! Spring bones.

use crate::Case;
use choreo_motion::spring::{
    BoneState, Drive, RigBone, SpringBone, SpringRig, SpringScratch, SpringState, SpringStep,
};
use choreo_motion::{Skeleton, Transform};
use glam::{Affine3A, DAffine3, DQuat, DVec3, Vec3};

const OFF_UNIT_LENGTH: &str = "direction, off unit length";
const ENERGY_GAIN: &str = "energy gained, share of the first";
const UNDAMPED: SpringBone = SpringBone { stiffness: 400.0, damping: 0.0 };

pub const CASES: &[Case] = &[
    Case::new("stiffness 1e12", OFF_UNIT_LENGTH, 1e-12, || {
        unit(SpringBone { stiffness: 1e12, damping: 0.0 })
    }),
    Case::new("stiffness 1e12, energy", ENERGY_GAIN, 1e-6, || {
        energy_gain(SpringBone { stiffness: 1e12, damping: 0.0 }, 1.0 / 60.0)
    }),
    Case::new("stiffness 1e12, at rest after 1 s", "radians from the target", 1e-9, || {
        bent_after(SpringBone { stiffness: 1e12, damping: 2e6 }, 1.0 / 60.0, 60)
    }),
    Case::new("damping 0, 10,000 steps", ENERGY_GAIN, 1e-9, || energy_gain(UNDAMPED, 1.0 / 60.0)),
    Case::new("damping 1e6", ENERGY_GAIN, 1e-12, || {
        energy_gain(SpringBone { damping: 1e6, ..UNDAMPED }, 1.0 / 60.0)
    }),
    Case::new("mass 1e-6", ENERGY_GAIN, 1e-9, || {
        energy_gain(SpringBone { stiffness: 400.0 / 1e-6, damping: 2.0 / 1e-6 }, 1.0 / 60.0)
    }),
    Case::new("mass 1e6", ENERGY_GAIN, 1e-9, || {
        energy_gain(SpringBone { stiffness: 400.0 / 1e6, damping: 2.0 / 1e6 }, 1.0 / 60.0)
    }),
    Case::new("dt 0", "radians moved", 1e-15, || (bent_after(UNDAMPED, 0.0, 100) - 1.0).abs()),
    Case::new("dt 1e-6, 100,000 steps", "radians from one step of 0.1 s", 1e-8, || {
        (bent_after(UNDAMPED, 1e-6, 100_000) - bent_after(UNDAMPED, 0.1, 1)).abs()
    }),
    Case::new("dt 10 s", "radians from the closed form", 1e-10, || {
        (signed_after(UNDAMPED, 10.0, 1) - libm::cos(200.0)).abs()
    }),
    Case::new("dt 10 s, energy", ENERGY_GAIN, 1e-9, || energy_gain(UNDAMPED, 10.0)),
    Case::new("a root thrown 1 km in a frame", "radians from undisturbed", 1e-12, thrown),
    Case::new("1e7 m from the origin", "metres from the same at the origin", 1e-6, || {
        let here = tail(DVec3::ONE, DVec3::ZERO, 0.1);
        tail(DVec3::ONE, DVec3::new(1e7, 0.0, -1e7), 0.1)
            .iter()
            .zip(&here)
            .map(|(a, b)| distance_between(a, b))
            .fold(0.0, f64::max)
    }),
    Case::new("bones of length 0", "metres from as animated", 0.0, || moved(DVec3::ONE, 0.0)),
    Case::new("bones of length 1e-9", "metres from as animated", 0.0, || moved(DVec3::ONE, 1e-9)),
    Case::new("scale 0 above springs", "metres from as animated", 0.0, || moved(DVec3::ZERO, 0.1)),
    Case::new("scale -1 above springs", "metres, farthest joint", 0.5, || {
        farthest(DVec3::new(-1.0, 1.0, 1.0))
    }),
    Case::new("scale 1e8 above springs", "metres, farthest joint", 0.5, || farthest(DVec3::splat(1e8))),
    Case::new("scale 1e-8 above springs", "metres, farthest joint", 0.5, || farthest(DVec3::splat(1e-8))),
    Case::new("scale 1, 1e3, 1e-3 above springs", "metres, farthest joint", 0.5, || {
        farthest(DVec3::new(1.0, 1e3, 1e-3))
    }),
];

fn drive() -> Drive {
    let zero = DVec3::ZERO;
    Drive {
        head: zero,
        follows: false,
        target: DVec3::NEG_Y,
        length: 0.2,
        gravity: zero,
        pull: zero,
        wind: zero,
    }
}

/// Initial state, bent by 1 rad.
fn start() -> BoneState {
    let direction = DVec3::new(libm::sin(1.0), -libm::cos(1.0), 0.0);
    let zero = DVec3::ZERO;
    BoneState { direction, velocity: zero, head: zero, head_velocity: zero, target: DVec3::NEG_Y }
}

fn signed_after(bone: SpringBone, seconds: f64, steps: usize) -> f64 {
    let mut state = start();
    (0..steps).for_each(|_| bone.step(&mut state, &drive(), seconds));
    libm::atan2(state.direction.x, -state.direction.y)
}

fn bent_after(bone: SpringBone, seconds: f64, steps: usize) -> f64 {
    signed_after(bone, seconds, steps).abs()
}

fn unit(bone: SpringBone) -> f64 {
    let mut state = start();
    let mut worst = 0.0f64;
    for _ in 0..1000 {
        bone.step(&mut state, &Drive { gravity: DVec3::X * 9.81, ..drive() }, 1.0 / 60.0);
        worst = worst.max((state.direction.length() - 1.0).abs());
    }
    if state.velocity.is_finite() { worst } else { f64::NAN }
}

fn energy_gain(bone: SpringBone, seconds: f64) -> f64 {
    let drive = Drive { gravity: DVec3::new(3.0, -9.0, 1.0), ..drive() };
    let mut state = start();
    let first = bone.energy(&state, &drive);
    let (mut before, mut gained) = (first, 0.0f64);
    for _ in 0..10_000 {
        bone.step(&mut state, &drive, seconds);
        let now = bone.energy(&state, &drive);
        gained = gained.max(now - before);
        before = now;
    }
    gained.max(before - first) / first
}

fn thrown() -> f64 {
    let bone = SpringBone { stiffness: 400.0, damping: 3.0 };
    let (mut still, mut far) = (start(), start());
    let mut worst = 0.0f64;
    for frame in 0..60 {
        let head = if (20..40).contains(&frame) { DVec3::Z * 1000.0 } else { DVec3::ZERO };
        bone.step(&mut still, &drive(), 1.0 / 60.0);
        bone.step(&mut far, &Drive { head, ..drive() }, 1.0 / 60.0);
        worst = worst.max((still.direction - far.direction).length());
    }
    worst
}

/// Joint matrices of a tail of four joints under a shaking body, after one second.
fn tail(scale: DVec3, origin: DVec3, length: f32) -> Vec<Affine3A> {
    let rest = |i: usize| Transform {
        translation: Vec3::NEG_Y * if i == 0 { 0.0 } else { length },
        ..Transform::IDENTITY
    };
    let names = (0..5).map(|i| i.to_string()).collect();
    let parents = (0..5usize).map(|i| i.checked_sub(1).map(|p| p as u32)).collect();
    let Ok(skeleton) = Skeleton::new(names, parents, (0..5).map(rest).collect()) else { return Vec::new() };
    let mut rig = SpringRig::default();
    for joint in 1..4 {
        rig.add(RigBone {
            joint,
            tail: Vec3::NEG_Y * length,
            spring: SpringBone::new(2.0, 0.3),
            gravity: DVec3::X * 9.81,
            pull: DVec3::ZERO,
            hit_radius: 0.01,
            center: None,
            colliders: Vec::new(),
        });
    }
    let (mut state, mut scratch) = (SpringState::default(), SpringScratch::default());
    let mut out = animated(length);
    for frame in 0..60 {
        out = animated(length);
        let at = origin + DVec3::Z * 0.2 * libm::sin(f64::from(frame) * 0.2);
        SpringStep {
            rig: &rig,
            skeleton: &skeleton,
            world_from_model: DAffine3::from_scale_rotation_translation(
                scale,
                DQuat::from_rotation_z(0.3),
                at,
            ),
            wind: DVec3::ZERO,
            seconds: 1.0 / 60.0,
            state: &mut state,
            scratch: &mut scratch,
            model_from_joint: &mut out,
        }
        .run();
    }
    out
}

fn animated(length: f32) -> Vec<Affine3A> {
    (0..5).map(|i| Affine3A::from_translation(Vec3::NEG_Y * length * i as f32)).collect()
}

fn distance_between(a: &Affine3A, b: &Affine3A) -> f64 {
    let moved = f64::from((a.translation - b.translation).length());
    if a.is_finite() && b.is_finite() { moved } else { f64::NAN }
}

fn moved(scale: DVec3, length: f32) -> f64 {
    tail(scale, DVec3::ZERO, length)
        .iter()
        .zip(&animated(length))
        .map(|(a, b)| distance_between(a, b))
        .fold(0.0, f64::max)
}

fn farthest(scale: DVec3) -> f64 {
    let all = tail(scale, DVec3::ZERO, 0.1);
    if all.iter().all(|m| m.is_finite()) {
        all.iter().map(|m| f64::from(m.translation.length())).fold(0.0, f64::max)
    } else {
        f64::NAN
    }
}
