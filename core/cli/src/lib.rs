//! The program `choreo`: the command line with the plugins of this repository. A program with plugins of its own calls [`run`] with
//! the [`registry`] and what it adds to it; `examples/my_plugin.rs` shows how.

use choreo_plugin::Registry;

pub use choreo_command_line::run;

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
    effects::all().into_iter().for_each(|effect| registry.add_shared_effect(effect));
    registry.add_exporter(export_png::PngExporter);
    registry.add_exporter(export_mp4::Mp4Exporter);
    registry.add_exporter(export_gif::GifExporter);
    registry.add_exporter(export_y4m::Y4mExporter);
    registry
}
