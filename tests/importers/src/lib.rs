//! The importers of model formats and the sample files of each: shared by the tests and the bench of this crate.

pub mod assimp;

use choreo_asset::Asset;
use choreo_importer_kit_testing::{Companions, source};
use choreo_plugin::{
    ExportedScene, ImportError, ImportScope, Importer, MemoryFiles, OptionValue, SceneExporter,
};
use choreo_stage::{Cue, Repeat, Stage};
use export_usd::UsdExporter;
use import_usd::UsdImporter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub struct Format {
    pub extension: &'static str,
    pub importer: &'static dyn Importer,
}

pub const FORMATS: [Format; 5] = [
    Format { extension: "bvh", importer: &import_bvh::BvhImporter },
    Format { extension: "dae", importer: &import_collada::ColladaImporter },
    Format { extension: "fbx", importer: &import_fbx::FbxImporter },
    Format { extension: "obj", importer: &import_obj::ObjImporter },
    Format { extension: "stl", importer: &import_stl::StlImporter },
];

/// Sample files of all these formats; there are others beside them.
pub const SAMPLES: usize = 54;
/// The samples of glTF, VRM and VRMA.
pub const GLTF_SAMPLES: usize = 40;

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

/// The importer of a file's extension, so that a file which only another importer would claim is seen as an error.
pub fn importer(path: &Path) -> Option<&'static dyn Importer> {
    let extension = extension(path);
    match extension.as_str() {
        "glb" | "gltf" => Some(&import_gltf::GltfImporter),
        "vrm" | "vrma" => Some(&import_vrm::VrmImporter),
        "usd" | "usda" | "usdc" | "usdz" => Some(&import_usd::UsdImporter),
        _ => FORMATS.iter().find(|f| f.extension == extension).map(|f| f.importer),
    }
}

/// Every file of the five formats, relative to the folder, in order.
pub fn samples(folder: &Path) -> Vec<PathBuf> {
    files(folder, |extension| FORMATS.iter().any(|f| f.extension == extension))
}

/// Files of glTF and of the formats over it, in order.
pub fn gltf_samples(folder: &Path) -> Vec<PathBuf> {
    files(folder, |extension| ["glb", "gltf", "vrm", "vrma"].contains(&extension))
}

fn files(folder: &Path, wanted: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let mut out = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(inner) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(inner) else { continue };
        for path in entries.flatten().map(|e| e.path()) {
            let known = wanted(&extension(&path));
            match path.is_dir() {
                true => folders.push(path),
                false if known => out.extend(path.strip_prefix(folder).map(Path::to_path_buf)),
                false => {}
            }
        }
    }
    out.sort();
    out
}

/// Imports a file with the files beside it, and default options.
pub fn import(path: &Path, needs: ImportScope) -> Result<Asset, ImportError> {
    import_with(path, needs, &[])
}

/// Like [`import`], with options of its importer.
pub fn import_with(
    path: &Path,
    needs: ImportScope,
    given: &[(&str, OptionValue)],
) -> Result<Asset, ImportError> {
    let importer = importer(path).unwrap_or_else(|| panic!("no importer for {}", path.display()));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let folder = Companions::in_folder(path.parent().unwrap_or(Path::new(".")));
    let options = choreo_importer_kit_testing::options(importer, given);
    importer.import(&source(&name, bytes), &folder, needs, &options)
}

pub fn import_whole(path: &Path) -> Asset {
    import(path, ImportScope::ALL).unwrap_or_else(|e| panic!("{e}"))
}

/// The formats of USD. No sample is of these: they are made of other samples by our exporter, which usd-core verifies.
pub const USD: [&str; 3] = ["usda", "usdc", "usdz"];

/// An asset as USD, playing its first clip: the file, and its images by name.
pub fn as_usd(asset: &Arc<Asset>, extension: &str) -> (Vec<u8>, Vec<(String, Vec<u8>)>) {
    let mut stage = Stage::default();
    let actor = stage.cast("model", asset.clone());
    if let Some(clip) = asset.clips.first() {
        stage.settings.length = clip.duration;
        stage.play(actor, Cue { repeat: Repeat::Once, ..Cue::new(clip.clone()) });
    }
    let mut scene = ExportedScene::new("model", Arc::new(stage));
    scene.extension = extension.into();
    scene.options =
        UsdExporter.manifest().complete(&scene.options).unwrap_or_else(|e| panic!("{}", e.message));
    let mut files = MemoryFiles::default();
    UsdExporter.export(&scene, &mut files).unwrap_or_else(|e| panic!("{e}"));
    let beside = files.beside.into_iter().map(|(ending, bytes)| (format!("out{ending}"), bytes));
    (files.main, beside.collect())
}

/// The import of what [`as_usd`] gives.
pub fn from_usd((bytes, beside): (Vec<u8>, Vec<(String, Vec<u8>)>), extension: &str) -> Asset {
    let name = format!("out.{extension}");
    let options = choreo_importer_kit_testing::options(&UsdImporter, &[]);
    let asset =
        UsdImporter.import(&source(&name, bytes), &Companions::of(beside), ImportScope::ALL, &options);
    asset.unwrap_or_else(|e| panic!("{e}"))
}
