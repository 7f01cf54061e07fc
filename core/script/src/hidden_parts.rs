//! Copies of assets without the mesh instances that a script hides.

use choreo_asset::{Asset, Mesh};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Cache of these copies. Actors of the same asset that hide the same mesh instances share a copy.
#[derive(Default)]
pub(crate) struct HiddenParts {
    /// The whole asset, which is kept alive, and the copy, by the address of the whole asset and the hidden instances.
    copies: BTreeMap<(usize, BTreeSet<u32>), [Arc<Asset>; 2]>,
}

impl HiddenParts {
    /// The asset with an empty mesh for each mesh instance in `hidden`. Instance indices, morph weights and joints stay the same.
    pub(crate) fn copy_without(&mut self, whole: &Arc<Asset>, hidden: BTreeSet<u32>) -> Arc<Asset> {
        if hidden.is_empty() {
            return whole.clone();
        }
        let make = || {
            let mut asset = Asset { derived: Default::default(), ..(**whole).clone() };
            for index in &hidden {
                let Some(instance) = asset.instances.get_mut(*index as usize) else { continue };
                let Some(mesh) = asset.meshes.get(instance.mesh as usize) else { continue };
                let (name, morph_names) = (mesh.name.clone(), mesh.morph_names.clone());
                let morph_targets = mesh.morph_targets;
                instance.mesh = asset.meshes.len() as u32;
                asset.meshes.push(Arc::new(Mesh {
                    name,
                    primitives: Vec::new(),
                    morph_targets,
                    morph_names,
                }));
            }
            [whole.clone(), Arc::new(asset)]
        };
        let key = (Arc::as_ptr(whole) as usize, hidden.clone());
        self.copies.entry(key).or_insert_with(make)[1].clone()
    }
}
