//! Runs sections that are given as text, with some built-in plugins.

#![allow(dead_code, reason = "each test program uses some of the functions")]

use choreo_plugin::Registry;
use choreo_script::AssetCache;
use choreo_script::testing::{SectionRun, TestOptions, list_sections, run_section};
use choreo_test_runner::Check;
use choreo_test_runner::evaluate::evaluate;
use std::sync::OnceLock;

pub(crate) fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.add_importer(import_gltf::GltfImporter);
    registry.add_importer(import_mannequin::Mannequin);
    effects::named(&["vignette"]).into_iter().for_each(|effect| registry.add_effect(effect));
    registry
}

/// All runs of one test program share their assets.
pub(crate) fn options() -> TestOptions {
    static ASSETS: OnceLock<AssetCache> = OnceLock::new();
    let mut options = TestOptions::default();
    options.script.assets = ASSETS.get_or_init(AssetCache::default).clone();
    options
}

/// Runs every section of a text: the run, and its checks.
pub(crate) fn run_sections(text: &str) -> Vec<(SectionRun, Vec<Check>)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.rhai");
    std::fs::write(&path, text).unwrap();
    let (registry, options) = (registry(), options());
    let sections = list_sections(&path, &registry, &options).unwrap();
    let run = |index| {
        let run = run_section(&path, index, &registry, &options).unwrap();
        let checks = evaluate(&run, &registry);
        (run, checks)
    };
    (0..sections.len()).map(run).collect()
}

/// The checks of the only section of a text.
pub(crate) fn checks(text: &str) -> Vec<Check> {
    let mut runs = run_sections(text);
    assert_eq!(runs.len(), 1);
    runs.remove(0).1
}

/// Place, title, expected and actual value, error and hint of each failed check.
pub(crate) fn failed_check_texts(checks: &[Check]) -> Vec<String> {
    let failed = checks.iter().filter(|c| !c.passed);
    failed
        .map(|c| {
            format!(
                "{}: {}\n    expected {}\n    got {}\n    by {}\n    {}",
                c.place, c.title, c.expected, c.got, c.by, c.hint
            )
        })
        .collect()
}
