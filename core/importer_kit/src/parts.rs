//! Files of named parts without a node tree, such as OBJ's groups and STL's solids.

use crate::text::stem;
use crate::{Problem, Result};
use choreo_asset::{Asset, Mesh, MeshInstance, Primitive};
use choreo_motion::{Skeleton, Transform};
use std::sync::Arc;

/// Gives an asset a joint for each part. A single part is the root; several are children of a root with the name of the file. A single part
/// without a name gets the file's name, one of several gets `kind` and its number. Returns the joint of the first part.
pub fn add_joints(asset: &mut Asset, kind: &str, parts: &[String]) -> Result<u32> {
    let root = stem(&asset.name);
    let first = usize::from(parts.len() > 1);
    let named = |(index, name): (usize, &String)| match (name.is_empty(), first) {
        (false, _) => name.clone(),
        (true, 0) => root.to_string(),
        (true, _) => format!("{kind} {index}"),
    };
    let mut names: Vec<String> = parts.iter().enumerate().map(named).collect();
    if names.len() != 1 {
        names.insert(0, root.to_string());
    }
    let parents = (0..names.len()).map(|i| (i > 0).then_some(0)).collect();
    let rest = vec![Transform::IDENTITY; names.len()];
    let skeleton = Skeleton::new(names, parents, rest).map_err(|e| Problem::new(kind, e.to_string()))?;
    asset.skeleton = Arc::new(skeleton);
    Ok(first as u32)
}

/// Adds a mesh that is attached to a joint and has the joint's name.
pub fn add_mesh(asset: &mut Asset, joint: u32, primitives: Vec<Primitive>) {
    let name = asset.skeleton.names()[joint as usize].clone();
    asset.instances.push(MeshInstance { joint, mesh: asset.meshes.len() as u32, ..MeshInstance::default() });
    asset.meshes.push(Arc::new(Mesh { name, primitives, ..Mesh::default() }));
}
