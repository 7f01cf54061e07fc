//! COLLADA 1.4 and 1.5 into an [`Asset`]. Contents, limits and options: README.md.

mod animation;
mod bake;
mod controller;
mod encoding;
mod geometry;
mod materials;
mod meshes;
mod nodes;
mod objects;
mod properties;
mod sampler;
mod source;
mod xml;

use choreo_asset::{Asset, Origin};
use choreo_importer_kit::text::{shown, stem};
use choreo_importer_kit::textures::use_normal_maps;
use choreo_importer_kit::{Budget, Notes, Result, bones, tangents};
use choreo_plugin::{Claim, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, Source};
use glam::{DMat4, DVec4};
use std::sync::{Arc, LazyLock};

/// Limit of all bytes decoded from one file together; the same as in import-gltf.
const MAX_DECODED_BYTES: u64 = 2 << 30;

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "collada",
        env!("CARGO_PKG_VERSION"),
        "COLLADA: meshes, skins, morphs, clips, materials, cameras, lights",
    )
    .extensions(["dae"])
    .number("smooth", "degrees up to which an edge is smooth, where normals are missing", 30.0, 0.0..=180.0)
    .text(
        "colors",
        "color space of the colors: srgb or linear; auto: linear in files of Blender, else srgb",
        "auto",
        &["auto", "srgb", "linear"],
    )
    .flag("bones", "show a mesh made of the bones where the file has no mesh", true)
});

#[derive(Clone, Copy, Debug, Default)]
pub struct ColladaImporter;

impl Importer for ColladaImporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    /// Claims files by their root element, in any encoding.
    fn claim(&self, source: &Source) -> Claim {
        let head = &source.bytes[..source.bytes.len().min(4096)];
        // ASCII letters in UTF-16 have a zero byte each, which is dropped.
        let letters: Vec<u8> = head.iter().copied().filter(|b| *b != 0).collect();
        if letters.windows(8).any(|w| w == b"<COLLADA") {
            Claim::Content(95)
        } else if MANIFEST.has_extension(&source.extension()) {
            Claim::Extension
        } else {
            Claim::NotMine
        }
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
    let notes = Notes::default();
    let budget = Budget::new(MAX_DECODED_BYTES);
    let text = encoding::decode(&source.bytes)?;
    let doc = xml::parse(&text)?;
    let xml = xml::Xml::new(&doc, files, &notes, &budget);
    let root = xml.root();
    if xml::name_of(root) != "COLLADA" {
        let what = format!("the root element is {}, not COLLADA", shown(xml::name_of(root).as_bytes()));
        return Err(
            choreo_importer_kit::Problem::new("line 1", what).hint("this is another kind of XML file")
        );
    }
    let (metres, up) = objects::convention(&xml);
    let tool = animation::authoring_tool(&xml).to_string();
    let srgb = match options.text("colors") {
        Some("srgb") => true,
        Some("linear") => false,
        _ => !tool.contains("Blender"),
    };
    let tree = nodes::Tree::read(&xml, nodes::Convention { metres, up: y_up_from_axis(up) })?;
    let mut asset = Asset {
        name: source.name.clone(),
        skeleton: Arc::new(tree.skeleton(&xml)?),
        origin: Origin {
            format: format!("COLLADA {}", shown(root.attribute("version").unwrap_or("?").as_bytes())),
            writer: tool,
            metres_per_unit: Some(metres),
            up: up.into(),
            ..Origin::default()
        },
        ..Asset::default()
    };
    let (cameras, lights) = (objects::cameras(&xml, &tree)?, objects::lights(&xml, &tree)?);
    asset.cameras = cameras.iter().map(|camera| camera.object.clone()).collect();
    asset.lights = lights.iter().map(|light| light.object.clone()).collect();
    let objects = properties::Objects { cameras, lights, metres };
    let materials = materials::Materials::new(needs.textures, files, srgb);
    let smooth_rad = options.number("smooth").unwrap_or(30.0).to_radians();
    let mut meshes = meshes::Builder::new(&xml, &tree, materials, smooth_rad);
    if needs.geometry {
        meshes.build(&mut asset)?;
    }
    let meshes::Builder { materials, morphs, .. } = meshes;
    asset.materials = materials.list;
    // Decoding images takes long, so it runs in parallel with reading clips.
    let clips = || match needs.clips {
        true => animation::read(&xml, &tree, (&morphs, &objects), stem(&source.name)),
        false => Ok(Vec::new()),
    };
    let (images, clips) =
        materials.textures.unwrap_or_default().decode_beside(&notes, needs, files, clips)?;
    (asset.images, asset.clips) = (images, clips?);
    use_normal_maps(&mut asset.materials, &asset.images, materials.bumps, &notes);
    for mesh in asset.meshes.iter_mut().filter_map(Arc::get_mut) {
        mesh.primitives.iter_mut().for_each(|p| tangents::add_for_normal_map(p, &asset.materials, &notes));
    }
    let has_bones = tree.joints.iter().any(|j| j.parent.is_some());
    if needs.geometry && asset.meshes.is_empty() && has_bones && options.bool("bones").unwrap_or(true) {
        bones::add_bones(&mut asset);
    }
    asset.warnings = notes.into_warnings();
    Ok(asset)
}

/// The shortest rotation from the file's upward axis to +Y, about x or z.
fn y_up_from_axis(up: &str) -> DMat4 {
    match up {
        // x becomes y, y becomes −x.
        "+X" => DMat4::from_cols(DVec4::Y, DVec4::NEG_X, DVec4::Z, DVec4::W),
        // z becomes y, y becomes −z.
        "+Z" => DMat4::from_cols(DVec4::X, DVec4::NEG_Z, DVec4::Y, DVec4::W),
        _ => DMat4::IDENTITY,
    }
}
