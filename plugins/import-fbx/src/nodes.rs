//! All nodes of the file as one skeleton.

use crate::convert;
use crate::file::{File, place_of};
use crate::local::LocalTransform;
use choreo_importer_kit::{Problem, Result};
use choreo_motion::{Skeleton, Transform};
use ufbx::{ElementType, Node, PropFlags};

pub(crate) struct Tree {
    pub skeleton: Skeleton,
    /// Joint of each node of the file, by `typed_id`; `None` for ufbx's root, which belongs to no object of the file.
    pub joint_of_node: Vec<Option<u32>>,
    /// (joint, node) pairs in the order of the joints. A geometry helper that is folded into its mesh has its parent's joint.
    pub holders: Vec<(u32, usize)>,
    /// Whether the file shows the node, by joint.
    pub visible: Vec<bool>,
}

pub(crate) fn read(file: &File<'_>) -> Result<Tree> {
    let scene = file.scene;
    let count = scene.nodes.len();
    file.charge(count, 512, || "nodes".into())?;
    let root: &Node = &scene.root_node;
    let mut tree = Walk { joint_of_node: vec![None; count], ..Walk::default() };
    tree.add_nodes(file, root);
    let names = joint_names(&tree.nodes);
    let rest = tree.nodes.iter().map(|node| rest_transform(node)).collect::<Result<_>>()?;
    tree.holders.sort_unstable();
    let skeleton =
        Skeleton::new(names, tree.parents, rest).map_err(|e| Problem::new("nodes", e.to_string()))?;
    Ok(Tree { skeleton, joint_of_node: tree.joint_of_node, holders: tree.holders, visible: tree.visible })
}

/// The transform at rest. Nodes that [`LocalTransform`] covers use our own trigonometry: the same bits on every machine.
fn rest_transform(node: &Node) -> Result<Transform> {
    let Some(local) = LocalTransform::new(node) else {
        return convert::transform(&node.local_transform, || place_of(&node.element));
    };
    let rest = local.at_rest();
    match rest.is_finite() {
        true => Ok(rest),
        false => Err(Problem::new(place_of(&node.element), convert::NOT_FINITE)),
    }
}

#[derive(Default)]
struct Walk<'a> {
    joint_of_node: Vec<Option<u32>>,
    nodes: Vec<&'a Node>,
    parents: Vec<Option<u32>>,
    visible: Vec<bool>,
    holders: Vec<(u32, usize)>,
}

impl<'a> Walk<'a> {
    /// Walks depth first with an explicit stack: a file can nest deeper than the call stack reaches.
    fn add_nodes(&mut self, file: &File<'_>, root: &'a Node) {
        let mut stack = vec![(root, None, true)];
        while let Some((node, parent, parent_shown)) = stack.pop() {
            let shown =
                file.hidden || (is_visible(file, node) && (parent_shown || !inherits_visibility(node)));
            // ufbx's root belongs to no object of the file.
            let joint = match node.is_root && node.all_attribs.is_empty() {
                true => None,
                false if is_folded(node) => {
                    let known = self.joint_of_node.get_mut(node.element.typed_id as usize);
                    if let (Some(slot), Some(joint)) = (known, parent) {
                        *slot = Some(joint);
                        self.holders.push((joint, node.element.typed_id as usize));
                    }
                    continue;
                }
                false => {
                    let joint = self.nodes.len() as u32;
                    let Some(slot) = self.joint_of_node.get_mut(node.element.typed_id as usize) else {
                        continue;
                    };
                    if slot.replace(joint).is_some() {
                        continue;
                    }
                    self.holders.push((joint, node.element.typed_id as usize));
                    self.nodes.push(node);
                    self.parents.push(parent);
                    self.visible.push(shown);
                    Some(joint)
                }
            };
            let levels = is_lod_group(node);
            for (index, child) in node.children.as_ref().iter().enumerate().rev() {
                // The first level of detail is the finest, and the only one that is shown.
                let child_shown = shown && (!levels || index == 0 || file.hidden);
                stack.push((child_of(child), joint, child_shown));
            }
        }
    }
}

fn child_of<T>(child: &ufbx::Ref<T>) -> &T {
    child
}

/// Whether a geometry helper needs no joint: its meshes have no other instance, so they take its transform into their vertices.
pub(crate) fn is_folded(node: &Node) -> bool {
    let alone = |a: &ufbx::Element| match a.type_ {
        ElementType::Camera | ElementType::Light => false,
        ElementType::Mesh => a.instances.len() <= 1,
        _ => true,
    };
    node.is_geometry_transform_helper && node.children.is_empty() && node.all_attribs.into_iter().all(alone)
}

/// The node of the file that a helper belongs to; any other node itself.
pub(crate) fn owner(mut node: &Node) -> &Node {
    while node.is_geometry_transform_helper || node.is_scale_helper {
        let Some(parent) = &node.parent else { break };
        node = parent;
    }
    node
}

fn is_lod_group(node: &Node) -> bool {
    let is = |n: &Node| n.all_attribs.as_ref().iter().any(|a| a.type_ == ElementType::LodGroup);
    is(node) || node.geometry_transform_helper.as_ref().is_some_and(|h| is(h))
}

/// The node's own visibility, by default visible. Before version 6 it is the value of a channel, which ufbx keeps only as a real
/// number. The integer that ufbx tests stays 0, so ufbx takes every node with such a channel for hidden.
fn is_visible(file: &File<'_>, node: &Node) -> bool {
    match node.element.props.find_prop("Visibility") {
        Some(prop) if file.scene.metadata.version < 6000 => prop.value_vec4.x != 0.0,
        _ => node.visible,
    }
}

/// Whether a hidden parent hides the node, as it does by default.
fn inherits_visibility(node: &Node) -> bool {
    match node.element.props.find_prop("Visibility Inheritance") {
        Some(prop) if !prop.flags.has_any(PropFlags::NO_VALUE) => prop.value_int != 0,
        _ => true,
    }
}

/// Names as in the file. A helper is named after its owner, a node without a name by its number.
fn joint_names(nodes: &[&Node]) -> Vec<String> {
    let name = |node: &&Node| {
        let own = node.element.name.as_ref();
        if node.is_geometry_transform_helper || node.is_scale_helper {
            let parent = node.parent.as_ref().map_or("", |p| p.element.name.as_ref());
            return format!("{parent} {own}");
        }
        match own {
            "" if node.is_root => "root".to_string(),
            "" => format!("node {}", node.element.typed_id),
            own => own.to_string(),
        }
    };
    nodes.iter().map(name).collect()
}
