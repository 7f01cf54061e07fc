//! `secondaryAnimation` of VRM 0.x, converted to the springs of 1.0: each bone named there swings with all its descendants.

use crate::facing::from_unity;
use crate::json::At;
use crate::springs::{Numbers, colliders, drop_duplicates, gravity, tail};
use choreo_asset::Asset;
use choreo_importer_kit::Result;
use choreo_importer_kit::bones::model_from_joints;
use choreo_motion::spring::parameters::{ColliderShape, SpringChain, SpringCollider, SpringJoint, Springs};
use glam::{DAffine3, DVec3, Vec3};
use import_gltf::profile::Document;
use std::collections::BTreeMap;

/// Length of a spring bone without children, metres (VRMC_springBone 1.0, §"For vrm0").
const LAST_STICK: f64 = 0.07;

/// Reads the springs. Vectors are in the axes of the rotated model ([`crate::facing`]), except tails, which that module rotates.
pub(crate) fn read(document: &Document<'_>, vrm: &At<'_>, asset: &Asset) -> Result<Springs> {
    let mut out = Springs::default();
    let Some(secondary) = vrm.get("secondaryAnimation") else { return Ok(out) };
    let mut groups: Vec<Vec<u32>> = Vec::new();
    for at in secondary.list("colliderGroups")? {
        let mut group = Vec::new();
        let joint = match at.index("node")? {
            None => None,
            Some(node) => document.joint(node, &|| at.place_of("node"))?,
        };
        for sphere in at.list("colliders")? {
            let radius = Numbers { document, at: &sphere }.within("radius", 0.0, f32::MAX)?;
            let offset = from_unity(sphere.vec3_or("offset", Vec3::ZERO)?);
            let Some(joint) = joint else { continue };
            group.push(out.colliders.len() as u32);
            let shape = ColliderShape::Sphere { offset, radius, inside: false };
            out.colliders.push(SpringCollider { joint, shape });
        }
        groups.push(group);
    }
    let skeleton = &asset.skeleton;
    let rest = model_from_joints(skeleton);
    let mut children = vec![Vec::new(); skeleton.len()];
    for (joint, parent) in (0u32..).zip(skeleton.parents()) {
        if let Some(parent) = parent {
            children[*parent as usize].push(joint);
        }
    }
    let mut swinging = BTreeMap::new();
    for at in secondary.list("boneGroups")? {
        let like = parameters(document, &at)?;
        let center = match at.index("center")? {
            None => None,
            Some(node) => document.joint(node, &|| at.place_of("center"))?,
        };
        let colliders = colliders(document, &at, &groups)?;
        for bone in at.list("bones")? {
            let Some(node) = bone.own_index()? else { continue };
            let Some(root) = document.joint(node, &|| bone.place())? else {
                document.warn(bone.place(), format!("nodes[{node}] is not in the scene; it is left out"));
                continue;
            };
            document.charge(colliders.len() as u64, 4, &|| bone.place())?;
            if swinging.contains_key(&root) {
                document.warn(bone.place(), "already belongs to an earlier spring; it is left out here");
                continue;
            }
            let joints = subtree(root, &children, &rest, skeleton.parents(), &like);
            document.charge(joints.len() as u64, size_of::<SpringJoint>(), &|| bone.place())?;
            let joints = drop_duplicates(document, joints, &mut swinging, out.chains.len(), &bone);
            let name = at.text("comment").unwrap_or_default().to_string();
            out.chains.push(SpringChain { name, joints, colliders: colliders.clone(), center });
        }
    }
    Ok(out)
}

fn parameters(document: &Document<'_>, at: &At<'_>) -> Result<SpringJoint> {
    let mut numbers = Numbers { document, at };
    let direction = from_unity(at.vec3_or("gravityDir", Vec3::NEG_Y)?);
    let (gravity_direction, gravity_power) = gravity(direction, at.number_or("gravityPower", 0.0)?);
    Ok(SpringJoint {
        hit_radius: numbers.within("hitRadius", 0.02, f32::MAX)?,
        // VRM 0.x spells it this way.
        stiffness: numbers.within("stiffiness", 1.0, f32::MAX)?,
        drag_force: numbers.within("dragForce", 0.4, 1.0)?,
        gravity_direction,
        gravity_power,
        ..SpringJoint::default()
    })
}

/// A joint and its descendants, parents first.
fn subtree(
    root: u32,
    children: &[Vec<u32>],
    rest: &[DAffine3],
    parents: &[Option<u32>],
    like: &SpringJoint,
) -> Vec<SpringJoint> {
    let mut out = Vec::new();
    let mut stack = vec![root];
    while let Some(joint) = stack.pop() {
        let here = &rest[joint as usize];
        let tail = match children[joint as usize].first() {
            Some(child) => tail(here, &rest[*child as usize]),
            None => {
                let from = parents[joint as usize].map_or(DVec3::ZERO, |p| rest[p as usize].translation);
                let way = (here.translation - from).normalize_or_zero() * LAST_STICK;
                tail(here, &DAffine3::from_translation(here.translation + way))
            }
        };
        out.push(SpringJoint { joint, tail, ..like.clone() });
        stack.extend(children[joint as usize].iter().rev());
    }
    out
}
