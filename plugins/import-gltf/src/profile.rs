//! Profiles: formats on top of glTF, such as VRM, which is glTF with its own extensions.
//!
//! [`import_with`] reads a file as [`crate::GltfImporter`] does, and calls a [`Profile`] wherever its extensions may change the
//! result.

use crate::container;
use crate::materials::MaterialTextures;
use crate::nodes::Tree;
use crate::problem::{Result, WithPlace};
use choreo_asset::{Asset, Material};
use choreo_importer_kit::{Budget, Notes};
use choreo_plugin::{Files, ImportError, ImportOptions, ImportScope, Source};
use gltf::json::Root;
use serde_json::{Map, Value};

/// Reads a glTF file with the extensions of a profile. Errors name the file.
pub fn import_with(
    source: &Source,
    files: &dyn Files,
    needs: ImportScope,
    options: &ImportOptions,
    profile: &dyn Profile,
) -> std::result::Result<Asset, ImportError> {
    crate::import(source, files, needs, options, profile).map_err(|p| p.in_file(&source.name))
}

/// The extensions that an importer on top of glTF reads.
pub trait Profile {
    /// Names of glTF extensions that this profile reads. They are not reported as ignored.
    fn extensions(&self) -> &[&str] {
        &[]
    }

    /// Called for each material after its glTF properties are read. `extensions`: those of the material that glTF itself does not
    /// read. Textures that are requested here count as the material's own.
    fn material(
        &self,
        _document: &Document<'_>,
        _index: usize,
        _extensions: &Map<String, Value>,
        _textures: &mut dyn MaterialTextures,
        _material: &mut Material,
    ) -> Result<()> {
        Ok(())
    }

    /// Called when the asset is complete except for its decoded images.
    fn finish(&self, _document: &Document<'_>, _needs: ImportScope, _asset: &mut Asset) -> Result<()> {
        Ok(())
    }
}

/// Plain glTF, without extensions of a profile.
pub(crate) struct NoProfile;

impl Profile for NoProfile {}

/// The parsed file, as a profile sees it.
pub struct Document<'d> {
    pub(crate) root: &'d Root,
    pub(crate) notes: &'d Notes,
    pub(crate) budget: &'d Budget,
    pub(crate) tree: Option<&'d Tree>,
}

impl<'d> Document<'d> {
    /// An extension at the root of the file, as JSON.
    pub fn extension(&self, name: &str) -> Option<&'d Value> {
        self.root.extensions.as_ref()?.others.get(name)
    }

    /// The generator that the file names: the program that wrote it.
    pub fn generator(&self) -> Option<&'d str> {
        self.root.asset.generator.as_deref()
    }

    pub fn nodes(&self) -> usize {
        self.root.nodes.len()
    }

    /// The joint of a node; `None` where the node is not in the scene. `place`: where the file refers to the node, for errors.
    pub fn joint(&self, node: usize, place: &dyn Fn() -> String) -> Result<Option<u32>> {
        crate::problem::element(&self.root.nodes, node, "nodes", place)?;
        Ok(self.tree.and_then(|t| t.joint_of_node[node]))
    }

    /// The node of a joint.
    pub fn node(&self, joint: u32) -> Option<usize> {
        self.tree.and_then(|t| t.node_of_joint.get(joint as usize).copied())
    }

    pub fn warn(&self, place: impl Into<String>, text: impl Into<String>) {
        self.notes.warn(place, text);
    }

    /// Charges `count` items of `size` bytes to the memory budget of the file, before they are allocated.
    pub fn charge(&self, count: u64, size: usize, place: &dyn Fn() -> String) -> Result<()> {
        self.budget.charge(count, size).at(place)
    }
}

/// Whether a file is glTF with one of these root extensions. `None` where its JSON is cut off or broken, but contains one of the
/// names.
pub fn has_extension(bytes: &[u8], names: &[&str]) -> Option<bool> {
    let json = match bytes.starts_with(container::GLB_MAGIC) {
        true => container::json_chunk(bytes),
        false => bytes,
    };
    let speaks = |name: &&str| {
        let quoted = format!("\"{name}\"");
        json.windows(quoted.len()).any(|w| w == quoted.as_bytes())
    };
    // Most files are settled here, without parsing.
    if !names.iter().any(speaks) {
        return Some(false);
    }
    #[derive(serde::Deserialize)]
    struct Top {
        extensions: Option<std::collections::BTreeMap<String, serde::de::IgnoredAny>>,
    }
    let top: Top = serde_json::from_slice(container::without_byte_order_mark(json)).ok()?;
    Some(top.extensions.is_some_and(|e| names.iter().any(|n| e.contains_key(*n))))
}

/// Names of the extensions that the file and its materials use, for messages.
pub(crate) fn used_extensions(root: &Root) -> Vec<&String> {
    let mut all: Vec<&String> = root.extensions_used.iter().chain(&root.extensions_required).collect();
    all.sort();
    all.dedup();
    all
}
