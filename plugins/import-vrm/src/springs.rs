//! `VRMC_springBone` 1.0 and its extended colliders.

use crate::json::At;
use choreo_asset::Asset;
use choreo_importer_kit::bones::model_from_joints;
use choreo_importer_kit::{Problem, Result};
use choreo_motion::Skeleton;
use choreo_motion::spring::parameters::{ColliderShape, SpringChain, SpringCollider, SpringJoint, Springs};
use glam::{DAffine3, Vec3};
use import_gltf::profile::Document;
use std::collections::{BTreeMap, BTreeSet};

pub(crate) fn read(document: &Document<'_>, springs: &At<'_>, asset: &Asset) -> Result<Springs> {
    crate::version(document, springs, "1.0");
    let mut out = Springs::default();
    // Index in `out` of each collider of the file; `None` for colliders outside the scene.
    let mut place_of = Vec::new();
    for at in springs.list("colliders")? {
        let node = at.needed_index("node")?;
        let joint = document.joint(node, &|| at.place_of("node"))?;
        place_of.push(match joint {
            Some(joint) => {
                out.colliders.push(SpringCollider { joint, shape: shape(document, &at)? });
                Some(out.colliders.len() as u32 - 1)
            }
            None => {
                document.warn(at.place(), format!("nodes[{node}] is not in the scene; it is left out"));
                None
            }
        });
    }
    let mut groups: Vec<Vec<u32>> = Vec::new();
    for at in springs.list("colliderGroups")? {
        let mut group = Vec::new();
        for index in at.list("colliders")? {
            let Some(number) = index.own_index()? else { continue };
            let collider =
                choreo_importer_kit::problem::element(&place_of, number, "colliders", || index.place())?;
            group.extend(*collider);
        }
        groups.push(group);
    }
    let rest = model_from_joints(&asset.skeleton);
    let mut swinging = BTreeMap::new();
    for (index, at) in springs.list("springs")?.enumerate() {
        let joints = spring_joints(document, &at, &asset.skeleton, &rest)?;
        let center = match at.index("center")? {
            None => None,
            Some(node) => document.joint(node, &|| at.place_of("center"))?,
        };
        let chain = SpringChain {
            name: at.text("name").unwrap_or_default().to_string(),
            joints: drop_duplicates(document, joints, &mut swinging, index, &at),
            colliders: colliders(document, &at, &groups)?,
            center,
        };
        if !chain.joints.is_empty() {
            out.chains.push(chain);
        }
    }
    Ok(out)
}

/// The colliders of a spring's collider groups, without duplicates.
pub(crate) fn colliders(document: &Document<'_>, at: &At<'_>, groups: &[Vec<u32>]) -> Result<Vec<u32>> {
    let mut all = BTreeSet::new();
    for group in at.list("colliderGroups")? {
        let Some(index) = group.own_index()? else { continue };
        let group = choreo_importer_kit::problem::element(groups, index, "colliderGroups", || group.place())?;
        document.charge(group.len() as u64, 32, &|| at.place())?;
        all.extend(group);
    }
    Ok(all.into_iter().collect())
}

/// Drops joints that an earlier spring moves (§"Exception"), because two springs cannot move one joint.
pub(crate) fn drop_duplicates(
    document: &Document<'_>,
    joints: Vec<SpringJoint>,
    swinging: &mut BTreeMap<u32, usize>,
    chain: usize,
    at: &At<'_>,
) -> Vec<SpringJoint> {
    let count = joints.len();
    let kept: Vec<SpringJoint> =
        joints.into_iter().filter(|j| *swinging.entry(j.joint).or_insert(chain) == chain).collect();
    if kept.len() < count {
        let what = format!(
            "{} of its joints already belong to an earlier spring and are left out here",
            count - kept.len()
        );
        document.warn(at.place(), what);
    }
    kept
}

/// Makes spring joints from the joints of a chain, each with the next joint as its tail. The last joint is only a tail.
fn spring_joints(
    document: &Document<'_>,
    spring: &At<'_>,
    skeleton: &Skeleton,
    rest: &[DAffine3],
) -> Result<Vec<SpringJoint>> {
    let mut out: Vec<SpringJoint> = Vec::new();
    let mut before: Option<SpringJoint> = None;
    let mut seen = BTreeSet::new();
    for at in spring.list("joints")? {
        let node = at.needed_index("node")?;
        let Some(joint) = document.joint(node, &|| at.place_of("node"))? else {
            document.warn(at.place(), format!("nodes[{node}] is not in the scene; the spring ends here"));
            break;
        };
        if !seen.insert(joint) {
            document.warn(at.place(), format!("nodes[{node}] is in this spring already; it ends here"));
            break;
        }
        if let Some(mut head) = before {
            if !is_above(skeleton, head.joint, joint) {
                let what = format!("nodes[{node}] is not below the joint before it; the spring ends here");
                document.warn(at.place(), what);
                break;
            }
            document.charge(u64::from(joint - head.joint), 1, &|| at.place())?;
            head.tail = tail(&rest[head.joint as usize], &rest[joint as usize]);
            out.push(head);
        }
        before = Some(spring_joint(document, &at, joint)?);
    }
    Ok(out)
}

fn is_above(skeleton: &Skeleton, above: u32, joint: u32) -> bool {
    let parents = skeleton.parents();
    let chain = std::iter::successors(parents[joint as usize], |j| parents[*j as usize]);
    // Parents have smaller indices, so the search can stop early.
    chain.take_while(|j| *j >= above).any(|j| j == above)
}

/// The origin of another joint in a joint's space.
pub(crate) fn tail(model_from_joint: &DAffine3, model_from_other: &DAffine3) -> Vec3 {
    let tail = model_from_joint.inverse().transform_point3(model_from_other.translation).as_vec3();
    if tail.is_finite() { tail } else { Vec3::ZERO }
}

fn spring_joint(document: &Document<'_>, at: &At<'_>, joint: u32) -> Result<SpringJoint> {
    let default = SpringJoint::default();
    let mut numbers = Numbers { document, at };
    let direction = at.vec3_or("gravityDir", default.gravity_direction)?;
    let power = at.number_or("gravityPower", default.gravity_power)?;
    let (gravity_direction, gravity_power) = gravity(direction, power);
    Ok(SpringJoint {
        joint,
        tail: Vec3::ZERO,
        hit_radius: numbers.within("hitRadius", default.hit_radius, f32::MAX)?,
        stiffness: numbers.within("stiffness", default.stiffness, f32::MAX)?,
        drag_force: numbers.within("dragForce", default.drag_force, 1.0)?,
        gravity_power,
        gravity_direction,
    })
}

/// Gravity with a unit direction. The length of the given direction multiplies the power, as in the specification.
pub(crate) fn gravity(direction: Vec3, power: f32) -> (Vec3, f32) {
    let length = direction.length();
    match direction.try_normalize() {
        Some(unit) if (power * length).is_finite() => (unit, power * length),
        _ => (Vec3::NEG_Y, 0.0),
    }
}

/// Reads numbers that must lie between 0 and a limit; others are clamped, with a warning.
pub(crate) struct Numbers<'a, 'd> {
    pub document: &'a Document<'d>,
    pub at: &'a At<'a>,
}

impl Numbers<'_, '_> {
    pub(crate) fn within(&mut self, key: &str, default: f32, most: f32) -> Result<f32> {
        let given = self.at.number_or(key, default)?;
        let used = given.clamp(0.0, most);
        if used != given {
            self.document.warn(self.at.place_of(key), format!("is {given}; {used} is used"));
        }
        Ok(used)
    }
}

fn shape(document: &Document<'_>, at: &At<'_>) -> Result<ColliderShape> {
    let extension = at.get("extensions").and_then(|e| e.get("VRMC_springBone_extended_collider"));
    let extended = extension.and_then(|e| e.get("shape"));
    let Some(shape) = extended.or_else(|| at.get("shape")) else {
        return Err(Problem::new(at.place_of("shape"), "is missing"));
    };
    if let Some(sphere) = shape.get("sphere") {
        return Ok(ColliderShape::Sphere {
            offset: sphere.vec3_or("offset", Vec3::ZERO)?,
            radius: Numbers { document, at: &sphere }.within("radius", 0.0, f32::MAX)?,
            inside: sphere.flag("inside")?.unwrap_or(false),
        });
    }
    if let Some(capsule) = shape.get("capsule") {
        return Ok(ColliderShape::Capsule {
            offset: capsule.vec3_or("offset", Vec3::ZERO)?,
            tail: capsule.vec3_or("tail", Vec3::ZERO)?,
            radius: Numbers { document, at: &capsule }.within("radius", 0.0, f32::MAX)?,
            inside: capsule.flag("inside")?.unwrap_or(false),
        });
    }
    if let Some(plane) = shape.get("plane") {
        let normal = plane.vec3_or("normal", Vec3::Z)?;
        let Some(normal) = normal.try_normalize() else {
            return Err(Problem::new(plane.place_of("normal"), "has length 0"));
        };
        return Ok(ColliderShape::Plane { offset: plane.vec3_or("offset", Vec3::ZERO)?, normal });
    }
    Err(Problem::new(shape.place(), "is neither a sphere nor a capsule"))
}
