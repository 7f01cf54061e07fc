//! The program `choreo`: the command line with the plugins of this repository. A program with further plugins adds them to [`app`], and
//! passes it to [`run`] and, for its viewer, to `choreo_viewer::run`; `tests/studio` is an example.

mod pages;

use choreo_plugin::Registry;

pub use choreo_command_line::{App, clap_command, run};

/// Describes the program `choreo`.
pub fn app() -> App {
    // Must be called before the plugins allocate memory.
    choreo_command_line::set_exit_code_of_abort();
    let mut app = App::new("choreo", env!("CARGO_PKG_VERSION"), registry());
    app.pages = pages::pages();
    app
}

/// Declares the built-in plugins: the registry function for each, its folder and its page.
macro_rules! plugins {
    ($($add:ident($plugin:path) $folder:literal $page:path;)*) => {
        /// Registry of the plugins that are compiled into this program.
        pub fn registry() -> Registry {
            let mut registry = Registry::default();
            effects::all().into_iter().for_each(|effect| registry.add_effect(effect));
            $(registry.$add($plugin);)*
            registry
        }

        const PLUGIN_PAGES: &[(&str, &str)] = &[$((concat!("plugins/", $folder, "/README.md"), $page),)*];
    };
}

plugins! {
    add_importer(import_gltf::GltfImporter) "import-gltf" import_gltf::README;
    add_importer(import_mannequin::Mannequin) "import-mannequin" import_mannequin::README;
    add_importer(import_fbx::FbxImporter) "import-fbx" import_fbx::README;
    add_importer(import_bvh::BvhImporter) "import-bvh" import_bvh::README;
    add_importer(import_vrm::VrmImporter) "import-vrm" import_vrm::README;
    add_importer(import_collada::ColladaImporter) "import-collada" import_collada::README;
    add_importer(import_obj::ObjImporter) "import-obj" import_obj::README;
    add_importer(import_stl::StlImporter) "import-stl" import_stl::README;
    add_importer(import_usd::UsdImporter) "import-usd" import_usd::README;
    add_exporter(export_png::PngExporter) "export-png" export_png::README;
    add_exporter(export_mp4::Mp4Exporter) "export-mp4" export_mp4::README;
    add_exporter(export_gif::GifExporter) "export-gif" export_gif::README;
    add_exporter(export_y4m::Y4mExporter) "export-y4m" export_y4m::README;
    add_exporter(export_apng::ApngExporter) "export-apng" export_apng::README;
    add_exporter(export_exr::ExrExporter) "export-exr" export_exr::README;
    add_exporter(export_webp::WebpExporter) "export-webp" export_webp::README;
    add_scene_exporter(export_csv::CsvExporter) "export-csv" export_csv::files::README;
    add_scene_exporter(export_bvh::BvhExporter) "export-bvh" export_bvh::README;
    add_scene_exporter(export_edit::EditExporter) "export-edit" export_edit::README;
    add_scene_exporter(export_gltf::GltfExporter) "export-gltf" export_gltf::README;
    add_scene_exporter(export_usd::UsdExporter) "export-usd" export_usd::README;
}
