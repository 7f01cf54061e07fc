//! Prims, and the joints of skeletons, become the joints of an asset.

use crate::layer::{Layer, Prim, Specifier};
use crate::transforms;
use choreo_importer_kit::{Problem, Result};
use choreo_motion::{Skeleton, Transform};
use glam::{DMat4, DVec3};
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

/// A prim that becomes a joint.
pub(crate) struct Node<'a> {
    pub prim: &'a Prim,
    pub path: String,
    pub joint: u32,
    /// Indices of the ancestor nodes, the root first.
    pub ancestors: Vec<usize>,
}

/// The joints of a Skeleton prim.
pub(crate) struct Rig<'a> {
    /// The asset's joint for each joint of the skeleton.
    pub joints: Vec<u32>,
    /// Index of each joint by its path.
    pub index_of_path: BTreeMap<&'a str, usize>,
    /// Bind transforms, skeleton from joint.
    pub bind_transforms: Vec<DMat4>,
}

pub(crate) struct Tree<'a> {
    pub root: &'a Prim,
    pub nodes: Vec<Node<'a>>,
    /// Index of each node by path.
    index_of_path: BTreeMap<String, usize>,
    /// Skeletons by the path of the Skeleton prim.
    pub rigs: BTreeMap<String, Rig<'a>>,
    names: Vec<String>,
    parents: Vec<Option<u32>>,
    rest: Vec<Transform>,
}

/// Prim types without a transform.
const TYPES_WITHOUT_TRANSFORM: [&str; 8] = [
    "Material",
    "Shader",
    "NodeGraph",
    "SkelAnimation",
    "BlendShape",
    "GeomSubset",
    "RenderSettings",
    "Backdrop",
];

impl<'a> Tree<'a> {
    pub(crate) fn of(layer: &'a Layer) -> Result<Tree<'a>> {
        let mut out = Tree {
            root: &layer.root,
            nodes: Vec::new(),
            index_of_path: BTreeMap::new(),
            rigs: BTreeMap::new(),
            names: Vec::new(),
            parents: Vec::new(),
            rest: Vec::new(),
        };
        // The conversion to metres and +Y up.
        let metres = layer.metres_per_unit.filter(|m| m.is_finite() && *m > 0.0).unwrap_or(0.01);
        let turn = match layer.up_axis.as_deref() {
            Some("Z") => DMat4::from_rotation_x(-FRAC_PI_2),
            _ => DMat4::IDENTITY,
        };
        let conversion = turn * DMat4::from_scale(DVec3::splat(metres));
        let above = (conversion != DMat4::IDENTITY)
            .then(|| out.add_joint("stage", None, transforms::to_transform(&conversion)));
        for prim in &layer.root.children {
            out.add_prim(prim, "", (above, &[]), layer.start_time_code.unwrap_or(0.0))?;
        }
        if out.names.is_empty() {
            out.add_joint("stage", None, Transform::IDENTITY);
        }
        Ok(out)
    }

    fn add_joint(&mut self, name: &str, parent: Option<u32>, rest: Transform) -> u32 {
        self.names.push(name.to_string());
        self.parents.push(parent);
        self.rest.push(rest);
        self.names.len() as u32 - 1
    }

    fn add_prim(
        &mut self,
        prim: &'a Prim,
        parent: &str,
        (joint, above): (Option<u32>, &[usize]),
        start: f64,
    ) -> Result<()> {
        let is_hidden = prim.text("visibility") == "invisible"
            && prim.attributes.get("visibility").is_some_and(|a| a.samples.is_empty());
        let purpose = prim.text("purpose");
        if prim.specifier != Specifier::Def
            || prim.inactive
            || is_hidden
            || matches!(purpose, "guide" | "proxy")
            || TYPES_WITHOUT_TRANSFORM.contains(&prim.kind.as_str())
        {
            return Ok(());
        }
        let path = format!("{parent}/{}", prim.name);
        if prim.kind == "Scope" {
            return prim
                .children
                .iter()
                .try_for_each(|child| self.add_prim(child, &path, (joint, above), start));
        }
        let name = if prim.display_name.is_empty() { &prim.name } else { &prim.display_name };
        let rest = transforms::to_transform(&transforms::local_matrix(prim, start));
        let own = self.add_joint(name, joint, rest);
        if prim.kind == "Skeleton" {
            let rig = self.add_rig(prim, own, &path)?;
            self.rigs.insert(path.clone(), rig);
        }
        self.index_of_path.insert(path.clone(), self.nodes.len());
        self.nodes.push(Node { prim, path: path.clone(), joint: own, ancestors: above.to_vec() });
        let mut inside = above.to_vec();
        inside.push(self.nodes.len() - 1);
        // The instancer draws its prototypes.
        if prim.kind == "PointInstancer" {
            return Ok(());
        }
        prim.children.iter().try_for_each(|child| self.add_prim(child, &path, (Some(own), &inside), start))
    }

    fn add_rig(&mut self, prim: &'a Prim, parent_joint: u32, path: &str) -> Result<Rig<'a>> {
        let tokens = prim.texts("joints");
        let names = prim.texts("jointNames");
        let list = |name: &str| -> Vec<DMat4> {
            prim.numbers(name).unwrap_or_default().chunks_exact(16).map(transforms::matrix).collect()
        };
        let (bind, rest) = (list("bindTransforms"), list("restTransforms"));
        let mut known: BTreeMap<&str, usize> = BTreeMap::new();
        let (mut joints, mut parents) = (Vec::with_capacity(tokens.len()), Vec::with_capacity(tokens.len()));
        for (index, token) in tokens.iter().enumerate() {
            let mut parent = token.as_str();
            let mut found = None;
            while let (None, Some((shorter, _))) = (found, parent.rsplit_once('/')) {
                parent = shorter;
                found = known.get(parent).copied();
            }
            let bound = |joint: usize| bind.get(joint).copied().unwrap_or(DMat4::IDENTITY);
            let from_bind = match found {
                Some(parent) => bound(parent).inverse() * bound(index),
                None => bound(index),
            };
            let local = rest.get(index).copied().unwrap_or(from_bind);
            let name = match names.len() == tokens.len() {
                true => names[index].as_str(),
                false => token.rsplit('/').next().unwrap_or(token),
            };
            let parent = found.map_or(parent_joint, |parent| joints[parent]);
            joints.push(self.add_joint(name, Some(parent), transforms::to_transform(&local)));
            parents.push(found);
            if known.insert(token, index).is_some() {
                return Err(Problem::new(path, format!("has the joint \"{token}\" twice")));
            }
        }
        let mut bind = bind;
        if bind.len() != tokens.len() {
            bind = rest_in_skeleton(&rest, &parents);
        }
        bind.resize(tokens.len(), DMat4::IDENTITY);
        Ok(Rig { joints, index_of_path: known, bind_transforms: bind })
    }

    pub(crate) fn node(&self, path: &str) -> Option<&Node<'a>> {
        self.nodes.get(*self.index_of_path.get(path)?)
    }

    pub(crate) fn skeleton(&mut self) -> Result<Skeleton> {
        let (names, parents) = (std::mem::take(&mut self.names), std::mem::take(&mut self.parents));
        Skeleton::new(names, parents, std::mem::take(&mut self.rest))
            .map_err(|e| Problem::new("stage", e.to_string()))
    }

    /// The first value that `get` finds on the prim or an ancestor, nearest first.
    pub(crate) fn inherited<R>(&self, node: &'a Node<'a>, get: impl Fn(&'a Prim) -> Option<R>) -> Option<R> {
        let above = node.ancestors.iter().rev().map(|index| self.nodes[*index].prim);
        std::iter::once(node.prim).chain(above).find_map(get)
    }
}

fn rest_in_skeleton(rest: &[DMat4], parents: &[Option<usize>]) -> Vec<DMat4> {
    let mut out: Vec<DMat4> = Vec::with_capacity(rest.len());
    for (local, parent) in rest.iter().zip(parents) {
        out.push(parent.map_or(*local, |parent| out[parent] * *local));
    }
    out
}
