//! Profiles: formats on top of glTF, such as VRM, which is glTF with its own extensions.
//!
//! [`import_with`] reads a file as [`crate::GltfImporter`] does and asks a [`Profile`] at each place where its extensions
//! count.

use crate::container;
use crate::materials::MaterialTextures;
use crate::nodes::Tree;
use crate::problem::{Result, WithPlace};
use choreo_asset::{Asset, Material};
use choreo_importer_kit::{Budget, Notes};
use choreo_plugin::{Files, ImportError, ImportOptions, ImportScope, Source};
use gltf::json::Root;
use serde_json::{Map, Value};

/// Reads a glTF file with what a profile adds. Errors name the file.
pub fn import_with(
    source: &Source,
    files: &dyn Files,
    needs: ImportScope,
    options: &ImportOptions,
    profile: &dyn Profile,
) -> std::result::Result<Asset, ImportError> {
    crate::import(source, files, needs, options, profile).map_err(|p| p.in_file(&source.name))
}

/// Extensions that an importer over glTF reads itself.
pub trait Profile {
    /// Names of its extensions, which are then not reported as ignored.
    fn extensions(&self) -> &[&str] {
        &[]
    }

    /// Called for each material once it is read as glTF has it. `extensions`: those of the material that glTF itself does not
    /// read; textures requested here count as the material's own.
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

    /// Called when everything else is there but for the images.
    fn finish(&self, _document: &Document<'_>, _needs: ImportScope, _asset: &mut Asset) -> Result<()> {
        Ok(())
    }
}

/// glTF itself.
pub(crate) struct Plain;

impl Profile for Plain {}

/// The file as a profile reads it.
pub struct Document<'d> {
    pub(crate) root: &'d Root,
    pub(crate) notes: &'d Notes,
    pub(crate) budget: &'d Budget,
    pub(crate) tree: Option<&'d Tree>,
}

impl<'d> Document<'d> {
    /// An extension of the file itself, as JSON.
    pub fn extension(&self, name: &str) -> Option<&'d Value> {
        self.root.extensions.as_ref()?.others.get(name)
    }

    /// The program that wrote the file, as it calls itself.
    pub fn generator(&self) -> Option<&'d str> {
        self.root.asset.generator.as_deref()
    }

    pub fn nodes(&self) -> usize {
        self.root.nodes.len()
    }

    /// The joint that a node became; `None` outside the scene. `place`: the place that asks.
    pub fn joint(&self, node: usize, place: &dyn Fn() -> String) -> Result<Option<u32>> {
        crate::problem::element(&self.root.nodes, node, "nodes", place)?;
        Ok(self.tree.and_then(|t| t.joint_of_node[node]))
    }

    /// The node that a joint was.
    pub fn node(&self, joint: u32) -> Option<usize> {
        self.tree.and_then(|t| t.node_of_joint.get(joint as usize).copied())
    }

    pub fn warn(&self, place: impl Into<String>, text: impl Into<String>) {
        self.notes.warn(place, text);
    }

    /// Takes `count` things of `size` bytes from the memory budget of the file, before they are made.
    pub fn charge(&self, count: u64, size: usize, place: &dyn Fn() -> String) -> Result<()> {
        self.budget.charge(count, size).at(place)
    }
}

/// Whether a file is glTF with one of these extensions at its root. `None` where its JSON is cut off or broken but speaks of one.
pub fn has_extension(bytes: &[u8], names: &[&str]) -> Option<bool> {
    let json = match bytes.starts_with(container::GLB_MAGIC) {
        true => container::json_chunk(bytes),
        false => bytes,
    };
    let speaks = |name: &&str| {
        let quoted = format!("\"{name}\"");
        json.windows(quoted.len()).any(|w| w == quoted.as_bytes())
    };
    // Most files are told apart by this alone.
    if !names.iter().any(speaks) {
        return Some(false);
    }
    #[derive(serde::Deserialize)]
    struct Top {
        extensions: Option<std::collections::BTreeMap<String, serde::de::IgnoredAny>>,
    }
    let top: Top = serde_json::from_slice(container::without_mark(json)).ok()?;
    Some(top.extensions.is_some_and(|e| names.iter().any(|n| e.contains_key(*n))))
}

/// Extensions of the file and of its materials that it names as used; for messages.
pub(crate) fn used(root: &Root) -> Vec<&String> {
    let mut all: Vec<&String> = root.extensions_used.iter().chain(&root.extensions_required).collect();
    all.sort();
    all.dedup();
    all
}
