//! Tangents of keys: limited tangents do not overshoot, and equal Catmull–Rom on smooth motions.

use choreo_motion::Time;
use choreo_stage::{Path, Tangents};
use glam::DVec3;

/// Farthest that a component leaves the range between its two keys.
fn overshoot(tangents: Tangents, times: &[f64], values: &[Vec<f64>], vector: bool) -> f64 {
    let times: Vec<Time> = times.iter().map(|t| Time::from_secs(*t)).collect();
    let found = tangents.of(&times, values, vector);
    let mut worst: f64 = 0.0;
    for key in 1..times.len() {
        let span = (times[key] - times[key - 1]).as_secs();
        for component in 0..values[key].len() {
            let (a, b) = (values[key - 1][component], values[key][component]);
            let (out, into) = (found[key - 1][component], found[key][component]);
            for step in 0..=100 {
                let s = f64::from(step) / 100.0;
                let (s2, s3) = (s * s, s * s * s);
                let value = (2.0 * s3 - 3.0 * s2 + 1.0) * a
                    + span * (s3 - 2.0 * s2 + s) * out
                    + (3.0 * s2 - 2.0 * s3) * b
                    + span * (s3 - s2) * into;
                worst = worst.max(a.min(b) - value).max(value - a.max(b));
            }
        }
    }
    worst
}

#[test]
fn limited_tangents_do_not_overshoot_at_short_key_gaps() {
    for gap in [0.1, 1e-3, 1e-6] {
        let times = [0.0, 1.0, 1.0 + gap, 2.0 + gap];
        for ends in [[0.0, 3.0], [2.0, 1.0], [1.5, -5.0]] {
            let numbers = [vec![ends[0]], vec![1.0], vec![2.0], vec![ends[1]]];
            assert!(overshoot(Tangents::Limited, &times, &numbers, false) < 1e-12, "{gap} {ends:?}");
            let line: Vec<Vec<f64>> = numbers.iter().map(|v| vec![v[0], 2.0 * v[0], -v[0]]).collect();
            assert!(overshoot(Tangents::Limited, &times, &line, true) < 1e-12, "{gap} {ends:?}");
            assert!(overshoot(Tangents::CatmullRom, &times, &numbers, false) > 0.05 / gap);
        }
    }
    // A path that turns the corner within the gap swings aside by less than a third of the way there.
    let corner = [vec![0.0, 0.0], vec![1.0, 0.0], vec![1.0, 1.0], vec![2.0, 1.0]];
    let aside = overshoot(Tangents::Limited, &[0.0, 1.0, 1.001, 2.001], &corner, true);
    assert!((0.01..0.33).contains(&aside), "{aside}");
}

#[test]
fn limited_tangents_of_a_circle_equal_catmull_rom() {
    let times: Vec<Time> = (0..9).map(|i| Time::from_secs(f64::from(i))).collect();
    let on = |i: i32| libm::sincos(0.3 + f64::from(i) * std::f64::consts::FRAC_PI_4);
    let values: Vec<Vec<f64>> = (0..9).map(|i| vec![on(i).0, on(i).1]).collect();
    let limited = Tangents::Limited.of(&times, &values, true);
    assert_eq!(limited, Tangents::CatmullRom.of(&times, &values, true));
    // Component by component it flattens wherever one of them turns.
    assert_ne!(limited, Tangents::Limited.of(&times, &values, false));
}

#[test]
fn tangents_are_zero_at_both_keys_of_a_jump() {
    let times = [0, 1000, 2000, 2001, 3000, 4000].map(Time);
    let values: Vec<Vec<f64>> = [0.0, 1.0, 2.0, 7.0, 8.0, 9.0].iter().map(|v| vec![*v]).collect();
    let tangents = Tangents::Limited.of(&times, &values, false);
    assert_eq!(tangents[2..4], [[0.0], [0.0]]);
    assert!(tangents[1][0] > 0.0 && tangents[4][0] > 0.0);
}

/// A hairpin of 0.3 m behind a straight of 10 m. With the same time from each point to the next a path swings out by 1.25 m.
#[test]
fn path_hardly_overshoots_where_its_points_are_close_together() {
    let points = [[0.0, 0.0], [10.0, 0.0], [10.0, 0.3], [0.0, 0.3]].map(|[x, z]| DVec3::new(x, 0.0, z));
    let path = Path::new(points.into(), false).unwrap();
    let places = (0..=4000).map(|i| path.at(path.length() * f64::from(i) / 4000.0).0.x);
    let out = places.fold(0.0, f64::max) - 10.0;
    assert!((0.01..0.1).contains(&out), "{out}");
}
