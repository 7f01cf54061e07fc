//! The paths of a crate file: a tree of names, in which properties are children of their prims.

use std::collections::BTreeMap;

pub(super) struct Paths {
    nodes: Vec<Node>,
}

struct Node {
    /// Token index of the last name in the path.
    token: u32,
    is_property: bool,
    children: BTreeMap<(bool, u32), u32>,
}

/// The three parallel lists of the PATHS section.
#[derive(Default)]
pub(super) struct Encoded {
    pub indices: Vec<i32>,
    pub tokens: Vec<i32>,
    pub jumps: Vec<i32>,
}

impl Paths {
    /// A tree that holds only the root, whose index is 0.
    pub(super) fn new() -> Paths {
        Paths { nodes: vec![Node { token: 0, is_property: false, children: BTreeMap::new() }] }
    }

    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    pub(super) fn child_index(&mut self, parent: u32, token: u32, is_property: bool) -> u32 {
        let next = self.nodes.len() as u32;
        let index = *self.nodes[parent as usize].children.entry((is_property, token)).or_insert(next);
        if index == next {
            self.nodes.push(Node { token, is_property, children: BTreeMap::new() });
        }
        index
    }

    /// Index of an absolute path, `/a/b` or `/a/b.c`. Adds the path where the tree does not have it yet.
    pub(super) fn index_of(&mut self, path: &str, mut token: impl FnMut(&str) -> u32) -> u32 {
        let (prim, property) = match path.split_once('.') {
            Some((prim, property)) => (prim, Some(property)),
            None => (path, None),
        };
        let mut at = 0;
        for name in prim.split('/').filter(|name| !name.is_empty()) {
            at = self.child_index(at, token(name), false);
        }
        property.map_or(at, |property| self.child_index(at, token(property), true))
    }

    /// Lists the tree depth first.
    pub(super) fn encode_tree(&self) -> Encoded {
        let mut out = Encoded::default();
        self.encode(0, false, &mut out);
        out
    }

    /// Appends a node and its descendants. `followed`: a sibling comes after the node. Recursion is safe, because prims are not
    /// nested deeply.
    fn encode(&self, index: u32, followed: bool, out: &mut Encoded) {
        let node = &self.nodes[index as usize];
        let place = out.indices.len();
        out.indices.push(index as i32);
        let token = node.token as i32;
        out.tokens.push(if node.is_property { -token } else { token });
        out.jumps.push(match (node.children.is_empty(), followed) {
            (true, false) => -2,
            (false, _) => -1,
            (true, true) => 0,
        });
        for (number, child) in node.children.values().enumerate() {
            self.encode(*child, number + 1 < node.children.len(), out);
        }
        if followed && !node.children.is_empty() {
            out.jumps[place] = (out.indices.len() - place) as i32;
        }
    }
}
