//! `<controller>`: skins and morphs.

use crate::geometry::Geometry;
use crate::nodes::{Tree, find_joint};
use crate::source::{doubles, floats, inputs, names};
use crate::xml::{Node, NodeId};
use crate::xml::{Xml, child, children, name_of};
use choreo_asset::{MorphTarget, Skin};
use choreo_importer_kit::Result;
use glam::{DMat4, Mat4, Vec3};
use std::rc::Rc;

/// A morphed mesh instance, to which animations refer.
pub(crate) struct MorphTargets {
    pub controller: NodeId,
    pub joint: u32,
    /// Weights where no clip drives them.
    pub weights: Vec<f32>,
}

/// Skin weights by position of the geometry.
pub(crate) struct Weights {
    /// Index of each position's first influence; has one more entry than there are positions.
    starts: Vec<u32>,
    pairs: Vec<(u16, f32)>,
    /// Influences of a vertex: 4 or 8.
    pub influences: usize,
}

pub(crate) struct SkinData {
    pub skin: Skin,
    pub weights: Weights,
}

/// Influences of a vertex, at most; the strongest are kept.
const MAX_INFLUENCES: usize = 8;

/// Reads a skin. `roots`: joints below which joint names are searched first. `carrier`: the joint used in place of missing ones.
pub(crate) fn skin(
    xml: &Xml<'_>,
    tree: &Tree<'_>,
    skin: Node<'_>,
    roots: &[u32],
    carrier: u32,
) -> Result<SkinData> {
    let bind_shape = match child(skin, "bind_shape_matrix") {
        Some(m) => matrix(&xml.array::<16>(m)?),
        None => DMat4::IDENTITY,
    };
    let Some(joints) = child(skin, "joints") else { return Err(xml.problem(skin, "has no joints")) };
    let joint_inputs = inputs(xml, joints)?;
    let find = |semantic: &str| joint_inputs.iter().find(|i| i.semantic == semantic);
    let Some(joint_input) = find("JOINT") else { return Err(xml.problem(joints, "has no JOINT input")) };
    let (joint_names, ids) = names(xml, joint_input.source)?;
    if joint_names.len() > usize::from(u16::MAX) {
        return Err(
            xml.problem(joints, format!("has {} joints; the limit is {}", joint_names.len(), u16::MAX))
        );
    }
    let binds = match find("INV_BIND_MATRIX") {
        Some(input) => doubles(xml, input.source, 16)?.0,
        None => Vec::new(),
    };
    if !binds.is_empty() && binds.len() < joint_names.len() * 16 {
        let what = format!(
            "{} joints need one bind matrix each, but there are {}",
            joint_names.len(),
            binds.len() / 16
        );
        return Err(xml.problem(joints, what));
    }
    let mut out = Skin::default();
    let mut lost = Vec::new();
    for (index, name) in joint_names.iter().enumerate() {
        let joint = find_joint(xml, tree, roots, name, ids).unwrap_or_else(|| {
            lost.push(*name);
            carrier
        });
        let bind = binds.get(index * 16..(index + 1) * 16).map_or(DMat4::IDENTITY, matrix);
        let inverse = tree.convention.scaled(bind * bind_shape).to_cols_array().map(|v| v as f32);
        let inverse = Mat4::from_cols_array(&inverse);
        if !inverse.is_finite() {
            return Err(xml.problem(joints, format!("the bind matrix of joint \"{name}\" is not finite")));
        }
        out.joints.push(joint);
        out.inverse_bind.push(inverse);
    }
    if !lost.is_empty() {
        let mut names = lost[..lost.len().min(5)].join(", ");
        names.push_str(if lost.len() > 5 { " …" } else { "" });
        xml.warn(
            joints,
            format!(
                "{} of {} joints are not in the scene ({names}); the vertices that they move stay still",
                lost.len(),
                joint_names.len()
            ),
        );
    }
    let weights = weights(xml, skin, joint_names.len())?;
    Ok(SkinData { skin: out, weights })
}

pub(crate) fn matrix(values: &[f64]) -> DMat4 {
    let mut m = DMat4::IDENTITY;
    if values.len() >= 16 {
        m = DMat4::from_cols_slice(&values[..16]).transpose();
    }
    // Forces the last row of an affine matrix.
    for column in 0..4 {
        m.col_mut(column).w = if column == 3 { 1.0 } else { 0.0 };
    }
    m
}

fn weights(xml: &Xml<'_>, skin: Node<'_>, joints: usize) -> Result<Weights> {
    let mut out = Weights { starts: vec![0], pairs: Vec::new(), influences: 4 };
    let Some(element) = child(skin, "vertex_weights") else {
        xml.warn(skin, "has no vertex_weights; the first joint moves all");
        return Ok(out);
    };
    let streams = inputs(xml, element)?;
    let find = |semantic: &str| streams.iter().find(|i| i.semantic == semantic);
    let (Some(joint), Some(weight)) = (find("JOINT"), find("WEIGHT")) else {
        return Err(xml.problem(element, "needs a JOINT and a WEIGHT input"));
    };
    let values = floats(xml, weight.source, 1)?;
    let width = streams.iter().map(|i| i.offset + 1).max().unwrap_or(2);
    let counts = child(element, "vcount").map_or(Ok(Vec::new()), |n| xml.integers(n))?;
    let indices = child(element, "v").map_or(Ok(Vec::new()), |n| xml.integers(n))?;
    let wanted: u64 = counts.iter().map(|c| (*c).max(0) as u64).sum();
    if wanted * width as u64 > indices.len() as u64 {
        let what = format!(
            "vcount asks for {wanted} pairs of joint and weight, but v has {}",
            indices.len() / width
        );
        return Err(xml.problem(element, what));
    }
    let mut rest = indices.chunks_exact(width);
    let (mut dropped, mut unbound, mut zero) = (0, 0, 0);
    let mut pairs: Vec<(u16, f32)> = Vec::new();
    for count in &counts {
        pairs.clear();
        for tuple in rest.by_ref().take((*count).max(0) as usize) {
            let (j, w) = (tuple[joint.offset], tuple[weight.offset]);
            if j < 0 {
                // Joint −1 is the bind shape itself, which does not move.
                unbound += 1;
                continue;
            }
            if j as usize >= joints || w < 0 || w as usize >= values.count {
                let what = format!("refers to joint {j} of {joints} and weight {w} of {}", values.count);
                return Err(xml.problem(element, what));
            }
            let [w] = values.get::<1>(w as usize);
            if w > 0.0 {
                pairs.push((j as u16, w));
            }
        }
        if pairs.len() > MAX_INFLUENCES {
            // The sort is stable, so equal weights keep the file's order.
            pairs.sort_by(|a, b| b.1.total_cmp(&a.1));
            dropped += pairs.len() - MAX_INFLUENCES;
            pairs.truncate(MAX_INFLUENCES);
        }
        let sum: f32 = pairs.iter().map(|p| p.1).sum();
        if sum > 0.0 && sum.is_finite() {
            pairs.iter_mut().for_each(|p| p.1 /= sum);
        } else {
            zero += 1;
            pairs.clear();
            pairs.push((0, 1.0));
        }
        if pairs.len() > 4 {
            out.influences = 8;
        }
        out.pairs.extend(&pairs);
        out.starts.push(out.pairs.len() as u32);
    }
    for (count, what) in [
        (dropped, "influences beyond 8 a vertex are left out, the weakest first"),
        (unbound, "influences of the bind shape itself (joint -1) are left out"),
        (zero, "vertices have weights that sum to 0; their first joint gets weight 1"),
    ] {
        if count > 0 {
            xml.warn(element, format!("{count} {what}"));
        }
    }
    Ok(out)
}

impl Weights {
    /// Number of positions that have weights.
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Appends the influences of a position, filled up to `influences`. Positions beyond the list follow the first joint.
    pub(crate) fn of(&self, position: u32, joints: &mut Vec<u16>, weights: &mut Vec<f32>) {
        let at = position as usize;
        let range = match (self.starts.get(at), self.starts.get(at + 1)) {
            (Some(a), Some(b)) => *a as usize..*b as usize,
            _ => 0..0,
        };
        let pairs = &self.pairs[range];
        for i in 0..self.influences {
            let first = if i == 0 && pairs.is_empty() { 1.0 } else { 0.0 };
            let (joint, weight) = pairs.get(i).copied().unwrap_or((0, first));
            joints.push(joint);
            weights.push(weight);
        }
    }
}

pub(crate) struct Morph {
    pub weights: Vec<f32>,
    pub names: Vec<String>,
    /// Offset of each position of the base, by target.
    pub offsets: Vec<Vec<Vec3>>,
}

/// Reads a morph. `positions_of` reads the positions of a target's geometry.
pub(crate) fn morph<'a>(
    xml: &Xml<'a>,
    morph: Node<'a>,
    base: &Geometry,
    mut positions_of: impl FnMut(Node<'a>) -> Result<Rc<Vec<Vec3>>>,
) -> Result<Morph> {
    let relative = morph.attribute("method") == Some("RELATIVE");
    let mut out = Morph { weights: Vec::new(), names: Vec::new(), offsets: Vec::new() };
    for targets in children(morph, "targets") {
        let streams = inputs(xml, targets)?;
        for input in &streams {
            match input.semantic {
                "MORPH_TARGET" => {
                    for name in names(xml, input.source)?.0 {
                        let target = xml.by_id(name).filter(|n| name_of(*n) == "geometry");
                        let Some(target) = target else {
                            return Err(xml.problem(
                                input.source,
                                format!("\"{name}\" is not a geometry of this file"),
                            ));
                        };
                        let positions = positions_of(target)?;
                        if positions.len() != base.positions.len() {
                            let what = format!(
                                "target \"{name}\" has {} positions, the base has {}",
                                positions.len(),
                                base.positions.len()
                            );
                            return Err(xml.problem(input.source, what));
                        }
                        xml.charge(targets, positions.len(), 24)?;
                        let offset = |(p, b): (&Vec3, &Vec3)| if relative { *p } else { *p - *b };
                        out.offsets.push(positions.iter().zip(base.positions.iter()).map(offset).collect());
                        out.names.push(target.attribute("name").unwrap_or(name).to_string());
                    }
                }
                "MORPH_WEIGHT" => {
                    let values = floats(xml, input.source, 1)?;
                    out.weights = (0..values.count).map(|i| values.get::<1>(i)[0]).collect();
                }
                _ => {}
            }
        }
    }
    out.weights.resize(out.offsets.len(), 0.0);
    Ok(out)
}

impl Morph {
    pub(crate) fn targets(&self, origin: &[u32]) -> Vec<MorphTarget> {
        let target = |offsets: &Vec<Vec3>| MorphTarget {
            positions: origin.iter().map(|o| offsets[*o as usize]).collect(),
            ..MorphTarget::default()
        };
        self.offsets.iter().map(target).collect()
    }
}
