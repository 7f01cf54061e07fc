//! Pages of the documentation, which are compiled into the program so that it can be installed alone. `choreo help` searches their headings
//! and tables, and `choreo help --page NAME` prints one.

/// Pages as (path in the sources, text). The files in `pages` are symbolic links, because a package contains only files of its own folder.
const PAGES: &[(&str, &str)] = &[
    ("core/cli/README.md", include_str!("../README.md")),
    ("core/viewer/README.md", include_str!("../pages/viewer.md")),
    ("plugins/README.md", include_str!("../pages/plugins.md")),
    ("plugins/COMPARISON.md", include_str!("../pages/comparison.md")),
    ("core/wasm_plugin/README.md", include_str!("../pages/wasm_plugin.md")),
];

macro_rules! guide {
    ($($name:literal,)*) => {
        &[$((concat!("scripts/guide/", $name), include_str!(concat!("../pages/guide/", $name)))),*]
    };
}

/// The guide, and the scripts that its pages include.
const GUIDE: &[(&str, &str)] = guide![
    "src/coming_from/blender.md",
    "src/coming_from/mixamo.md",
    "src/coming_from/motion_canvas.md",
    "src/coming_from/three_js.md",
    "src/coming_from/unity.md",
    "src/concepts/cameras.md",
    "src/concepts/constraints.md",
    "src/concepts/effects.md",
    "src/concepts/layers.md",
    "src/concepts/lights.md",
    "src/concepts/retargeting.md",
    "src/concepts/root_motion.md",
    "src/concepts/springs.md",
    "src/concepts/tests.md",
    "src/concepts/timeline.md",
    "src/internals.md",
    "src/introduction.md",
    "src/performance.md",
    "src/plugin_authors.md",
    "src/recipes/compositor.md",
    "src/recipes/crowd.md",
    "src/recipes/dialogue.md",
    "src/recipes/hand_over.md",
    "src/recipes/other_programs.md",
    "src/recipes/regression.md",
    "src/recipes/render_farm.md",
    "src/recipes/template.md",
    "src/recipes/titles.md",
    "src/recipes/turntable.md",
    "src/recipes/walk_to_a_mark.md",
    "src/ten_minutes.md",
    "src/troubleshooting.md",
    "scenes/cameras.rhai",
    "scenes/constraints.rhai",
    "scenes/crowd.rhai",
    "scenes/dialogue.rhai",
    "scenes/effects.rhai",
    "scenes/first_1.rhai",
    "scenes/first_2.rhai",
    "scenes/first_3.rhai",
    "scenes/hand_over.rhai",
    "scenes/layers.rhai",
    "scenes/lights.rhai",
    "scenes/mixamo.rhai",
    "scenes/regression.rhai",
    "scenes/retargeting.rhai",
    "scenes/root_motion.rhai",
    "scenes/same_scene.rhai",
    "scenes/template.rhai",
    "scenes/tested.rhai",
    "scenes/timeline.rhai",
    "scenes/titles.rhai",
    "scenes/turntable.rhai",
    "scenes/tweens.rhai",
    "scenes/walk_to_a_mark.rhai",
];

/// The pages of the guide, the command line, the viewer and the built-in plugins.
pub(crate) fn pages() -> Vec<(&'static str, &'static str)> {
    [PAGES, crate::PLUGIN_PAGES, effects::PAGES, GUIDE].concat()
}

#[cfg(test)]
mod tests {
    use super::pages;

    /// A checkout without symbolic links has the path of the page in place of its text.
    #[test]
    fn every_page_has_its_text() {
        for (path, text) in pages() {
            let is_text = if path.ends_with(".rhai") { text.contains(';') } else { text.starts_with("# ") };
            assert!(is_text, "{path}: {text:.60}; git needs core.symlinks");
        }
    }

    #[test]
    fn every_page_and_scene_of_the_guide_is_included() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scripts/guide/src/SUMMARY.md");
        let summary = std::fs::read_to_string(path).unwrap();
        let links = summary.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
        let guide_pages: Vec<&str> =
            links.map(|(path, _)| path).filter(|path| !path.starts_with("..")).collect();
        assert!(guide_pages.len() > 20, "{guide_pages:?}");
        for path in guide_pages {
            let page = format!("scripts/guide/src/{path}");
            let text = pages().iter().find(|(known, _)| *known == page).map(|(_, text)| *text);
            let text = text.unwrap_or_else(|| panic!("{page} is missing in core/cli/src/pages.rs"));
            for scene in text.split("{{#include ").skip(1).filter_map(|rest| rest.split("scenes/").nth(1)) {
                let scene = scene.split('}').next().unwrap_or_default();
                let scene = format!("scripts/guide/scenes/{scene}");
                assert!(pages().iter().any(|(known, _)| *known == scene), "{scene}, of {page}");
            }
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
