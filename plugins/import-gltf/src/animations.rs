//! Animations to clips (glTF 2.0 §3.11).

use crate::accessor::Integers;
use crate::file::File;
use crate::meshes::morph_counts;
use crate::nodes::Tree;
use crate::pointers::{self, PointerTarget};
use crate::problem::{Problem, Result, WithPlace, element};
use choreo_motion::{Clip, ClipError, Curve, Interpolation, Path, PropertyCurve, PropertyTarget, Time};
use gltf::json::animation::{self, Property};
use gltf::json::validation::Checked;
use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;

/// Latest key time, seconds (about 115 days). Later keys are taken for damage.
pub(crate) const MAX_KEY_SECS: f32 = 1e7;

pub(crate) fn read(file: &File<'_>, tree: &Tree) -> Result<Vec<Arc<Clip>>> {
    let mut times = BTreeMap::new();
    let morphs = morph_counts(file);
    let mut clips = Vec::with_capacity(file.root.animations.len());
    for (index, animation) in file.root.animations.iter().enumerate() {
        let name = animation.name.clone().unwrap_or_else(|| format!("animation {index}"));
        let clip = match file.files.wants_clip(index, &name) {
            true => read_clip(file, tree, index, name, &morphs, &mut times)?,
            false => Clip::new(name, tree.skeleton.len(), Vec::new())
                .map_err(|e| Problem::new(format!("animations[{index}]"), e.to_string()))?,
        };
        clips.push(Arc::new(clip));
    }
    Ok(clips)
}

/// Key times of an accessor, and the indices of the keys to keep where times repeat.
struct Keys {
    times: Arc<[Time]>,
    count: usize,
    kept: Option<Vec<usize>>,
}

fn read_clip(
    file: &File<'_>,
    tree: &Tree,
    index: usize,
    name: String,
    morphs: &[usize],
    cache: &mut BTreeMap<usize, Keys>,
) -> Result<Clip> {
    let animation = &file.root.animations[index];
    let mut curves = Vec::with_capacity(animation.channels.len());
    let mut channel_of_curve = Vec::with_capacity(animation.channels.len());
    let mut properties = Vec::new();
    let mut channel_of_property = Vec::new();
    let mut targets = HashSet::new();
    for (number, channel) in animation.channels.iter().enumerate() {
        let place = || format!("animations[{index}].channels[{number}]");
        let warn_duplicate =
            || file.warn(place(), "animates the same property as an earlier channel; it is left out");
        match read_target(file, tree, (index, number), morphs, &place)? {
            None => {}
            Some(ChannelTarget::Joint(joint, path)) => {
                if !targets.insert((joint, std::mem::discriminant(&path))) {
                    warn_duplicate();
                    continue;
                }
                let sampler = element(&animation.samplers, channel.sampler.value(), "samplers", place)?;
                if let Some(curve) = read_curve(file, sampler, joint, path, cache, &place)? {
                    curves.push(curve);
                    channel_of_curve.push(number);
                }
            }
            Some(ChannelTarget::Properties { targets, factor }) => {
                let sampler = element(&animation.samplers, channel.sampler.value(), "samplers", place)?;
                let path = Path::Weights(targets.first().map_or(0, |t| t.width() as u32));
                let Some(curve) = read_curve(file, sampler, 0, path, cache, &place)? else { continue };
                let values: Arc<[f32]> = curve.values.iter().map(|v| v * factor).collect();
                for target in targets {
                    if properties.iter().any(|p: &PropertyCurve| p.target == target) {
                        warn_duplicate();
                        continue;
                    }
                    properties.push(PropertyCurve {
                        target,
                        interpolation: curve.interpolation,
                        times: curve.times.clone(),
                        values: values.clone(),
                    });
                    channel_of_property.push(number);
                }
            }
        }
    }
    let clip = Clip::new(name, tree.skeleton.len(), curves).and_then(|clip| clip.with_properties(properties));
    clip.map_err(|e| {
        let (channel, what) = match e {
            ClipError::Curve { curve, what, .. } => (channel_of_curve[curve], what),
            ClipError::Property { curve, what, .. } => (channel_of_property[curve], what),
        };
        Problem::new(format!("animations[{index}].channels[{channel}]"), what.to_string())
    })
}

enum ChannelTarget {
    Joint(u32, Path),
    /// Properties of equal width. Values of the file are multiplied by the factor.
    Properties {
        targets: Vec<PropertyTarget>,
        factor: f32,
    },
}

fn read_target(
    file: &File<'_>,
    tree: &Tree,
    (animation, number): (usize, usize),
    morphs: &[usize],
    place: &dyn Fn() -> String,
) -> Result<Option<ChannelTarget>> {
    let channel = &file.root.animations[animation].channels[number];
    if let Some(pointer) = file.pointers.get(&(animation, number)) {
        return match pointers::resolve_pointer(file, tree, pointer) {
            Some(PointerTarget::Node(node, property)) => {
                read_node_target(file, tree, node, property, morphs, place)
            }
            Some(PointerTarget::Properties { targets, factor }) => {
                Ok(Some(ChannelTarget::Properties { targets, factor }))
            }
            None => {
                file.warn(
                    place(),
                    format!("animates {pointer}, which cannot be animated here; it is left out"),
                );
                Ok(None)
            }
        };
    }
    match (channel.target.path, channel.target.node.value()) {
        (_, node) if node == pointers::NO_NODE as usize => {
            file.warn(place(), "names neither a node nor a pointer; it is left out");
            Ok(None)
        }
        (Checked::Valid(property), node) => read_node_target(file, tree, node, property, morphs, place),
        (Checked::Invalid, node) => {
            element(&file.root.nodes, node, "nodes", place)?;
            file.warn(place(), "animates an unknown property; it is left out");
            Ok(None)
        }
    }
}

fn read_node_target(
    file: &File<'_>,
    tree: &Tree,
    node: usize,
    property: Property,
    morphs: &[usize],
    place: &dyn Fn() -> String,
) -> Result<Option<ChannelTarget>> {
    let node_json = element(&file.root.nodes, node, "nodes", place)?;
    let Some(joint) = tree.joint_of_node[node] else {
        file.warn(place(), format!("animates nodes[{node}], which is not in the scene; it is left out"));
        return Ok(None);
    };
    let path = match property {
        Property::Translation => Path::Translation,
        Property::Rotation => Path::Rotation,
        Property::Scale => Path::Scale,
        Property::MorphTargetWeights => match node_json.mesh {
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
    };
    Ok(Some(ChannelTarget::Joint(joint, path)))
}

fn read_curve(
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
        slot.insert(read_keys(file, input).at(place)?);
    }
    let keys = &cache[&input];
    let output = sampler.output.value();
    let values = match path {
        Path::Translation | Path::Scale => {
            file.read_floats::<3>(output, Integers::AsFlagged).map(Vec::into_flattened)
        }
        Path::Rotation => file.read_floats::<4>(output, Integers::Normalized).map(Vec::into_flattened),
        Path::Weights(_) => match file.width(output) {
            // Vectors of colors and texture transforms.
            Some(2) => file.read_floats::<2>(output, Integers::Normalized).map(Vec::into_flattened),
            Some(3) => file.read_floats::<3>(output, Integers::Normalized).map(Vec::into_flattened),
            Some(4) => file.read_floats::<4>(output, Integers::Normalized).map(Vec::into_flattened),
            _ => file.read_floats::<1>(output, Integers::Normalized).map(Vec::into_flattened),
        },
    };
    let mut values = values.at(place)?;
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

/// Decreasing key times are an error, because the intended order is unknown. Of keys at the same time (within a tick) the last
/// one counts, as it would just after that time.
fn read_keys(file: &File<'_>, accessor: usize) -> Result<Keys> {
    let secs = file.read_floats::<1>(accessor, Integers::AsFlagged)?.into_flattened();
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
