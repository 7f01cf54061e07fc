//! The visual scene as a parents-first list of joints, each with its stack of transforms.

use crate::xml::{LEFT_OUT, Xml, child, descendant, label_of, name_of};
use crate::xml::{Node, NodeId};
use choreo_importer_kit::decompose::{Trs, decompose};
use choreo_importer_kit::{Problem, Result};
use choreo_motion::{Skeleton, Transform};
use glam::{DMat4, DQuat, DVec3};
use std::collections::HashMap;

/// Joint limit, which bounds what instance_node multiplies.
const MAX_JOINTS: usize = 65_536;
/// Largest relative difference between a matrix and its decomposition that gives no warning.
const SHEAR_TOLERANCE: f64 = 1e-3;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TransformKind {
    Matrix,
    Translate,
    Rotate,
    Scale,
    LookAt,
}

/// One transform element of a node. The first element is the leftmost factor of the product.
#[derive(Clone, Debug)]
pub(crate) struct TransformElement<'a> {
    pub sid: &'a str,
    pub kind: TransformKind,
    /// 16, 3, 4, 3 or 9 numbers, as in the file (matrices by rows, angles in degrees).
    pub values: Vec<f64>,
}

pub(crate) struct Joint<'a> {
    pub node: Node<'a>,
    pub parent: Option<u32>,
    pub name: String,
    pub stack: Vec<TransformElement<'a>>,
}

/// Conversion of the file's units and axes to metres and +Y up: translations are scaled, and the roots are rotated, which their
/// children follow. Joints keep their own axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Convention {
    pub metres: f64,
    pub up: DMat4,
}

pub(crate) struct Tree<'a> {
    pub joints: Vec<Joint<'a>>,
    /// Joints of each XML element; several where it is instanced.
    pub of_element: HashMap<NodeId, Vec<u32>>,
    pub convention: Convention,
}

impl TransformElement<'_> {
    pub(crate) fn matrix(&self) -> DMat4 {
        let v = &self.values;
        match self.kind {
            TransformKind::Matrix => DMat4::from_cols_slice(v).transpose(),
            TransformKind::Translate => DMat4::from_translation(DVec3::new(v[0], v[1], v[2])),
            TransformKind::Scale => DMat4::from_scale(DVec3::new(v[0], v[1], v[2])),
            TransformKind::Rotate => {
                let (sin, cos) = libm::sincos(v[3].to_radians() * 0.5);
                match DVec3::new(v[0], v[1], v[2]).try_normalize() {
                    Some(axis) => {
                        DMat4::from_quat(DQuat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos))
                    }
                    None => DMat4::IDENTITY,
                }
            }
            TransformKind::LookAt => {
                let point = |at: usize| DVec3::new(v[at], v[at + 1], v[at + 2]);
                let back = (point(0) - point(3)).normalize_or(DVec3::Z);
                let right =
                    point(6).cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
                let up = back.cross(right);
                DMat4::from_cols(right.extend(0.0), up.extend(0.0), back.extend(0.0), point(0).extend(1.0))
            }
        }
    }
}

impl Convention {
    /// Converts a matrix between lengths in the file's units to metres, by scaling its translation.
    pub(crate) fn scaled(&self, mut m: DMat4) -> DMat4 {
        let t = m.w_axis.truncate() * self.metres;
        m.w_axis = t.extend(m.w_axis.w);
        m
    }

    /// Parent-from-joint matrix of a transform stack.
    pub(crate) fn local(&self, stack: &[TransformElement<'_>], root: bool) -> DMat4 {
        let product = stack.iter().map(TransformElement::matrix).reduce(|m, e| m * e);
        let file = product.unwrap_or(DMat4::IDENTITY);
        let scaled = self.scaled(file);
        if root { self.up * scaled } else { scaled }
    }
}

impl<'a> Tree<'a> {
    pub(crate) fn read(xml: &Xml<'a>, convention: Convention) -> Result<Tree<'a>> {
        let mut tree = Tree { joints: Vec::new(), of_element: HashMap::new(), convention };
        let Some(scene) = scene(xml) else { return Ok(tree) };
        let mut open: Vec<(Node<'a>, Option<u32>)> =
            nodes_in(xml, scene).into_iter().rev().map(|n| (n, None)).collect();
        while let Some((node, parent)) = open.pop() {
            if tree.joints.len() == MAX_JOINTS {
                let what = format!(
                    "the scene has more than {MAX_JOINTS} nodes, which is the limit; an instance_node may contain itself"
                );
                return Err(xml.problem(node, what));
            }
            let index = tree.joints.len() as u32;
            let name = label_of(node).or(node.attribute("sid"));
            let name = name.filter(|n| !n.is_empty()).map_or(format!("node {index}"), str::to_string);
            tree.of_element.entry(node.id()).or_default().push(index);
            tree.joints.push(Joint { node, parent, name, stack: stack(xml, node)? });
            open.extend(nodes_in(xml, node).into_iter().rev().map(|n| (n, Some(index))));
        }
        Ok(tree)
    }

    pub(crate) fn skeleton(&self, xml: &Xml<'a>) -> Result<Skeleton> {
        let mut rest = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            let m = self.convention.local(&joint.stack, joint.parent.is_none());
            let parts = decompose(&m);
            let transform = transform(&parts);
            if !transform.is_finite() || transform.scale.max_element().abs() > 1e18 {
                return Err(xml.problem(joint.node, "its transforms together are not finite"));
            }
            if parts.error > SHEAR_TOLERANCE {
                let what = format!(
                    "the transform is sheared; the nearest translation, rotation and scale differ from it by {:.1} %",
                    parts.error * 100.0
                );
                xml.warn(joint.node, what);
            }
            rest.push(transform);
        }
        let names = self.joints.iter().map(|j| j.name.clone()).collect();
        let parents = self.joints.iter().map(|j| j.parent).collect();
        Skeleton::new(names, parents, rest).map_err(|e| Problem::new("visual_scene", e.to_string()))
    }
}

pub(crate) fn transform(parts: &Trs) -> Transform {
    Transform {
        translation: parts.translation.as_vec3(),
        rotation: parts.rotation.as_quat().normalize(),
        scale: parts.scale.as_vec3(),
    }
}

/// The scene that the file instances, else its first scene.
fn scene<'a>(xml: &Xml<'a>) -> Option<Node<'a>> {
    let shown = child(xml.root(), "scene").and_then(|s| child(s, "instance_visual_scene"));
    let named = shown.map(|s| xml.resolve_instance(s, "url", "visual_scene", "the first scene is used"));
    let first = || descendant(xml.root(), "visual_scene");
    match (named, first()) {
        (Some(Some(scene)), _) => return Some(scene),
        (Some(None), Some(_)) => {}
        (None, Some(scene)) => {
            xml.warn(scene, "the file does not say which scene it shows; this one is used");
        }
        (_, None) => xml.notes.warn("visual_scene", "the file has no scene"),
    }
    first()
}

/// The child nodes and instanced nodes of a scene or node, in order.
fn nodes_in<'a>(xml: &Xml<'a>, parent: Node<'a>) -> Vec<Node<'a>> {
    let mut out = Vec::new();
    for element in parent.children() {
        match name_of(element) {
            "node" => out.push(element),
            "instance_node" => {
                let url = element.attribute("url").unwrap_or_default();
                if !url.starts_with('#') {
                    xml.warn(element, format!("url=\"{url}\" is in another file, which is not read"));
                    continue;
                }
                match xml.node_by_id(&url[1..]) {
                    Some(node) => out.push(node),
                    None => {
                        let what = format!("url=\"{url}\" is not a node of this file; {LEFT_OUT}");
                        xml.warn(element, what);
                    }
                }
            }
            _ => {}
        }
    }
    out
}

fn stack<'a>(xml: &Xml<'_>, node: Node<'a>) -> Result<Vec<TransformElement<'a>>> {
    let mut out = Vec::new();
    for element in node.children() {
        let (kind, count) = match name_of(element) {
            "matrix" => (TransformKind::Matrix, 16),
            "translate" => (TransformKind::Translate, 3),
            "rotate" => (TransformKind::Rotate, 4),
            "scale" => (TransformKind::Scale, 3),
            "lookat" => (TransformKind::LookAt, 9),
            "skew" => {
                xml.warn(element, "skew is not supported; it is left out");
                continue;
            }
            _ => continue,
        };
        let values = xml.numbers(element)?;
        if values.len() != count {
            let what = format!("has {} numbers, but needs {count}", values.len());
            return Err(xml.problem(element, what));
        }
        if kind == TransformKind::Matrix && values[12..] != [0.0, 0.0, 0.0, 1.0] {
            xml.warn(element, "the matrix has a fourth row other than 0 0 0 1, which is ignored");
        }
        let mut values = values;
        if kind == TransformKind::Matrix {
            values[12..].copy_from_slice(&[0.0, 0.0, 0.0, 1.0]);
        }
        out.push(TransformElement { sid: element.attribute("sid").unwrap_or_default(), kind, values });
    }
    Ok(out)
}

/// Finds a joint of a skin by name: by sid below the skeleton's roots, by sid anywhere, by id, then by name. `is_id` puts ids
/// first.
pub(crate) fn find_joint(
    xml: &Xml<'_>,
    tree: &Tree<'_>,
    roots: &[u32],
    name: &str,
    is_id: bool,
) -> Option<u32> {
    let below = |joint: u32| -> bool {
        let mut at = Some(joint);
        while let Some(j) = at {
            if roots.contains(&j) {
                return true;
            }
            at = tree.joints[j as usize].parent;
        }
        false
    };
    let with = |attribute: &'static str| {
        (0u32..)
            .zip(&tree.joints)
            .filter(move |(_, j)| j.node.attribute(attribute) == Some(name))
            .map(|(i, _)| i)
    };
    let by_id =
        || xml.node_by_id(name).and_then(|n| tree.of_element.get(&n.id())).and_then(|j| j.first().copied());
    if is_id && let Some(joint) = by_id() {
        return Some(joint);
    }
    with("sid")
        .find(|j| below(*j))
        .or_else(|| with("sid").next())
        .or_else(by_id)
        .or_else(|| with("name").next())
}
