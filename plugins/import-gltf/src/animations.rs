//! Animations to clips (glTF 2.0 §3.11).

use crate::accessor::Integers;
use crate::file::File;
use crate::meshes::morph_counts;
use crate::nodes::Tree;
use crate::problem::{Problem, Result, element};
use choreo_motion::{Clip, ClipError, Curve, Interpolation, Path, Time};
use gltf::json::animation::{self, Property};
use gltf::json::validation::Checked;
use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;

/// Keys further out than this (about 115 days) are taken for damage.
pub const MAX_KEY_SECS: f32 = 1e7;

pub fn read(file: &File<'_>, tree: &Tree) -> Result<Vec<Arc<Clip>>> {
    let mut times = BTreeMap::new();
    let morphs = morph_counts(file);
    let mut clips = Vec::with_capacity(file.root.animations.len());
    for index in 0..file.root.animations.len() {
        clips.push(Arc::new(clip(file, tree, index, &morphs, &mut times)?));
    }
    Ok(clips)
}

/// Key times of an accessor, and which keys are kept where times repeat.
struct Keys {
    times: Arc<[Time]>,
    count: usize,
    kept: Option<Vec<usize>>,
}

fn clip(
    file: &File<'_>,
    tree: &Tree,
    index: usize,
    morphs: &[usize],
    cache: &mut BTreeMap<usize, Keys>,
) -> Result<Clip> {
    let animation = &file.root.animations[index];
    let mut curves = Vec::with_capacity(animation.channels.len());
    let mut channel_of_curve = Vec::with_capacity(animation.channels.len());
    let mut targets = HashSet::new();
    for (number, channel) in animation.channels.iter().enumerate() {
        let place = || format!("animations[{index}].channels[{number}]");
        let Some((joint, path)) = target(file, tree, channel, morphs, &place)? else { continue };
        if !targets.insert((joint, std::mem::discriminant(&path))) {
            file.warn(place(), "animates the same property as an earlier channel; it is left out");
            continue;
        }
        let sampler = element(&animation.samplers, channel.sampler.value(), "samplers", place)?;
        if let Some(curve) = curve(file, sampler, joint, path, cache, &place)? {
            curves.push(curve);
            channel_of_curve.push(number);
        }
    }
    let name = animation.name.clone().unwrap_or_else(|| format!("animation {index}"));
    Clip::new(name, tree.skeleton.len(), curves).map_err(|e| {
        let ClipError::Curve { curve, what, .. } = e;
        Problem::new(format!("animations[{index}].channels[{}]", channel_of_curve[curve]), what)
    })
}

fn target(
    file: &File<'_>,
    tree: &Tree,
    channel: &animation::Channel,
    morphs: &[usize],
    place: &dyn Fn() -> String,
) -> Result<Option<(u32, Path)>> {
    let node = channel.target.node.value();
    let node_json = element(&file.root.nodes, node, "nodes", place)?;
    let Some(joint) = tree.joint_of_node[node] else {
        file.warn(place(), format!("animates nodes[{node}], which is not in the scene; it is left out"));
        return Ok(None);
    };
    let path = match channel.target.path {
        Checked::Valid(Property::Translation) => Path::Translation,
        Checked::Valid(Property::Rotation) => Path::Rotation,
        Checked::Valid(Property::Scale) => Path::Scale,
        Checked::Valid(Property::MorphTargetWeights) => match node_json.mesh {
            Some(mesh) => match *element(morphs, mesh.value(), "meshes", || format!("nodes[{node}].mesh"))? {
                0 => {
                    file.warn(
                        place(),
                        format!("animates weights of nodes[{node}], whose mesh has no morph targets"),
                    );
                    return Ok(None);
                }
                n => Path::Weights(n as u32),
            },
            None => {
                file.warn(place(), format!("animates weights of nodes[{node}], which has no mesh"));
                return Ok(None);
            }
        },
        Checked::Invalid => {
            file.warn(place(), "animates an unknown property; it is left out");
            return Ok(None);
        }
    };
    Ok(Some((joint, path)))
}

fn curve(
    file: &File<'_>,
    sampler: &animation::Sampler,
    joint: u32,
    path: Path,
    cache: &mut BTreeMap<usize, Keys>,
    place: &dyn Fn() -> String,
) -> Result<Option<Curve>> {
    let interpolation = match sampler.interpolation {
        Checked::Valid(animation::Interpolation::Step) => Interpolation::Step,
        Checked::Valid(animation::Interpolation::Linear) => Interpolation::Linear,
        Checked::Valid(animation::Interpolation::CubicSpline) => Interpolation::CubicSpline,
        Checked::Invalid => {
            return Err(Problem::new(place(), "has an unknown interpolation")
                .hint("glTF knows STEP, LINEAR and CUBICSPLINE"));
        }
    };
    let input = sampler.input.value();
    if let std::collections::btree_map::Entry::Vacant(slot) = cache.entry(input) {
        slot.insert(keys(file, input).map_err(|p| p.used_by(place()))?);
    }
    let keys = &cache[&input];
    let output = sampler.output.value();
    let values = match path {
        Path::Translation | Path::Scale => {
            file.floats::<3>(output, Integers::AsFlagged).map(Vec::into_flattened)
        }
        Path::Rotation => file.floats::<4>(output, Integers::Normalized).map(Vec::into_flattened),
        Path::Weights(_) => file.floats::<1>(output, Integers::Normalized).map(Vec::into_flattened),
    };
    let mut values = values.map_err(|p| p.used_by(place()))?;
    let per_key = path.width() * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    if values.len() != keys.count * per_key {
        return Err(Problem::new(
            place(),
            format!(
                "has {} keys and needs {} numbers, but accessors[{output}] holds {}",
                keys.count,
                keys.count * per_key,
                values.len()
            ),
        ));
    }
    if keys.count == 0 {
        file.warn(place(), "has no keys; it is left out");
        return Ok(None);
    }
    if let Some(kept) = &keys.kept {
        values = kept.iter().flat_map(|k| values[k * per_key..(k + 1) * per_key].iter().copied()).collect();
    }
    Ok(Some(Curve { joint, path, interpolation, times: keys.times.clone(), values: values.into() }))
}

/// Times that run backwards are an error: nobody can say what was meant. A time that repeats (within a
/// tick) is harmless: the last key of that time counts, as it would just after it.
fn keys(file: &File<'_>, accessor: usize) -> Result<Keys> {
    let secs = file.floats::<1>(accessor, Integers::AsFlagged)?.into_flattened();
    let fail =
        |k: usize, what: String| Problem::new(format!("accessors[{accessor}]"), format!("key {k} {what}"));
    let mut times: Vec<Time> = Vec::with_capacity(secs.len());
    for (k, s) in secs.iter().enumerate() {
        if *s < 0.0 {
            return Err(fail(k, format!("is at {s} s; key times start at 0"))
                .hint("export the clip again with its first frame at 0"));
        }
        if *s > MAX_KEY_SECS {
            return Err(fail(k, format!("is at {s} s; the limit is {MAX_KEY_SECS} s")));
        }
        let time = Time::from_secs(f64::from(*s));
        if let Some(last) = times.last()
            && time < *last
        {
            return Err(fail(k, format!("is at {s} s, before key {} at {} s", k - 1, secs[k - 1]))
                .hint("key times must increase"));
        }
        times.push(time);
    }
    let count = times.len();
    let last_of_its_time = |k: &usize| *k + 1 == count || times[*k] < times[*k + 1];
    let kept: Vec<usize> = (0..count).filter(last_of_its_time).collect();
    if kept.len() == count {
        return Ok(Keys { times: times.into(), count, kept: None });
    }
    file.warn(
        format!("accessors[{accessor}]"),
        format!("{} of {count} key times repeat; the last key of each time is used", count - kept.len()),
    );
    let times = kept.iter().map(|k| times[*k]).collect();
    Ok(Keys { times, count, kept: Some(kept) })
}
