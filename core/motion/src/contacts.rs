//! Foot contacts: when which foot of a clip stands on the floor, and how fast the floor goes by.
//!
//! A foot stands where it is near the lowest place that it gets to, hardly rises or sinks, and moves with the floor. The
//! floor's velocity is not known beforehand: of a clip with root motion it is zero, of one on the spot it is that of a
//! treadmill. While the lower foot is low and neither lands nor lifts it stands, nearly always, so the median of its velocity
//! is the floor's, and what differs from it much is a swinging foot that happens to be low. (Thresholds on height and speed: L. Kovar, J. Schreiner,
//! M. Gleicher, "Footskate Cleanup for Motion Capture Editing", SCA 2002, §4; the median is ours.) All are shares of the
//! length of a leg, so that they hold for mice and giants.

use crate::joint_names::humanoid_name;
use crate::{Clip, LocalToModel, Pose, Sample, Skeleton, Time};
use glam::{Affine3A, DVec3, Vec3};

/// Above the lowest place, in legs. A walk's toe swings through at 2 %, but fast.
pub const HEIGHT: f64 = 0.06;
/// Up or down, in legs a second.
pub const CLIMB: f64 = 0.8;
/// Against the floor, in legs a second; and as a share of the floor's own speed.
pub const SLIP: f64 = 0.5;
pub const SLIP_SHARE: f64 = 0.35;
/// Stands and gaps shorter than these are noise, seconds.
const SHORTEST_STAND: f64 = 0.06;
const SHORTEST_GAP: f64 = 0.05;
/// Looks a second, at most so many a clip.
const RATE: f64 = 120.0;
const MOST: usize = 4096;
/// Fewer say nothing of the floor.
const LEAST_SAMPLES: usize = 4;

/// One foot: the joints of which the lower one counts, heel (ankle) and toe.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Foot {
    pub joints: Vec<u32>,
}

/// A foot on the floor. `to` may lie after the end of a clip that is looped: then the stand goes on into its beginning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stand {
    pub from: Time,
    pub to: Time,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Contacts {
    /// By foot, in the order of time.
    pub stands: Vec<Vec<Stand>>,
    /// Of the floor in model space, metres a second of the clip; horizontal.
    pub floor_velocity: DVec3,
}

/// The feet of a skeleton by their names, left before right, fore or hind as they come: `left foot` with its toes, else
/// every joint called foot, toe or paw with no other below it.
pub fn find_feet(skeleton: &Skeleton) -> Vec<Foot> {
    let named = |wanted: &str| {
        skeleton.names().iter().position(|n| humanoid_name(n).as_deref() == Some(wanted)).map(|j| j as u32)
    };
    let mut feet = Vec::new();
    for side in ["left", "right"] {
        let joints: Vec<u32> =
            ["foot", "toebase"].iter().filter_map(|part| named(&format!("{side} {part}"))).collect();
        if !joints.is_empty() {
            feet.push(Foot { joints });
        }
    }
    if feet.len() == 2 {
        return feet;
    }
    let footed: Vec<bool> = skeleton
        .names()
        .iter()
        .map(|name| {
            let name = name.to_lowercase();
            ["foot", "toe", "paw", "hoof"].iter().any(|word| name.contains(word))
        })
        .collect();
    let mut above: Vec<bool> = vec![false; skeleton.len()];
    for joint in (0..skeleton.len()).rev() {
        if let Some(parent) = skeleton.parents()[joint]
            && (footed[joint] || above[joint])
        {
            above[parent as usize] = true;
        }
    }
    let ends = (0..skeleton.len()).filter(|j| footed[*j] && !above[*j]);
    ends.map(|joint| Foot { joints: vec![joint as u32] }).collect()
}

/// Along the bones from the joint that all feet hang on to a foot, the longest, metres: whatever pose the skeleton rests in.
/// `None` without feet or length.
pub fn leg_length(skeleton: &Skeleton, feet: &[Foot]) -> Option<f64> {
    let model = model(skeleton, &Pose::rest(skeleton));
    let above = |joint: u32| {
        let up = |j: &u32| skeleton.parents().get(*j as usize).copied().flatten();
        std::iter::successors(Some(joint), up).collect::<Vec<u32>>()
    };
    let chains: Vec<Vec<u32>> = feet.iter().filter_map(|f| f.joints.first()).map(|j| above(*j)).collect();
    // The lowest of all that carry every foot, but no foot itself.
    let first = chains.first()?;
    let shared = first.iter().skip(1).find(|j| chains.iter().all(|chain| chain.contains(j)))?;
    let length = |chain: &Vec<u32>| {
        let bones = chain.windows(2).take_while(|pair| pair[0] != *shared);
        let bone =
            |pair: &[u32]| Some((*model.get(pair[0] as usize)? - *model.get(pair[1] as usize)?).length());
        bones.filter_map(bone).map(f64::from).sum::<f64>()
    };
    let leg = chains.iter().map(length).fold(0.0, f64::max);
    (leg.is_finite() && leg > 0.0).then_some(leg)
}

fn model(skeleton: &Skeleton, pose: &Pose) -> Vec<Vec3> {
    let mut matrices = vec![Affine3A::IDENTITY; skeleton.len()];
    LocalToModel { skeleton, pose, model_from_joint: &mut matrices }.run();
    matrices.into_iter().map(|m| m.translation.into()).collect()
}

impl Contacts {
    /// Of the part of a clip that `trim` says, taken as a loop where it ends as it begins. `None` without feet, or where
    /// nothing is as long as it must be.
    pub fn find(skeleton: &Skeleton, clip: &Clip, trim: (Time, Time), feet: &[Foot]) -> Option<Contacts> {
        let leg = leg_length(skeleton, feet)?;
        let span = (trim.1 - trim.0).as_secs();
        let count = ((span * RATE) as usize).clamp(8, MOST);
        if span <= 0.0 || clip.joint_count() != skeleton.len() {
            return None;
        }
        let time = |i: usize| trim.0 + Time(((trim.1 - trim.0).0 as i128 * i as i128 / count as i128) as i64);
        let mut pose = Pose::rest(skeleton);
        // By look, by foot, by joint.
        let mut places: Vec<Vec<Vec<DVec3>>> = Vec::with_capacity(count + 1);
        for i in 0..=count {
            Sample { clip, time: time(i), pose: &mut pose }.run();
            let model = model(skeleton, &pose);
            let of = |foot: &Foot| foot.joints.iter().map(|j| model[*j as usize].as_dvec3()).collect();
            places.push(feet.iter().map(of).collect());
        }
        let step = span / count as f64;
        let velocity = |i: usize, foot: usize, joint: usize| {
            // Central differences, one-sided at the ends.
            let (a, b) = (i.saturating_sub(1), (i + 1).min(count));
            (places[b][foot][joint] - places[a][foot][joint]) / ((b - a) as f64 * step)
        };
        let lowest: Vec<Vec<f64>> = (0..feet.len())
            .map(|f| {
                let low = |j: usize| places.iter().map(|p| p[f][j].y).fold(f64::INFINITY, f64::min);
                (0..feet[f].joints.len()).map(low).collect()
            })
            .collect();
        let height = |i: usize, f: usize, j: usize| places[i][f][j].y - lowest[f][j];
        let lower = |i: usize, f: usize, a: &usize, b: &usize| height(i, f, *a).total_cmp(&height(i, f, *b));
        // The joint of a foot that is nearest to its own lowest place.
        let standing_joint = |i: usize, f: usize| (0..feet[f].joints.len()).min_by(|a, b| lower(i, f, a, b));
        // The lower foot where it is really low and neither lands nor lifts; in a run it stands for less than half the time.
        let (mut samples, mut all): (Vec<DVec3>, Vec<DVec3>) = Default::default();
        for i in 0..=count {
            let lowest_foot = (0..feet.len())
                .filter_map(|f| standing_joint(i, f).map(|j| (height(i, f, j), f, j)))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((high, f, j)) = lowest_foot {
                let v = velocity(i, f, j);
                all.push(v);
                if high <= 0.5 * HEIGHT * leg && v.y.abs() <= 0.5 * CLIMB * leg {
                    samples.push(v);
                }
            }
        }
        let mut floor = median(if samples.len() >= LEAST_SAMPLES { &samples } else { &all })?;
        let mut down = vec![vec![false; count + 1]; feet.len()];
        // Once by what is low, once by those who stand.
        for _ in 0..2 {
            let slip = SLIP * leg + SLIP_SHARE * floor.length();
            let mut stood = Vec::new();
            for i in 0..=count {
                for (f, down) in down.iter_mut().enumerate() {
                    let stands = |j: usize| {
                        let v = velocity(i, f, j);
                        height(i, f, j) <= HEIGHT * leg
                            && v.y.abs() <= CLIMB * leg
                            && (v.with_y(0.0) - floor).length() <= slip
                    };
                    let standing = (0..feet[f].joints.len()).filter(|j| stands(*j));
                    let best = standing.min_by(|a, b| lower(i, f, a, b));
                    down[i] = best.is_some();
                    // Of a foot that rolls, heel and toe are slower or faster; flat on the floor they are as fast as it.
                    stood.extend(best.map(|j| velocity(i, f, j)));
                }
            }
            floor = median(&stood).unwrap_or(floor);
        }
        let looped = is_loop(&places, leg);
        let stands = down.iter().map(|down| stands_of(down, looped, step, &time, trim)).collect();
        Some(Contacts { stands, floor_velocity: floor })
    }
}

fn median(samples: &[DVec3]) -> Option<DVec3> {
    let middle = |component: fn(&DVec3) -> f64| {
        let mut values: Vec<f64> = samples.iter().map(component).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    Some(DVec3::new(middle(|v| v.x)?, 0.0, middle(|v| v.z)?))
}

/// Whether the feet end where they began, the way of the whole left out.
fn is_loop(places: &[Vec<Vec<DVec3>>], leg: f64) -> bool {
    let (Some(first), Some(last)) = (places.first(), places.last()) else { return false };
    let pairs: Vec<DVec3> = first.iter().flatten().zip(last.iter().flatten()).map(|(a, b)| *b - *a).collect();
    let mean = pairs.iter().sum::<DVec3>() / pairs.len().max(1) as f64;
    pairs.iter().all(|way| (*way - mean).length() < 0.1 * leg)
}

fn stands_of(
    down: &[bool],
    looped: bool,
    step: f64,
    time: &dyn Fn(usize) -> Time,
    trim: (Time, Time),
) -> Vec<Stand> {
    let count = down.len() - 1;
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for (i, down) in down.iter().enumerate() {
        match runs.last_mut() {
            Some((_, to)) if *down && *to + 1 == i => *to = i,
            _ if *down => runs.push((i, i)),
            _ => {}
        }
    }
    // Over the seam of a loop the last run goes on in the first.
    let first = runs.first().copied();
    if looped
        && runs.len() > 1
        && let (Some((0, to)), Some(last)) = (first, runs.last_mut())
        && last.1 == count
    {
        last.1 = count + to;
        runs.remove(0);
    }
    let gap = (SHORTEST_GAP / step) as usize;
    runs.dedup_by(|next, before| {
        let close = next.0 - before.1 <= gap;
        if close {
            before.1 = next.1;
        }
        close
    });
    runs.retain(|(from, to)| (*to - *from) as f64 * step >= SHORTEST_STAND || *to - *from == count);
    let at = |i: usize| if i <= count { time(i) } else { trim.1 + (time(i - count) - trim.0) };
    runs.into_iter().map(|(from, to)| Stand { from: at(from), to: at(to) }).collect()
}
