//! Fewer keys: rows of samples as curves of a rig, of which those keys go that follow from the others.

use crate::bake::rig::{self, STRIDE};
use crate::bake::sample::{Row, Sampled};
use crate::bake::signals::Signal;
use crate::bake::tracks::{Track, TrackSet, Values};
use choreo_plugin::motion::edit::reduce::KeptTimes;
use choreo_plugin::motion::{Clip, Curve, Interpolation, Path, Skeleton, Time};
use choreo_plugin::stage::Actor;
use std::sync::Arc;

/// Curves of an actor. `tolerance`: metres in the world.
pub fn actor_tracks(actor: &Actor, sampled: &Sampled, rows: &[Row], tolerance: f64) -> TrackSet<'static> {
    let times: Arc<[Time]> = rows.iter().map(|row| row.time).collect();
    let mut out = TrackSet {
        times: Vec::new(),
        tracks: Vec::new(),
        still: Vec::new(),
        values: Values::Lists(Vec::new()),
    };
    let mut curves = Vec::new();
    for joint in 0..sampled.joints {
        let paths = [(Path::Translation, 0, 3), (Path::Rotation, 3, 4), (Path::Scale, 7, 3)];
        for (path, from, width) in paths {
            let at = sampled.offset + joint * STRIDE + from;
            let first = &rows[0].values[at..at + width];
            if rows.iter().all(|row| row.values[at..at + width] == *first) {
                out.still.push((joint as u32, path, first.to_vec()));
                continue;
            }
            let values = rows.iter().flat_map(|row| row.values[at..at + width].iter().copied()).collect();
            let (times, interpolation) = (times.clone(), Interpolation::Linear);
            curves.push(Curve { joint: joint as u32, path, interpolation, times, values });
        }
    }
    let world = rig::transform(&rows[0].values[sampled.offset..]);
    let Some(skeleton) = skeleton(actor, sampled, world) else { return out };
    let Ok(clip) = Clip::new(String::new(), skeleton.len(), curves) else { return out };
    let reduced = clip.reduced(&skeleton, tolerance, KeptTimes::Own).map(|(clip, _)| clip).unwrap_or(clip);
    add_curves(reduced.curves(), &mut out);
    out
}

/// The rig that errors are measured on; of an actor without its pose, one joint as far away as its farthest vertex.
fn skeleton(actor: &Actor, sampled: &Sampled, world: choreo_plugin::motion::Transform) -> Option<Skeleton> {
    if sampled.pose {
        return rig::skeleton(actor, world);
    }
    let tip = choreo_plugin::motion::Transform {
        translation: choreo_plugin::glam::Vec3::X * sampled.reach,
        ..choreo_plugin::motion::Transform::IDENTITY
    };
    Skeleton::new(vec![String::new(); 2], vec![None, Some(0)], vec![world, tip]).ok()
}

fn add_curves(curves: &[Curve], out: &mut TrackSet<'_>) {
    let mut lists = Vec::new();
    let mut known: Vec<Arc<[Time]>> = Vec::new();
    for curve in curves {
        let Curve { joint, path, interpolation, .. } = *curve;
        if curve.times.len() == 1 {
            out.still.push((joint, path, curve.values.to_vec()));
            continue;
        }
        let times = known.iter().position(|known| *known == curve.times).unwrap_or_else(|| {
            known.push(curve.times.clone());
            out.times.push(curve.times.to_vec());
            known.len() - 1
        });
        out.tracks.push(Track { joint, path, interpolation, times });
        lists.push(curve.values.to_vec());
    }
    out.values = Values::Lists(lists);
}

/// A signal over time: LINEAR keys, one where it never changes.
#[derive(Clone, Debug, Default)]
pub struct Series {
    pub times: Vec<Time>,
    pub values: Vec<f32>,
    pub width: usize,
}

impl Series {
    pub fn first(&self) -> &[f32] {
        &self.values[..self.width]
    }

    pub fn is_still(&self) -> bool {
        self.times.len() < 2
    }
}

/// Keys of a signal in some rows: from each, the longest way to the next that keeps all between near enough.
pub fn series(signal: &Signal, rows: &[&Row]) -> Series {
    let value = |row: usize| &rows[row].values[signal.offset..][..signal.width];
    let mut out = Series { width: signal.width, ..Series::default() };
    let Some(last) = rows.len().checked_sub(1) else { return out };
    let mut push = |row: usize| {
        out.times.push(rows[row].time);
        out.values.extend_from_slice(value(row));
    };
    push(0);
    if (0..=last).all(|row| signal.is_near(value(row), value(0))) {
        return out;
    }
    let mut between = vec![0.0; signal.width];
    let mut fits = |from: usize, to: usize| {
        (from + 1..to).all(|row| {
            let t = rows[row].time.fraction(rows[from].time, rows[to].time);
            signal.between(value(from), value(to), t, &mut between);
            signal.is_near(&between, value(row))
        })
    };
    let mut at = 0;
    while at < last {
        // Doubling, then halving: few looks along a long way.
        let (mut good, mut step) = (at + 1, 2);
        while at + step <= last && fits(at, at + step) {
            good = at + step;
            step *= 2;
        }
        let mut bad = (at + step).min(last + 1);
        while bad - good > 1 {
            let middle = good + (bad - good) / 2;
            if fits(at, middle) { good = middle } else { bad = middle }
        }
        push(good);
        at = good;
    }
    out
}
