//! Animation stacks to clips. FBX curves are Bézier in time, rotate by Euler angles, and act through pivots and layers, which
//! no track of ours says: ufbx evaluates all of that, and straight lines (arcs) connect the samples. Steps stay steps.

use crate::file::{File, place_of};
use crate::keys::{self, Baked, Blend, Keys, Times, Track};
use crate::load;
use crate::meshes::Shown;
use crate::morphs;
use crate::nodes::Tree;
use crate::refine::{Part, Rows, refine};
use choreo_import::{Problem, Result};
use choreo_motion::clip::MAX_WEIGHTS;
use choreo_motion::{Clip, Curve, Path, Time};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use ufbx::{
    AnimStack, BakeOpts, BakeStepHandling, BakedAnim, BakedKeyFlags, BakedProp, BlendChannel, ElementType,
    ErrorType, ExtrapolationMode,
};

/// Keys further out than this (about 115 days) are taken for damage.
const MAX_KEY_SECS: f64 = 1e7;
/// Samples between two keys of the file; further apart, they get sparser.
const MAX_SEGMENTS: usize = 1 << 16;
/// Metres, parts of a quaternion, of a scale.
const STILL: f32 = 1e-6;
const WEIGHT: &str = "DeformPercent";

pub fn read(file: &File<'_>, tree: &Tree, shown: &[Shown<'_>]) -> Result<Vec<Arc<Clip>>> {
    let mut clips = Vec::new();
    for stack in &file.scene.anim_stacks {
        let place = || place_of(&stack.element);
        let baked = bake(file, stack)?;
        let maker =
            Maker { file, tree, shown, stack, baked: &baked, times: Times::default(), curves: Vec::new() };
        match maker.clip()? {
            Some(clip) => clips.push(Arc::new(clip)),
            None => file.notes.warn(place(), "moves nothing and is left out"),
        }
    }
    Ok(clips)
}

fn bake(file: &File<'_>, stack: &AnimStack) -> Result<ufbx::BakedAnimRoot> {
    let options = BakeOpts {
        temp_allocator: load::allocator(file.size),
        result_allocator: load::allocator(file.size),
        resample_rate: file.rate,
        // Lines of rotations are lines of Euler angles: shorter ones than a sample are taken for arcs.
        minimum_sample_rate: file.rate,
        max_keyframe_segments: MAX_SEGMENTS,
        step_handling: BakeStepHandling::IdenticalTime,
        ..BakeOpts::default()
    };
    ufbx::bake_anim(file.scene, &stack.anim, options).map_err(|error| {
        let place = place_of(&stack.element);
        match error.type_ {
            ErrorType::MemoryLimit | ErrorType::AllocationLimit | ErrorType::OutOfMemory => {
                let limit = load::memory_limit(file.size) >> 20;
                Problem::new(place, format!("its keys take more than {limit} MiB at {} a second, which is the limit for a file of this size", file.rate))
                    .hint("a lower option rate needs less")
            }
            _ => Problem::new(place, format!("cannot be evaluated: {}", error.description.as_ref())),
        }
    })
}

/// One moving curve of a node, still as rows.
struct Member<'n> {
    joint: u32,
    node: &'n ufbx::Node,
    path: Path,
    values: Vec<f64>,
}

impl Member<'_> {
    fn part(&self) -> Part {
        match self.path {
            Path::Rotation => Part::Rotation,
            Path::Scale => Part::Scale,
            _ => Part::Translation,
        }
    }
}

fn rows<const N: usize>(track: Track<N>) -> (Vec<Time>, Vec<f64>) {
    let values = track.keys.iter().flat_map(|k| k.1).collect();
    (track.keys.iter().map(|k| k.0).collect(), values)
}

struct Maker<'a, 'f> {
    file: &'a File<'f>,
    tree: &'a Tree,
    shown: &'a [Shown<'f>],
    stack: &'a AnimStack,
    baked: &'a BakedAnim,
    times: Times,
    curves: Vec<Curve>,
}

impl Maker<'_, '_> {
    fn place(&self) -> String {
        place_of(&self.stack.element)
    }

    fn clip(mut self) -> Result<Option<Clip>> {
        let (begin, end) = self.range()?;
        let repeated = self.repeated(begin, end);
        self.nodes(begin, end, &repeated)?;
        self.weights(begin, end, &repeated)?;
        self.left_out();
        if self.curves.iter().all(|c| self.is_still(c)) {
            return Ok(None);
        }
        self.reach(Time::from_secs(end) - Time::from_secs(begin));
        let name = match self.stack.element.name.as_ref() {
            "" => format!("stack {}", self.stack.element.typed_id),
            name => name.to_string(),
        };
        Clip::new(name, self.tree.skeleton.len(), self.curves)
            .map(Some)
            .map_err(|e| Problem::new(place_of(&self.stack.element), e.to_string()))
    }

    /// Holds its joint where it is at rest: exporters write such curves for nodes that nobody moved.
    fn is_still(&self, curve: &Curve) -> bool {
        let Some(rest) = self.tree.skeleton.rest().get(curve.joint as usize) else { return false };
        let near = |rest: &[f32]| {
            let close = |sign: f32| curve.values.iter().zip(rest).all(|(v, r)| (sign * v - r).abs() < STILL);
            curve.times.len() == 1 && (close(1.0) || curve.path == Path::Rotation && close(-1.0))
        };
        match curve.path {
            Path::Translation => near(&rest.translation.to_array()),
            Path::Rotation => near(&rest.rotation.to_array()),
            Path::Scale => near(&rest.scale.to_array()),
            Path::Weights(_) => false,
        }
    }

    /// What the stack says it plays; where it says nothing, from its first key to its last.
    fn range(&self) -> Result<(f64, f64)> {
        let (begin, end) = match self.stack.time_end > self.stack.time_begin {
            true => (self.stack.time_begin, self.stack.time_end),
            false if self.baked.key_time_max >= self.baked.key_time_min => {
                (self.baked.key_time_min, self.baked.key_time_max)
            }
            false => (0.0, 0.0),
        };
        let sound = |t: f64| t.is_finite() && t.abs() <= MAX_KEY_SECS;
        match sound(begin) && sound(end) {
            true => Ok((begin, end)),
            false => {
                let what =
                    format!("plays from {begin} s to {end} s; times must lie within ±{MAX_KEY_SECS} s");
                Err(Problem::new(self.place(), what))
            }
        }
    }

    /// Elements (by id) with a curve that goes on in another way than by holding its last value.
    fn repeated(&self, begin: f64, end: f64) -> BTreeSet<u32> {
        let mut out = BTreeSet::new();
        for layer in &self.stack.layers {
            for prop in &layer.anim_props {
                for curve in prop.anim_value.curves.iter().flatten() {
                    let before =
                        curve.pre_extrapolation.mode != ExtrapolationMode::Constant && curve.min_time > begin;
                    let after =
                        curve.post_extrapolation.mode != ExtrapolationMode::Constant && curve.max_time < end;
                    if before || after {
                        out.insert(prop.element.element_id);
                    }
                }
            }
        }
        for id in out.iter().take(20) {
            if let Some(element) = self.file.scene.elements.as_ref().get(*id as usize) {
                let what = format!(
                    "repeats beyond its keys, and is sampled {} times a second; steps are not kept",
                    self.file.rate
                );
                self.file.notes.warn(format!("{}: {}", self.place(), place_of(element)), what);
            }
        }
        out
    }

    /// Times of even samples, both ends among them.
    fn samples(&self, begin: f64, end: f64) -> Result<Vec<f64>> {
        let count = (((end - begin) * self.file.rate) as usize).saturating_add(2);
        self.file.charge(count, 8, || self.place())?;
        let even = (0..count).map(|k| begin + k as f64 / self.file.rate).take_while(|t| *t < end);
        Ok(even.chain([end]).collect())
    }

    fn nodes(&mut self, begin: f64, end: f64, repeated: &BTreeSet<u32>) -> Result<()> {
        let scene = self.file.scene;
        let mut groups: BTreeMap<Vec<Time>, Vec<Member<'_>>> = BTreeMap::new();
        for node in &self.baked.nodes {
            let joint = self.tree.joint_of_node.get(node.typed_id as usize).copied().flatten();
            let Some(joint) = joint else { continue };
            let start = Time::from_secs(begin);
            let mut t = Track::new(node.translation_keys.as_ref().iter().map(vec3_key), start);
            let mut s = Track::new(node.scale_keys.as_ref().iter().map(vec3_key), start);
            let mut r = Track::new(node.rotation_keys.as_ref().iter().map(quat_key), start);
            if repeated.contains(&node.element_id)
                && let Some(of_file) = scene.nodes.as_ref().get(node.typed_id as usize)
            {
                let samples = self.samples(begin, end)?;
                self.file.charge(samples.len(), 120, || self.place())?;
                t.keys.clear();
                s.keys.clear();
                r.keys.clear();
                for secs in samples {
                    let at = of_file.evaluate_transform(&self.stack.anim, secs);
                    let time = Time::from_secs(secs) - start;
                    t.keys.push((time, [at.translation.x, at.translation.y, at.translation.z]));
                    s.keys.push((time, [at.scale.x, at.scale.y, at.scale.z]));
                    r.keys.push((time, [at.rotation.x, at.rotation.y, at.rotation.z, at.rotation.w]));
                }
                [&mut t.keys, &mut s.keys].into_iter().for_each(|k| k.dedup_by_key(|k| k.0));
                r.keys.dedup_by_key(|k| k.0);
            }
            let Some(of_file) = scene.nodes.as_ref().get(node.typed_id as usize) else { continue };
            let length = Time::from_secs(end) - start;
            let mut gather = |path, rows| self.gather(&mut groups, joint, of_file, path, rows);
            gather(Path::Translation, rows(t.cut(length, Blend::Numbers)))?;
            gather(Path::Rotation, rows(r.cut(length, Blend::Rotation)))?;
            gather(Path::Scale, rows(s.cut(length, Blend::Numbers)))?;
        }
        for (times, members) in groups {
            self.group(times, members, begin)?;
        }
        Ok(())
    }

    /// A curve that never changes is done; others wait for those with the same key times, so that they share more.
    fn gather<'n>(
        &mut self,
        groups: &mut BTreeMap<Vec<Time>, Vec<Member<'n>>>,
        joint: u32,
        node: &'n ufbx::Node,
        path: Path,
        (times, values): (Vec<Time>, Vec<f64>),
    ) -> Result<()> {
        self.file.charge(times.len(), 8 + 8 * path.width(), || self.place())?;
        let row = |i: usize| &values[i * path.width()..(i + 1) * path.width()];
        if (1..times.len()).all(|i| row(i) == row(0)) {
            self.push(joint, path, times, values.iter().map(|v| *v as f32).collect());
        } else {
            groups.entry(times).or_default().push(Member { joint, node, path, values });
        }
        Ok(())
    }

    fn group(&mut self, times: Vec<Time>, members: Vec<Member<'_>>, begin: f64) -> Result<()> {
        let parts: Vec<Part> = members.iter().map(|m| m.part()).collect();
        let width: usize = parts.iter().map(|p| p.width()).sum();
        let mut values = Vec::with_capacity(width * times.len());
        for i in 0..times.len() {
            members
                .iter()
                .for_each(|m| values.extend_from_slice(&m.values[i * m.path.width()..][..m.path.width()]));
        }
        let mut rows = Rows { parts: &parts, times, values };
        if self.file.adapts {
            let anim = &self.stack.anim;
            let evaluate = |time: Time, out: &mut Vec<f64>| {
                // A node's curves lie side by side: it is evaluated once.
                let mut latest: Option<(u32, ufbx::Transform)> = None;
                for member in &members {
                    let at = match &latest {
                        Some((joint, at)) if *joint == member.joint => *at,
                        _ => member.node.evaluate_transform(anim, begin + time.as_secs()),
                    };
                    latest = Some((member.joint, at));
                    match member.path {
                        Path::Rotation => {
                            out.extend([at.rotation.x, at.rotation.y, at.rotation.z, at.rotation.w])
                        }
                        Path::Scale => out.extend([at.scale.x, at.scale.y, at.scale.z]),
                        _ => out.extend([at.translation.x, at.translation.y, at.translation.z]),
                    }
                }
            };
            rows = refine(rows, evaluate, || self.file.budget.charge(1, 8 + 8 * width).is_ok());
        }
        self.file.charge(rows.times.len(), 8 + 4 * width, || self.place())?;
        let mut at = 0;
        for member in &members {
            let own = rows.values.chunks_exact(width).flat_map(|row| &row[at..at + member.path.width()]);
            let own = own.map(|v| *v as f32).collect();
            self.push(member.joint, member.path, rows.times.clone(), own);
            at += member.path.width();
        }
        Ok(())
    }

    fn push(&mut self, joint: u32, path: Path, times: Vec<Time>, values: Vec<f32>) {
        if times.is_empty() {
            return;
        }
        let blend = if path == Path::Rotation { Blend::Rotation } else { Blend::Numbers };
        let Keys { interpolation, times, values } = keys::finish(times, values, path.width(), blend);
        let times = self.times.share(times);
        self.curves.push(Curve { joint, path, interpolation, times, values: values.into() });
    }

    /// One curve a mesh: at every time at which one of its channels bends, the weights of all its shapes.
    fn weights(&mut self, begin: f64, end: f64, repeated: &BTreeSet<u32>) -> Result<()> {
        let mut percent: BTreeMap<u32, &BakedProp> = BTreeMap::new();
        for element in &self.baked.elements {
            if let Some(prop) = element.props.as_ref().iter().find(|p| p.name.as_ref() == WEIGHT) {
                percent.insert(element.element_id, prop);
            }
        }
        let mut done = BTreeSet::new();
        let length = Time::from_secs(end) - Time::from_secs(begin);
        for one in self.shown {
            let count = morphs::count(one.mesh);
            let driven = morphs::channels(one.mesh).any(|c| percent.contains_key(&c.element.element_id));
            if !driven || count > MAX_WEIGHTS as usize || !done.insert(one.joint) {
                continue;
            }
            let mut times = BTreeSet::new();
            let mut tracks = Vec::new();
            for channel in morphs::channels(one.mesh) {
                let track = match percent.get(&channel.element.element_id) {
                    Some(_) if repeated.contains(&channel.element.element_id) => {
                        Track { keys: self.channel_samples(channel, begin, end)? }
                    }
                    Some(prop) => {
                        Track::new(prop.keys.as_ref().iter().map(percent_key), Time::from_secs(begin))
                    }
                    None => Track { keys: vec![(Time::ZERO, [channel.weight])] },
                };
                let track = self.close(channel, track.cut(length, Blend::Numbers), begin);
                let track = with_bends(channel, track);
                self.file.charge(track.keys.len(), 64, || self.place())?;
                times.extend(track.keys.iter().map(|k| k.0));
                tracks.push((channel, track));
            }
            self.file.charge(times.len(), 8 + 4 * count, || self.place())?;
            let mut values = Vec::with_capacity(times.len() * count);
            for time in &times {
                for (channel, track) in &tracks {
                    morphs::shape_weights(channel, track.at(*time, Blend::Numbers)[0], &mut values);
                }
            }
            self.push(one.joint, Path::Weights(count as u32), times.into_iter().collect(), values);
        }
        Ok(())
    }

    /// The channel's weight with more keys where it bends.
    fn close(&self, channel: &BlendChannel, track: Track<1>, begin: f64) -> Track<1> {
        if !self.file.adapts || track.keys.len() < 2 {
            return track;
        }
        let (times, values) = rows(track);
        let evaluate = |time: Time, out: &mut Vec<f64>| {
            out.push(channel.evaluate_blend_weight(&self.stack.anim, begin + time.as_secs()));
        };
        let rows = Rows { parts: &[Part::Weight], times, values };
        let rows = refine(rows, evaluate, || self.file.budget.charge(1, 64).is_ok());
        Track { keys: rows.times.into_iter().zip(rows.values.into_iter().map(|v| [v])).collect() }
    }

    fn channel_samples(&self, channel: &BlendChannel, begin: f64, end: f64) -> Result<Vec<(Time, [f64; 1])>> {
        let samples = self.samples(begin, end)?;
        self.file.charge(samples.len(), 16, || self.place())?;
        let start = Time::from_secs(begin);
        let at = |secs: f64| {
            (Time::from_secs(secs) - start, [channel.evaluate_blend_weight(&self.stack.anim, secs)])
        };
        let mut keys: Vec<(Time, [f64; 1])> = samples.into_iter().map(at).collect();
        keys.dedup_by_key(|k| k.0);
        Ok(keys)
    }

    /// What of the stack clips cannot hold.
    fn left_out(&self) {
        for element in &self.baked.elements {
            let Some(of_file) = self.file.scene.elements.as_ref().get(element.element_id as usize) else {
                continue;
            };
            let known =
                |name: &str| name == WEIGHT || of_file.type_ == ElementType::Node && name.starts_with("Lcl ");
            let moving = element.props.as_ref().iter().filter(|p| !p.constant_value);
            let names: Vec<&str> = moving.map(|p| p.name.as_ref()).filter(|name| !known(name)).collect();
            if !names.is_empty() {
                let list = names.iter().take(6).copied().collect::<Vec<_>>().join(", ");
                let what = format!("animates {list}, which clips cannot hold; the value at rest is used");
                self.file.notes.warn(format!("{}: {}", self.place(), place_of(of_file)), what);
            }
        }
    }

    /// A clip is as long as its longest curve: the first gets a key at the end that the stack names.
    fn reach(&mut self, length: Time) {
        let last = |c: &Curve| c.times.last().copied().unwrap_or(Time::ZERO);
        if self.curves.iter().map(last).max().unwrap_or(Time::ZERO) >= length {
            return;
        }
        let curve = &mut self.curves[0];
        let width = curve.path.width();
        let end = &curve.values[curve.values.len() - width..];
        curve.values = curve.values.iter().chain(end).copied().collect();
        curve.times = self.times.share(curve.times.iter().copied().chain([length]).collect());
    }
}

/// Adds keys where the weights of the channel's shapes bend.
fn with_bends(channel: &BlendChannel, track: Track<1>) -> Track<1> {
    let bends = morphs::bends(channel);
    let mut keys: Vec<(Time, [f64; 1])> = Vec::with_capacity(track.keys.len());
    for pair in track.keys.windows(2) {
        let ((from, [a]), (to, [b])) = (pair[0], pair[1]);
        keys.push(pair[0]);
        let mut crossed: Vec<(Time, [f64; 1])> = bends
            .iter()
            .filter(|bend| (a < **bend && **bend < b) || (b < **bend && **bend < a))
            .map(|bend| {
                let ticks = (to.0 - from.0) as f64 * ((bend - a) / (b - a));
                (Time(from.0 + ticks.round() as i64), [*bend])
            })
            .filter(|(time, _)| from < *time && *time < to)
            .collect();
        crossed.sort_by_key(|k| k.0);
        crossed.dedup_by_key(|k| k.0);
        keys.extend(crossed);
    }
    keys.extend(track.keys.last());
    Track { keys }
}

/// The channel's weight: 1 for 100 percent.
fn percent_key(key: &ufbx::BakedVec3) -> Baked<1> {
    let (before_step, after_step) = step(key.flags);
    Baked { secs: key.time, before_step, after_step, value: [key.value.x * 0.01] }
}

fn vec3_key(key: &ufbx::BakedVec3) -> Baked<3> {
    let (before_step, after_step) = step(key.flags);
    Baked { secs: key.time, before_step, after_step, value: [key.value.x, key.value.y, key.value.z] }
}

fn quat_key(key: &ufbx::BakedQuat) -> Baked<4> {
    let (before_step, after_step) = step(key.flags);
    let q = key.value;
    Baked { secs: key.time, before_step, after_step, value: [q.x, q.y, q.z, q.w] }
}

fn step(flags: BakedKeyFlags) -> (bool, bool) {
    (flags.has_any(BakedKeyFlags::STEP_LEFT), flags.has_any(BakedKeyFlags::STEP_RIGHT))
}
