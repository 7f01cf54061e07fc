//! Blending of two poses.

use crate::{BUDGET_SECS, Section, scenes};
use choreo_bench::scene::crossfade::{Fade, NOW, crossfade};
use choreo_motion::{Pose, Sample};

/// Clips that are crossfaded, each with the time in seconds at the middle of the fade.
const FADES: [(&str, f64, &str, f64); 6] = [
    ("Walk", 0.3, "Run", 0.1),
    ("Run", 0.2, "Idle", 0.5),
    ("Idle", 1.0, "Dance_Spin", 0.7),
    ("Dance_Groove", 3.1, "Bow", 0.4),
    ("Jump", 0.5, "Walk", 0.6),
    ("Wave", 1.2, "Dance_Groove", 5.3),
];

pub(crate) fn section() -> Result<Section, String> {
    let asset = scenes::mannequin()?;
    let skeleton = &asset.skeleton;
    let pose = |name: &str, share: f64| -> Result<Pose, String> {
        let clip =
            asset.clips.iter().find(|c| c.name == name).ok_or(format!("the mannequin has no clip {name}"))?;
        let mut pose = Pose::rest(skeleton);
        let time = choreo_motion::Time::from_secs(share % clip.duration.as_secs());
        Sample { clip, time, pose: &mut pose }.run();
        Ok(pose)
    };
    let mut fades = Vec::new();
    for (from, at, to, there) in FADES {
        let (from_pose, to_pose) = (pose(from, at)?, pose(to, there)?);
        let place = format!("{from} at {at} s → {to} at {there} s");
        fades.push(Fade { from: from_pose, to: to_pose, skeleton: skeleton.clone(), place });
    }
    let mut choice = crossfade(&fades, BUDGET_SECS);
    choice.choose(NOW, "an invisible error, for about a fifth more time than plain nlerp");
    Ok(Section {
        title: "Crossfades",
        text: "All ways follow the same arc and agree at weights 0, ½ and 1. In between, plain nlerp is \
               ahead or behind by the error in the table, at the end of chains of joints that differ by \
               tens of degrees; a cubic correction of the weight removes nearly all of it. Each way blends \
               eight joints at once, translations and scales included."
            .into(),
        choices: vec![choice],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}
