//! Contacts of generated gaits, whose contact times are known.

use choreo_motion::contacts::{find_feet, leg_length};
use choreo_motion::{Clip, Contacts, Curve, Interpolation, Path, Skeleton, Time, Transform};
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// A gait of one stride: duration of the clip, and touch-down time and contact duration of each foot as shares of it.
struct Gait {
    secs: f64,
    /// Metres per second.
    speed: f64,
    /// Height by which feet in the air are lifted, in leg lengths.
    lift: f64,
    downs: Vec<(f64, f64)>,
    /// Whether it is played on the spot.
    on_the_spot: bool,
    /// Length of the leg, metres.
    leg: f64,
}

impl Gait {
    /// Displacement of a foot from its rest position, in the space of the character (on the spot) or of the floor.
    fn foot_position(&self, foot: usize, t: f64) -> DVec3 {
        let (down, share) = self.downs[foot];
        let phase = (t / self.secs - down).rem_euclid(1.0);
        let stride = self.speed * self.secs;
        let z = if phase < share {
            stride * (0.5 * share - phase)
        } else {
            // In the air the foot swings forwards; at both ends it has the velocity of the floor, so that velocity is continuous.
            let s = (phase - share) / (1.0 - share);
            let (from, to, slope) = (-0.5 * share * stride, 0.5 * share * stride, -stride * (1.0 - share));
            let (s2, s3) = (s * s, s * s * s);
            (2.0 * s3 - 3.0 * s2 + 1.0) * from
                + (s3 - 2.0 * s2 + s) * slope
                + (3.0 * s2 - 2.0 * s3) * to
                + (s3 - s2) * slope
        };
        let s = ((phase - share) / (1.0 - share)).max(0.0);
        let y = self.lift * self.leg * libm::sin(std::f64::consts::PI * s);
        let carried = if self.on_the_spot { 0.0 } else { self.speed * t };
        DVec3::new(0.0, y, z + carried)
    }

    /// Hips with feet as their children, which are animated by translations.
    fn skeleton(&self) -> Skeleton {
        let mut names = vec!["Hips".to_string()];
        let mut parents = vec![None];
        let mut rest = vec![Transform { translation: Vec3::Y * self.leg as f32, ..Transform::IDENTITY }];
        for foot in 0..self.downs.len() {
            names.push(format!("{} Foot {foot}", if foot % 2 == 0 { "left" } else { "right" }));
            parents.push(Some(0));
            let down = Vec3::NEG_Y * self.leg as f32;
            rest.push(Transform { translation: down, ..Transform::IDENTITY });
        }
        Skeleton::new(names, parents, rest).unwrap()
    }

    fn clip(&self, skeleton: &Skeleton) -> Clip {
        let keys = 240;
        let times: Arc<[Time]> =
            (0..=keys).map(|i| Time::from_secs(self.secs * f64::from(i) / f64::from(keys))).collect();
        let curves = (0..self.downs.len()).map(|foot| {
            let rest = skeleton.rest()[foot + 1].translation.as_dvec3();
            let values = times
                .iter()
                .flat_map(|t| (rest + self.foot_position(foot, t.as_secs())).as_vec3().to_array());
            Curve {
                joint: foot as u32 + 1,
                path: Path::Translation,
                interpolation: Interpolation::Linear,
                times: times.clone(),
                values: values.collect(),
            }
        });
        Clip::new("gait".into(), skeleton.len(), curves.collect()).unwrap()
    }

    fn contacts(&self) -> Contacts {
        let (skeleton, feet) = (self.skeleton(), find_feet(&self.skeleton()));
        assert_eq!(feet.len(), self.downs.len());
        assert!((leg_length(&skeleton, &feet).unwrap() - self.leg).abs() < 1e-5);
        Contacts::find(&skeleton, &self.clip(&skeleton), (Time::ZERO, Time::from_secs(self.secs)), &feet)
            .unwrap()
    }
}

fn gaits() -> Vec<(&'static str, Gait)> {
    let walk = || Gait {
        secs: 1.0,
        speed: 1.2,
        lift: 0.15,
        downs: vec![(0.1, 0.62), (0.6, 0.62)],
        on_the_spot: true,
        leg: 0.85,
    };
    let run = || Gait { secs: 0.7, speed: 4.0, lift: 0.5, downs: vec![(0.2, 0.25), (0.7, 0.25)], ..walk() };
    let four = vec![(0.0, 0.6), (0.5, 0.6), (0.25, 0.6), (0.75, 0.6)];
    vec![
        ("walk", walk()),
        ("walk over the floor", Gait { on_the_spot: false, ..walk() }),
        ("run", run()),
        ("run over the floor", Gait { on_the_spot: false, ..run() }),
        ("a mouse's", Gait { leg: 0.02, speed: 0.06, secs: 0.4, ..walk() }),
        ("a giant's", Gait { leg: 12.0, speed: 14.0, secs: 1.6, ..walk() }),
        ("backwards", Gait { speed: -0.8, ..walk() }),
        ("on four feet", Gait { downs: four, ..walk() }),
    ]
}

#[test]
fn contacts_are_found_at_the_times_of_generated_gaits() {
    for (name, gait) in gaits() {
        let found = gait.contacts();
        let floor = if gait.on_the_spot { -gait.speed } else { 0.0 };
        let off = (found.floor_velocity.z - floor).abs();
        println!("{name}: floor at {:.3} m/s, must be {floor:.3}", found.floor_velocity.z);
        assert!(off < 0.03 * gait.speed.abs(), "{name}: floor at {}", found.floor_velocity.z);
        for (foot, (down, share)) in gait.downs.iter().enumerate() {
            let stands = &found.intervals[foot];
            assert_eq!(stands.len(), 1, "{name}, foot {foot}: {stands:?}");
            let near = |a: f64, b: f64| {
                let off = (a - b).rem_euclid(1.0);
                off.min(1.0 - off)
            };
            let (from, to) = (stands[0].from.as_secs() / gait.secs, stands[0].to.as_secs() / gait.secs);
            // A foot leaves the floor slowly, and is low for part of its time in the air (4 % of a stride).
            assert!(near(from, *down) < 0.04 && near(to, down + share) < 0.04, "{name} {foot}: {from} {to}");
        }
    }
}

#[test]
fn shuffling_and_hovering_feet_have_short_contacts() {
    let (_, mut gait) = gaits().remove(0);
    gait.lift = 0.03;
    gait.downs = vec![(0.1, 0.3), (0.6, 0.3)];
    // A shuffle: feet in the air are as low as feet on the floor, but faster.
    let of = gait.contacts();
    assert!(of.intervals.iter().flatten().all(|s| (s.to - s.from).as_secs() < 0.45), "{of:?}");
    // A character that hovers up and down has no contacts as long as those of a walk.
    gait.downs = vec![(0.1, 1e-3), (0.6, 1e-3)];
    gait.lift = 0.5;
    let of = gait.contacts();
    assert!(of.intervals.iter().flatten().all(|s| (s.to - s.from).as_secs() < 0.2), "{of:?}");
}

#[test]
fn a_standing_character_has_contacts_at_all_times() {
    let (_, gait) = gaits().remove(0);
    let skeleton = gait.skeleton();
    let clip = Clip::new(
        "still".into(),
        skeleton.len(),
        vec![Curve {
            joint: 0,
            path: Path::Translation,
            interpolation: Interpolation::Linear,
            times: [Time::ZERO, Time::from_secs(2.0)].into(),
            values: [0.0, 0.85, 0.0, 0.0, 0.855, 0.004].into(),
        }],
    )
    .unwrap();
    let trim = (Time::ZERO, Time::from_secs(2.0));
    let found = Contacts::find(&skeleton, &clip, trim, &find_feet(&skeleton)).unwrap();
    for stands in &found.intervals {
        assert_eq!(stands.iter().map(|s| (s.from, s.to)).collect::<Vec<_>>(), [trim]);
    }
    assert!(found.floor_velocity.length() < 0.01);
}

/// The skeleton is like that of Khronos' CesiumMan, where no joint is called foot or toe.
#[test]
fn feet_without_names_are_the_ends_of_the_legs() {
    let mut joints: Vec<(String, Option<u32>, [f32; 3])> = vec![
        ("Skeleton_torso_joint_1".into(), None, [0.0, 0.9, 0.0]),
        ("torso_joint_3".into(), Some(0), [0.0, 0.4, 0.0]),
        ("Skeleton_neck_joint_1".into(), Some(1), [0.0, 0.2, 0.0]),
    ];
    for (side, x) in [("L", 1.0f32), ("R", -1.0)] {
        let mut above = 0;
        let steps = [[0.1, 0.0, 0.0], [0.0, -0.4, 0.02], [0.0, -0.4, -0.02], [0.0, -0.1, 0.15]];
        for (number, [out, up, ahead]) in [1, 2, 3, 5].into_iter().zip(steps) {
            joints.push((format!("leg_joint_{side}_{number}"), Some(above), [x * out, up, ahead]));
            above = joints.len() as u32 - 1;
        }
    }
    let rest =
        joints.iter().map(|j| Transform { translation: Vec3::from(j.2), ..Transform::IDENTITY }).collect();
    let names = joints.iter().map(|j| j.0.clone()).collect();
    let skeleton = Skeleton::new(names, joints.iter().map(|j| j.1).collect(), rest).unwrap();
    let feet: Vec<Vec<&str>> = find_feet(&skeleton)
        .iter()
        .map(|foot| foot.joints.iter().map(|j| skeleton.names()[*j as usize].as_str()).collect())
        .collect();
    assert_eq!(feet, [["leg_joint_L_3", "leg_joint_L_5"], ["leg_joint_R_3", "leg_joint_R_5"]]);
}
