//! The node tree of one scene as a skeleton (glTF 2.0 §3.5).

use crate::file::File;
use crate::problem::{Problem, Result, element};
use choreo_asset::Asset;
use choreo_importer_kit::decompose::decompose;
use choreo_motion::{Skeleton, Transform};
use glam::{DMat4, Quat, Vec3};
use gltf::json::scene::Node;

/// Largest difference between a matrix and its decomposition, relative to its longest column, that counts as no shear.
const SHEAR_TOLERANCE: f64 = 1e-4;

pub(crate) struct Tree {
    pub skeleton: Skeleton,
    /// Joint of each node of the file; `None` outside the scene.
    pub joint_of_node: Vec<Option<u32>>,
    /// Node of each joint.
    pub node_of_joint: Vec<usize>,
    /// Number of joints that belong to the scene. The joints after them are read because skins refer to them; nothing on them is
    /// shown.
    pub scene_joint_count: usize,
}

pub(crate) fn read(file: &File<'_>, scene: Option<usize>) -> Result<Tree> {
    let nodes = &file.root.nodes;
    let parents = parents(nodes)?;
    let roots = scene_roots(file, scene, &parents)?;

    let mut tree = Walk {
        nodes,
        joint_of_node: vec![None; nodes.len()],
        node_of_joint: Vec::new(),
        parent_of_joint: Vec::new(),
    };
    for root in roots {
        tree.add(root);
    }
    let scene_joint_count = tree.node_of_joint.len();
    for joint in skin_joints_outside(file, &tree)? {
        if tree.joint_of_node[joint].is_some() {
            continue;
        }
        let mut root = joint;
        while let Some(parent) = parents[root] {
            root = parent;
        }
        file.warn(
            format!("nodes[{joint}]"),
            "is a skin joint outside the scene; its tree is read as joints but not shown",
        );
        tree.add(root);
    }
    let left_out = tree.joint_of_node.iter().filter(|j| j.is_none()).count();
    if let Some(first) = tree.joint_of_node.iter().position(Option::is_none) {
        file.warn(
            format!("nodes[{first}]"),
            format!(
                "{left_out} of {} nodes are not part of the scene and were left out, this one first",
                nodes.len()
            ),
        );
    }

    let mut names = Vec::new();
    let mut rest = Vec::new();
    for node in &tree.node_of_joint {
        names.push(nodes[*node].name.clone().unwrap_or_else(|| format!("node {node}")));
        rest.push(transform(file, *node)?);
    }
    let skeleton =
        Skeleton::new(names, tree.parent_of_joint, rest).map_err(|e| Problem::new("nodes", e.to_string()))?;
    Ok(Tree {
        skeleton,
        joint_of_node: tree.joint_of_node,
        node_of_joint: tree.node_of_joint,
        scene_joint_count,
    })
}

struct Walk<'a> {
    nodes: &'a [Node],
    joint_of_node: Vec<Option<u32>>,
    node_of_joint: Vec<usize>,
    parent_of_joint: Vec<Option<u32>>,
}

impl Walk<'_> {
    /// Walks depth first with an explicit stack: a file can nest deeper than the call stack reaches.
    fn add(&mut self, root: usize) {
        let mut stack = vec![(root, None)];
        while let Some((node, parent)) = stack.pop() {
            if self.joint_of_node[node].is_some() {
                continue;
            }
            let joint = self.node_of_joint.len() as u32;
            self.joint_of_node[node] = Some(joint);
            self.node_of_joint.push(node);
            self.parent_of_joint.push(parent);
            let children = self.nodes[node].children.as_deref().unwrap_or_default();
            stack.extend(children.iter().rev().map(|c| (c.value(), Some(joint))));
        }
    }
}

/// The parent of each node. Fails where a node has two parents or is its own ancestor.
fn parents(nodes: &[Node]) -> Result<Vec<Option<usize>>> {
    let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        for child in node.children.iter().flatten() {
            element(nodes, child.value(), "nodes", || format!("nodes[{index}].children"))?;
            if let Some(other) = parents[child.value()].replace(index) {
                return Err(Problem::new(
                    format!("nodes[{}]", child.value()),
                    format!("has two parents, nodes[{other}] and nodes[{index}]; a node may have one"),
                ));
            }
        }
    }
    // Walk up from each node; a walk that meets its own mark has found a cycle.
    let mut mark = vec![usize::MAX; nodes.len()];
    for start in 0..nodes.len() {
        let mut at = start;
        while mark[at] == usize::MAX {
            mark[at] = start;
            match parents[at] {
                Some(parent) => at = parent,
                None => break,
            }
        }
        if mark[at] == start && parents[at].is_some() {
            return Err(Problem::new(
                format!("nodes[{at}]"),
                "is its own ancestor: the node tree has a cycle",
            ));
        }
    }
    Ok(parents)
}

fn scene_roots(file: &File<'_>, scene: Option<usize>, parents: &[Option<usize>]) -> Result<Vec<usize>> {
    let root = &file.root;
    let index = match (scene, root.scene) {
        (Some(asked), _) => asked,
        (None, Some(own)) => own.value(),
        (None, None) if !root.scenes.is_empty() => 0,
        // A file without scenes shows all nodes that have no parent.
        (None, None) => return Ok((0..parents.len()).filter(|n| parents[*n].is_none()).collect()),
    };
    let listed = &element(&root.scenes, index, "scenes", || "scene".into())?.nodes;
    let place = || format!("scenes[{index}].nodes");
    let mut roots: Vec<usize> = Vec::new();
    let mut seen = vec![false; parents.len()];
    for node in listed.iter().map(|n| n.value()) {
        element(&root.nodes, node, "nodes", place)?;
        if std::mem::replace(&mut seen[node], true) {
            file.warn(place(), format!("lists nodes[{node}] twice; it is shown once"));
            continue;
        }
        roots.push(node);
    }
    // A listed node below another listed node is already shown there. `clear` marks nodes without a listed ancestor, so that long
    // shared branches are walked once.
    let mut clear = vec![false; parents.len()];
    roots.retain(|node| {
        let above = |n: usize| std::iter::successors(parents[n], |at| parents[*at]);
        if let Some(listed) = above(*node).take_while(|at| !clear[*at]).find(|at| seen[*at]) {
            file.warn(place(), format!("lists nodes[{node}] and its ancestor nodes[{listed}]"));
            return false;
        }
        let fresh: Vec<usize> = above(*node).take_while(|at| !clear[*at]).collect();
        fresh.into_iter().for_each(|at| clear[at] = true);
        if let Some(parent) = parents[*node] {
            let what =
                format!("nodes[{node}] is a root of the scene; its parent nodes[{parent}] is left out");
            file.warn(place(), what);
        }
        true
    });
    Ok(roots)
}

/// Whether a file without meshes has a skeleton to be drawn as bones: a skin, or a clip that moves a node with no camera or light
/// on it or below it.
pub(crate) fn has_skeleton(file: &File<'_>, tree: &Tree, asset: &Asset) -> bool {
    let mut carries = vec![false; asset.skeleton.len()];
    let on = asset.cameras.iter().map(|c| c.joint).chain(asset.lights.iter().map(|l| l.joint));
    on.for_each(|joint| carries[joint as usize] = true);
    let parents = asset.skeleton.parents();
    // Parents come before their children.
    for (joint, parent) in parents.iter().enumerate().rev() {
        if let (true, Some(parent)) = (carries[joint], parent) {
            carries[*parent as usize] = true;
        }
    }
    let channels = file.root.animations.iter().flat_map(|a| &a.channels);
    let mut moved = channels.filter_map(|c| tree.joint_of_node.get(c.target.node.value()).copied().flatten());
    !file.root.skins.is_empty() || moved.any(|joint| !carries[joint as usize])
}

fn skin_joints_outside(file: &File<'_>, tree: &Walk<'_>) -> Result<Vec<usize>> {
    let mut outside = Vec::new();
    let mut done = vec![false; file.root.skins.len()];
    for node in &tree.node_of_joint {
        let Some(skin) = file.root.nodes[*node].skin else { continue };
        let place = || format!("nodes[{node}].skin");
        let joints = &element(&file.root.skins, skin.value(), "skins", place)?.joints;
        if std::mem::replace(&mut done[skin.value()], true) {
            continue;
        }
        let mut brought = false;
        for joint in joints {
            let place = || format!("skins[{}].joints", skin.value());
            element(&file.root.nodes, joint.value(), "nodes", place)?;
            if tree.joint_of_node[joint.value()].is_none() && !brought {
                // One joint brings its whole tree; a skin has one tree (glTF 2.0 §3.7.3.2).
                outside.push(joint.value());
                brought = true;
            }
        }
    }
    Ok(outside)
}

fn transform(file: &File<'_>, index: usize) -> Result<Transform> {
    let node = &file.root.nodes[index];
    let place = || format!("nodes[{index}]");
    let not_finite = |what: &str| Problem::new(place(), format!("{what} is not finite"));
    if let Some(m) = node.matrix {
        if m.iter().any(|v| !v.is_finite()) {
            return Err(not_finite("matrix"));
        }
        if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
            file.warn(place(), "the matrix has a fourth row other than 0 0 0 1, which is ignored");
        }
        let parts = decompose(&DMat4::from_cols_array(&m.map(f64::from)));
        if parts.error > SHEAR_TOLERANCE {
            file.warn(place(), format!("the matrix is sheared; the nearest translation, rotation and scale differ from it by {:.1} %", parts.error * 100.0));
        }
        return Ok(Transform {
            translation: parts.translation.as_vec3(),
            rotation: parts.rotation.as_quat().normalize(),
            scale: parts.scale.as_vec3(),
        });
    }
    let translation = Vec3::from(node.translation.unwrap_or_default());
    let scale = Vec3::from(node.scale.unwrap_or([1.0; 3]));
    let rotation = node.rotation.map_or(Quat::IDENTITY, |r| Quat::from_array(r.0));
    if !translation.is_finite() || !scale.is_finite() || !rotation.is_finite() {
        return Err(not_finite("translation, rotation or scale"));
    }
    let length = rotation.length();
    let rotation = if length < 1e-6 || !length.is_finite() {
        file.warn(place(), "the rotation has length 0; no rotation is used");
        Quat::IDENTITY
    } else {
        if (length - 1.0).abs() > 0.01 {
            file.warn(place(), format!("the rotation has length {length}, not 1; it is normalized"));
        }
        rotation * (1.0 / length)
    };
    Ok(Transform { translation, rotation, scale })
}
