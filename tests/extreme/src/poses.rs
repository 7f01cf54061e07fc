//! Clips, blending and chains of joints.

use crate::{Case, refused};
use choreo_motion::{
    BlendOnto, Clip, Curve, Interpolation, LocalToModel, Path, Playback, Pose, Sample, Skeleton, Time,
    Transform,
};
use choreo_stage::{Channel, Property, Tangents};
use glam::{Affine3A, DAffine3, Quat, Vec3};

pub const CASES: &[Case] = &[
    Case::new("1,000-deep chain", "metres from f64", 2e-4, || model(1000, 1000, |_| Vec3::ONE).0),
    Case::new("10,000 joints", "metres from f64", 1e-4, || model(10_000, 50, |_| Vec3::ONE).0),
    Case::new("scale 0", "share off f64", 1e-6, || {
        model(10, 10, |i| if i == 3 { Vec3::ZERO } else { Vec3::ONE }).1
    }),
    Case::new("scale -1, rotations below", "share off f64", 1e-5, || {
        model(10, 10, |i| if i == 3 { Vec3::new(-1.0, 1.0, 1.0) } else { Vec3::ONE }).1
    }),
    Case::new("scale 1e8", "share off f64", 1e-5, || {
        model(10, 10, |i| Vec3::splat(if i == 3 { 1e8 } else { 1.0 })).1
    }),
    Case::new("scale 1e-8", "share off f64", 1e-5, || {
        model(10, 10, |i| Vec3::splat(if i == 3 { 1e-8 } else { 1.0 })).1
    }),
    Case::new("scale 1, 1e4, 1e-4, rotations below", "share off f64", 1e-5, || {
        model(10, 10, |i| if i == 3 { Vec3::new(1.0, 1e4, 1e-4) } else { Vec3::ONE }).1
    }),
    Case::new("antipodal quaternions", "radians from the first", 1e-6, || turned(&[TILTED, -TILTED], 0.37)),
    Case::new("unnormalized quaternions", "off unit length", 1e-6, || {
        sampled(&[TILTED * 3.0, TILTED * 0.01], 0.5).map_or(f64::NAN, |q| f64::from((q.length() - 1.0).abs()))
    }),
    Case::new("keys half a turn apart", "off unit length", 1e-6, || {
        sampled(&[Quat::IDENTITY, Quat::from_xyzw(0.0, 1.0, 0.0, 0.0)], 0.5)
            .map_or(f64::NAN, |q| f64::from((q.length() - 1.0).abs()))
    }),
    Case::new("a quaternion of zeros", "named error (0) or not (1)", 0.0, || {
        let zero = clip(&[Time::ZERO], &[Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)]);
        if zero.is_err() || zero.is_ok_and(|c| sample(&c, Time::ZERO).is_finite()) { 0.0 } else { 1.0 }
    }),
    Case::new("equal key times", "named error (0) or not (1)", 0.0, || {
        refused(clip(&[Time::ZERO, Time::ZERO], &[TILTED, TILTED]).map(drop), "curve 0")
    }),
    Case::new("stage keys a microsecond apart", "metres out of their range", 1e-9, stage_keys),
    Case::new("one key", "radians from it", 1e-6, || turned(&[TILTED], 100.0)),
    Case::new("1,000,000 keys", "radians from the key asked for", 1e-5, many_keys),
    Case::new("100 h into a loop", "ticks off", 0.0, || {
        let play = Playback::whole(Time::from_secs(1.75));
        let elapsed = Time(Time::from_secs(1.75).0 * 205_714 + 12_345);
        (play.clip_time(elapsed).0 - 12_345).abs() as f64
    }),
    Case::new("weight NaN", "named error (0) or not (1)", 0.0, || {
        refused(blend(f32::NAN, None).1, "must be 0..=1")
    }),
    Case::new("weight negative", "named error (0) or not (1)", 0.0, || {
        refused(blend(-0.5, None).1, "must be 0..=1")
    }),
    Case::new("weights summing to 0", "radians from the pose below", 0.0, || blend(1.0, Some(0.0)).0),
    Case::new("weights summing to 1e-30", "radians from the pose below", 1e-6, || blend(1e-30, None).0),
];

/// A position with keyframes at 0, 1, 2 and 3 m, one second apart except for the gap, interpolated as "cubic" in scripts.
fn stage_keys() -> f64 {
    let times = [0.0, 1.0, 1.000_001, 2.000_001].map(Time::from_secs);
    let places: Vec<Vec<f64>> = (0..4).map(|i| vec![f64::from(i), 0.0, 0.0]).collect();
    let tangents = Tangents::Limited.of(&times, &places, true);
    let key = |(tangent, place): (&Vec<f64>, &Vec<f64>)| [&tangent[..], place, tangent].concat();
    let channel = Channel {
        property: Property::Translation,
        interpolation: Interpolation::CubicSpline,
        times: times.to_vec(),
        values: tangents.iter().zip(&places).flat_map(key).collect(),
    };
    let off = |i: i32| {
        let x = channel.at(Time::from_secs(f64::from(i) / 500.0)).map_or(f64::NAN, |v| v[0]);
        let (low, high) = if i <= 500 { (0.0, 1.0) } else { (2.0, 3.0) };
        if (low..=high).contains(&x) { 0.0 } else { (x - low).abs().min((x - high).abs()) }
    };
    (0..=1000).map(off).sum()
}

const TILTED: Quat = Quat::from_xyzw(0.6, 0.0, 0.0, 0.8);

/// Errors of model-space matrices against f64: largest position error in metres, and largest error of a number relative to the largest in
/// its matrix.
fn model(count: usize, depth: usize, scale: fn(usize) -> Vec3) -> (f64, f64) {
    let rest: Vec<Transform> = (0..count)
        .map(|i| Transform {
            translation: Vec3::new(0.0, 0.1, 0.0),
            rotation: Quat::from_rotation_x(0.3 + i as f32).normalize()
                * Quat::from_rotation_z(0.2 * i as f32).normalize(),
            scale: scale(i),
        })
        .map(|t| Transform { rotation: t.rotation.normalize(), ..t })
        .collect();
    let names = (0..count).map(|i| i.to_string()).collect();
    let parents: Vec<Option<u32>> =
        (0..count).map(|i| (!i.is_multiple_of(depth)).then(|| (i - 1) as u32)).collect();
    let Ok(skeleton) = Skeleton::new(names, parents.clone(), rest.clone()) else {
        return (f64::NAN, f64::NAN);
    };
    let mut out = vec![Affine3A::IDENTITY; count];
    LocalToModel { skeleton: &skeleton, pose: &Pose::rest(&skeleton), model_from_joint: &mut out }.run();
    let mut exact: Vec<DAffine3> = Vec::new();
    let (mut metres, mut share) = (0.0f64, 0.0f64);
    for i in 0..count {
        let t = rest[i];
        let (s, r, p) = (t.scale.as_dvec3(), t.rotation.as_dquat(), t.translation.as_dvec3());
        let local = DAffine3::from_scale_rotation_translation(s, r, p);
        exact.push(parents[i].map_or(local, |p| exact[p as usize] * local));
        let (wanted, got) = (exact[i].to_cols_array(), out[i].to_cols_array());
        let largest = wanted.iter().fold(0.1f64, |a, b| a.max(b.abs()));
        for (a, b) in wanted.iter().zip(got) {
            let off = (a - f64::from(b)).abs();
            share = if off.is_finite() { share.max(off / largest) } else { f64::NAN };
        }
        metres = metres.max((exact[i].translation - Vec3::from(out[i].translation).as_dvec3()).length());
    }
    (metres, share)
}

fn clip(times: &[Time], keys: &[Quat]) -> Result<Clip, String> {
    let curve = Curve {
        joint: 0,
        path: Path::Rotation,
        interpolation: Interpolation::Linear,
        times: times.into(),
        values: keys.iter().flat_map(|q| q.to_array()).collect::<Vec<f32>>().into(),
    };
    Clip::new("clip".into(), 1, vec![curve]).map_err(|e| e.to_string())
}

fn sample(clip: &Clip, time: Time) -> Quat {
    let mut pose = Pose::identity(1);
    Sample { clip, time, pose: &mut pose }.run();
    pose.get(0).rotation
}

/// Samples a clip with keyframes one second apart.
fn sampled(keys: &[Quat], secs: f64) -> Option<Quat> {
    let times: Vec<Time> = (0..keys.len()).map(|i| Time::from_secs(i as f64)).collect();
    clip(&times, keys).ok().map(|clip| sample(&clip, Time::from_secs(secs)))
}

fn angle(a: Quat, b: Quat) -> f64 {
    let q = (a.as_dquat().inverse() * b.as_dquat()).normalize();
    2.0 * libm::atan2(q.xyz().length(), q.w.abs())
}

fn turned(keys: &[Quat], secs: f64) -> f64 {
    sampled(keys, secs).map_or(f64::NAN, |q| angle(q, TILTED))
}

fn many_keys() -> f64 {
    let key = |i: usize| Quat::from_rotation_y((i % 100) as f32 * 0.02);
    let times: Vec<Time> = (0..1_000_000).map(|i| Time(i * 1000)).collect();
    let keys: Vec<Quat> = (0..1_000_000).map(key).collect();
    let Ok(clip) = clip(&times, &keys) else { return f64::NAN };
    [0usize, 1, 499_999, 777_777, 999_999]
        .map(|i| angle(sample(&clip, times[i]), key(i)))
        .into_iter()
        .fold(0.0, f64::max)
}

/// Angle in radians by which a blend rotates the pose below, and the result of its check.
fn blend(weight: f32, mask: Option<f32>) -> (f64, Result<(), String>) {
    let (mut below, mut above) = (Pose::identity(1), Pose::identity(1));
    above.set(0, Transform { rotation: TILTED, ..Transform::IDENTITY });
    let mask = mask.map(|m| [m]);
    let mut job = BlendOnto { pose: &mut below, to: &above, weight, mask: mask.as_ref().map(|m| &m[..]) };
    let said = job.check().map_err(|e| e.to_string());
    job.run();
    (angle(below.get(0).rotation, Quat::IDENTITY), said)
}
