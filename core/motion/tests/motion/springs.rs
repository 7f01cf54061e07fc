//! Spring bones are compared with closed forms, energy conservation and finer steps, and tried with extreme input.

use crate::support::Random;
use choreo_motion::spring::{
    BoneState, Drive, RigBone, SpringBone, SpringRig, SpringScratch, SpringState, SpringStep,
};
use choreo_motion::{Skeleton, Transform};
use glam::{Affine3A, DAffine3, DQuat, DVec3, Vec3};

fn drive_at_rest(target: DVec3) -> Drive {
    let zero = DVec3::ZERO;
    Drive { head: zero, follows: false, target, length: 0.2, gravity: zero, pull: zero, wind: zero }
}

fn state_at(direction: DVec3, drive: &Drive) -> BoneState {
    let zero = DVec3::ZERO;
    BoneState { direction, velocity: zero, head: drive.head, head_velocity: zero, target: drive.target }
}

fn direction_of_angle(angle: f64) -> DVec3 {
    DVec3::new(libm::sin(angle), -libm::cos(angle), 0.0)
}

fn angle_of_direction(d: DVec3) -> f64 {
    libm::atan2(d.x, -d.y)
}

#[test]
fn a_planar_swing_equals_the_closed_form_at_any_step_length() {
    let start = 2.0;
    for frequency in [0.1, 1.0, 12.0, 1000.0] {
        for ratio in [0.0, 0.1, 0.5, 1.0, 3.0, 10.0] {
            for rate in [12.0, 30.0, 60.0, 240.0] {
                let (bone, drive) = (SpringBone::new(frequency, ratio), drive_at_rest(DVec3::NEG_Y));
                let mut state = state_at(direction_of_angle(start), &drive);
                for frame in 1..=24 {
                    bone.step(&mut state, &drive, 1.0 / rate);
                    let exact = closed_form_angle(start, frequency, ratio, f64::from(frame) / rate);
                    let off = (angle_of_direction(state.direction) - exact).abs();
                    // At 1,000 Hz, rounding of the time limits the accuracy of the phase.
                    let allowed = if frequency > 100.0 { 1e-8 } else { 1e-11 };
                    assert!(off < allowed, "{frequency} Hz, ζ {ratio}, {rate} fps, frame {frame}: {off:e}");
                }
            }
        }
    }
}

/// Closed form of the damped oscillator, released from rest.
fn closed_form_angle(start: f64, frequency: f64, ratio: f64, t: f64) -> f64 {
    let w = 2.0 * std::f64::consts::PI * frequency;
    let fall = libm::exp(-ratio * w * t);
    if ratio < 1.0 {
        let wd = w * (1.0 - ratio * ratio).sqrt();
        start * fall * (libm::cos(wd * t) + ratio * w / wd * libm::sin(wd * t))
    } else if ratio == 1.0 {
        start * fall * (1.0 + w * t)
    } else {
        let root = (ratio * ratio - 1.0).sqrt();
        let (a, b) = (-w / (ratio + root), -w * (ratio + root));
        start * (b * libm::exp(a * t) - a * libm::exp(b * t)) / (b - a)
    }
}

/// The energy of a bone whose head and target rest never grows: with and without gravity, in still air, at any step length.
#[test]
fn free_damped_motion_never_gains_energy() {
    let mut n = Random(7);
    for case in 0..4000 {
        let bone = SpringBone {
            stiffness: n.power(-3.0, 12.0),
            damping: if case % 4 == 0 { 0.0 } else { n.power(-3.0, 6.0) },
        };
        let gravity = if case % 3 == 0 { DVec3::ZERO } else { n.direction() * n.power(-1.0, 4.0) };
        let drive = Drive { gravity, length: n.power(-3.0, 1.0), ..drive_at_rest(n.direction()) };
        let step = n.power(-6.0, 1.0);
        let mut state = BoneState { velocity: DVec3::ZERO, ..state_at(n.direction(), &drive) };
        // The velocity is at most that of a swing from half a turn away, the limit that steps impose.
        state.velocity = state.direction.any_orthonormal_vector() * bone.stiffness.sqrt();
        let mut energy = bone.energy(&state, &drive);
        let scale = energy + gravity.length() / drive.length;
        for frame in 0..40 {
            bone.step(&mut state, &drive, step);
            let now = bone.energy(&state, &drive);
            assert!(
                now <= energy + scale * 1e-9,
                "case {case}, frame {frame}: {energy} → {now}; {bone:?}, {step} s"
            );
            energy = now;
        }
    }
}

/// Period of a pendulum of frequency ω and amplitude φ: 2π / (ω · agm(1, cos φ/2)), Gauss's arithmetic–geometric mean.
fn pendulum_period(omega: f64, amplitude: f64) -> f64 {
    let (mut a, mut g) = (1.0, libm::cos(0.5 * amplitude));
    for _ in 0..8 {
        (a, g) = (0.5 * (a + g), (a * g).sqrt());
    }
    2.0 * std::f64::consts::PI / (omega * a)
}

#[test]
fn an_undamped_swing_under_gravity_keeps_its_amplitude_for_a_minute() {
    let gravity = 9.81;
    for amplitude in [0.1, 0.6, 1.5, 2.6] {
        for rate in [24.0, 60.0, 144.0] {
            // A pendulum without a spring, where energy and period are known.
            let pendulum = SpringBone::new(0.0, 0.0);
            let drive = Drive { gravity: DVec3::NEG_Y * gravity, ..drive_at_rest(DVec3::NEG_Y) };
            let mut state = state_at(direction_of_angle(amplitude), &drive);
            let energy = pendulum.energy(&state, &drive);
            let (mut widest, mut crossings, mut before) = (0.0f64, Vec::new(), amplitude);
            let seconds = 60;
            for frame in 1..=(seconds * rate as i32) {
                pendulum.step(&mut state, &drive, 1.0 / rate);
                let now = angle_of_direction(state.direction);
                let time = f64::from(frame) / rate;
                if before > 0.0 && now <= 0.0 {
                    crossings.push(time - now / (now - before) / rate);
                }
                before = now;
                if time > f64::from(seconds - 5) {
                    widest = widest.max(now.abs());
                }
            }
            let off = pendulum.energy(&state, &drive) / energy - 1.0;
            assert!(off.abs() < 1e-6, "{amplitude} rad at {rate} Hz: energy off by {off:e}");
            assert!(
                (widest / amplitude - 1.0).abs() < 0.02,
                "{amplitude} rad at {rate} Hz: {widest} rad wide"
            );
            let periods = crossings.len() as f64 - 1.0;
            let period = (crossings[crossings.len() - 1] - crossings[0]) / periods;
            let exact = pendulum_period((gravity / drive.length).sqrt(), amplitude);
            // The spring that replaces the load changes with each step.
            let allowed = 0.6 / (rate * rate) * gravity / drive.length;
            assert!(
                (period / exact - 1.0).abs() < allowed,
                "{amplitude} rad at {rate} Hz: {period} s, {exact} s"
            );
        }
    }
    // With a spring and gravity across it, in all directions.
    let mut n = Random(7);
    for _ in 0..20 {
        let bone = SpringBone::new(0.5 + n.signed64().abs(), 0.0);
        let drive = Drive { gravity: n.vec3() * 20.0, ..drive_at_rest(n.direction()) };
        let mut state = state_at(n.direction(), &drive);
        let energy = bone.energy(&state, &drive);
        for _ in 0..3600 {
            bone.step(&mut state, &drive, 1.0 / 60.0);
        }
        let off = bone.energy(&state, &drive) / energy - 1.0;
        assert!(off.abs() < 1e-6, "{bone:?}, {drive:?}: energy off by {off:e}");
    }
}

/// Negative control: the semi-implicit Euler method gains energy.
#[test]
fn semi_implicit_euler_fails_the_energy_test() {
    let (bone, drive) = (SpringBone::new(15.0, 0.0), drive_at_rest(DVec3::NEG_Y));
    let mut state = state_at(direction_of_angle(1.0), &drive);
    let before = bone.energy(&state, &drive);
    for _ in 0..10 {
        let bent = angle_of_direction(state.direction);
        state.velocity +=
            direction_of_angle(bent + std::f64::consts::FRAC_PI_2) * (-bent * bone.stiffness / 30.0);
        state.direction = (state.direction + state.velocity / 30.0).normalize();
    }
    assert!(bone.energy(&state, &drive) > 2.0 * before);
}

/// The head shakes and the target rotates.
#[test]
fn a_bone_at_60_hz_converges_to_a_thousand_times_finer_steps() {
    let drive_at = |t: f64| Drive {
        head: DVec3::new(0.1 * libm::sin(7.0 * t), 0.05 * libm::cos(5.0 * t), 0.0),
        target: DQuat::from_rotation_z(0.6 * libm::sin(4.0 * t))
            * DQuat::from_rotation_x(0.3 * t)
            * DVec3::NEG_Y,
        gravity: DVec3::NEG_Y * 9.81,
        ..drive_at_rest(DVec3::NEG_Y)
    };
    let bone = SpringBone::new(2.0, 0.2);
    let run = |rate: u32| {
        let mut state = bone.settled(&drive_at(0.0));
        for i in 1..=rate {
            bone.step(&mut state, &drive_at(f64::from(i) / f64::from(rate)), 1.0 / f64::from(rate));
        }
        state.direction
    };
    let truth = run(60_000);
    let errors: Vec<f64> = [60, 120, 240].map(|rate| (run(rate) - truth).length()).to_vec();
    // Radians: a hundredth of a degree at 60 Hz.
    assert!(errors[0] < 3e-4 && errors[1] < errors[0] && errors[2] < 0.7 * errors[1], "{errors:?}");
}

#[test]
fn the_settled_state_is_an_equilibrium() {
    let mut n = Random(3);
    for _ in 0..200 {
        let bone = SpringBone::new(n.power(-1.0, 1.0), 0.3);
        let drive =
            Drive { gravity: n.direction() * 9.81, wind: n.vec3() * 5.0, ..drive_at_rest(n.direction()) };
        let settled = bone.settled(&drive);
        let mut state = settled;
        for _ in 0..60 {
            bone.step(&mut state, &drive, 1.0 / 60.0);
        }
        assert!((state.direction - settled.direction).length() < 1e-9, "{bone:?}");
    }
}

/// A tail of `count` sticks along −Y, 10 cm each; the first joint is the character.
fn tail_rig(count: usize) -> (Skeleton, SpringRig) {
    let rest = |i: usize| Transform {
        translation: if i == 0 { Vec3::ZERO } else { Vec3::NEG_Y * 0.1 },
        ..Transform::IDENTITY
    };
    let names = (0..=count).map(|i| format!("Tail{i}")).collect();
    let parents = (0..=count).map(|i| i.checked_sub(1).map(|p| p as u32)).collect();
    let skeleton = Skeleton::new(names, parents, (0..=count).map(rest).collect()).unwrap();
    let mut rig = SpringRig::default();
    for joint in 1..=count as u32 {
        rig.add(rig_bone(joint, SpringBone::new(3.0, 0.2)));
    }
    (skeleton, rig)
}

fn rig_bone(joint: u32, spring: SpringBone) -> RigBone {
    RigBone {
        joint,
        tail: Vec3::NEG_Y * 0.1,
        spring,
        gravity: DVec3::NEG_Y * 9.81,
        pull: DVec3::ZERO,
        hit_radius: 0.0,
        center: None,
        colliders: vec![],
    }
}

struct Simulation {
    skeleton: Skeleton,
    rig: SpringRig,
    state: SpringState,
    scratch: SpringScratch,
    out: Vec<Affine3A>,
}

impl Simulation {
    fn new((skeleton, rig): (Skeleton, SpringRig)) -> Simulation {
        let out = skeleton.rest_model_from_joint();
        Simulation { skeleton, rig, state: SpringState::default(), scratch: SpringScratch::default(), out }
    }

    fn step(&mut self, world_from_model: DAffine3, seconds: f64) {
        self.out = self.skeleton.rest_model_from_joint();
        let mut step = SpringStep {
            rig: &self.rig,
            skeleton: &self.skeleton,
            world_from_model,
            wind: DVec3::ZERO,
            seconds,
            state: &mut self.state,
            scratch: &mut self.scratch,
            model_from_joint: &mut self.out,
        };
        assert_eq!(step.check(), Ok(()));
        step.run();
    }

    fn is_valid(&self) -> bool {
        self.out.iter().all(|m| m.is_finite())
            && self
                .state
                .bones()
                .iter()
                .flatten()
                .all(|b| b.velocity.is_finite() && (b.direction.length() - 1.0).abs() < 1e-9)
    }

    /// Lengths of the sticks.
    fn stick_lengths(&self) -> Vec<f32> {
        self.out.windows(2).skip(1).map(|w| (w[1].translation - w[0].translation).length()).collect()
    }
}

#[test]
fn joints_lag_behind_and_sticks_keep_their_length() {
    let mut run = Simulation::new(tail_rig(8));
    let place = |t: f64| DAffine3::from_translation(DVec3::new(libm::sin(6.0 * t), 0.0, 1e7));
    let mut widest = 0.0f32;
    for frame in 0..240 {
        run.step(place(f64::from(frame) / 60.0), 1.0 / 60.0);
        assert!(run.is_valid());
        assert!(run.stick_lengths().iter().all(|l| (l - 0.1).abs() < 1e-5), "{:?}", run.stick_lengths());
        widest = widest.max(run.out[8].translation.x.abs());
    }
    assert!(widest > 0.3 && widest < 0.8, "{widest}");
    // Each joint points at the next one.
    let way = run.out[5].translation - run.out[4].translation;
    let points = run.out[4].transform_vector3(Vec3::NEG_Y);
    assert!(way.normalize().dot(points.into()) > 0.99999);
}

#[test]
fn springs_of_mirrored_and_scaled_actors_swing_in_world_space() {
    for scale in [DVec3::splat(2.0), DVec3::splat(0.01), DVec3::new(-1.0, 1.0, 1.0)] {
        let (skeleton, mut rig) = tail_rig(3);
        let length = 0.1 * scale.y.abs();
        rig.bones_mut().for_each(|b| b.gravity = DVec3::new(3.0 * length, 0.0, 0.0));
        let mut run = Simulation::new((skeleton, rig));
        run.step(DAffine3::from_scale(scale), 0.0);
        let stick = Vec3::from(run.out[2].translation - run.out[1].translation).as_dvec3();
        let shown = (scale * stick).normalize();
        let expected = run.state.bones()[0].unwrap().direction;
        assert!((shown - expected).length() < 1e-5 && expected.x > 0.005, "{scale}: {shown} {expected}");
    }
}

#[test]
fn extreme_parameters_and_motions_stay_finite() {
    let bones = [
        ("stiffness 1e12", SpringBone { stiffness: 1e12, damping: 0.0 }),
        ("stiffness 1e18", SpringBone { stiffness: 1e18, damping: 1e18 }),
        ("damping 1e6", SpringBone { stiffness: 0.0, damping: 1e6 }),
        ("nothing", SpringBone { stiffness: 0.0, damping: 0.0 }),
        ("mass 1e-6", SpringBone { stiffness: 100.0 / 1e-6, damping: 1.0 / 1e-6 }),
        ("mass 1e6", SpringBone { stiffness: 100.0 / 1e6, damping: 1.0 / 1e6 }),
    ];
    for (name, spring) in bones {
        for seconds in [0.0, 1e-6, 1.0 / 60.0, 10.0] {
            for scale in [1.0, 0.0, -1.0, 1e8, 1e-8] {
                let (skeleton, mut rig) = tail_rig(20);
                rig.bones_mut().for_each(|b| b.spring = spring);
                rig.ground = Some(-1.0);
                let mut run = Simulation::new((skeleton, rig));
                for frame in 0..30 {
                    // The actor is teleported by 1 km and back.
                    let x = if frame % 7 == 3 { 1000.0 } else { 0.01 * f64::from(frame) };
                    let place = DAffine3::from_scale_rotation_translation(
                        DVec3::new(scale, scale, scale * 3.0),
                        DQuat::from_rotation_y(f64::from(frame)),
                        DVec3::new(x, 0.0, 1e7),
                    );
                    run.step(place, seconds);
                    assert!(run.is_valid(), "{name}, steps of {seconds} s, scale {scale}, frame {frame}");
                }
            }
        }
    }
}

#[test]
fn sticks_without_length_stay_as_animated() {
    let (skeleton, mut rig) = tail_rig(4);
    for (bone, length) in rig.bones_mut().zip([0.0, 1e-9, 0.1, 0.1]) {
        bone.tail = Vec3::NEG_Y * length;
    }
    let before = skeleton.rest_model_from_joint();
    let mut run = Simulation::new((skeleton, rig));
    for frame in 0..20 {
        run.step(DAffine3::from_translation(DVec3::X * 0.1 * f64::from(frame)), 1.0 / 60.0);
        assert!(run.is_valid());
        assert_eq!(run.out[..3], before[..3]);
        assert!(run.state.bones()[0].is_none() && run.state.bones()[1].is_none());
    }
    assert_ne!(run.out[3].matrix3, before[3].matrix3);
}

#[test]
fn a_teleported_head_does_not_disturb_its_stick() {
    let bone = SpringBone::new(2.0, 0.1);
    let drive = drive_at_rest(DVec3::NEG_Y);
    let (mut near, mut far) =
        (state_at(direction_of_angle(0.4), &drive), state_at(direction_of_angle(0.4), &drive));
    for frame in 0..60 {
        let head = if frame >= 30 { DVec3::X * 1000.0 } else { DVec3::ZERO };
        bone.step(&mut near, &drive, 1.0 / 60.0);
        bone.step(&mut far, &Drive { head, ..drive }, 1.0 / 60.0);
        assert!((near.direction - far.direction).length() < 1e-12, "frame {frame}");
    }
    // A small movement of the head does affect the stick.
    bone.step(&mut far, &Drive { head: DVec3::X * 1000.05, ..drive }, 1.0 / 60.0);
    bone.step(&mut near, &drive, 1.0 / 60.0);
    assert!((near.direction - far.direction).length() > 0.1);
}

#[test]
fn velocities_of_a_long_undamped_chain_stay_bounded() {
    let (skeleton, mut rig) = tail_rig(100);
    rig.bones_mut().for_each(|b| b.spring = SpringBone::new(3.0, 0.0));
    let mut run = Simulation::new((skeleton, rig));
    for frame in 0..1200 {
        let x = if frame < 60 { libm::sin(f64::from(frame) * 0.3) } else { 0.0 };
        run.step(DAffine3::from_translation(DVec3::X * x), 1.0 / 60.0);
        assert!(run.is_valid());
    }
    let limit = std::f64::consts::PI * 60.0 + 1.0;
    assert!(run.state.bones().iter().flatten().all(|b| b.velocity.length() < limit));
}

/// Positions of the end of a shaken tail of `count` bones, at each of `frames` 60ths of a second, with `steps` steps per frame.
fn shaken_tails(count: usize, steps: u32, spring: SpringBone, frames: u32) -> Vec<Vec3> {
    let (skeleton, mut rig) = tail_rig(count);
    rig.bones_mut().for_each(|b| b.spring = spring);
    let mut run = Simulation::new((skeleton, rig));
    let mut seen = Vec::new();
    for i in 0..=frames * steps {
        let t = f64::from(i) / f64::from(60 * steps);
        // Three frequencies, one of them the bones' resonance.
        let x = 0.1 * (1.0 - libm::cos(9.0 * t)) + 0.02 * libm::sin(18.8 * t) + 0.01 * libm::sin(40.0 * t);
        run.step(DAffine3::from_translation(DVec3::X * x), 1.0 / f64::from(60 * steps));
        if i.is_multiple_of(steps) {
            let last = run.out.last().unwrap();
            seen.push(last.transform_point3(Vec3::NEG_Y * 0.1));
        }
    }
    seen
}

fn largest_distance(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f32::max)
}

/// Chains of any length and damping give the same motion with finer steps.
#[test]
fn chains_converge_to_a_thousand_times_finer_steps() {
    for (count, steps) in [(1, 1000), (4, 1000), (20, 200), (100, 40)] {
        for ratio in [0.02, 0.4, 1.5] {
            let spring = SpringBone::new(3.0, ratio);
            let tip = |steps| shaken_tails(count, steps, spring, 60);
            let truth = tip(steps);
            let off = [1, 4].map(|steps| largest_distance(&tip(steps), &truth));
            let reach = count as f32 * 0.1;
            println!("{count} bones, ζ {ratio}: {off:?} m");
            assert!(off[0] < 0.1 * reach, "{count} bones, ζ {ratio}: {off:?}");
            // The order of convergence is at least first, except for the rounding of f32 matrices.
            assert!(off[1] < off[0] / 3.0 + 1e-4 * reach, "{count} bones, ζ {ratio}: {off:?}");
        }
    }
}

/// A bone passes on no larger swing than it receives: the frequency response, long after a steady shake began.
#[test]
fn a_following_bone_amplifies_no_frequency() {
    for frequency in [0.5, 3.0] {
        for hz in [0.3, 1.0, 2.5, 3.0, 3.5, 8.0] {
            let bone = SpringBone::new(frequency, 0.0);
            let swing = |follows: bool| {
                let drive = |t: f64| Drive {
                    follows,
                    target: direction_of_angle(0.1 * libm::sin(std::f64::consts::TAU * hz * t)),
                    gravity: DVec3::NEG_Y * 9.81,
                    length: 5.0,
                    ..drive_at_rest(DVec3::NEG_Y)
                };
                let mut state = state_at(DVec3::NEG_Y, &drive(0.0));
                let mut most = 0.0f64;
                for i in 1..=24_000 {
                    let t = f64::from(i) / 1200.0;
                    bone.step(&mut state, &drive(t), 1.0 / 1200.0);
                    most = if t > 16.0 { most.max(angle_of_direction(state.direction).abs()) } else { 0.0 };
                }
                most
            };
            assert!(swing(true) < 0.1001, "{frequency} Hz at {hz} Hz: {}", swing(true));
            if (hz - frequency).abs() < 0.1 {
                assert!(swing(false) > 0.3, "a bone that follows no other must resonate: {}", swing(false));
            }
        }
    }
}

#[test]
fn springs_ignore_the_motion_of_their_center() {
    let (skeleton, mut rig) = tail_rig(3);
    let mut free = Simulation::new((skeleton.clone(), rig.clone()));
    rig.bones_mut().for_each(|b| b.center = Some(0));
    let mut centered = Simulation::new((skeleton, rig));
    for frame in 0..30 {
        let t = f64::from(frame) / 60.0;
        let place = DAffine3::from_translation(DVec3::X * 4.0 * t * t);
        free.step(place, 1.0 / 60.0);
        centered.step(place, 1.0 / 60.0);
    }
    assert!(free.out[3].translation.x < -0.05);
    assert!(centered.out[3].translation.x.abs() < 1e-6);
}

#[test]
fn check_names_the_invalid_field() {
    let (skeleton, rig) = tail_rig(2);
    let error_text = |change: fn(&mut SpringRig), seconds: f64| {
        let mut rig = rig.clone();
        change(&mut rig);
        let (mut state, mut scratch, mut out) =
            (SpringState::default(), SpringScratch::default(), skeleton.rest_model_from_joint());
        let step = SpringStep {
            rig: &rig,
            skeleton: &skeleton,
            world_from_model: DAffine3::IDENTITY,
            wind: DVec3::ZERO,
            seconds,
            state: &mut state,
            scratch: &mut scratch,
            model_from_joint: &mut out,
        };
        step.check().unwrap_err().to_string()
    };
    assert_eq!(error_text(|_| (), f64::NAN), "`SpringStep.seconds` is NaN, must be finite and ≥ 0");
    let stiff: fn(&mut SpringRig) = |r| r.bones_mut().for_each(|b| b.spring.stiffness = f64::NAN);
    assert_eq!(
        error_text(stiff, 0.0),
        "`SpringStep.rig`: bone of joint 1: stiffness is NaN, must be 0..=1e18"
    );
    let joint: fn(&mut SpringRig) = |r| r.add(rig_bone(9, SpringBone::default()));
    assert_eq!(
        error_text(joint, 0.0),
        "`SpringStep.rig`: bone of joint 9: joint 9 does not exist (count: 3)"
    );
}
