//! `choreo plugins test`: tests a package as its users will use it: its description and plugins, importers on intact and damaged sample
//! files, exporters on a small stage, and the package's own test scripts.

use super::packages;
use crate::args::Cli;
use crate::args::Command;
use crate::commands::test;
use crate::failure::{Failure, Problem, print, print_message};
use crate::terminal::{counted, page::Page};
use choreo_asset::Asset;
use choreo_files::{Folder, containing_folder};
use choreo_motion::Transform;
use choreo_plugin::{
    AssetBuilder, BuildError, Claim, ExportError, ExportedScene, Files, ImportError, ImportOptions,
    ImportScope, Importer, MemoryFiles, OptionError, Registry, SceneExporter, Source,
};
use choreo_session::package::PackagedKind;
use choreo_stage::Stage;
use clap::Parser;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Limits on the size of a sample in bytes, and on the number of samples.
const MAX_SAMPLE_BYTES: u64 = 64 << 20;
const MAX_SAMPLES: usize = 100;
/// Number of truncated copies of each sample, and number of copies with one flipped bit.
const TRUNCATIONS: usize = 16;
const BIT_FLIPS: usize = 64;
/// Folders of a package that are searched for samples and test scripts.
const SEARCHED_FOLDERS: [&str; 3] = ["", "samples", "tests"];

pub(super) fn run(path: &Path, plugins: &Registry) -> Result<(), Failure> {
    let (folder, package) = packages::open_or_installed(path)?;
    let listing = packages::list_working_plugins(&folder, plugins)?;
    let notes = packages::package_notes(&folder, &package, &listing);
    notes.iter().for_each(|text| print_message(format_args!("note: {text}")));
    let mut page = Page::default();
    page.line(format_args!(
        "{} {} ({}): {}",
        package.name,
        package.version,
        package.license,
        package.contents()
    ));
    let mut problems: Vec<String> = Vec::new();
    let names = listing.names();
    for (kind, name) in &names {
        let test_result = match kind {
            PackagedKind::Importer => test_importer(name, &folder, &listing.registry),
            PackagedKind::Exporter => test_exporter(name, &listing.registry),
            PackagedKind::Effect => Ok(Vec::new()),
        };
        match test_result {
            Ok(lines) => page.lines(lines.into_iter().map(|line| format!("  {line}"))),
            Err(faults) => problems.extend(faults),
        }
    }
    print(page.as_str())?;
    let scripts = test_scripts(&folder);
    let effects: Vec<&str> = names
        .iter()
        .filter(|(kind, _)| *kind == PackagedKind::Effect)
        .map(|(_, name)| name.as_str())
        .collect();
    if let (true, [name, ..]) = (scripts.is_empty(), effects.as_slice()) {
        problems.push(format!(
            "{}: the effect {name} has no test; write tests/{name}.rhai with a section: test(\"it shows\", || {{ … }})",
            folder.display()
        ));
    }
    if !problems.is_empty() {
        return Err(Failure::Input(problems.into_iter().map(Problem::Text).collect()));
    }
    if scripts.is_empty() { Ok(()) } else { run_scripts(scripts, &folder, plugins, &effects) }
}

/// Runs the package's test scripts as `choreo test` does. An effect that no script uses is an error: importers and exporters are tested
/// without scripts, effects only by them.
fn run_scripts(
    scripts: Vec<PathBuf>,
    folder: &Path,
    plugins: &Registry,
    effects: &[&str],
) -> Result<(), Failure> {
    let words = ["choreo", "test"].map(|word| word.into()).into_iter();
    let words = words.chain(scripts.into_iter().map(PathBuf::into_os_string));
    let Ok(Command::Test(args)) = Cli::try_parse_from(words).map(|cli| cli.command) else {
        return Err(Failure::Internal("choreo test was called with wrong arguments".into()));
    };
    let mut unused = test::run_package(args, folder, plugins)?;
    unused.retain(|name| effects.contains(&name.as_str()));
    if unused.is_empty() {
        return Ok(());
    }
    let problem = |name: String| {
        let what =
            format!("{}: no test uses the effect {name}; write effect(\"{name}\") in one", folder.display());
        Problem::Text(what)
    };
    Err(Failure::Input(unused.into_iter().map(problem).collect()))
}

/// Scripts of the package that have sections and are not plugins.
fn test_scripts(folder: &Path) -> Vec<PathBuf> {
    let is_script = |name: &str| name.ends_with(".rhai") && !is_plugin(name);
    let mut scripts: Vec<PathBuf> =
        package_files(folder).into_iter().filter(|(name, _)| is_script(name)).map(|(_, p)| p).collect();
    scripts.retain(|path| std::fs::read_to_string(path).is_ok_and(|text| text.contains("test(")));
    scripts
}

fn is_plugin(name: &str) -> bool {
    choreo_session::package::FILE_ENDINGS.iter().any(|ending| name.ends_with(ending))
}

/// Names and paths of the files in the folders of samples and tests, sorted.
fn package_files(folder: &Path) -> Vec<(String, PathBuf)> {
    let in_folder = |below: &&str| {
        let place = if below.is_empty() { folder.to_path_buf() } else { folder.join(below) };
        let names = Folder::open(&place).and_then(|open| open.names(10_000)).unwrap_or_default();
        let named = move |name: std::ffi::OsString| (name.to_string_lossy().into_owned(), place.join(&name));
        names.into_iter().map(named).filter(|(_, path)| path.is_file()).collect::<Vec<_>>()
    };
    SEARCHED_FOLDERS.iter().flat_map(in_folder).collect()
}

/// Files in the folder of a sample, for importers.
struct SampleFolder(Folder);

impl Files for SampleFolder {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        let bytes = self.0.read(Path::new(relative), MAX_SAMPLE_BYTES);
        bytes.map(Arc::new).map_err(|e| format!("{relative}: {e}"))
    }
}

/// Reads the samples with an importer, intact and damaged. The result must be an error or a valid asset.
fn test_importer(name: &str, folder: &Path, registry: &Registry) -> Result<Vec<String>, Vec<String>> {
    let plugin = registry.importers().iter().rfind(|importer| importer.manifest().name == name);
    let Some(plugin) = plugin else { return Err(vec![format!("the importer {name} was not found")]) };
    let (mut lines, mut faults) = (Vec::new(), Vec::new());
    for (file, path) in package_files(folder).into_iter().take(MAX_SAMPLES) {
        if is_plugin(&file) || file == choreo_session::package::DESCRIPTION {
            continue;
        }
        let shown = path.display().to_string();
        let opened = Folder::open(containing_folder(&path));
        let Ok(opened) = opened else { continue };
        let Ok(bytes) = opened.read(Path::new(&file), MAX_SAMPLE_BYTES) else { continue };
        let source = Source { name: shown, bytes: Arc::new(bytes) };
        if plugin.claim(&source) == Claim::NotMine {
            continue;
        }
        match test_sample(&**plugin, &source, &SampleFolder(opened)) {
            Ok(line) => lines.push(format!("importer {name}: {line}")),
            Err(fault) => faults.push(fault.to_string()),
        }
    }
    if lines.is_empty() && faults.is_empty() {
        let extension = plugin.manifest().extensions.first().map_or("EXTENSION", String::as_str);
        faults.push(format!(
            "{}: the importer {name} has no sample; put a small file there, as sample.{extension}",
            folder.display()
        ));
    }
    if faults.is_empty() { Ok(lines) } else { Err(faults) }
}

/// A fault of an importer or exporter found with samples.
#[derive(Debug, thiserror::Error)]
enum PluginFault {
    #[error(transparent)]
    Options(#[from] OptionError),
    #[error("{}", with_hint(.0))]
    Import(ImportError),
    #[error("{} (of a damaged copy)", with_hint(.0))]
    Damaged(ImportError),
    #[error(transparent)]
    Export(#[from] ExportError),
}

fn test_sample(
    importer: &dyn Importer,
    source: &Source,
    beside: &SampleFolder,
) -> Result<String, PluginFault> {
    let manifest = importer.manifest();
    let options = manifest.complete(&ImportOptions::default())?;
    let import = |source: &Source| importer.import(source, beside, ImportScope::ALL, &options);
    let asset = import(source).map_err(PluginFault::Import)?;
    let (mut refused, mut read) = (0, 0);
    for damaged in damaged_copies(&source.bytes) {
        match import(&Source { name: source.name.clone(), bytes: Arc::new(damaged) }) {
            Ok(_) => read += 1,
            // This is a fault of the plugin, not of the file: a panic, or an invalid asset.
            Err(e)
                if e.what.starts_with(&format!("the plugin {} {} has ", manifest.name, manifest.version)) =>
            {
                return Err(PluginFault::Damaged(e));
            }
            Err(_) => refused += 1,
        }
    }
    let shown = &source.name;
    Ok(format!("{shown}: {}; damaged copies: {refused} refused, {read} read", asset_summary(&asset)))
}

fn with_hint(error: &ImportError) -> String {
    let hint = error.hint.as_ref().map(|hint| format!("\n    hint: {hint}")).unwrap_or_default();
    format!("{error}{hint}")
}

fn asset_summary(asset: &Asset) -> String {
    let primitives = asset.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let vertices: usize = primitives.map(|primitive| primitive.positions.len()).sum();
    let joints = asset.skeleton.names().len();
    let (meshes, clips, images) = (asset.meshes.len(), asset.clips.len(), asset.images.len());
    format!("meshes {meshes}, vertices {vertices}, joints {joints}, clips {clips}, images {images}")
}

/// Damaged copies: truncated ones, and ones with a single changed bit. The places are the same in every run.
fn damaged_copies(bytes: &[u8]) -> impl Iterator<Item = Vec<u8>> + '_ {
    let cut = (0..TRUNCATIONS).map(|i| bytes[..bytes.len() * i / TRUNCATIONS].to_vec());
    let changed = (0..BIT_FLIPS.min(bytes.len())).map(|i| {
        let mut copy = bytes.to_vec();
        // Steps of the golden ratio spread the places; the flipped bit cycles through the byte.
        let at = (i as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) % bytes.len() as u64;
        copy[at as usize] ^= 1 << (i % 8);
        copy
    });
    cut.chain(changed)
}

/// An exporter must write a small scene, and write the same bytes the second time.
fn test_exporter(name: &str, registry: &Registry) -> Result<Vec<String>, Vec<String>> {
    let plugin = registry.scene_exporters().iter().rfind(|exporter| exporter.manifest().name == name);
    let Some(plugin) = plugin else { return Err(vec![format!("the exporter {name} was not found")]) };
    let scene = small_scene().map_err(|e| vec![e.to_string()])?;
    let write = || export_to_memory(&**plugin, &scene).map_err(|e| vec![format!("the exporter {name}: {e}")]);
    let (first, second) = (write()?, write()?);
    if (&first.main, &first.beside) != (&second.main, &second.beside) {
        return Err(vec![format!(
            "the exporter {name} wrote different bytes for the same scene the second time"
        )]);
    }
    let beside = counted(first.beside.len() as u64, "file");
    Ok(vec![format!("exporter {name}: {} bytes of a small scene, {beside} beside", first.main.len())])
}

fn export_to_memory(exporter: &dyn SceneExporter, scene: &ExportedScene) -> Result<MemoryFiles, PluginFault> {
    let mut files = MemoryFiles::default();
    let mut scene = scene.clone();
    scene.options = exporter.manifest().complete(&scene.options)?;
    exporter.export(&scene, &mut files)?;
    Ok(files)
}

/// Scene with two actors, each of two joints and a triangle.
fn small_scene() -> Result<ExportedScene, BuildError> {
    let mut builder = AssetBuilder::default();
    let hips = builder.joint("hips", None, Transform::IDENTITY)?;
    let up = Transform { translation: glam::Vec3::Y, ..Transform::IDENTITY };
    let head = builder.joint("head", Some(hips), up)?;
    let positions = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    builder.mesh(choreo_plugin::MeshData { joint: Some(head), positions, ..Default::default() })?;
    let asset = Arc::new(builder.finish("figure")?);
    let mut stage = Stage::default();
    stage.cast("anna", asset.clone());
    stage.cast("bert", asset);
    Ok(ExportedScene::new("scene.rhai", Arc::new(stage)))
}
