//! Keyed properties of an actor's joints, and of a cue: weight, speed and time.

use crate::state::keyed::{KeyedProperty, ValueKind, field_property, named_property};
use crate::state::selection::Selected;
use choreo_motion::edit::offset_in_parent;
use choreo_motion::{Curve, Interpolation, Path, Skeleton, Time};
use choreo_session::edit::ScriptObject;
use choreo_stage::{Actor, Channel, Cue, Described, Property};
use glam::{DMat3, DQuat, DVec3};

/// Joint properties that have keys, relative to the rest pose as in scripts.
pub(super) fn joint_properties(
    what: &Selected,
    actor: &Actor,
    object: Option<&ScriptObject>,
) -> Vec<KeyedProperty> {
    let Some(cue) = joint_keys_cue(actor) else { return Vec::new() };
    let skeleton = &actor.asset.skeleton;
    let stated: Vec<&str> = object.into_iter().flat_map(ScriptObject::keyed_joints).collect();
    let of = |curve: &Curve| {
        // The name in the script is used, which may be a short one.
        let joint = curve.joint as usize;
        let short = stated.iter().find(|name| skeleton.find(name) == Some(joint));
        let name =
            short.map_or_else(|| skeleton.names().get(joint).cloned(), |name| Some(name.to_string()))?;
        let channel = relative_to_rest(skeleton, curve)?;
        let (property, kind, unit) = match channel.property {
            Property::Rotation => ("rotation", ValueKind::Rotation, "°"),
            Property::Scale => ("scale", ValueKind::Scale, ""),
            _ => ("position", ValueKind::Numbers(3), "m"),
        };
        let name = format!("joint:{name}:{property}");
        Some(KeyedProperty { kind, unit, ..named_property(what, &name, vec![channel], Vec::new()) })
    };
    cue.clip.curves().iter().filter_map(of).collect()
}

/// The cue of an actor that holds the keys of its joints.
pub(super) fn joint_keys_cue(actor: &Actor) -> Option<&Cue> {
    let layer = actor.layers.iter().find(|layer| layer.rank == u32::MAX)?;
    layer.cues.first()
}

/// Converts a curve in the space of a joint's parent to keys relative to the rest pose.
fn relative_to_rest(skeleton: &Skeleton, curve: &Curve) -> Option<Channel> {
    let rest = skeleton.rest().get(curve.joint as usize)?;
    let cubic = curve.interpolation == Interpolation::CubicSpline;
    let values: Vec<f64> = curve.values.iter().map(|value| f64::from(*value)).collect();
    let (property, values) = match curve.path {
        Path::Rotation => {
            let back = rest.rotation.as_dquat().inverse();
            let of = |q: &[f64]| (back * DQuat::from_slice(q)).to_array();
            (Property::Rotation, values.chunks_exact(4).flat_map(of).collect())
        }
        Path::Scale => {
            let rest = rest.scale.as_dvec3();
            let of = |v: &[f64]| (DVec3::from_slice(v) / rest).to_array();
            (Property::Scale, values.chunks_exact(3).flat_map(of).collect())
        }
        Path::Translation => {
            let along = |axis| offset_in_parent(skeleton, curve.joint, axis);
            let back = DMat3::from_cols(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)).inverse();
            let rest = rest.translation.as_dvec3();
            let of = |(part, v): (usize, &[f64])| {
                let from = if cubic && part % 3 != 1 { DVec3::ZERO } else { rest };
                (back * (DVec3::from_slice(v) - from)).to_array()
            };
            (Property::Translation, values.chunks_exact(3).enumerate().flat_map(of).collect())
        }
        _ => return None,
    };
    let times: Vec<Time> = curve.times.to_vec();
    Some(Channel { property, interpolation: curve.interpolation, times, values })
}

/// Weight, speed and time of a cue, and the weight of its layer.
pub(super) fn keyed_cue_properties(
    what: &Selected,
    actor: &Actor,
    [layer, cue]: [usize; 2],
) -> Vec<KeyedProperty> {
    let Some(layer) = actor.layers.get(layer).filter(|layer| layer.rank != u32::MAX) else {
        return Vec::new();
    };
    let Some(cue) = layer.cues.get(cue) else { return Vec::new() };
    let of_option = |(name, property)| {
        let keys: Vec<Channel> = cue.keys(property).cloned().into_iter().collect();
        let method = format!(".{name}");
        match Cue::field(name) {
            Some(field) => field_property(what, field, cue, &method, keys),
            // The displayed time of the clip is unknown if there are no keys.
            None if keys.is_empty() => None,
            None => Some(KeyedProperty {
                unit: "s",
                range: [-1e6, 1e6],
                ..named_property(what, &method, keys, vec![0.0])
            }),
        }
    };
    let of_layer = layer.weight_keys.as_deref().cloned().into_iter().collect();
    let of_layer = named_property(what, ".layer_weight", of_layer, vec![1.0]);
    let mut all: Vec<KeyedProperty> = Cue::keyed_options().filter_map(of_option).collect();
    all.push(KeyedProperty { range: [0.0, 1.0], ..of_layer });
    all
}
