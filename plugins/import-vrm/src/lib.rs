//! VRM 0.x and 1.0 characters and VRM animations (.vrma) into an [`Asset`]. Contents, limits and options: README.md.

mod about;
mod animation;
mod expressions;
mod eyes;
mod facing;
mod gaze;
mod human;
mod json;
mod mtoon;
mod springs;
mod springs_v0;

use choreo_asset::{Asset, Material};
use choreo_importer_kit::{Problem, Result, bones};
use choreo_plugin::{Claim, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, Source};
use import_gltf::MaterialTextures;
use import_gltf::profile::{Document, Profile, has_extension, import_with};
use json::At;
use serde_json::{Map, Value};
use std::sync::{Arc, LazyLock};

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "vrm",
        env!("CARGO_PKG_VERSION"),
        "VRM 0.x and 1.0: characters with human bones, expressions, springs; VRM animations (.vrma)",
    )
    .extensions(["vrm", "vrma"])
    .flag("bones", "show a mesh made of the bones in animations, which have no mesh", true)
});

/// The root extension that marks each kind of file.
const V0: &str = "VRM";
const V1: &str = "VRMC_vrm";
const ANIMATION: &str = "VRMC_vrm_animation";

#[derive(Clone, Copy, Debug, Default)]
pub struct VrmImporter;

impl Importer for VrmImporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    /// Claims with higher priority than the glTF importer. A truncated file that mentions VRM is claimed where its name says so
    /// too, so that the user reads what is broken.
    fn claim(&self, source: &Source) -> Claim {
        let bytes = source.bytes.as_slice();
        let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes).trim_ascii_start();
        if !bytes.starts_with(b"glTF") && !text.starts_with(b"{") {
            return Claim::NotMine;
        }
        let named = MANIFEST.has_extension(&source.extension());
        match has_extension(bytes, &[V0, V1, ANIMATION]) {
            Some(true) => Claim::Content(98),
            None if named => Claim::Content(96),
            _ => Claim::NotMine,
        }
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        scope: ImportScope,
        options: &ImportOptions,
    ) -> std::result::Result<Asset, ImportError> {
        let vrm = Vrm { bones: options.bool("bones").unwrap_or(true), orders: mtoon::DrawOrders::default() };
        import_with(source, files, scope, options, &vrm)
    }
}

/// The glTF profile that reads VRM's extensions.
struct Vrm {
    bones: bool,
    orders: mtoon::DrawOrders,
}

impl Profile for Vrm {
    fn extensions(&self) -> &[&str] {
        &[V0, V1, ANIMATION, "VRMC_springBone", "VRMC_springBone_extended_collider", "VRMC_materials_mtoon"]
    }

    fn material(
        &self,
        document: &Document<'_>,
        index: usize,
        extensions: &Map<String, Value>,
        textures: &mut dyn MaterialTextures,
        material: &mut Material,
    ) -> Result<()> {
        if let Some(mtoon) = extensions.get("VRMC_materials_mtoon")
            && document.extension(V1).is_some()
        {
            let place = format!("materials[{index}].extensions.VRMC_materials_mtoon");
            return mtoon::read(&At::new(mtoon, place), textures, material, &self.orders);
        }
        let v0 = document.extension(V0).filter(|_| document.extension(V1).is_none());
        let properties = v0.and_then(|v| v.get("materialProperties")?.get(index));
        if let Some(properties) = properties.filter(|p| p["shader"] == "VRM/MToon") {
            let place = format!("extensions.VRM.materialProperties[{index}]");
            mtoon::read_v0(&At::new(properties, place), textures, material)?;
        }
        Ok(())
    }

    fn finish(&self, document: &Document<'_>, scope: ImportScope, asset: &mut Asset) -> Result<()> {
        self.orders.warn(document);
        let root = |name: &str| document.extension(name).map(|v| At::new(v, format!("extensions.{name}")));
        if let Some(vrm) = root(V1) {
            character(document, &vrm, scope, asset)
        } else if let Some(vrm) = root(V0) {
            character_v0(document, &vrm, scope, asset)
        } else if let Some(vrma) = root(ANIMATION) {
            animation::read(document, &vrma, asset)?;
            if self.bones && scope.geometry && asset.meshes.is_empty() {
                bones::add_bones(asset);
            }
            Ok(())
        } else {
            let problem = Problem::new("extensions", "has none of VRM, VRMC_vrm and VRMC_vrm_animation");
            Err(problem.hint("read the file with #{ importer: \"gltf\" }"))
        }
    }
}

/// Reads a VRM 1.0 character.
fn character(document: &Document<'_>, vrm: &At<'_>, scope: ImportScope, asset: &mut Asset) -> Result<()> {
    version(document, vrm, "1.0");
    about::read(document, vrm, asset);
    human::read(document, vrm, asset)?;
    expressions::read(document, vrm, scope, asset)?;
    asset.eyes = eyes::read(vrm)?;
    expressions::add_gaze(asset);
    if let Some(springs) = document.extension("VRMC_springBone") {
        let springs = At::new(springs, "extensions.VRMC_springBone".into());
        asset.springs = springs::read(document, &springs, asset)?;
    }
    checked(asset)
}

/// Reads a VRM 0.x character, and finally rotates it, because it looks along −Z.
fn character_v0(document: &Document<'_>, vrm: &At<'_>, scope: ImportScope, asset: &mut Asset) -> Result<()> {
    about::read_v0(document, vrm, asset);
    human::read_v0(document, vrm, asset)?;
    expressions::read_v0(document, vrm, scope, asset)?;
    asset.eyes = eyes::read_v0(vrm)?;
    expressions::add_gaze(asset);
    asset.springs = springs_v0::read(document, vrm, asset)?;
    facing::turn(asset)?;
    checked(asset)
}

fn version(document: &Document<'_>, extension: &At<'_>, known: &str) {
    match extension.text("specVersion") {
        Some(version) if version == known || version.starts_with(&format!("{known}-")) => {}
        Some(other) => {
            let other: String = other.chars().take(40).collect();
            document.warn(extension.place(), format!("has version \"{other}\"; it is read as {known}"));
        }
        None => document.warn(extension.place(), format!("has no specVersion; it is read as {known}")),
    }
}

/// Checks the springs, which the solver relies on.
fn checked(asset: &mut Asset) -> Result<()> {
    asset
        .springs
        .check(asset.skeleton.len())
        .map_err(|e| Problem::new(format!("springs.{}", e.place), e.what))
}

/// Sets the humanoid bones of the skeleton.
fn set_humanoid(asset: &mut Asset, humanoid: choreo_motion::Humanoid, place: String) -> Result<()> {
    let skeleton = asset.skeleton.as_ref().clone();
    let skeleton = skeleton.with_humanoid(humanoid).map_err(|e| Problem::new(place, e.to_string()))?;
    asset.skeleton = Arc::new(skeleton);
    Ok(())
}
