//! Motion: the transform of an actor over time, and its joints and morph targets as a SkelAnimation.

use crate::frames::Frames;
use crate::layer::{
    Attribute, DOUBLE3, FLOAT, FLOAT3, HALF3, Prim, QUATF, RowSink, SampleValues, Samples, TOKEN, Type, Value,
};
use crate::model::Model;
use choreo_exporter_kit::bake::rig;
use choreo_exporter_kit::bake::signals::Quantity;
use choreo_exporter_kit::bake::tracks::{Track, TrackSet};
use choreo_exporter_kit::{Baked, Series};
use choreo_plugin::motion::{Clip, Interpolation, Path, Pose, Sample, Skeleton, Time, Transform};
use choreo_plugin::stage::Actor;
use std::rc::Rc;

/// Baked track sets, shared by the prims that are written from them.
pub(crate) type Sets<'a> = [Rc<TrackSet<'a>>];

/// The values of a track as time samples.
fn track_samples<'a>(set: &Rc<TrackSet<'a>>, track: usize, frames: Frames) -> Samples<'a> {
    let Track { path, times, .. } = set.tracks[track];
    let set = set.clone();
    let times = frames.time_codes(&set.times[times]);
    let each = move |take: RowSink<'_>| {
        let mut numbers = Vec::new();
        set.values(track, &mut numbers);
        numbers.chunks(path.width()).try_for_each(|row| {
            let row: Vec<f64> = row.iter().map(|v| f64::from(*v)).collect();
            take(&row)
        })
    };
    Samples { times, values: SampleValues::Numbers { count: None, each: Rc::new(each) } }
}

/// The keys of a series as time samples, each number mapped by a function.
pub(crate) fn series_samples<'a>(
    series: &Series,
    frames: Frames,
    map_number: impl Fn(f32) -> f64,
) -> Samples<'a> {
    let numbers = series.values.iter().map(|v| map_number(*v)).collect();
    Samples::of(frames.time_codes(&series.times), None, series.width, numbers)
}

/// Adds the transform ops of a prim: translate, orient and scale. Returns the property index of each.
pub(crate) fn add_transform_ops<'a>(prim: &mut Prim<'a>, at: &Transform) -> [usize; 3] {
    let first = prim.properties.len();
    prim.set_number(DOUBLE3, "xformOp:translate", &at.translation.to_array());
    prim.set_number(QUATF, "xformOp:orient", &at.rotation.to_array());
    prim.set_number(FLOAT3, "xformOp:scale", &at.scale.to_array());
    let order = ["xformOp:translate", "xformOp:orient", "xformOp:scale"];
    prim.set_uniform_tokens("xformOpOrder", order.map(String::from).to_vec());
    [first, first + 1, first + 2]
}

/// Replaces the value of an attribute by time samples.
pub(crate) fn animate<'a>(prim: &mut Prim<'a>, property: usize, samples: Samples<'a>) {
    if let Some(crate::layer::Property::Attribute(attribute)) = prim.properties.get_mut(property) {
        attribute.value = None;
        attribute.set_samples(samples);
    }
}

/// Places an actor over time. A hidden actor is invisible, and has size 0 for programs that ignore visibility.
pub(crate) fn place_actor<'a>(
    prim: &mut Prim<'a>,
    at: &Transform,
    sets: &[&Rc<TrackSet<'a>>],
    frames: Frames,
) {
    let property_indices = add_transform_ops(prim, at);
    for set in sets {
        let own = set.tracks.iter().enumerate().filter(|(_, track)| track.joint == 0);
        for (number, track) in own {
            let part = match track.path {
                Path::Translation => 0,
                Path::Rotation => 1,
                Path::Scale => 2,
                Path::Weights(_) => continue,
            };
            animate(prim, property_indices[part], track_samples(set, number, frames));
            if track.path == Path::Scale {
                add_visibility(prim, set, number, frames);
            }
        }
    }
}

fn add_visibility<'a>(prim: &mut Prim<'a>, set: &Rc<TrackSet<'a>>, track: usize, frames: Frames) {
    let mut numbers = Vec::new();
    set.values(track, &mut numbers);
    let times = &set.times[set.tracks[track].times];
    let mut changes: Vec<(Time, bool)> = Vec::new();
    for (time, size) in times.iter().zip(numbers.chunks(3)) {
        let visible = size != [0.0; 3];
        if changes.last().is_none_or(|(_, before)| *before != visible) {
            changes.push((*time, visible));
        }
    }
    if changes.iter().all(|(_, visible)| *visible) {
        return;
    }
    let times: Vec<Time> = changes.iter().map(|(time, _)| *time).collect();
    let tokens = changes.iter().map(|(_, visible)| if *visible { "inherited" } else { "invisible" });
    let values = SampleValues::Texts(tokens.collect());
    prim.add_attribute(TOKEN, "visibility").set_samples(Samples { times: frames.time_codes(&times), values });
}

/// The index of the track set that moves an actor's joints.
pub(crate) fn joint_set(baked: &Baked<'_>, sets: &Sets<'_>, actor: usize) -> Option<usize> {
    let moves = |set: &usize| sets[*set].tracks.iter().any(is_of_joint);
    baked.motions[actor].sets.iter().copied().find(moves)
}

fn is_of_joint(track: &Track) -> bool {
    track.joint > 0 && !matches!(track.path, Path::Weights(_))
}

/// Morph weights of one instance over time.
enum Weights<'a> {
    Still(Vec<f32>),
    Series(Series),
    Track(Rc<TrackSet<'a>>, usize),
}

impl Weights<'_> {
    fn times(&self) -> &[Time] {
        match self {
            Weights::Still(_) => &[],
            Weights::Series(series) => &series.times,
            Weights::Track(set, track) => &set.times[set.tracks[*track].times],
        }
    }

    /// The keys as a series, and whether values hold until the next key instead of being interpolated.
    fn series(&self) -> (Series, bool) {
        match self {
            Weights::Still(values) => {
                let (times, width) = (vec![Time::ZERO], values.len());
                (Series { times, values: values.clone(), width }, false)
            }
            Weights::Series(series) => (series.clone(), false),
            Weights::Track(set, number) => {
                let track = set.tracks[*number];
                let mut values = Vec::new();
                set.values(*number, &mut values);
                let (times, width) = (self.times().to_vec(), track.path.width());
                (Series { times, values, width }, track.interpolation == Interpolation::Step)
            }
        }
    }
}

fn instance_weights<'a>(
    baked: &Baked<'_>,
    sets: &[&Rc<TrackSet<'a>>],
    (index, actor): (usize, &Actor),
    instance: usize,
) -> Weights<'a> {
    let mesh_instance = &actor.asset.instances[instance];
    if let Some(series) = baked.series_of(Quantity::Weights { actor: index, instance }) {
        return match series.is_still() {
            true => Weights::Still(series.first().to_vec()),
            false => Weights::Series(series.clone()),
        };
    }
    for set in sets {
        let is_own =
            |track: &Track| track.joint == mesh_instance.joint + 1 && matches!(track.path, Path::Weights(_));
        if let Some(track) = set.tracks.iter().position(is_own) {
            return Weights::Track((*set).clone(), track);
        }
        let is_still = |(joint, path, _): &&(u32, Path, Vec<f32>)| {
            *joint == mesh_instance.joint + 1 && matches!(path, Path::Weights(_))
        };
        if let Some((_, _, value)) = set.still.iter().find(is_still) {
            return Weights::Still(value.clone());
        }
    }
    Weights::Still(mesh_instance.weights.clone())
}

/// The SkelAnimation of an actor's joints and morph targets; `None` where nothing moves.
pub(crate) fn animation<'a>(
    model: &Model<'a>,
    (index, actor): (usize, &'a Actor),
    (baked, sets, frames): (&Baked<'a>, &Sets<'a>, Frames),
    still: &[Transform],
) -> Option<Prim<'a>> {
    let paths = model.joints.as_ref()?;
    let mut out = Prim::new("SkelAnimation", "animation");
    if let Some(set) = joint_set(baked, sets, index) {
        let set = &sets[set];
        let skeleton = rig::skeleton(actor, Transform::IDENTITY)?;
        let rig =
            Skeleton::new(skeleton.names().to_vec(), skeleton.parents().to_vec(), still.to_vec()).ok()?;
        let mut animated_joints: Vec<u32> =
            set.tracks.iter().filter(|t| is_of_joint(t)).map(|t| t.joint).collect();
        animated_joints.sort_unstable();
        animated_joints.dedup();
        let names = animated_joints.iter().map(|joint| paths[*joint as usize - 1].clone()).collect();
        out.set_uniform_tokens("joints", names);
        let joint_tracks =
            JointTracks { set: set.clone(), rig: Rc::new(rig), animated_joints: animated_joints.into() };
        joint_tracks.add_attribute(
            &mut out,
            (QUATF, "rotations"),
            (Path::Rotation, |t| t.rotation.to_array()),
            frames,
        );
        joint_tracks.add_attribute(
            &mut out,
            (HALF3, "scales"),
            (Path::Scale, |t| t.scale.extend(0.0).to_array()),
            frames,
        );
        let translation: TransformPart = (Path::Translation, |t| t.translation.extend(0.0).to_array());
        joint_tracks.add_attribute(&mut out, (FLOAT3, "translations"), translation, frames);
    }
    let own: Vec<&Rc<TrackSet<'a>>> = baked.motions[index].sets.iter().map(|set| &sets[*set]).collect();
    let shaped = (0..model.shapes.len()).filter(|i| !model.shapes[*i].is_empty());
    let all: Vec<(usize, Weights<'a>)> =
        shaped.map(|instance| (instance, instance_weights(baked, &own, (index, actor), instance))).collect();
    add_weights(&mut out, model, all, frames);
    (!out.properties.is_empty()).then_some(out)
}

fn add_weights<'a>(out: &mut Prim<'a>, model: &Model<'a>, all: Vec<(usize, Weights<'a>)>, frames: Frames) {
    let is_nothing = |w: &Weights<'_>| matches!(w, Weights::Still(list) if list.iter().all(|v| *v == 0.0));
    if all.iter().all(|(_, weights)| is_nothing(weights)) {
        return;
    }
    let tokens: Vec<String> =
        all.iter().flat_map(|(instance, _)| model.shapes[*instance].iter().cloned()).collect();
    let count = tokens.len();
    out.set_uniform_tokens("blendShapes", tokens);
    let mut times: Vec<Time> = all.iter().flat_map(|(_, weights)| weights.times().iter().copied()).collect();
    let widths: Vec<usize> = all.iter().map(|(instance, _)| model.shapes[*instance].len()).collect();
    let series: Vec<(Series, bool)> = all.iter().map(|(_, weights)| weights.series()).collect();
    for (series, steps) in &series {
        if *steps {
            times.extend(series.times.iter().skip(1).map(|time| *time - Time(1)));
        }
    }
    times.sort_unstable();
    times.dedup();
    let at = move |time: Time| -> Vec<f64> {
        let mut row = Vec::with_capacity(count);
        for ((series, steps), width) in series.iter().zip(&widths) {
            let time = match steps {
                true => series.times.iter().rev().find(|key| **key <= time).copied().unwrap_or(time),
                false => time,
            };
            let value = series.at(time);
            row.extend((0..*width).map(|i| f64::from(value.get(i).copied().unwrap_or(0.0))));
        }
        row
    };
    match &times[..] {
        [] => {
            let row = at(Time::ZERO);
            out.set(FLOAT, "blendShapeWeights", Value::array(count, move |i| row[i]));
        }
        _ => {
            let list = frames.time_codes(&times);
            let each = move |take: RowSink<'_>| times.iter().try_for_each(|time| take(&at(*time)));
            let values = SampleValues::Numbers { count: Some(count), each: Rc::new(each) };
            out.add_attribute(FLOAT, "blendShapeWeights").set_samples(Samples { times: list, values });
        }
    }
}

/// A channel of a transform: its path, and a function that reads it. The fourth number is unused where the channel has three.
type TransformPart = (Path, fn(&Transform) -> [f32; 4]);

/// The moving joints of a rig, with their curves.
struct JointTracks<'a> {
    set: Rc<TrackSet<'a>>,
    /// The rig, with the pose of the joints that do not move as its rest pose.
    rig: Rc<Skeleton>,
    animated_joints: Rc<[u32]>,
}

impl<'a> JointTracks<'a> {
    fn add_attribute(
        &self,
        out: &mut Prim<'a>,
        (value_type, name): (Type, &str),
        (path, part): TransformPart,
        frames: Frames,
    ) {
        let attribute: &mut Attribute<'a> = out.add_attribute(value_type, name);
        let times = self.set.common_times(|track| track.joint > 0 && track.path == path);
        let count = self.animated_joints.len();
        if times.is_empty() {
            let (rig, animated_joints) = (self.rig.clone(), self.animated_joints.clone());
            let number = move |i: usize| {
                let joint = animated_joints[i / value_type.width] as usize;
                f64::from(part(&rig.rest()[joint])[i % value_type.width])
            };
            attribute.set_value(Value::array(count, number));
            return;
        }
        let list = frames.time_codes(&times);
        let (set, rig, animated_joints) = (self.set.clone(), self.rig.clone(), self.animated_joints.clone());
        let each = move |take: RowSink<'_>| {
            let mut row: Vec<f64> = vec![0.0; count * value_type.width];
            if let Some(curves) = set.aligned(path, &times) {
                return aligned_rows(
                    (&rig, &animated_joints),
                    &curves,
                    (value_type, part),
                    (&mut row, times.len()),
                    take,
                );
            }
            let mut curves = Vec::new();
            set.add_curves(|times| times.to_vec(), |_, number| number, &mut curves);
            curves.retain(|curve| curve.joint > 0 && curve.path == path);
            let clip = Clip::new(String::new(), rig.len(), curves).map_err(std::io::Error::other)?;
            let mut pose = Pose::rest(&rig);
            for time in &times {
                Sample { clip: &clip, time: *time, pose: &mut pose }.run();
                for (own, joint) in row.chunks_mut(value_type.width).zip(animated_joints.iter()) {
                    write_components(value_type, part(&pose.get(*joint as usize)), own);
                }
                take(&row)?;
            }
            Ok(())
        };
        let values = SampleValues::Numbers { count: Some(count), each: Rc::new(each) };
        attribute.set_samples(Samples { times: list, values });
    }
}

/// Hands over one row a key, from curves that all have the same key times; joints without a curve keep the rest pose.
fn aligned_rows(
    (rig, animated_joints): (&Skeleton, &[u32]),
    curves: &[(u32, Vec<f32>)],
    (value_type, part): (Type, fn(&Transform) -> [f32; 4]),
    (row, keys): (&mut [f64], usize),
    take: RowSink<'_>,
) -> std::io::Result<()> {
    for (own, joint) in row.chunks_mut(value_type.width).zip(animated_joints) {
        write_components(value_type, part(&rig.rest()[*joint as usize]), own);
    }
    let row_indices: Vec<Option<usize>> =
        curves.iter().map(|(joint, _)| animated_joints.iter().position(|own| own == joint)).collect();
    for key in 0..keys {
        for ((_, values), index) in curves.iter().zip(&row_indices) {
            let Some(index) = index else { continue };
            let mut numbers = [0.0; 4];
            numbers[..value_type.width]
                .copy_from_slice(&values[key * value_type.width..][..value_type.width]);
            write_components(value_type, numbers, &mut row[index * value_type.width..][..value_type.width]);
        }
        take(row)?;
    }
    Ok(())
}

/// Puts a channel's value into a row that still holds the previous one. A quaternion gets the sign nearer to the previous one, because
/// not all programs interpolate along the shorter arc.
fn write_components(value_type: Type, numbers: [f32; 4], own: &mut [f64]) {
    let numbers = numbers.map(f64::from);
    let turned: f64 = own.iter().zip(numbers).map(|(a, b)| *a * b).sum();
    let sign = if value_type.is_quaternion() && turned < 0.0 { -1.0 } else { 1.0 };
    own.iter_mut().zip(numbers).for_each(|(own, number)| *own = sign * number);
}
