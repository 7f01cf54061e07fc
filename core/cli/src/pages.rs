//! Pages of the documentation, compiled in, because they do not lie beside an installed program: `choreo help` searches their headings and
//! tables, `choreo help --page NAME` prints one.

/// Path in the sources, and text. Those in `pages` are symbolic links, because a package holds no files outside its own folder.
const PAGES: [(&str, &str); 22] = [
    ("core/cli/README.md", include_str!("../README.md")),
    ("core/viewer/README.md", include_str!("../pages/viewer.md")),
    ("plugins/README.md", include_str!("../pages/plugins.md")),
    ("plugins/export-apng/README.md", export_apng::README),
    ("plugins/export-bvh/README.md", export_bvh::README),
    ("plugins/export-csv/README.md", export_csv::files::README),
    ("plugins/export-edit/README.md", export_edit::README),
    ("plugins/export-gif/README.md", export_gif::README),
    ("plugins/export-gltf/README.md", export_gltf::README),
    ("plugins/export-mp4/README.md", export_mp4::README),
    ("plugins/export-png/README.md", export_png::README),
    ("plugins/export-usd/README.md", export_usd::README),
    ("plugins/export-y4m/README.md", export_y4m::README),
    ("plugins/import-bvh/README.md", import_bvh::README),
    ("plugins/import-collada/README.md", import_collada::README),
    ("plugins/import-fbx/README.md", import_fbx::README),
    ("plugins/import-gltf/README.md", import_gltf::README),
    ("plugins/import-mannequin/README.md", import_mannequin::README),
    ("plugins/import-obj/README.md", import_obj::README),
    ("plugins/import-stl/README.md", import_stl::README),
    ("plugins/import-usd/README.md", import_usd::README),
    ("plugins/import-vrm/README.md", import_vrm::README),
];

/// The pages of the command line, the viewer and the built-in plugins.
pub fn pages() -> Vec<(&'static str, &'static str)> {
    [&PAGES, effects::PAGES].concat()
}

#[cfg(test)]
mod tests {
    use super::pages;

    /// A checkout without symbolic links has the path of the page in place of its text.
    #[test]
    fn every_page_has_its_text() {
        for (path, text) in pages() {
            assert!(text.starts_with("# "), "{path}: {text:.60}; git needs core.symlinks");
        }
    }

    #[test]
    fn every_plugin_has_a_page() {
        let (registry, pages) = (crate::registry(), pages());
        let importers = registry.importers().iter().map(|p| format!("import-{}", p.manifest().name));
        let exporters = registry.exporters().iter().map(|p| format!("export-{}", p.manifest().name));
        let scenes = registry.scene_exporters().iter().map(|p| format!("export-{}", p.manifest().name));
        let effects = registry.effects().iter().map(|p| format!("effects/{}", p.manifest().name));
        for plugin in importers.chain(exporters).chain(scenes).chain(effects) {
            let page = format!("plugins/{plugin}/README.md");
            assert!(pages.iter().any(|(path, _)| *path == page), "{page}");
        }
    }
}
