//! Tangents of single keyframes, compared with Bézier curves in f64 that are evaluated here by de Casteljau's construction and bisection.

use crate::common::*;
use choreo_motion::{Interpolation, Time};
use choreo_stage::{Channel, Property, TimeRemapping};
use glam::DQuat;

/// The channel of an actor's property, from its `.key(…)`.
fn channel(call: &str, property: Property) -> Channel {
    let script =
        run_or_panic(&format!("stage(#{{ length: 100.0 }});\ncast(\"a\", load(\"hero.toy\")){call};"));
    let channels = &script.stage.actors[0].channels;
    channels.iter().find(|channel| channel.property == property).unwrap().clone()
}

fn position(keys: &str) -> Channel {
    channel(&format!(".key(\"position\", {keys})"), Property::Translation)
}

/// Bézier curve between two keys. Tangents are changes per second, weights the shares of the span that the handles take.
struct BezierReference {
    times: [f64; 2],
    values: [f64; 2],
    tangents: [f64; 2],
    weights: [f64; 2],
}

impl BezierReference {
    fn at(&self, secs: f64) -> f64 {
        let [t0, t1] = self.times;
        let span = t1 - t0;
        let casteljau = |points: [f64; 4], u: f64| {
            let mut points = points.to_vec();
            while points.len() > 1 {
                points = points.windows(2).map(|p| p[0] + (p[1] - p[0]) * u).collect();
            }
            points[0]
        };
        let [w0, w1] = self.weights.map(|weight| weight * span);
        let time = [t0, t0 + w0, t1 - w1, t1];
        let [a, b] = self.values;
        let value = [a, a + w0 * self.tangents[0], b - w1 * self.tangents[1], b];
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..200 {
            let u = 0.5 * (low + high);
            if casteljau(time, u) < secs { low = u } else { high = u }
        }
        casteljau(value, 0.5 * (low + high))
    }

    /// Largest difference from one component of a channel, at 1000 times and at 200 more around the middle, where a curve may be vertical.
    fn largest_error(&self, channel: &Channel, part: usize) -> f64 {
        let [t0, t1] = self.times;
        let middle = (-100..100).map(|n| 0.5 + f64::from(n) * 1e-6);
        let shares = (0..1000).map(|n| f64::from(n) / 1000.0).chain(middle);
        let error = |share: f64| {
            let time = Time::from_secs(t0 + (t1 - t0) * share);
            let error = (channel.at(time).unwrap()[part] - self.at(time.as_secs())).abs();
            assert!(error.is_finite(), "at {}", time.as_secs());
            error
        };
        shares.map(error).fold(0.0, f64::max)
    }
}

const THIRD: [f64; 2] = [1.0 / 3.0; 2];

#[test]
fn keys_with_tangents_are_hermite_splines() {
    let keys = "[[0.5, [0, 1, 2]], [1.5, [1, 1, -2], #{ in_tangent: [3, 0, -7.5], out_tangent: [0, -4, 1] }], \
                [4.0, [5, 0, 0], #{ tangent: 2 }], [6.0, [6, 0, 0]], [7.0, [6, 0, 9]]]";
    let position = position(keys);
    assert_eq!(position.interpolation, Interpolation::CubicSpline);
    // The ends without a tangent point straight at each other.
    let first = [([0.0, 1.0], [1.0, 3.0]), ([1.0, 1.0], [0.0, 0.0]), ([2.0, -2.0], [-4.0, -7.5])];
    let second = [([1.0, 5.0], [0.0, 2.0]), ([1.0, 0.0], [-4.0, 2.0]), ([-2.0, 0.0], [1.0, 2.0])];
    let third = [([5.0, 6.0], [2.0, 0.5]), ([0.0, 0.0], [2.0, 0.0]), ([0.0, 0.0], [2.0, 0.0])];
    let last = [([6.0, 6.0], [0.0, 0.0]), ([0.0, 0.0], [0.0, 0.0]), ([0.0, 9.0], [9.0, 9.0])];
    for (times, parts) in [([0.5, 1.5], first), ([1.5, 4.0], second), ([4.0, 6.0], third), ([6.0, 7.0], last)]
    {
        for (part, (values, tangents)) in parts.into_iter().enumerate() {
            let largest_error =
                BezierReference { times, values, tangents, weights: THIRD }.largest_error(&position, part);
            assert!(largest_error < 1e-8, "{times:?} {part}: {largest_error}");
        }
    }
    // A key costs no more than one of "cubic".
    assert_eq!(position.times.len(), 5);
}

#[test]
fn key_sides_without_tangents_follow_the_how_option() {
    for (how, flat) in [("smooth", true), ("linear", false), ("catmull_rom", false), ("cubic", false)] {
        let keys = format!("[[0, [0, 0, 0]], [1, [1, 0, 0]], [2, [2, 0, 0], #{{ tangent: 5 }}]], \"{how}\"");
        let position = position(&keys);
        let start = if flat { 0.0 } else { 1.0 };
        let truth =
            BezierReference { times: [1.0, 2.0], values: [1.0, 2.0], tangents: [start, 5.0], weights: THIRD };
        let largest_error = truth.largest_error(&position, 0);
        assert!(largest_error < 1e-8, "{how}: {largest_error}");
    }
}

#[test]
fn weights_make_bezier_curves() {
    let of = |weights: [f64; 2]| {
        let [start, end] = weights;
        let keys = format!(
            "[[1, [0, 0, 0], #{{ out_tangent: [2, 0, -3], out_weight: {start} }}], \
             [3, [1, 4, 2], #{{ in_tangent: [-1, 0, 6], in_weight: {end} }}]]"
        );
        let position = position(&keys);
        let parts = [([0.0, 1.0], [2.0, -1.0]), ([0.0, 4.0], [0.0, 0.0]), ([0.0, 2.0], [-3.0, 6.0])];
        let truth =
            parts.map(|(values, tangents)| BezierReference { times: [1.0, 3.0], values, tangents, weights });
        truth.iter().enumerate().map(|(part, truth)| truth.largest_error(&position, part)).fold(0.0, f64::max)
    };
    for (weights, most) in [
        ([0.3, 0.4], 2e-6),
        ([0.8, 0.8], 4e-5),
        ([0.0, 0.6], 2e-5),
        ([0.0, 0.0], 1e-12),
        ([1.0, 0.0], 2e-4),
        // Upright in its middle: a hundredth of the change, for a tenth of a millisecond.
        ([1.0, 1.0], 0.06),
    ] {
        let largest_error = of(weights);
        println!("{weights:?}: {largest_error:.1e}");
        assert!(largest_error < most, "{weights:?}: {largest_error}");
    }
    // Without effect where it is the usual one.
    assert!(of(THIRD) < 1e-8);
}

#[test]
fn numbers_have_weights_of_their_own() {
    let keys =
        "[[0, [0, 0, 0], #{ tangent: 1, out_weight: [0.1, 0.5, 0.9] }], [2, [1, 1, 1], #{ in_tangent: 0 }]]";
    let position = position(keys);
    for (part, weight) in [0.1, 0.5, 0.9].into_iter().enumerate() {
        let weights = [weight, 1.0 / 3.0];
        let truth = BezierReference { times: [0.0, 2.0], values: [0.0, 1.0], tangents: [1.0, 0.0], weights };
        assert!(truth.largest_error(&position, part) < 1e-4);
    }
}

/// A curve of angles turns more than once around, and its samples follow it.
#[test]
fn angles_turn_along_their_tangents() {
    for (keys, truth) in [
        ("[[0, 0, #{ tangent: 900 }], [2, 720, #{ tangent: -300 }]]", ([0.0, 720.0], [900.0, -300.0])),
        ("[[0, 0, #{ out_tangent: 5000 }], [2, 0, #{ in_tangent: 5000 }]]", ([0.0, 0.0], [5000.0, 5000.0])),
    ] {
        let rotation = channel(&format!(".key(\"rotation\", {keys})"), Property::Rotation);
        let truth = BezierReference { times: [0.0, 2.0], values: truth.0, tangents: truth.1, weights: THIRD };
        for n in 0..1000 {
            let time = Time::from_secs(f64::from(n) / 500.0);
            let wanted = DQuat::from_rotation_y(truth.at(time.as_secs()).to_radians());
            let error = DQuat::from_array(rotation.at(time).unwrap()).angle_between(wanted).to_degrees();
            assert!(error < 0.2, "{keys} at {}: {error}°", time.as_secs());
        }
    }
}

#[test]
fn an_easing_forms_its_whole_span() {
    let keys = "[[0, [0, 0, 0], #{ tangent: 9 }], [1, [1, 0, 0], #{ ease: \"in_quad\", out_tangent: 4 }], [2, [1, 0, 0]]]";
    let position = position(keys);
    let at = |secs: f64| position.at(Time::from_secs(secs)).unwrap()[0];
    assert!((at(0.5) - 0.25).abs() < 1e-3 && (at(0.25) - 0.0625).abs() < 1e-3);
    let truth =
        BezierReference { times: [1.0, 2.0], values: [1.0, 1.0], tangents: [4.0, 0.0], weights: THIRD };
    assert!(truth.largest_error(&position, 0) < 1e-8);
    // An easing of all leaves the spans out that have tangents.
    let all = channel(
        ".key(\"position\", [[0, [0, 0, 0]], [1, [1, 0, 0]], [2, [2, 0, 0], #{ in_tangent: 0 }]], \"in_quad\")",
        Property::Translation,
    );
    assert!((all.at(Time::from_secs(0.5)).unwrap()[0] - 0.25).abs() < 1e-3);
    let truth =
        BezierReference { times: [1.0, 2.0], values: [1.0, 2.0], tangents: [1.0, 0.0], weights: THIRD };
    assert!(truth.largest_error(&all, 0) < 1e-8);
}

/// Within a microsecond, a tick and a jump, with the steepest tangents.
#[test]
fn stiff_tangents_stay_finite_and_reach_their_keys() {
    for gap in ["1e-6", "1e-9", "0.0", "1e5"] {
        for tangent in ["1e15", "-1e15", "1e6", "0"] {
            for weight in ["", ", weight: 1.0", ", weight: 0.0", ", weight: 0.999"] {
                let key = format!("#{{ tangent: {tangent}{weight} }}");
                let keys = format!(
                    "[[0.5, [0, 0, 0], {key}], [1.5, [1, 0, 2], {key}], [1.5 + {gap}, [2, 0, 0], {key}], [1e5 + 9.0, [3, 0, 0], {key}]]"
                );
                let position = position(&keys);
                let values = ["0.5", "1.5", "100009.0"].map(|secs| secs.parse().unwrap());
                for (secs, wanted) in values.into_iter().zip([0.0, if gap == "0.0" { 2.0 } else { 1.0 }, 3.0])
                {
                    let x = position.at(Time::from_secs(secs)).unwrap()[0];
                    assert!((x - wanted).abs() < 1e-6, "{keys} at {secs}: {x}");
                }
                assert!(position.values.iter().all(|value| value.is_finite()), "{keys}");
                for n in 0..300 {
                    let time = Time::from_secs(1.5) + Time(n * 10_007);
                    assert!(position.at(time).unwrap().iter().all(|v| v.is_finite()), "{keys}");
                }
            }
        }
    }
}

/// Everything that has keys takes tangents, in the unit of its values.
#[test]
fn all_properties_take_tangents() {
    let script = run_or_panic(
        r##"
stage(#{ length: 8.0 });
let hero = load("hero.toy");
let keys = [[0, 0.2, #{ out_tangent: 0.4 }], [2, 0.6, #{ in_tangent: 0 }]];
let anna = cast("anna", hero).key("scale", keys).key("tint", [[0, "black", #{ tangent: [1, 0, 0] }], [2, "white"]]);
anna.play(hero.clip("Walk")).weight(keys).then(hero.clip("Run")).from(4).speed(keys);
anna.play(hero.clip("Wave")).from(2.0).on("Spine..").layer_weight(keys).clip_time(keys);
camera("c").key("fov", [[0, 40, #{ out_tangent: 20 }], [2, 40, #{ in_tangent: -20 }]]);
sun().key("intensity", keys).key("color", [[0, "black", #{ tangent: 1 }], [2, "white"]]);
sky("studio").key("turn", [[0, 0, #{ tangent: 90 }], [2, 0]]);
effect("glow").key("strength", keys);
text("Title").key("opacity", keys).key("position", [[0, [0.5, 0.5], #{ tangent: [0.1, -0.1] }], [2, [0.5, 0.5]]]);
anna.joint("Head").key("position", [[0, [0, 0, 0], #{ tangent: 1 }], [2, [0, 0, 0]]]);
"##,
    );
    let stage = &script.stage;
    let truth = |values, tangents| BezierReference { times: [0.0, 2.0], values, tangents, weights: THIRD };
    let usual = truth([0.2, 0.6], [0.4, 0.0]);
    let (actor, of) = (&stage.actors[0], |channels: &[Channel], property| {
        channels.iter().find(|channel| channel.property == property).unwrap().clone()
    });
    let near = |truth: &BezierReference, channel: &Channel, part| {
        let largest_error = truth.largest_error(channel, part);
        assert!(largest_error < 1e-6, "{:?}: {largest_error}", channel.property);
    };
    near(&usual, &of(&actor.channels, Property::Scale), 2);
    near(&truth([0.0, 1.0], [1.0, 0.5]), &of(&actor.channels, Property::Tint), 0);
    near(&truth([0.0, 1.0], [0.0, 0.5]), &of(&actor.channels, Property::Tint), 1);
    let base = &actor.layers[0].cues;
    near(&usual, base[0].weight_keys.as_ref().unwrap(), 0);
    let Some(TimeRemapping::Speed(speed)) = base[1].time_remapping.as_deref() else { panic!() };
    near(&usual, &speed.keys, 0);
    // The integral of the spline, in closed form: (a + b) / 2 + (m − n) span / 12.
    let played = speed.played(Time::from_secs(2.0)) / Time::from_secs(1.0).0 as f64;
    assert!((played - 2.0 * (0.4 + (0.4 - 0.0) * 2.0 / 12.0)).abs() < 1e-9, "{played}");
    near(&usual, actor.layers[1].weight_keys.as_ref().unwrap(), 0);
    let Some(TimeRemapping::ClipTime(time)) = actor.layers[1].cues[0].time_remapping.as_deref() else {
        panic!()
    };
    near(&usual, time, 0);
    let [angle, turn] = [40f64, 20.0].map(f64::to_radians);
    near(&truth([angle; 2], [turn, -turn]), &of(&stage.cameras[0].channels, Property::FieldOfView), 0);
    near(&usual, &of(&stage.lights[0].channels, Property::Intensity), 0);
    near(&truth([0.0, 1.0], [1.0, 0.5]), &of(&stage.lights[0].channels, Property::Color), 2);
    let sky = &stage.sky.as_ref().unwrap().channels;
    near(&truth([0.0, 0.0], [90f64.to_radians(), 0.0]), &of(sky, Property::Turn), 0);
    near(&usual, &stage.effects[0].keys[0].1, 0);
    let title = &stage.layers_2d[0].channels;
    near(&usual, &of(title, Property::Opacity), 0);
    near(&truth([0.5, 0.5], [-0.1, 0.0]), &of(title, Property::Translation), 1);
}
