//! Autodesk FBX into an [`Asset`], through the C library ufbx. Contents, limits and options: README.md.

mod alpha;
mod clips;
mod convert;
mod curve;
mod driven;
mod emit;
mod file;
mod geometry;
mod joined;
mod keys;
mod load;
mod local;
mod materials;
mod meshes;
mod morphs;
mod nodes;
mod objects;
mod properties;
mod refine;
mod sampled;
mod skinning;
#[cfg(test)]
mod tests;
mod textures;
mod value_conversion;
mod vertices;
mod weights;

use choreo_asset::Asset;
use choreo_importer_kit::{Problem, Result, bones, images};
use choreo_plugin::{Claim, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, Source};
use file::File;
use std::sync::{Arc, LazyLock};

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "fbx",
        env!("CARGO_PKG_VERSION"),
        "Autodesk FBX 6.1–7.7, binary or text: meshes, skins, blend shapes, clips, materials, cameras, lights",
    )
    .extensions(["fbx"])
    .magic(BINARY_MAGIC)
    .number(
        "tolerance",
        "largest rotation error between keys, in degrees; at 0.05 translations are off by at most 0.1 mm",
        file::TOLERANCE_DEG,
        1e-4..=10.0,
    )
    .number(
        "rate",
        "keys a second, interpolated linearly, instead of the tolerance; 0: the file's own keys",
        0.0,
        0.0..=1000.0,
    )
    .flag("bones", "show the bones of a file that has no mesh", true)
    .flag("hidden", "show meshes that the file hides, too", false)
    .flag("vertex_colors", "multiply the mesh's colors, taken as sRGB, into the material", true)
});

const BINARY_MAGIC: &[u8] = b"Kaydara FBX Binary  \0";
/// Bytes of a text file in which its first section must begin.
const TEXT_HEAD: usize = 4096;

#[derive(Clone, Copy, Debug, Default)]
pub struct FbxImporter;

impl Importer for FbxImporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    /// Claims binary files by their magic number, and text files by their first section.
    fn claim(&self, source: &Source) -> Claim {
        let head = &source.bytes[..source.bytes.len().min(TEXT_HEAD)];
        if head.starts_with(BINARY_MAGIC) {
            return Claim::Content(100);
        }
        let says = |word: &[u8]| head.windows(word.len()).any(|w| w == word);
        if says(b"FBXHeaderExtension:") && !head.contains(&0) {
            return Claim::Content(95);
        }
        if MANIFEST.has_extension(&source.extension()) { Claim::Extension } else { Claim::NotMine }
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> std::result::Result<Asset, ImportError> {
        import(source, files, needs, options).map_err(|p| p.in_file(&source.name))
    }
}

fn import(source: &Source, files: &dyn Files, needs: ImportScope, options: &ImportOptions) -> Result<Asset> {
    let scene = load::load(&source.bytes, needs, files)?;
    let file = File::new(&scene, source.bytes.len(), files, needs, options);
    load::pass_warnings(&file);
    let tree = nodes::read(&file)?;
    let mut table = textures::ImageTable::default();
    let mut materials = materials::read(&file, &mut table)?;

    // Decoding images takes as long as everything else together, so both run in parallel.
    let (decoded, rest) =
        images::decode_beside(table.encoded(), needs, files, || decode(&file, &tree, &materials));
    let mut asset = rest?;
    let is_off = |p: &Problem| p.what == images::CANCELLED;
    if let Some(off) = decoded.iter().filter_map(|p| p.as_ref().err()).find(|p| is_off(p)) {
        return Err(off.clone());
    }
    let show_bones = options.bool("bones").unwrap_or(true) && !scene.bones.is_empty();
    asset.name = source.name.clone();
    asset.images = table.finish(&file, decoded, &mut materials)?;
    asset.materials = materials.into_iter().map(|m| m.material).collect();
    asset.origin = file.origin();
    asset.skeleton = Arc::new(tree.skeleton);
    asset.warnings = file.notes.into_warnings();
    if needs.geometry && show_bones && asset.instances.is_empty() {
        bones::add_bones(&mut asset);
    }
    Ok(asset)
}

fn decode(file: &File<'_>, tree: &nodes::Tree, materials: &[materials::MaterialDraft]) -> Result<Asset> {
    let mut asset = Asset::default();
    let shown = meshes::visible_meshes(file, tree);
    if file.needs.geometry {
        meshes::read(file, tree, &shown, materials, &mut asset)?;
    }
    let mut objects = Vec::new();
    asset.cameras = objects::cameras(file, tree, &mut objects)?;
    asset.lights = objects::lights(file, tree, &mut objects)?;
    if file.needs.clips {
        asset.clips = clips::read(file, tree, &shown, &objects)?;
    }
    Ok(asset)
}
