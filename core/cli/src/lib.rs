//! The program `choreo`: the command line with the plugins of this repository. A program with plugins of its own adds them to
//! [`app`] and gives it to [`run`] and, for its viewer, to `choreo_viewer::run`; `tests/studio` shows how.

mod pages;

use choreo_plugin::Registry;

pub use choreo_command_line::{App, command, run};

/// The program `choreo`.
pub fn app() -> App {
    // Making the plugins takes memory, too.
    choreo_command_line::exit_code_of_abort();
    let mut app = App::new("choreo", env!("CARGO_PKG_VERSION"), registry());
    app.pages = pages::pages();
    app
}

/// The plugins that this program is built with.
pub fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.add_importer(import_gltf::GltfImporter);
    registry.add_importer(import_mannequin::Mannequin);
    registry.add_importer(import_fbx::FbxImporter);
    registry.add_importer(import_bvh::BvhImporter);
    registry.add_importer(import_vrm::VrmImporter);
    registry.add_importer(import_collada::ColladaImporter);
    registry.add_importer(import_obj::ObjImporter);
    registry.add_importer(import_stl::StlImporter);
    effects::all().into_iter().for_each(|effect| registry.add_effect(effect));
    registry.add_exporter(export_png::PngExporter);
    registry.add_exporter(export_mp4::Mp4Exporter);
    registry.add_exporter(export_gif::GifExporter);
    registry.add_exporter(export_y4m::Y4mExporter);
    registry.add_exporter(export_apng::ApngExporter);
    registry.add_exporter(export_exr::ExrExporter);
    registry.add_scene_exporter(export_csv::CsvExporter);
    registry.add_scene_exporter(export_bvh::BvhExporter);
    registry.add_scene_exporter(export_edit::EditExporter);
    registry.add_scene_exporter(export_gltf::GltfExporter);
    registry.add_scene_exporter(export_usd::UsdExporter);
    registry
}
