//! Sampling rate of baked motion: error against frames per second.

use crate::{BUDGET_SECS, Section};
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::{Clip, Curve, FrameRate, Interpolation, Path, Pose, Sample, Time};
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// Frequencies of human motion: walking has about 1 Hz, a waving hand 3 Hz, a shiver 8 Hz.
const FREQUENCIES_HZ: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
const AMPLITUDE_DEGREES: f64 = 30.0;
/// Distance in metres from the joint to the measured point: a forearm with its hand.
const ARM_LENGTH: f64 = 0.45;
const CLIP_SECS: f64 = 4.0;

pub(crate) fn section() -> Result<Section, String> {
    let methods: Vec<(u32, Interpolation)> = [24, 30, 60, 120, 240]
        .map(|rate| (rate, Interpolation::Linear))
        .into_iter()
        .chain([15, 30, 60].map(|rate| (rate, Interpolation::CubicSpline)))
        .collect();
    let name = |(rate, how): &(u32, Interpolation)| match how {
        Interpolation::CubicSpline => format!("splines, {rate} Hz"),
        _ => format!("slerp, {rate} Hz"),
    };
    let mut clips = Vec::new();
    for method in &methods {
        clips.push(
            FREQUENCIES_HZ
                .iter()
                .map(|hz| swinging_clip(*hz, *method))
                .collect::<Result<Vec<Clip>, String>>()?,
        );
    }
    let mut by_hertz = vec![vec![ErrorStats::default(); FREQUENCIES_HZ.len()]; methods.len()];
    for (method, clips) in clips.iter().enumerate() {
        for (clip, (hz, errors)) in clips.iter().zip(FREQUENCIES_HZ.iter().zip(&mut by_hertz[method])) {
            for i in 0..3000 {
                let secs = CLIP_SECS * ((f64::from(i) * 0.618_033_988_75) % 1.0);
                errors.add((hand_position(clip, secs) - reference_hand_position(*hz, secs)).length() * 1e3);
            }
        }
    }
    // 2 Hz is quick for a whole limb.
    let typical = 1;
    let mut choice =
        Choice::new("baking", "At what rate, and with which curves, is resampled motion stored?");
    choice.error_unit = "mm";
    choice.reference = format!(
        "a hand {ARM_LENGTH} m from its joint that swings by ±{AMPLITUDE_DEGREES}° twice a second, a closed form in f64"
    );
    choice.per = "sample of 8 joints".into();
    let mut cases: Vec<Case> = clips.iter().map(|clips| sampling_case(&clips[typical])).collect();
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    for (((method, errors), nanos), clips) in methods.iter().zip(&by_hertz).zip(nanos).zip(&clips) {
        let error = &errors[typical];
        let bytes: usize = clips[typical].curves().iter().take(1).map(|c| c.values.len() * 4).sum();
        let row = Row::new(name(method))
            .error(error.worst, error.mean())
            .nanos(nanos)
            .bytes(bytes as f64 / CLIP_SECS);
        choice.rows.push(row);
    }
    let chosen = name(&(60, Interpolation::Linear));
    choice.choose(
        &chosen,
        "the rate of Clip::baked where sparse clips are resampled for speed; clips of files stay as authored",
    );
    choice.rows.iter_mut().for_each(|r| r.note = "size: a second of one joint".into());
    let titles: Vec<String> = FREQUENCIES_HZ.iter().map(|h| format!(">{h} Hz")).collect();
    let mut columns: Vec<(&str, &'static str)> = vec![("worst error in mm, motion of", "way")];
    columns.extend(titles.iter().map(|t| (t.as_str(), "hertz")));
    let mut table = Table::new("By the speed of the motion", &columns);
    for (method, errors) in methods.iter().zip(&by_hertz) {
        let cells = errors.iter().map(|e| Cell::number(quantity(e.worst), e.worst));
        table.rows.push([Cell::text(name(method))].into_iter().chain(cells).collect());
    }
    Ok(Section {
        title: "Sampling rate of baked motion",
        text: "Between two keys slerp takes a shortcut: twice the rate has a quarter of the error. Splines \
               with exact tangents have a sixteenth, but need three times as many numbers and more time."
            .into(),
        choices: vec![choice],
        tables: vec![table],
        off_front: vec![(
            "baking",
            "30 and 240 Hz cost the same time, since two rows are read at any rate; a higher rate costs \
             size.",
        )],
    })
}

fn angle(hz: f64, secs: f64) -> f64 {
    AMPLITUDE_DEGREES.to_radians() * libm::sin(std::f64::consts::TAU * hz * secs)
}

fn rotation(hz: f64, secs: f64) -> DQuat {
    DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), angle(hz, secs))
}

fn reference_hand_position(hz: f64, secs: f64) -> DVec3 {
    rotation(hz, secs) * (DVec3::Y * ARM_LENGTH)
}

fn hand_position(clip: &Clip, secs: f64) -> DVec3 {
    let mut pose = Pose::identity(8);
    Sample { clip, time: Time::from_secs(secs), pose: &mut pose }.run();
    pose.get(0).rotation.as_dquat() * (DVec3::Y * ARM_LENGTH)
}

/// A clip with eight joints that all swing.
fn swinging_clip(hz: f64, (rate, interpolation): (u32, Interpolation)) -> Result<Clip, String> {
    let rate = FrameRate { num: rate, den: 1 };
    let frames = rate.frames_in(Time::from_secs(CLIP_SECS));
    let times: Arc<[Time]> = (0..=frames).map(|f| rate.time_of(f)).collect();
    let mut values = Vec::new();
    for time in times.iter() {
        let secs = time.as_secs();
        let q = rotation(hz, secs);
        if interpolation == Interpolation::CubicSpline {
            // Derivative of the quaternion, ½ ω q.
            let speed = AMPLITUDE_DEGREES.to_radians()
                * std::f64::consts::TAU
                * hz
                * libm::cos(std::f64::consts::TAU * hz * secs);
            let omega = DVec3::new(0.6, 0.0, 0.8) * (speed * 0.5);
            let tangent = (DQuat::from_xyzw(omega.x, omega.y, omega.z, 0.0) * q).as_quat().to_array();
            values.extend(tangent);
            values.extend(q.as_quat().to_array());
            values.extend(tangent);
        } else {
            values.extend(q.as_quat().to_array());
        }
    }
    let values: Arc<[f32]> = values.into();
    let curve = |joint| Curve {
        joint,
        path: Path::Rotation,
        interpolation,
        times: times.clone(),
        values: values.clone(),
    };
    Clip::new("swing".into(), 8, (0..8).map(curve).collect()).map_err(|e| e.to_string())
}

fn sampling_case(clip: &Clip) -> Case<'_> {
    const TIME_COUNT: usize = 64;
    let mut pose = Pose::identity(8);
    Case::new(TIME_COUNT, move || {
        for i in 0..TIME_COUNT {
            let time =
                Time(clip.duration.0 / TIME_COUNT as i64 * ((i * 29 + 11) % TIME_COUNT) as i64 + 12_345);
            Sample { clip, time, pose: &mut pose }.run();
            std::hint::black_box(&pose);
        }
    })
}
