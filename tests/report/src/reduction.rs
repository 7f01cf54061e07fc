//! Keyframe reduction: error and savings by tolerance.

use crate::{BUDGET_SECS, Section, scenes};
use choreo_bench::plots::{Choice, Row};
use choreo_bench::reference::{self, ErrorStats};
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::edit::reduce::KeptTimes;
use choreo_motion::{Clip, FrameRate, Pose, Sample, Skeleton, Time};

/// Tolerances in millimetres, in model space.
const TOLERANCES: [f64; 6] = [0.01, 0.1, 0.5, 1.0, 2.0, 5.0];

pub(crate) fn section() -> Result<Section, String> {
    let asset = scenes::mannequin()?;
    let skeleton = &asset.skeleton;
    let dance =
        asset.clips.iter().find(|c| c.name == "Dance_Groove").ok_or("the mannequin has no Dance_Groove")?;
    let (dense, _) = dance.baked(FrameRate { num: 30, den: 1 }).map_err(|e| e.to_string())?;
    let mut methods: Vec<(String, Clip, usize)> = Vec::new();
    for (keep, name) in [(KeptTimes::Fewest, "fewest bytes"), (KeptTimes::Shared, "shared keys")] {
        for mm in TOLERANCES {
            let (clip, report) = dense.reduced(skeleton, mm * 1e-3, keep).map_err(|e| e.to_string())?;
            if methods.is_empty() {
                methods.push(("all keys, 30 Hz".into(), dense.clone(), report.bytes[0]));
            }
            methods.push((format!("{name}, {mm} mm"), clip, report.bytes[1]));
        }
    }
    for mm in [0.01, 0.1, 0.5, 1.0, 2.0, 5.0] {
        let (clip, report) = dense.compressed(skeleton, mm * 1e-3).map_err(|e| e.to_string())?;
        methods.push((format!("compressed, {mm} mm"), clip, report.bytes[1]));
    }
    let floats = skeleton.len() * 40 * 30;
    let mut choice = Choice::new("reduction", "In how few bytes is motion sampled at 30 Hz stored?");
    choice.error_unit = "mm";
    choice.reference = "f64 slerp on all keys, position of any joint in the model, at 400 times".into();
    choice.per = format!("sample of {} joints at any time", skeleton.len());
    let nanos = {
        let mut cases: Vec<Case> = methods.iter().map(|(_, clip, _)| sampling_case(clip)).collect();
        interleaved(Clock::Thread, BUDGET_SECS, &mut cases)
    };
    let secs = dense.duration.as_secs();
    for ((name, clip, bytes), nanos) in methods.iter().zip(nanos) {
        let errors = joint_errors(skeleton, &dense, clip);
        let mut row =
            Row::new(name).error(errors.worst, errors.mean()).nanos(nanos).bytes(*bytes as f64 / secs);
        let ratio = floats as f64 / (*bytes as f64 / secs);
        row.note = match clip.is_compressed() {
            true => format!("size: a second; 1/{ratio:.1} of dense floats"),
            false => format!("size: a second; {} keys", clip.keys()),
        };
        choice.rows.push(row);
    }
    choice.choose(
        "all keys, 30 Hz",
        "clips stay as authored unless a script calls Clip.compress or Clip.reduce",
    );
    Ok(Section {
        title: "Key reduction and compression",
        text: "A key is removed where the keys around it reproduce it within the tolerance, which is \
               distributed by how far the joints below reach; then the whole clip is measured in model \
               space and reduced again until the tolerance holds. Separate keys for each curve take the \
               fewest bytes, but every curve then searches its own interval; shared keys keep the rows from \
               which eight joints are read at once. Compressed clips keep the rate and the slerp between \
               keys; each key comes from a cubic spline with a knot for every 1 to 8 keys, in as few bits \
               as the tolerance needs. Dense floats are translation, rotation and scale of every joint: 40 \
               bytes a key."
            .into(),
        choices: vec![choice],
        tables: Vec::new(),
        off_front: vec![(
            "reduction",
            "no key shared by all curves of this clip could be removed, so these are the same clip; the \
             times differ by chance.",
        )],
    })
}

fn joint_errors(skeleton: &Skeleton, dense: &Clip, clip: &Clip) -> ErrorStats {
    let mut errors = ErrorStats::default();
    for i in 0..400 {
        let at = Time((dense.duration.0 as f64 * ((f64::from(i) * 0.618_033_988_75) % 1.0)) as i64);
        let model = |clip: &Clip| reference::model_from_joint(skeleton, &reference::pose(clip, skeleton, at));
        for (a, b) in model(dense).iter().zip(&model(clip)) {
            errors.add((a.translation - b.translation).length() * 1e3);
        }
    }
    errors
}

fn sampling_case(clip: &Clip) -> Case<'_> {
    const TIME_COUNT: usize = 64;
    let mut pose = Pose::identity(clip.joint_count());
    Case::new(TIME_COUNT, move || {
        for i in 0..TIME_COUNT {
            let time =
                Time(clip.duration.0 / TIME_COUNT as i64 * ((i * 29 + 11) % TIME_COUNT) as i64 + 12_345);
            Sample { clip, time, pose: &mut pose }.run();
            std::hint::black_box(&pose);
        }
    })
}
