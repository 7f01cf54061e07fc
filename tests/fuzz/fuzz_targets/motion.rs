//! Fields of each job of motion: lists of any length, weights, times and key values of any bits. Whatever `check()` lets
//! through runs, gives the same bits at every level, and finite numbers where the numbers given are sane.
#![no_main]

use choreo_motion::*;
use glam::{Affine3A, DAffine3, Mat4, Quat, Vec3};
use libfuzzer_sys::arbitrary::{Arbitrary, Result, Unstructured};
use libfuzzer_sys::fuzz_target;

/// Any bits, or mostly a number that a file could hold.
fn float(u: &mut Unstructured) -> Result<f32> {
    Ok(match u.int_in_range(0..=7)? {
        0 => f32::from_bits(u.arbitrary()?),
        1 => [0.0, -0.0, 1.0, -1.0, f32::MIN_POSITIVE, 1e15, -1e15, 1e-15, 0.5, 2.0][u.choose_index(10)?],
        _ => f32::from(u.arbitrary::<i16>()?) / 1000.0,
    })
}

fn time(u: &mut Unstructured) -> Result<Time> {
    Ok(match u.int_in_range(0..=3)? {
        0 => Time(u.arbitrary()?),
        _ => Time::from_secs(f64::from(u.arbitrary::<i16>()?) / 1000.0),
    })
}

fn vec3(u: &mut Unstructured) -> Result<Vec3> {
    Ok(Vec3::new(float(u)?, float(u)?, float(u)?))
}

fn transform(u: &mut Unstructured) -> Result<Transform> {
    let rotation = Quat::from_xyzw(float(u)?, float(u)?, float(u)?, float(u)?);
    let rotation = if rotation.length_squared().is_normal() { rotation.normalize() } else { Quat::IDENTITY };
    Ok(Transform { translation: vec3(u)?, rotation, scale: vec3(u)? })
}

fn list<T>(
    u: &mut Unstructured,
    most: usize,
    make: impl Fn(&mut Unstructured) -> Result<T>,
) -> Result<Vec<T>> {
    let count = u.int_in_range(0..=most)?;
    (0..count).map(|_| make(u)).collect()
}

fn skeleton(u: &mut Unstructured) -> Result<Option<Skeleton>> {
    let joints = u.int_in_range(0..=20usize)?;
    let mut parents = Vec::new();
    for i in 0..joints {
        // Mostly a parent that comes before.
        let parent = u.int_in_range(0..=i as u32 + 1)?;
        parents.push(if parent as usize > i {
            u.arbitrary::<Option<u32>>()?.map(|p| p % 30)
        } else {
            parent.checked_sub(1)
        });
    }
    let names = (0..joints).map(|i| format!("joint {}", i % 15)).collect();
    let rest = (0..joints).map(|_| transform(u)).collect::<Result<Vec<_>>>()?;
    Ok(Skeleton::new(names, parents, rest).ok())
}

fn clip(u: &mut Unstructured, joints: usize) -> Result<Option<Clip>> {
    let curves = list(u, 12, |u| {
        let path = [Path::Translation, Path::Rotation, Path::Scale, Path::Weights(u.int_in_range(0..=5)?)];
        let path = path[u.choose_index(4)?];
        let interpolation =
            [Interpolation::Step, Interpolation::Linear, Interpolation::CubicSpline][u.choose_index(3)?];
        let mut times = list(u, 6, time)?;
        if u.ratio(7, 8)? {
            times.sort_unstable();
            times.dedup();
        }
        let stride = path.width() * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let count = if u.ratio(15, 16)? { times.len() * stride } else { u.int_in_range(0..=40)? };
        let values = (0..count).map(|_| float(u)).collect::<Result<Vec<_>>>()?;
        let joint = if u.ratio(15, 16)? {
            u.int_in_range(0..=joints.saturating_sub(1) as u32)?
        } else {
            u.arbitrary()?
        };
        Ok(Curve { joint, path, interpolation, times: times.into(), values: values.into() })
    })?;
    Ok(Clip::new("fuzz".into(), joints, curves).ok())
}

fn is_within_limits(t: &Transform) -> bool {
    let small = |v: f32| v.abs() < 1e12;
    t.translation.to_array().into_iter().chain(t.scale.to_array()).all(small)
}

fn bits(pose: &Pose) -> Vec<u32> {
    pose.iter()
        .flat_map(|t| {
            let (a, b, c) = (t.translation.to_array(), t.rotation.to_array(), t.scale.to_array());
            a.into_iter().chain(b).chain(c).map(number).collect::<Vec<_>>()
        })
        .collect()
}

/// Not-a-number is one number here: which of its many bits come out is left open by IEEE 754.
fn number(v: f32) -> u32 {
    if v.is_nan() { f32::NAN.to_bits() } else { v.to_bits() }
}

fn matrix_bits(m: &[Affine3A]) -> Vec<u32> {
    m.iter().flat_map(|m| m.to_cols_array()).map(number).collect()
}

fn poses(u: &mut Unstructured) -> Result<()> {
    let Some(skeleton) = skeleton(u)? else { return Ok(()) };
    let joints = skeleton.len();
    let (Some(a), Some(b)) = (clip(u, joints)?, clip(u, joints)?) else { return Ok(()) };
    let (ta, tb, weight) = (time(u)?, time(u)?, float(u)?);
    let wrong = u.ratio(1, 16)?;
    let mut results = Vec::new();
    for level in [Level::Portable, Level::best()] {
        let mut pose = Pose::rest(&skeleton);
        let mut sample = Sample { clip: &a, time: ta, pose: &mut pose };
        assert!(sample.check().is_ok());
        sample.run_on(level);
        let mut other = Pose::rest(&skeleton);
        Sample { clip: &b, time: tb, pose: &mut other }.run_on(level);
        let mask: Vec<f32> =
            (0..joints + usize::from(wrong)).map(|j| j as f32 / (joints + 1) as f32).collect();
        let mut out = Pose::identity(0);
        let mut blend = Blend { from: &pose, to: &other, weight, mask: Some(&mask), out: &mut out };
        if blend.check().is_ok() {
            blend.run();
            assert!(out.iter().all(|t| !is_within_limits(&t) || t.rotation.is_finite()), "{out:?}");
        }
        let mut model = vec![Affine3A::IDENTITY; joints];
        LocalToModel { skeleton: &skeleton, pose: &pose, model_from_joint: &mut model }.run_on(level);
        let mut scratch = [Pose::rest(&skeleton), Pose::rest(&skeleton)];
        let mut faded = vec![Affine3A::IDENTITY; joints];
        let rest = Pose::rest(&skeleton);
        let mut fade = Crossfade {
            skeleton: &skeleton,
            rest: &rest,
            from: &a,
            from_time: ta,
            to: &b,
            to_time: tb,
            weight,
            scratch: &mut scratch,
            model_from_joint: &mut faded,
        };
        if fade.check().is_ok() {
            fade.run_on(level);
        }
        results.push((bits(&pose), bits(&out), matrix_bits(&model), matrix_bits(&faded)));
    }
    assert_eq!(results[0], results[1], "levels differ");
    let mut weights = [0.5f32; 4];
    a.sample_weights(u.arbitrary()?, ta, &mut weights);
    let (bound, _) = bind_clip(&a, &skeleton, &skeleton);
    let mut pose = Pose::rest(&skeleton);
    Sample { clip: &bound, time: ta, pose: &mut pose }.run();
    assert_eq!(bits(&pose), results[0].0, "bound to its own skeleton");
    if a.duration < Time::from_secs(100.0) {
        let rate = FrameRate { num: u.int_in_range(1..=240)?, den: u.int_in_range(1..=10)? };
        let _ = a.baked(rate);
    }
    Ok(())
}

/// A compressed clip gives the same bits at every SIMD level, and its reported error is within the tolerance.
fn compressed(u: &mut Unstructured) -> Result<()> {
    let Some(skeleton) = skeleton(u)? else { return Ok(()) };
    let Some(clip) = clip(u, skeleton.len())? else { return Ok(()) };
    if clip.duration > Time::from_secs(100.0) {
        return Ok(());
    }
    let tolerance = [1e-4, 1e-6, 0.1, f64::from(float(u)?)][u.choose_index(4)?];
    let Ok((small, told)) = clip.compressed(&skeleton, tolerance) else { return Ok(()) };
    assert!(told.worst_m <= tolerance, "{told:?}");
    let times = [time(u)?, time(u)?, clip.duration];
    let poses = [Level::Portable, Level::best()].map(|level| {
        times.map(|time| {
            let mut pose = Pose::rest(&skeleton);
            Sample { clip: &small, time, pose: &mut pose }.run_on(level);
            bits(&pose)
        })
    });
    assert_eq!(poses[0], poses[1], "levels differ");
    Ok(())
}

fn vertices(u: &mut Unstructured) -> Result<()> {
    let matrix = |u: &mut Unstructured| -> Result<Affine3A> {
        let t = transform(u)?;
        Ok(Affine3A::from_scale_rotation_translation(t.scale, t.rotation, t.translation))
    };
    let model = list(u, 6, matrix)?;
    let joints = list(u, 6, |u| u.int_in_range(0..=6u32))?;
    let bind = list(u, 6, |u| Ok(Mat4::from(matrix(u)?)))?;
    let mut matrices = vec![Affine3A::IDENTITY; joints.len()];
    let mut job =
        SkinMatrices { model_from_joint: &model, joints: &joints, inverse_bind: &bind, out: &mut matrices };
    if job.check().is_ok() {
        job.run();
    }
    let positions = list(u, 20, vec3)?;
    let normals = if u.arbitrary()? { positions.clone() } else { list(u, 3, vec3)? };
    let influences = u.int_in_range(0..=9usize)?;
    let count = if u.ratio(7, 8)? { positions.len() * influences } else { u.int_in_range(0..=64)? };
    let joint_indices = (0..count).map(|_| u.int_in_range(0..=6u16)).collect::<Result<Vec<_>>>()?;
    let joint_weights = (0..count).map(|_| float(u)).collect::<Result<Vec<_>>>()?;
    let mut out_positions = vec![Vec3::ZERO; positions.len()];
    let mut out_normals = vec![Vec3::ZERO; normals.len()];
    let mut job = LinearSkinning {
        matrices: &matrices,
        influences,
        joint_indices: &joint_indices,
        joint_weights: &joint_weights,
        positions: &positions,
        normals: &normals,
        out_positions: &mut out_positions,
        out_normals: &mut out_normals,
    };
    if job.check().is_ok() {
        job.run();
    }
    let wide = |m: &Affine3A| DAffine3 {
        matrix3: glam::Mat3::from(m.matrix3).as_dmat3(),
        translation: m.translation.as_dvec3(),
    };
    let carriers: Vec<StretchedDualQuaternion> =
        matrices.iter().map(|m| StretchedDualQuaternion::of(wide(m))).collect();
    let motions: Vec<DualQuaternion> = carriers.iter().map(DualQuaternion::from).collect();
    let stretches: Vec<Affine3A> =
        if u.arbitrary()? { carriers.iter().map(stretch_matrix).collect() } else { Vec::new() };
    let dual = [Level::Portable, Level::best()].map(|level| {
        let mut out_positions = vec![Vec3::ZERO; positions.len()];
        let mut out_normals = vec![Vec3::ZERO; normals.len()];
        let mut job = DualQuaternionSkinning {
            motions: &motions,
            stretches: &stretches,
            influences,
            joint_indices: &joint_indices,
            joint_weights: &joint_weights,
            positions: &positions,
            normals: &normals,
            out_positions: &mut out_positions,
            out_normals: &mut out_normals,
        };
        if job.check().is_ok() {
            job.run_on(level);
        }
        out_positions.iter().chain(&out_normals).flat_map(|v| v.to_array().map(number)).collect::<Vec<_>>()
    });
    assert_eq!(dual[0], dual[1], "levels differ");
    let targets = list(u, 4, |u| list(u, 20, vec3))?;
    let targets: Vec<&[Vec3]> = targets.iter().map(Vec::as_slice).collect();
    let weights = list(u, 5, float)?;
    let mut values = positions;
    let mut job = Morph { targets: &targets, weights: &weights, values: &mut values };
    if job.check().is_ok() {
        job.run();
    }
    Ok(())
}

fn playback(u: &mut Unstructured) -> Result<()> {
    let repeat = [Repeat::Once, Repeat::Loop, Repeat::PingPong][u.choose_index(3)?];
    let playback = Playback { speed: f64::arbitrary(u)?, trim: (time(u)?, time(u)?), repeat };
    if playback.check().is_ok() {
        let at = playback.clip_time(time(u)?);
        assert!(playback.trim.0 <= at && at <= playback.trim.1, "{playback:?}: {at:?}");
    }
    let rate = FrameRate { num: u.int_in_range(1..=u32::MAX)?, den: u.int_in_range(1..=u32::MAX)? };
    rate.frames_in(time(u)?);
    rate.time_of(u.arbitrary()?);
    let _ = FrameRate::from_fps(f64::arbitrary(u)?);
    Time::from_secs(f64::arbitrary(u)?);
    Ok(())
}

fuzz_target!(|bytes: &[u8]| {
    let Some((kind, rest)) = bytes.split_first() else { return };
    let mut u = Unstructured::new(rest);
    // Too few bytes is no finding.
    let _ = match kind % 8 {
        0..4 => poses(&mut u),
        4..6 => vertices(&mut u),
        6 => compressed(&mut u),
        _ => playback(&mut u),
    };
});
