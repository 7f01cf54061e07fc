//! KHR_animation_pointer: channels that name their target by a path into the JSON (RFC 6901).

use crate::file::File;
use crate::nodes::Tree;
use choreo_motion::{MaterialProperty, PropertyTarget};
use gltf::json::animation::Property;
use serde_json::Value;
use std::collections::BTreeMap;

pub(crate) const NAME: &str = "KHR_animation_pointer";

/// Node index of channels that have a pointer instead, because the typed form requires a number.
pub(crate) const NO_NODE: u32 = u32::MAX;

/// Pointers by (animation, channel).
pub(crate) type Pointers = BTreeMap<(usize, usize), String>;

/// Sets the node of every channel without one to [`NO_NODE`], and collects the channels' pointers. `None` where every channel has
/// a node.
pub(crate) fn mark_channels(root: &mut Value) -> Option<Pointers> {
    let mut pointers = Pointers::new();
    let mut any = false;
    let animations = root.get_mut("animations").and_then(Value::as_array_mut);
    for (a, animation) in animations.into_iter().flatten().enumerate() {
        let channels = animation.get_mut("channels").and_then(Value::as_array_mut);
        for (c, channel) in channels.into_iter().flatten().enumerate() {
            let Some(target) = channel.get_mut("target").and_then(Value::as_object_mut) else { continue };
            if target.contains_key("node") {
                continue;
            }
            any = true;
            let pointer = target.get("extensions").and_then(|e| e.get(NAME)?.get("pointer")?.as_str());
            if let Some(pointer) = pointer {
                pointers.insert((a, c), pointer.to_string());
            }
            target.insert("node".into(), NO_NODE.into());
        }
    }
    any.then_some(pointers)
}

/// The meaning of a pointer in the asset.
pub(crate) enum PointerTarget {
    /// A property of a node, as in plain channels.
    Node(usize, Property),
    /// A property of each object that the file's element became: a camera on two nodes is two objects.
    Properties { targets: Vec<PropertyTarget>, factor: f32 },
}

/// Resolves a pointer; `None` where it names nothing that can be animated.
pub(crate) fn resolve_pointer(file: &File<'_>, tree: &Tree, pointer: &str) -> Option<PointerTarget> {
    let steps: Vec<&str> = pointer.strip_prefix('/')?.split('/').collect();
    let number = |text: &str| text.parse::<usize>().ok();
    let things = |list: Vec<u32>, target: fn(u32) -> PropertyTarget, factor: f32| {
        let targets: Vec<PropertyTarget> = list.into_iter().map(target).collect();
        (!targets.is_empty()).then_some(PointerTarget::Properties { targets, factor })
    };
    match steps[..] {
        ["nodes", node, property] => {
            let property = match property {
                "translation" => Property::Translation,
                "rotation" => Property::Rotation,
                "scale" => Property::Scale,
                "weights" => Property::MorphTargetWeights,
                _ => return None,
            };
            Some(PointerTarget::Node(number(node)?, property))
        }
        ["cameras", camera, "perspective", "yfov"] => {
            things(cameras_of(file, tree, number(camera)?), PropertyTarget::CameraYfov, 1.0)
        }
        ["cameras", camera, "orthographic", "ymag"] => {
            things(cameras_of(file, tree, number(camera)?), PropertyTarget::CameraHeight, 2.0)
        }
        ["extensions", "KHR_lights_punctual", "lights", light, property] => {
            let lights = lights_of(file, tree, number(light)?);
            match property {
                "color" => things(lights, PropertyTarget::LightColor, 1.0),
                "intensity" => things(lights, PropertyTarget::LightIntensity, 1.0),
                "range" => things(lights, PropertyTarget::LightRange, 1.0),
                _ => None,
            }
        }
        ["extensions", "KHR_lights_punctual", "lights", light, "spot", angle] => {
            let lights = lights_of(file, tree, number(light)?);
            match angle {
                "innerConeAngle" => things(lights, PropertyTarget::SpotInner, 1.0),
                "outerConeAngle" => things(lights, PropertyTarget::SpotOuter, 1.0),
                _ => None,
            }
        }
        ["materials", material, "pbrMetallicRoughness", "baseColorFactor"] => {
            let material = number(material).filter(|m| *m < file.root.materials.len())?;
            things(vec![material as u32], PropertyTarget::BaseColor, 1.0)
        }
        ["materials", material, ref path @ ..] => {
            let material = number(material).filter(|m| *m < file.root.materials.len())?;
            let (property, factor) = material_property(&file.root.materials[material], path)?;
            let targets = vec![PropertyTarget::Material(material as u32, property)];
            Some(PointerTarget::Properties { targets, factor })
        }
        _ => None,
    }
}

/// The material property that the rest of a pointer names, and the factor of its values.
fn material_property(material: &gltf::json::Material, path: &[&str]) -> Option<(MaterialProperty, f32)> {
    let strength = || {
        let extensions = material.extensions.as_ref()?;
        Some(extensions.emissive_strength.as_ref()?.emissive_strength.0)
    };
    let plain = |property| Some((property, 1.0));
    match path {
        ["emissiveFactor"] => Some((MaterialProperty::Emissive, strength().unwrap_or(1.0).max(0.0))),
        // The asset stores emissive factor and strength as their product, so the strength can be animated unless the product is
        // zero at rest.
        ["extensions", "KHR_materials_emissive_strength", "emissiveStrength"] => {
            let rest = strength().filter(|s| *s > 0.0)?;
            Some((MaterialProperty::EmissiveStrength, 1.0 / rest))
        }
        ["pbrMetallicRoughness", "metallicFactor"] => plain(MaterialProperty::Metallic),
        ["pbrMetallicRoughness", "roughnessFactor"] => plain(MaterialProperty::Roughness),
        ["alphaCutoff"] => plain(MaterialProperty::AlphaCutoff),
        ["normalTexture", "scale"] => plain(MaterialProperty::NormalScale),
        ["occlusionTexture", "strength"] => plain(MaterialProperty::OcclusionStrength),
        [texture @ .., "extensions", "KHR_texture_transform", part] => {
            let slot = match texture {
                ["pbrMetallicRoughness", "baseColorTexture"] => 0,
                ["pbrMetallicRoughness", "metallicRoughnessTexture"] => 1,
                ["normalTexture"] => 2,
                ["occlusionTexture"] => 3,
                ["emissiveTexture"] => 4,
                ["extensions", "KHR_materials_specular", "specularTexture"] => 5,
                ["extensions", "KHR_materials_specular", "specularColorTexture"] => 6,
                _ => return None,
            };
            match *part {
                "offset" => plain(MaterialProperty::UvOffset(slot)),
                "rotation" => plain(MaterialProperty::UvRotation(slot)),
                "scale" => plain(MaterialProperty::UvScale(slot)),
                _ => None,
            }
        }
        _ => None,
    }
}

/// The asset's cameras that a camera of the file became. Their order is that of `objects::cameras`.
fn cameras_of(file: &File<'_>, tree: &Tree, camera: usize) -> Vec<u32> {
    let shown = tree.node_of_joint[..tree.scene_joint_count].iter();
    let all = shown.filter_map(|node| file.root.nodes[*node].camera.map(|c| c.value()));
    (0..).zip(all).filter(|(_, of)| *of == camera).map(|(index, _)| index).collect()
}

/// The asset's lights that a light of the file became. Their order is that of `objects::lights`.
fn lights_of(file: &File<'_>, tree: &Tree, light: usize) -> Vec<u32> {
    let shown = tree.node_of_joint[..tree.scene_joint_count].iter();
    let all = shown.filter_map(|node| {
        let extensions = file.root.nodes[*node].extensions.as_ref()?;
        Some(extensions.khr_lights_punctual.as_ref()?.light.value())
    });
    (0..).zip(all).filter(|(_, of)| *of == light).map(|(index, _)| index).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_without_a_node_are_marked() {
        let mut root = serde_json::json!({"animations": [{"channels": [
            {"sampler": 0, "target": {"node": 3, "path": "scale"}},
            {"sampler": 0, "target": {"path": "pointer", "extensions": {NAME: {"pointer": "/x"}}}}]}]});
        let pointers = mark_channels(&mut root).unwrap();
        assert_eq!(pointers.into_iter().collect::<Vec<_>>(), [((0, 1), "/x".to_string())]);
        let nodes = |root: &Value| {
            let channels = root["animations"][0]["channels"].as_array().unwrap().clone();
            channels.iter().map(|c| c["target"]["node"].as_u64().unwrap()).collect::<Vec<_>>()
        };
        assert_eq!(nodes(&root), [3, u64::from(NO_NODE)]);
        assert_eq!(mark_channels(&mut root), None, "once is enough");
    }
}
