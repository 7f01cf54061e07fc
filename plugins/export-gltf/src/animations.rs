//! Animations: samplers and channels of the baked curves (glTF 2.0, §3.11; KHR_animation_pointer).

use crate::actors::{ActorNodes, Parts};
use crate::buffer::{F32, each_chunk};
use crate::cameras::ShotNode;
use crate::document::{Accessor, Animation, Channel, Index, Sampler, Target};
use crate::lights::LightNode;
use choreo_exporter_kit::bake::signals::{LightPart, MaterialPart, Quantity, TEXTURE_SLOTS};
use choreo_exporter_kit::bake::tracks::{TrackSet, seconds};
use choreo_exporter_kit::bake::{Baked, Series};
use choreo_plugin::asset::Projection;
use choreo_plugin::motion::{Interpolation, Path, Time, Transform};
use choreo_plugin::stage::Stage;
use serde_json::json;
use std::collections::BTreeMap;

/// The glTF nodes of all animated objects.
pub(crate) struct Nodes {
    /// One entry for each actor; `None` for actors that are never visible.
    pub actors: Vec<Option<ActorNodes>>,
    pub shots: Vec<ShotNode>,
    pub lights: Vec<LightNode>,
}

/// The samplers of a track set: joint of the rig, path, sampler.
pub(crate) type WrittenSet = Vec<(u32, Path, Sampler)>;

/// An animation under construction.
#[derive(Default)]
pub(crate) struct Builder {
    animation: Animation,
    /// Index of each sampler by its accessors, so that channels share equal ones.
    sampler_of_accessors: BTreeMap<(Index, Index), Index>,
}

impl Builder {
    fn channel(&mut self, sampler: Sampler, target: Target) {
        let list = &mut self.animation.samplers;
        let sampler =
            *self.sampler_of_accessors.entry((sampler.input, sampler.output)).or_insert_with(|| {
                list.push(sampler);
                list.len() as Index - 1
            });
        self.animation.channels.push(Channel { sampler, target });
    }

    fn node(&mut self, sampler: Sampler, node: Index, path: &'static str) {
        self.channel(sampler, Target { node: Some(node), path, extensions: None });
    }

    fn pointer(&mut self, sampler: Sampler, pointer: String) {
        let extensions = json!({ "KHR_animation_pointer": { "pointer": pointer } });
        self.channel(sampler, Target { node: None, path: "pointer", extensions: Some(Box::new(extensions)) });
    }

    pub(crate) fn finish(self, name: &str, parts: &mut Parts<'_>) {
        if !self.animation.channels.is_empty() {
            parts.document.animations.push(Animation { name: name.into(), ..self.animation });
        }
    }
}

/// Adds a single animation; with `split`, one for each actor, and one for cameras and lights.
pub(crate) fn add<'a>(
    parts: &mut Parts<'a>,
    stage: &Stage,
    mut baked: Baked<'a>,
    nodes: &Nodes,
    split: bool,
) {
    let start = baked.start;
    let sets: Vec<TrackSet<'a>> = std::mem::take(&mut baked.sets);
    let samplers: Vec<WrittenSet> = sets.into_iter().map(|set| write_set(parts, set, start)).collect();
    let mut builder = Builder::default();
    for (index, actor) in stage.actors.iter().enumerate() {
        let Some(of) = &nodes.actors[index] else { continue };
        for set in &baked.motions[index].sets {
            for (joint, path, sampler) in &samplers[*set] {
                actor_channel(&mut builder, actor.asset.instances.as_slice(), of, (*joint, *path), *sampler);
            }
        }
        material_channels(parts, &mut builder, &baked, index);
        weight_channels(parts, &mut builder, &baked, index, of);
        if split {
            std::mem::take(&mut builder).finish(&actor.name, parts);
        }
    }
    for (shot, node) in baked.shots.iter().zip(&nodes.shots) {
        shot_channels(parts, &mut builder, shot, node, start);
    }
    for light in &nodes.lights {
        light_channels(parts, &mut builder, &baked, light);
    }
    builder.finish(if split { "cameras and lights" } else { "timeline" }, parts);
}

/// Adds the times and values of a track set to the buffer. The values are computed only as the buffer is written.
pub(crate) fn write_set<'a>(parts: &mut Parts<'a>, set: TrackSet<'a>, start: Time) -> WrittenSet {
    let times: Vec<Vec<f32>> = set.times.iter().map(|times| seconds(times, start)).collect();
    let of_times: u64 = times.iter().map(|times| times.len() as u64 * 4).sum();
    let of_values: u64 = (0..set.tracks.len()).map(|track| set.numbers(track) as u64 * 4).sum();
    if of_times + of_values == 0 {
        return Vec::new();
    }
    let (mut inputs, mut out, mut at) = (Vec::new(), Vec::new(), 0);
    let view = parts.buffer.views.len() as Index;
    let mut accessor = |count: usize, shape, numbers: usize, bounds: Option<(f32, f32)>| {
        let mut accessor =
            Accessor { buffer_view: Some(view), byte_offset: at, ..Accessor::of(F32, shape, count) };
        if let Some((min, max)) = bounds {
            (accessor.min, accessor.max) = (vec![min], vec![max]);
        }
        at += numbers as u64 * 4;
        parts.buffer.accessor(accessor)
    };
    for times in &times {
        let bounds = times.first().copied().zip(times.last().copied());
        inputs.push(accessor(times.len(), "SCALAR", times.len(), bounds));
    }
    for (number, track) in set.tracks.iter().enumerate() {
        let numbers = set.numbers(number);
        let (shape, width) = match track.path {
            Path::Translation | Path::Scale => ("VEC3", 3),
            Path::Rotation => ("VEC4", 4),
            Path::Weights(_) => ("SCALAR", 1),
        };
        let output = accessor(numbers / width, shape, numbers, None);
        let interpolation = match track.interpolation {
            Interpolation::Step => "STEP",
            Interpolation::Linear => "LINEAR",
            Interpolation::CubicSpline => "CUBICSPLINE",
        };
        out.push((track.joint, track.path, Sampler { input: inputs[track.times], interpolation, output }));
    }
    parts.buffer.add_computed(of_times + of_values, move |file| {
        let mut numbers = Vec::new();
        for times in &times {
            each_chunk(times.len(), |i| [times[i]], |bytes| file.write_all(bytes))?;
        }
        for track in 0..set.tracks.len() {
            numbers.clear();
            set.values(track, &mut numbers);
            each_chunk(numbers.len(), |i| [numbers[i]], |bytes| file.write_all(bytes))?;
        }
        Ok(())
    });
    out
}

pub(crate) fn actor_channel(
    builder: &mut Builder,
    instances: &[choreo_plugin::asset::MeshInstance],
    nodes: &ActorNodes,
    (joint, path): (u32, Path),
    sampler: Sampler,
) {
    let name = match path {
        Path::Translation => "translation",
        Path::Rotation => "rotation",
        Path::Scale => "scale",
        Path::Weights(_) => {
            let on_joint = instances.iter().zip(&nodes.meshes).filter(|(i, _)| i.joint + 1 == joint);
            for node in on_joint.flat_map(|(_, nodes)| nodes) {
                builder.node(sampler, *node, "weights");
            }
            return;
        }
    };
    match joint.checked_sub(1) {
        None => builder.node(sampler, nodes.root, name),
        Some(joint) => nodes.characters.iter().for_each(|base| builder.node(sampler, base + joint, name)),
    }
}

/// A LINEAR sampler of a series, each value mapped by a function.
fn sampler(parts: &mut Parts<'_>, series: &Series, start: Time, change: impl Fn(f32) -> f32) -> Sampler {
    let times = seconds(&series.times, start);
    let values: Vec<f32> = series.values.iter().map(|v| change(*v)).collect();
    let (shape, width) = match series.width {
        2 => ("VEC2", 2),
        3 => ("VEC3", 3),
        4 => ("VEC4", 4),
        _ => ("SCALAR", 1),
    };
    let input = Accessor::of(F32, "SCALAR", times.len()).bounded(times.iter().map(|t| [*t]));
    let input = parts.buffer.array(move |i| [times[i]], None, input);
    let output = Accessor::of(F32, shape, values.len() / width);
    let output = match width {
        2 => parts.buffer.array(move |i| [values[2 * i], values[2 * i + 1]], None, output),
        3 => parts.buffer.array(move |i| [0, 1, 2].map(|k| values[3 * i + k]), None, output),
        4 => parts.buffer.array(move |i| [0, 1, 2, 3].map(|k| values[4 * i + k]), None, output),
        _ => parts.buffer.array(move |i| [values[i]], None, output),
    };
    Sampler { input, interpolation: "LINEAR", output }
}

pub(crate) fn weight_channels(
    parts: &mut Parts<'_>,
    builder: &mut Builder,
    baked: &Baked<'_>,
    actor: usize,
    of: &ActorNodes,
) {
    for (signal, series) in baked.series.iter().filter(|(_, series)| !series.is_still()) {
        let Quantity::Weights { actor: whose, instance } = signal.quantity else { continue };
        if whose == actor && !of.meshes[instance].is_empty() {
            // glTF stores weights as scalars, whatever their number.
            let scalars = Series { width: 1, ..series.clone() };
            let sampler = sampler(parts, &scalars, baked.start, |v| v);
            of.meshes[instance].iter().for_each(|node| builder.node(sampler, *node, "weights"));
        }
    }
}

fn material_channels(parts: &mut Parts<'_>, builder: &mut Builder, baked: &Baked<'_>, actor: usize) {
    let animated = parts.animated.clone();
    for ((_, material), index) in animated.iter().filter(|((of, _), _)| *of == actor) {
        for (signal, series) in baked.series.iter().filter(|(_, series)| !series.is_still()) {
            let Quantity::Material { actor: whose, material: which, part } = signal.quantity else {
                continue;
            };
            if (whose, which) != (actor, *material) {
                continue;
            }
            let brightest = series.values.iter().copied().fold(1.0, f32::max);
            let (path, divisor) = match part {
                MaterialPart::BaseColor => ("pbrMetallicRoughness/baseColorFactor".to_string(), 1.0),
                MaterialPart::Emissive => ("emissiveFactor".to_string(), brightest),
                MaterialPart::Metallic => ("pbrMetallicRoughness/metallicFactor".to_string(), 1.0),
                MaterialPart::Roughness => ("pbrMetallicRoughness/roughnessFactor".to_string(), 1.0),
                MaterialPart::AlphaCutoff => ("alphaCutoff".to_string(), 1.0),
                MaterialPart::NormalScale => ("normalTexture/scale".to_string(), 1.0),
                MaterialPart::OcclusionStrength => ("occlusionTexture/strength".to_string(), 1.0),
                MaterialPart::UvOffset(slot) => (transform_path(slot, "offset"), 1.0),
                MaterialPart::UvRotation(slot) => (transform_path(slot, "rotation"), 1.0),
                MaterialPart::UvScale(slot) => (transform_path(slot, "scale"), 1.0),
            };
            parts.extensions.insert("KHR_animation_pointer");
            let sampler = sampler(parts, series, baked.start, |v| v / divisor);
            builder.pointer(sampler, format!("/materials/{index}/{path}"));
        }
    }
}

/// JSON paths of a material's texture slots, in the exporter kit's order.
const SLOTS: [&str; TEXTURE_SLOTS as usize] = [
    "pbrMetallicRoughness/baseColorTexture",
    "pbrMetallicRoughness/metallicRoughnessTexture",
    "normalTexture",
    "occlusionTexture",
    "emissiveTexture",
    "extensions/KHR_materials_specular/specularTexture",
    "extensions/KHR_materials_specular/specularColorTexture",
];

fn transform_path(slot: u8, part: &str) -> String {
    format!("{}/extensions/KHR_texture_transform/{part}", SLOTS[usize::from(slot)])
}

fn shot_channels(
    parts: &mut Parts<'_>,
    builder: &mut Builder,
    shot: &choreo_exporter_kit::bake::shots::Shot,
    node: &ShotNode,
    start: Time,
) {
    let [position, rotation, lens] = &shot.parts;
    for (series, path) in [(position, "translation"), (rotation, "rotation")] {
        if !series.is_still() {
            let sampler = sampler(parts, series, start, |v| v);
            builder.node(sampler, node.node, path);
        }
    }
    if !lens.is_still() {
        let (path, factor) = match shot.projection {
            Projection::Perspective { .. } => ("perspective/yfov", 1.0),
            Projection::Orthographic { .. } => ("orthographic/ymag", 0.5),
        };
        parts.extensions.insert("KHR_animation_pointer");
        let sampler = sampler(parts, lens, start, |v| v * factor);
        builder.pointer(sampler, format!("/cameras/{}/{path}", node.camera));
    }
}

fn light_channels(parts: &mut Parts<'_>, builder: &mut Builder, baked: &Baked<'_>, of: &LightNode) {
    let (directional, has_cone) = (of.kind.is_directional(), of.kind.cone().is_some());
    for (signal, series) in baked.series.iter().filter(|(_, series)| !series.is_still()) {
        let Quantity::Light { light, part } = signal.quantity else { continue };
        let path = match part {
            _ if light != of.light => continue,
            LightPart::Position if directional => continue,
            LightPart::Range if directional => continue,
            LightPart::Inner | LightPart::Outer if !has_cone => continue,
            LightPart::Position | LightPart::Rotation => {
                let path = if part == LightPart::Position { "translation" } else { "rotation" };
                let sampler = sampler(parts, series, baked.start, |v| v);
                builder.node(sampler, of.node, path);
                continue;
            }
            LightPart::Color => "color",
            LightPart::Intensity => "intensity",
            LightPart::Range => "range",
            LightPart::Inner => "spot/innerConeAngle",
            LightPart::Outer => "spot/outerConeAngle",
        };
        parts.extensions.insert("KHR_animation_pointer");
        let sampler = sampler(parts, series, baked.start, |v| v);
        builder.pointer(sampler, format!("/extensions/KHR_lights_punctual/lights/{}/{path}", of.index));
    }
}

/// Adds one key for each joint whose constant pose in a clip differs from rest.
pub(crate) fn still_channels(
    parts: &mut Parts<'_>,
    builder: &mut Builder,
    of: &ActorNodes,
    rest: &[Transform],
    still: &[Transform],
) {
    for (joint, (rest, still)) in (1..).zip(rest.iter().zip(still)) {
        let numbers = |t: &Transform| {
            [t.translation.to_array().to_vec(), t.rotation.to_array().to_vec(), t.scale.to_array().to_vec()]
        };
        let paths = [Path::Translation, Path::Rotation, Path::Scale];
        for (path, (rest, values)) in paths.into_iter().zip(numbers(rest).into_iter().zip(numbers(still))) {
            if rest != values {
                let series = Series { times: vec![Time::ZERO], width: values.len(), values };
                let sampler = sampler(parts, &series, Time::ZERO, |v| v);
                actor_channel(builder, &[], of, (joint, path), sampler);
            }
        }
    }
}
