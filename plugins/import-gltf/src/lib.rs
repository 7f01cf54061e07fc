//! glTF 2.0 and GLB into an [`Asset`]. What it reads, limits and options: README.md.

mod accessor;
mod animations;
mod container;
mod draco;
mod extensions;
mod file;
mod glossiness;
mod images;
mod instancing;
mod layers;
mod locate;
mod materials;
mod meshes;
mod meshopt;
mod nodes;
mod objects;
mod packed;
mod pointers;
pub mod profile;
mod repair;
mod skinning;
mod topology;
mod uri;
mod variants;

use choreo_asset::Asset;
use choreo_asset::{Material, TextureRef};
use choreo_importer_kit::bones;
use choreo_importer_kit::problem;
use choreo_plugin::{Claim, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, Source};
use file::File;
pub use materials::MaterialTextures;
use problem::Result;
use profile::Profile;
use serde_json::Value;
use std::sync::{Arc, LazyLock};

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "gltf",
        env!("CARGO_PKG_VERSION"),
        "glTF 2.0, binary or JSON: meshes, skins, morph targets, clips, materials, cameras, lights",
    )
    .extensions(["glb", "gltf"])
    .magic(container::GLB_MAGIC)
    .number(
        "scene",
        "which scene of the file, counted from 0; -1 is the one the file names",
        -1.0,
        -1.0..=65535.0,
    )
    .text(
        "variant",
        "which of the file's variants is shown, by its name; empty: the materials as they are",
        "",
        &[],
    )
    .flag("bones", "show the bones of a file that has a skeleton or clips, but no mesh", true)
});

#[derive(Clone, Copy, Debug, Default)]
pub struct GltfImporter;

impl GltfImporter {
    pub fn new() -> GltfImporter {
        GltfImporter
    }
}

impl Importer for GltfImporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    /// Claims GLB by its magic, and JSON by `asset.version`. Broken JSON is claimed where the name says glTF, so that the user
    /// reads what is broken.
    fn claim(&self, source: &Source) -> Claim {
        let bytes = source.bytes.as_slice();
        if bytes.starts_with(container::GLB_MAGIC) {
            return Claim::Content(95);
        }
        let named = MANIFEST.has_extension(&source.extension());
        let text = container::without_byte_order_mark(bytes).trim_ascii_start();
        if !text.starts_with(b"{") {
            return if named { Claim::Extension } else { Claim::NotMine };
        }
        match serde_json::from_slice::<Probe>(text) {
            Ok(probe) if probe.is_gltf() => Claim::Content(95),
            Ok(_) => Claim::NotMine,
            Err(_) if named => Claim::Extension,
            Err(_) => Claim::NotMine,
        }
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> std::result::Result<Asset, ImportError> {
        profile::import_with(source, files, needs, options, &profile::NoProfile)
    }
}

/// The part of a JSON file that shows whether it is glTF; `gltf::json::Root` is too strict for that.
struct Probe(Option<Value>);

impl Probe {
    fn is_gltf(&self) -> bool {
        self.0.as_ref().and_then(|a| a.get("version")).is_some_and(Value::is_string)
    }
}

impl<'de> serde::Deserialize<'de> for Probe {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        #[derive(serde::Deserialize)]
        struct Top {
            asset: Option<Value>,
        }
        Top::deserialize(deserializer).map(|t| Probe(t.asset))
    }
}

fn import(
    source: &Source,
    files: &dyn Files,
    needs: ImportScope,
    options: &ImportOptions,
    profile: &dyn Profile,
) -> Result<Asset> {
    let container = container::split(&source.bytes)?;
    let root = container::parse(&container)?;
    let mut file = File::new(root, &container, files);
    file.variant = variants::find_variant(&file, options.text("variant").unwrap_or_default())?;
    extensions::check(&file, needs, profile.extensions())?;

    let scene = options.number("scene").filter(|s| *s >= 0.0).map(|s| s as usize);
    let mut tree = nodes::read(&file, scene)?;
    let mut table = images::ImageTable::default();
    let (mut materials, glossy) = materials::read(&file, &mut table, needs.textures, profile)?;

    // Decoding images takes as long as everything else together, so both run in parallel.
    let (images, rest) = choreo_importer_kit::images::decode_beside(&table.entries, needs, files, || {
        decode(&file, &tree, needs, &materials)
    });
    let mut asset = rest?;
    asset.name = source.name.clone();
    // Images that cannot be decoded become white, which is no valid direction, so their normal maps are dropped.
    let lost: Vec<u32> = (0..).zip(&images).filter(|(_, image)| image.is_err()).map(|(i, _)| i).collect();
    materials.iter_mut().for_each(|material| leave_out_normal_maps(material, &lost));
    asset.images =
        choreo_importer_kit::images::replace_failed_with_white(images, &table.entries, &file.notes)?;
    drop(table);
    glossiness::convert(&glossy, &mut materials, &mut asset.images);
    asset.materials = materials;
    asset.skeleton = Arc::new(std::mem::take(&mut tree.skeleton));
    profile.finish(&file.document(Some(&tree)), needs, &mut asset)?;
    let show_bones = needs.geometry && options.bool("bones").unwrap_or(true);
    if show_bones && asset.instances.is_empty() && nodes::has_skeleton(&file, &tree, &asset) {
        bones::add_bones(&mut asset);
    }
    asset.warnings = file.into_warnings();
    Ok(asset)
}

fn leave_out_normal_maps(material: &mut Material, images: &[u32]) {
    let leave_out = |map: &mut Option<TextureRef>| _ = map.take_if(|t| images.contains(&t.image));
    leave_out(&mut material.normal_texture);
    if let Some(layers) = &mut material.layers {
        leave_out(&mut layers.clearcoat_normal_texture);
    }
}

fn decode(file: &File<'_>, tree: &nodes::Tree, needs: ImportScope, materials: &[Material]) -> Result<Asset> {
    let mut asset = Asset::default();
    if needs.geometry {
        asset.skins = objects::skins(file, tree)?;
        asset.meshes = meshes::read(file, materials)?;
        asset.instances = meshes::instances(file, tree, &asset.meshes, &asset.skins)?;
    }
    asset.cameras = objects::cameras(file, tree)?;
    asset.lights = objects::lights(file, tree)?;
    if needs.clips {
        asset.clips = animations::read(file, tree)?;
    }
    Ok(asset)
}
