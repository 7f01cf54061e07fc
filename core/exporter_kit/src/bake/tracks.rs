//! Curves of one rig over the timeline, as they are written: key times, the curves that use them, and their numbers. Numbers of clips are
//! computed when they are requested.

use crate::bake::keys::KeyTracks;
use choreo_plugin::motion::{Curve, Interpolation, Path, Time};
use std::sync::Arc;

/// A curve of an actor's rig. Joint 0 is the actor itself, joint n + 1 is joint n of its skeleton.
#[derive(Clone, Copy, Debug)]
pub struct Track {
    pub joint: u32,
    pub path: Path,
    pub interpolation: Interpolation,
    /// Index into [`TrackSet::times`].
    pub times: usize,
}

/// Curves that are written together.
pub struct TrackSet<'a> {
    /// Key times on the stage, strictly increasing.
    pub times: Vec<Vec<Time>>,
    pub tracks: Vec<Track>,
    /// Constant values by joint of the rig, which can differ from the rest pose.
    pub still: Vec<(u32, Path, Vec<f32>)>,
    pub values: Values<'a>,
}

pub enum Values<'a> {
    /// Keys of clips.
    Keys(KeyTracks<'a>),
    /// One list per track.
    Lists(Vec<Vec<f32>>),
}

impl TrackSet<'_> {
    /// Appends the numbers of a track, in glTF's order.
    pub fn values(&self, track: usize, out: &mut Vec<f32>) {
        match &self.values {
            Values::Keys(keys) => keys.values(track, out),
            Values::Lists(lists) => out.extend_from_slice(&lists[track]),
        }
    }

    /// Count of numbers in a track.
    pub fn numbers(&self, track: usize) -> usize {
        let Track { path, interpolation, times, .. } = self.tracks[track];
        let parts = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        self.times[times].len() * path.width() * parts
    }
}

impl TrackSet<'_> {
    /// Adds the curves of joints, without morph weights. `on_file` converts lists of key times, and `number` single numbers, to those of
    /// the file.
    pub fn add_curves(
        &self,
        on_file: impl Fn(&[Time]) -> Vec<Time>,
        number: impl Fn(Path, f32) -> f32,
        out: &mut Vec<Curve>,
    ) {
        let times: Vec<Arc<[Time]>> = self.times.iter().map(|times| on_file(times).into()).collect();
        let of_joints = |(_, track): &(usize, &Track)| !matches!(track.path, Path::Weights(_));
        for (index, track) in self.tracks.iter().enumerate().filter(of_joints) {
            let mut values = Vec::new();
            self.values(index, &mut values);
            out.push(Curve {
                joint: track.joint,
                path: track.path,
                interpolation: track.interpolation,
                times: times[track.times].clone(),
                values: values.into_iter().map(|v| number(track.path, v)).collect(),
            });
        }
    }

    /// The curves of one path of all joints but the actor itself, as (joint, numbers). `None` if one of them is a spline, or has keys at
    /// other times than these.
    pub fn aligned(&self, path: Path, times: &[Time]) -> Option<Vec<(u32, Vec<f32>)>> {
        let own = |(_, track): &(usize, &Track)| track.joint > 0 && track.path == path;
        let tracks: Vec<(usize, &Track)> = self.tracks.iter().enumerate().filter(own).collect();
        let fits = |(_, track): &(usize, &Track)| {
            track.interpolation != Interpolation::CubicSpline && self.times[track.times] == times
        };
        tracks.iter().all(fits).then(|| {
            let values = |(index, track): (usize, &Track)| {
                let mut values = Vec::with_capacity(self.numbers(index));
                self.values(index, &mut values);
                (track.joint, values)
            };
            tracks.into_iter().map(values).collect()
        })
    }

    /// All key times of the tracks that `of` selects, increasing. The tick before a STEP key, at which the value before it ends, is added.
    pub fn common_times(&self, of: impl Fn(&Track) -> bool) -> Vec<Time> {
        let mut out: Vec<Time> = Vec::new();
        let mut taken = vec![[false; 2]; self.times.len()];
        for track in self.tracks.iter().filter(|track| of(track)) {
            let steps = track.interpolation == Interpolation::Step;
            if std::mem::replace(&mut taken[track.times][usize::from(steps)], true) {
                continue;
            }
            let times = &self.times[track.times];
            out.extend(times);
            if steps {
                out.extend(times.iter().skip(1).map(|time| *time - Time(1)));
            }
        }
        out.sort_unstable();
        out.dedup();
        out
    }
}

/// Key times as a file has them: seconds from the start of the export, as f32, strictly increasing.
///
/// A jump is two keys one tick apart. The later one must not be after its time, so that the frame of that time shows the new value. f32
/// cannot resolve ticks, so the earlier one is moved before it by an f32 step, and at least 3 ticks.
pub fn seconds(times: &[Time], start: Time) -> Vec<f32> {
    let secs = |time: Time| (time - start).as_secs();
    let mut out: Vec<f32> = Vec::with_capacity(times.len());
    for (i, time) in times.iter().enumerate() {
        let is_jump = |later: Time, earlier: Time| (later - earlier).0 <= JUMP_TICKS;
        let at = match times.get(i + 1) {
            Some(next) if is_jump(*next, *time) => {
                let landing = f32_not_after(secs(*next));
                // The ticks that an importer makes of both must differ, too.
                landing.next_down().min((f64::from(landing) - 3.0 / Time::TICKS_PER_SECOND as f64) as f32)
            }
            _ if i > 0 && is_jump(*time, times[i - 1]) => f32_not_after(secs(*time)),
            _ => secs(*time) as f32,
        };
        let least = out.last().map_or(0.0, |last: &f32| last.next_up());
        out.push(at.max(least));
    }
    out
}

/// Keys that are at most this far apart are a jump.
pub(crate) const JUMP_TICKS: i64 = 2;

fn f32_not_after(secs: f64) -> f32 {
    let near = secs as f32;
    if f64::from(near) > secs { near.next_down() } else { near }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jumps_are_not_late_and_times_increase() {
        let jump = Time::from_secs(2.4);
        let times = [Time::ZERO, Time(1), jump - Time(1), jump, Time::from_secs(3.0)];
        let secs = seconds(&times, Time::ZERO);
        assert!(secs.windows(2).all(|pair| pair[0] < pair[1]), "{secs:?}");
        assert!(f64::from(secs[3]) <= 2.4 && f64::from(secs[3]) > 2.3999 && secs[2] > 2.3999, "{secs:?}");
        assert_eq!(secs[4], 3.0);
    }
}
