//! Parts that make a model a character, for `choreo info`: humanoid bones, expressions, springs, eyes.

use super::hands;
use crate::scene::model::list;
use crate::terminal::{counted, page::Page};
use choreo_asset::{Asset, EyesMovedBy};
use choreo_motion::spring::parameters::ColliderShape;
use serde_json::{Value, json};

/// Adds the lines about a character to the overview. `joints`: also list the joint of each bone.
pub(super) fn write_character_lines(page: &mut Page, asset: &Asset, joints: bool) {
    for (label, about) in &asset.origin.about {
        page.line(format_args!("{label:<10} {about}"));
    }
    let name = |joint: u32| asset.skeleton.names().get(joint as usize).map_or("?", String::as_str);
    if let Some(humanoid) = asset.skeleton.humanoid() {
        page.line(format_args!("humanoid   {}", counted(humanoid.bones().count() as u64, "bone")));
        if joints {
            for (bone, joint) in humanoid.bones() {
                page.line(format_args!("  {:<24} {}", bone.name(), name(joint)));
            }
        }
    }
    if let Some(hands) = hands::hands_text(asset) {
        page.line(format_args!("hands      {hands}"));
    }
    if !asset.expressions.is_empty() {
        let names = list(asset.expressions.iter().map(|e| e.name.as_str()), 24);
        page.line(format_args!("expressions {}: {names}", asset.expressions.len()));
    }
    let springs = &asset.springs;
    if !springs.is_empty() {
        let spring_joints: usize = springs.chains.iter().map(|c| c.joints.len()).sum();
        page.line(format_args!(
            "springs    {}, {}, {}",
            counted(springs.chains.len() as u64, "chain"),
            counted(spring_joints as u64, "joint"),
            counted(springs.colliders.len() as u64, "collider")
        ));
        for chain in springs.chains.iter().take(if joints { usize::MAX } else { 8 }) {
            let Some(first) = chain.joints.first() else { continue };
            let chain_name =
                if chain.name.is_empty() { String::new() } else { format!(" \"{}\"", chain.name) };
            page.line(format_args!(
                "  {}{chain_name}: {}, stiffness {}, drag {}, gravity {}, radius {} m, {}",
                name(first.joint),
                counted(chain.joints.len() as u64, "joint"),
                first.stiffness,
                first.drag_force,
                first.gravity_power,
                first.hit_radius,
                counted(chain.colliders.len() as u64, "collider")
            ));
        }
    }
    if let Some(eyes) = &asset.eyes {
        let by = match eyes.moved_by {
            EyesMovedBy::Bones => "their bones",
            EyesMovedBy::Expressions => "expressions (lookLeft, lookRight, lookUp, lookDown)",
        };
        page.line(format_args!("eyes       moved by {by}"));
    }
}

pub(super) fn character_json(asset: &Asset) -> Value {
    let springs = &asset.springs;
    let colliders: Vec<Value> = springs
        .colliders
        .iter()
        .map(|c| json!({ "joint": c.joint, "shape": collider_json(&c.shape) }))
        .collect();
    let chains: Vec<Value> = springs
        .chains
        .iter()
        .map(|chain| {
            let joints: Vec<Value> = chain
                .joints
                .iter()
                .map(|j| {
                    json!({
                        "joint": j.joint, "tail": j.tail.to_array(), "hit_radius": j.hit_radius, "stiffness": j.stiffness,
                        "gravity_power": j.gravity_power, "gravity_direction": j.gravity_direction.to_array(),
                        "drag_force": j.drag_force,
                    })
                })
                .collect();
            json!({ "name": chain.name, "joints": joints, "colliders": chain.colliders, "center": chain.center })
        })
        .collect();
    let bones: Option<serde_json::Map<String, Value>> = asset
        .skeleton
        .humanoid()
        .map(|h| h.bones().map(|(bone, joint)| (bone.name().to_string(), joint.into())).collect());
    let about: Vec<Value> = asset.origin.about.iter().map(|(k, v)| json!([k, v])).collect();
    json!({
        "about": about,
        "humanoid": bones,
        "hands": hands::hands_json(asset),
        "expressions": asset.expressions.iter().map(|e| json!({
            "name": e.name, "binary": e.binary, "morphs": e.morphs.len(),
        })).collect::<Vec<_>>(),
        "springs": { "colliders": colliders, "chains": chains },
        "eyes": asset.eyes.as_ref().map(|e| match e.moved_by {
            EyesMovedBy::Bones => "bones",
            EyesMovedBy::Expressions => "expressions",
        }),
    })
}

fn collider_json(shape: &ColliderShape) -> Value {
    match shape {
        ColliderShape::Sphere { offset, radius, inside } => {
            json!({ "sphere": { "offset": offset.to_array(), "radius": radius, "inside": inside } })
        }
        ColliderShape::Capsule { offset, tail, radius, inside } => json!({ "capsule": {
            "offset": offset.to_array(), "tail": tail.to_array(), "radius": radius, "inside": inside,
        } }),
        ColliderShape::Plane { offset, normal } => {
            json!({ "plane": { "offset": offset.to_array(), "normal": normal.to_array() } })
        }
    }
}
