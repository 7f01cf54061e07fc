//! `cargo bench -p choreo-motion` measures choreo's numbers for the table in the design document.
//!
//! The input is generated: a 67-joint skeleton shaped like a Mixamo character, and two 15 s clips. Times are CPU time of one
//! thread, medians over many runs. The fastest run is printed in parentheses, since other work on the machine shares caches and
//! memory. `-- skinning`, `-- compression` and `-- sparse` measure one part alone. Errors are measured against an f64 evaluation
//! of the same clips.

#[path = "../tests/support/mod.rs"]
mod support;

use choreo_motion::{
    Clip, Crossfade, Curve, DualQuaternion, DualQuaternionSkinning, FrameRate, Interpolation, Level,
    LinearSkinning, LocalToModel, Path, Pose, Sample, Skeleton, StretchedDualQuaternion, Time, Transform,
    stretch_matrix,
};
use glam::{Affine3A, DAffine3, DQuat, DVec3, Mat3, Quat, Vec3};
use std::sync::Arc;
use support::Random;

const JOINTS: usize = 67;
const CLIP_SECS: f64 = 15.0;

fn main() {
    // `cargo test --benches` passes `--test`: then one quick round only.
    let quick = std::env::args().any(|a| a == "--test");
    let skeleton = mixamo_like_skeleton();
    if std::env::args().any(|a| a == "skinning") {
        return print_skinning_table(quick);
    }
    if std::env::args().any(|a| a == "compression") {
        let set =
            ("rotations 30 Hz, hips move, rest constant", generate_clips(&skeleton, ClipStyle::Typical));
        return print_compression_table(
            &skeleton,
            &[set, ("all T, R, S move, 30 Hz", generate_clips(&skeleton, ClipStyle::All))],
            quick,
        );
    }
    if std::env::args().any(|a| a == "sparse") {
        return print_sparse_key_table(&skeleton, quick);
    }
    println!("level: {:?}; {JOINTS} joints; ns a character, median (fastest)\n", Level::best());
    println!("crossfade: sample + sample + blend + local-to-model");
    println!("{:<44}{:>15}{:>15}{:>15}{:>12}", "clips", "one, hot", "1,000", "10,000", "error, mm");
    let sparse = generate_clips(&skeleton, ClipStyle::Sparse);
    let rate = FrameRate { num: 60, den: 1 };
    let baked = sparse.each_ref().map(|clip| clip.baked(rate).unwrap());
    let lost = baked[0].1;
    let baked = baked.map(|(clip, _)| clip);
    let sets = [
        ("rotations 30 Hz, hips move, rest constant", generate_clips(&skeleton, ClipStyle::Typical)),
        ("all T, R, S move, 30 Hz", generate_clips(&skeleton, ClipStyle::All)),
        ("sparse: rotations, own key times a joint", sparse),
        ("the sparse ones baked at 60 Hz", baked),
    ];
    for (name, clips) in &sets {
        let [hot, thousand, ten] =
            [1, 1_000, 10_000].map(|n| measure_crossfades(&skeleton, clips, n, Level::best(), quick));
        let error = worst_error_mm(&skeleton, clips);
        println!("{name:<44}{hot:>15}{thousand:>15}{ten:>15}{error:>12.5}");
    }
    let portable = measure_crossfades(&skeleton, &sets[0].1, 1, Level::Portable, quick);
    println!("{:<44}{portable:>15}", "the first, portable level");

    println!(
        "\none sample of a 15 s clip; a random time against the next frame in turns, median of the rounds"
    );
    println!("{:<44}{:>15}{:>15}{:>12}", "clip", "next frame", "random seek", "random/next");
    for (name, clips) in &sets {
        let [next, random] = [false, true].map(|random| measure_samples(&clips[0], random, quick));
        println!("{name:<44}{next:>15}{random:>15}{:>12.2}", seek_ratio(&clips[0], quick));
    }
    print_compression_table(&skeleton, &sets, quick);

    println!("baking lost {:.4}° at worst", lost.rotation_rad.to_degrees());
    println!("\nlocal-to-model alone: {}", measure_local_to_model(&skeleton, quick));
    print_skinning_table(quick);
}

/// Costs and savings of compression: bytes against dense f32 at 30 Hz (40 bytes per joint and key), the error measured at compression
/// and one found at other times in f64, and the time of a sample.
fn print_compression_table(skeleton: &Skeleton, sets: &[(&str, [Clip; 2])], quick: bool) {
    println!("\ncompressed clips, one sample");
    println!(
        "{:<44}{:>10}{:>10}{:>12}{:>12}{:>15}{:>15}{:>12}",
        "clip, tolerance",
        "bytes",
        "dense : 1",
        "stated, mm",
        "found, mm",
        "next frame",
        "random seek",
        "random/next"
    );
    for (name, clips) in sets {
        for tolerance in [1e-5, 1e-4, 1e-3] {
            let (clip, report) = clips[0].compressed(skeleton, tolerance).unwrap();
            let [next, random] = [false, true].map(|random| measure_samples(&clip, random, quick));
            println!(
                "{:<44}{:>10}{:>10.1}{:>12.4}{:>12.4}{next:>15}{random:>15}{:>12.2}",
                format!("{name}, {} mm", tolerance * 1e3),
                report.bytes[1],
                report.dense_bytes as f64 / report.bytes[1] as f64,
                report.worst_m * 1e3,
                largest_error_mm(skeleton, &clips[0], &clip),
                seek_ratio(&clip, quick),
            );
        }
    }
}

/// Compares clips with separate key times per joint with the same clips baked at 60 Hz, measured alternately.
fn print_sparse_key_table(skeleton: &Skeleton, quick: bool) {
    println!("separate key times per joint against the same baked at 60 Hz, {JOINTS} joints, ns");
    println!("{:<12}{:<14}{:>10}{:>10}{:>10}", "keys", "what", "separate", "baked", "ratio");
    for (name, style) in [("linear", ClipStyle::Sparse), ("cubic", ClipStyle::Cubic)] {
        let sparse = generate_clips(skeleton, style);
        let rate = FrameRate { num: 60, den: 1 };
        let baked = sparse.each_ref().map(|clip| clip.baked(rate).unwrap().0);
        let [next, random] = [false, true].map(|random| sample_times(&sparse[0], random));
        let sampled = |clips: &[Clip; 2], times: &[Time]| {
            let mut pose = Pose::identity(JOINTS);
            for &time in times {
                Sample { clip: &clips[0], time, pose: &mut pose }.run();
                std::hint::black_box(&mut pose);
            }
        };
        let rest = Pose::rest(skeleton);
        let faded = |clips: &[Clip; 2], times: &[Time]| {
            let mut scratch = [rest.clone(), rest.clone()];
            let mut out = vec![Affine3A::IDENTITY; JOINTS];
            for &time in times {
                Crossfade {
                    skeleton,
                    rest: &rest,
                    from: &clips[0],
                    from_time: time,
                    to: &clips[1],
                    to_time: time,
                    weight: 0.4,
                    scratch: &mut scratch,
                    model_from_joint: &mut out,
                }
                .run();
                std::hint::black_box(&mut out);
            }
        };
        type Round<'a> = &'a dyn Fn(&[Clip; 2], &[Time]);
        let rows: [(&str, Round, &[Time]); 4] = [
            ("crossfade", &faded, &next),
            ("random fade", &faded, &random),
            ("next frame", &sampled, &next),
            ("random seek", &sampled, &random),
        ];
        for (what, round, times) in rows {
            let mut took = [Vec::new(), Vec::new()];
            for _ in 0..if quick { 1 } else { 101 } {
                for (clips, took) in [&sparse, &baked].into_iter().zip(&mut took) {
                    let start = thread_nanos();
                    round(clips, times);
                    took.push((thread_nanos() - start) / times.len() as f64);
                }
            }
            let [own, baked] = took.map(|mut took| {
                took.sort_by(f64::total_cmp);
                took[took.len() / 2]
            });
            println!("{name:<12}{what:<14}{own:>10.0}{baked:>10.0}{:>10.2}", own / baked);
        }
    }
}

/// Largest distance in mm between a joint of `clip` and an f64 evaluation of `source`, over 500 times.
fn largest_error_mm(skeleton: &Skeleton, source: &Clip, clip: &Clip) -> f64 {
    let mut random = Random(41);
    let mut pose = Pose::rest(skeleton);
    let mut worst = 0.0f64;
    for _ in 0..500 {
        let time = Time(random.below(source.duration.0 as usize) as i64);
        Sample { clip, time, pose: &mut pose }.run();
        let wide =
            |t: Transform| (t.translation.as_dvec3(), t.rotation.as_dquat().normalize(), t.scale.as_dvec3());
        let got: Vec<_> = pose.iter().map(wide).collect();
        let wanted = support::model64(skeleton, &locals64(source, time));
        for (a, b) in support::model64(skeleton, &got).iter().zip(wanted) {
            worst = worst.max((a.translation - b.translation).length() * 1e3);
        }
    }
    worst
}

/// Ratio of the time per sample at random times to that at successive frames, measured alternately so that other work slows both.
fn seek_ratio(clip: &Clip, quick: bool) -> f64 {
    let mut pose = Pose::identity(JOINTS);
    let [next, random] = [false, true].map(|random| sample_times(clip, random));
    let mut round = |times: &[Time]| {
        let start = thread_nanos();
        for &time in times {
            Sample { clip, time, pose: &mut pose }.run();
            std::hint::black_box(&mut pose);
        }
        thread_nanos() - start
    };
    let mut ratios: Vec<f64> = (0..if quick { 1 } else { 301 })
        .map(|_| (round(&random), round(&next)))
        .map(|(r, n)| r / n.max(1.0))
        .collect();
    ratios.sort_by(f64::total_cmp);
    ratios[ratios.len() / 2]
}

fn sample_times(clip: &Clip, random: bool) -> Vec<Time> {
    let mut numbers = Random(9);
    (0..2_000)
        .map(|i| match random {
            true => Time(numbers.below(clip.duration.0 as usize) as i64),
            false => Time(i * 11_760_000).wrapped(clip.duration),
        })
        .collect()
}

/// ozz-animation's figure is that of the design document: SSE, 4 influences, position + normal.
fn print_skinning_table(quick: bool) {
    println!("\nskinning, position + normal, ns a vertex (ozz-animation 0.16, linear, 4 influences: 3.8)");
    println!("{:<44}{:>15}{:>15}", "method", "4 influences", "8 influences");
    let methods = [
        ("linear", SkinningMethod::Linear),
        ("dual quaternions", SkinningMethod::Dual),
        ("dual quaternions and stretches", SkinningMethod::Stretched),
    ];
    for (name, method) in methods {
        let [four, eight] = [4, 8].map(|n| measure_skinning(method, n, Level::best(), quick));
        println!("{name:<44}{four:>15}{eight:>15}");
    }
    for (name, level) in [("AVX2", Level::Avx2), ("portable", Level::Portable)] {
        let [linear, dual] = [SkinningMethod::Linear, SkinningMethod::Dual]
            .map(|method| measure_skinning(method, 4, level, quick));
        println!("{:<44}{linear:>15}", format!("linear, {name} level"));
        println!("{:<44}{dual:>15}", format!("dual quaternions, {name} level"));
    }
}

#[derive(Clone, Copy, PartialEq)]
enum SkinningMethod {
    Linear,
    Dual,
    Stretched,
}

/// CPU time of this thread in nanoseconds.
#[cfg(unix)]
fn thread_nanos() -> f64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    now.tv_sec as f64 * 1e9 + now.tv_nsec as f64
}

#[cfg(not(unix))]
fn thread_nanos() -> f64 {
    use std::{sync::OnceLock, time::Instant};
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_nanos() as f64
}

/// "median (fastest)" of the time that one of `items` takes.
fn measure(items: usize, quick: bool, mut round: impl FnMut()) -> String {
    round();
    let start = thread_nanos();
    round();
    // Runs of at least 0.2 ms, 40 to 2000 of them in about half a second.
    let once = (thread_nanos() - start).max(100.0);
    let repeat = (200_000.0 / once).ceil() as usize;
    let runs = if quick { 1 } else { (500_000_000.0 / (once * repeat as f64)).clamp(40.0, 2000.0) as usize };
    let mut times: Vec<f64> = (0..runs)
        .map(|_| {
            let start = thread_nanos();
            (0..repeat).for_each(|_| round());
            (thread_nanos() - start) / (items * repeat) as f64
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let digits = if times[0] < 20.0 { 2 } else { 0 };
    format!("{:.digits$} ({:.digits$})", times[runs / 2], times[0])
}

/// Hips, spine, head, arms with five fingers of four joints, legs: parents as in a Mixamo character.
fn mixamo_like_skeleton() -> Skeleton {
    let mut parents: Vec<Option<u32>> = vec![None];
    let chain = |parents: &mut Vec<Option<u32>>, root: u32, length: usize| {
        let mut parent = root;
        for _ in 0..length {
            parents.push(Some(parent));
            parent = parents.len() as u32 - 1;
        }
        parent
    };
    let chest = chain(&mut parents, 0, 3);
    chain(&mut parents, chest, 3);
    for _ in 0..2 {
        let hand = chain(&mut parents, chest, 4);
        (0..5).for_each(|_| _ = chain(&mut parents, hand, 4));
    }
    for _ in 0..2 {
        chain(&mut parents, 0, 5);
    }
    chain(&mut parents, chest, 2);
    assert_eq!(parents.len(), JOINTS);
    let mut random = Random(1);
    let rest = parents
        .iter()
        .map(|parent| Transform {
            translation: if parent.is_some() { Vec3::new(0.0, 0.12, 0.02) } else { Vec3::Y },
            rotation: Quat::from_array(random.rotation()),
            scale: Vec3::ONE,
        })
        .collect();
    Skeleton::new((0..JOINTS).map(|i| format!("j{i}")).collect(), parents, rest).unwrap()
}

#[derive(Clone, Copy, PartialEq)]
enum ClipStyle {
    Typical,
    All,
    Sparse,
    /// [`ClipStyle::Sparse`] with CUBICSPLINE keys.
    Cubic,
}

/// Two clips of smooth motion (a few harmonics per joint) at 30 Hz, or with ten to forty keys per joint.
fn generate_clips(skeleton: &Skeleton, style: ClipStyle) -> [Clip; 2] {
    let thirty: Arc<[Time]> = {
        let rate = FrameRate { num: 30, den: 1 };
        (0..=(CLIP_SECS * 30.0) as i64).map(|frame| rate.time_of(frame)).collect()
    };
    [11, 12].map(|seed| {
        let mut random = Random(seed);
        let mut curves = Vec::new();
        for (joint, rest) in skeleton.rest().iter().enumerate() {
            let mut times = Arc::clone(&thirty);
            if matches!(style, ClipStyle::Sparse | ClipStyle::Cubic) {
                let mut secs: Vec<f64> = (0..10 + random.below(30))
                    .map(|_| f64::from(random.signed() + 1.0) * 0.5 * CLIP_SECS)
                    .collect();
                secs.extend([0.0, CLIP_SECS]);
                secs.sort_by(f64::total_cmp);
                times = secs.into_iter().map(Time::from_secs).collect();
            }
            let joint = joint as u32;
            let [a, b, c] = [0; 3].map(|_| random.rotation());
            let mut add = |path, values: &dyn Fn(f64) -> Vec<f32>| {
                let cubic = style == ClipStyle::Cubic;
                let key = |t: &Time| {
                    let (at, h) = (t.as_secs(), 1e-3);
                    let slope = values(at + h).into_iter().zip(values(at - h));
                    let tangent = slope.map(|(after, before)| (after - before) / (2.0 * h) as f32);
                    let tangent: Vec<f32> = if cubic { tangent.collect() } else { Vec::new() };
                    [&tangent[..], &values(at), &tangent].concat()
                };
                let values = times.iter().flat_map(key).collect();
                let interpolation = if cubic { Interpolation::CubicSpline } else { Interpolation::Linear };
                curves.push(Curve { joint, path, interpolation, times: times.clone(), values });
            };
            let wave = |t: f64, k: [f32; 4]| {
                (t * (2.0 + f64::from(k[0])) + 6.0 * f64::from(k[1])).sin() as f32 * 0.5
                    + (t * (7.0 + f64::from(k[2])) + 6.0 * f64::from(k[3])).sin() as f32 * 0.1
            };
            add(Path::Rotation, &|t| {
                let turn = Quat::from_euler(glam::EulerRot::XYZ, wave(t, a), wave(t, b), wave(t, c));
                (rest.rotation * turn).to_array().to_vec()
            });
            let moving = style == ClipStyle::All;
            add(Path::Translation, &|t| {
                let sway = if moving || joint == 0 { 0.1 } else { 0.0 };
                let offset = Vec3::new(wave(t, b), wave(t, c), wave(t, a)) * sway;
                (rest.translation + offset).to_array().to_vec()
            });
            add(Path::Scale, &|t| {
                let sway = if moving { 0.02 } else { 0.0 };
                (Vec3::ONE + Vec3::splat(wave(t, a) * sway)).to_array().to_vec()
            });
        }
        Clip::new("bench".into(), JOINTS, curves).unwrap()
    })
}

fn measure_crossfades(
    skeleton: &Skeleton,
    clips: &[Clip; 2],
    count: usize,
    level: Level,
    quick: bool,
) -> String {
    let rest = Pose::rest(skeleton);
    let mut scratch = [rest.clone(), rest.clone()];
    let mut random = Random(5);
    let duration = clips[0].duration.0 as usize;
    let mut characters: Vec<(Time, Time, f32)> = (0..count)
        .map(|_| {
            let [a, b] = [0; 2].map(|_| Time(random.below(duration) as i64));
            (a, b, 0.5 + 0.45 * random.signed())
        })
        .collect();
    let mut out = vec![Affine3A::IDENTITY; JOINTS * count];
    measure(count, quick, || {
        for ((a, b, weight), matrices) in characters.iter_mut().zip(out.chunks_exact_mut(JOINTS)) {
            // The next frame at 60 Hz.
            *a = (*a + Time(11_760_000)).wrapped(clips[0].duration);
            *b = (*b + Time(11_760_000)).wrapped(clips[1].duration);
            Crossfade {
                skeleton,
                rest: &rest,
                from: &clips[0],
                from_time: *a,
                to: &clips[1],
                to_time: *b,
                weight: *weight,
                scratch: &mut scratch,
                model_from_joint: matrices,
            }
            .run_on(level);
        }
        std::hint::black_box(&mut out);
    })
}

fn measure_samples(clip: &Clip, random: bool, quick: bool) -> String {
    let mut pose = Pose::identity(JOINTS);
    let times = sample_times(clip, random);
    measure(times.len(), quick, || {
        for &time in &times {
            Sample { clip, time, pose: &mut pose }.run();
            std::hint::black_box(&mut pose);
        }
    })
}

fn measure_local_to_model(skeleton: &Skeleton, quick: bool) -> String {
    let pose = Pose::rest(skeleton);
    let mut out = vec![Affine3A::IDENTITY; JOINTS];
    measure(1, quick, || {
        LocalToModel { skeleton, pose: &pose, model_from_joint: &mut out }.run();
        std::hint::black_box(&mut out);
    })
}

fn measure_skinning(method: SkinningMethod, influences: usize, level: Level, quick: bool) -> String {
    const VERTICES: usize = 10_000;
    let mut random = Random(21);
    let mut vector = |_| Vec3::new(random.signed(), random.signed(), random.signed() + 1.5);
    let positions: Vec<Vec3> = (0..VERTICES).map(&mut vector).collect();
    let normals: Vec<Vec3> = (0..VERTICES).map(|i| vector(i).normalize()).collect();
    let matrices: Vec<Affine3A> = (0..JOINTS)
        .map(|_| Affine3A::from_rotation_translation(Quat::from_array(random.rotation()), Vec3::ONE))
        .collect();
    let joint_indices: Vec<u16> = (0..VERTICES * influences).map(|_| random.below(JOINTS) as u16).collect();
    let joint_weights = vec![1.0 / influences as f32; VERTICES * influences];
    let (mut out_positions, mut out_normals) = (positions.clone(), normals.clone());
    let wide = |m: &Affine3A| {
        DAffine3::from_mat3_translation(
            Mat3::from(m.matrix3).as_dmat3(),
            Vec3::from(m.translation).as_dvec3(),
        )
    };
    let maps: Vec<StretchedDualQuaternion> =
        matrices.iter().map(|m| StretchedDualQuaternion::of(wide(m))).collect();
    let motions: Vec<DualQuaternion> = maps.iter().map(DualQuaternion::from).collect();
    let stretches: Vec<Affine3A> = match method {
        SkinningMethod::Stretched => maps.iter().map(stretch_matrix).collect(),
        _ => Vec::new(),
    };
    measure(VERTICES, quick, || {
        if method == SkinningMethod::Linear {
            LinearSkinning {
                matrices: &matrices,
                influences,
                joint_indices: &joint_indices,
                joint_weights: &joint_weights,
                positions: &positions,
                normals: &normals,
                out_positions: &mut out_positions,
                out_normals: &mut out_normals,
            }
            .run_on(level);
        } else {
            DualQuaternionSkinning {
                motions: &motions,
                stretches: &stretches,
                influences,
                joint_indices: &joint_indices,
                joint_weights: &joint_weights,
                positions: &positions,
                normals: &normals,
                out_positions: &mut out_positions,
                out_normals: &mut out_normals,
            }
            .run_on(level);
        }
        std::hint::black_box((&mut out_positions, &mut out_normals));
    })
}

/// Worst distance of a joint's origin in model space from an f64 evaluation of the same keys (slerp) and the same blend.
fn worst_error_mm(skeleton: &Skeleton, clips: &[Clip; 2]) -> f64 {
    let rest = Pose::rest(skeleton);
    let mut scratch = [rest.clone(), rest.clone()];
    let mut out = vec![Affine3A::IDENTITY; JOINTS];
    let mut random = Random(77);
    let mut worst = 0.0f64;
    for _ in 0..500 {
        let [a, b] = [0; 2].map(|_| Time(random.below(clips[0].duration.0 as usize) as i64));
        let weight = (random.signed() + 1.0) / 2.0;
        Crossfade {
            skeleton,
            rest: &rest,
            from: &clips[0],
            from_time: a,
            to: &clips[1],
            to_time: b,
            weight,
            scratch: &mut scratch,
            model_from_joint: &mut out,
        }
        .run();
        let (a, b) = (locals64(&clips[0], a), locals64(&clips[1], b));
        let weight = f64::from(weight);
        let blended: Vec<_> = a
            .iter()
            .zip(&b)
            .map(|((ta, ra, sa), (tb, rb, sb))| {
                let rb = if ra.dot(*rb) < 0.0 { -*rb } else { *rb };
                let rotation = (*ra * (1.0 - weight) + rb * weight).normalize();
                (ta.lerp(*tb, weight), rotation, sa.lerp(*sb, weight))
            })
            .collect();
        for (got, wanted) in out.iter().zip(support::model64(skeleton, &blended)) {
            worst = worst.max(got.translation.as_dvec3().distance(wanted.translation) * 1000.0);
        }
    }
    worst
}

fn locals64(clip: &Clip, time: Time) -> Vec<(DVec3, DQuat, DVec3)> {
    let mut locals = vec![(DVec3::ZERO, DQuat::IDENTITY, DVec3::ONE); clip.joint_count()];
    for curve in clip.curves() {
        let value = support::evaluate(curve, time);
        let local = &mut locals[curve.joint as usize];
        match curve.path {
            Path::Translation => local.0 = DVec3::from_slice(&value),
            Path::Rotation => local.1 = DQuat::from_slice(&value),
            Path::Scale => local.2 = DVec3::from_slice(&value),
            Path::Weights(_) => {}
        }
    }
    locals
}
