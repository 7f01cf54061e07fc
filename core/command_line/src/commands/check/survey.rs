//! Messages of `check` about a scene that another program has already opened, such as the viewer.

use super::{look, of_sections, root};
use choreo_plugin::Registry;
use choreo_script::testing::has_sections;
use choreo_script::{Diagnostic, Places, ScriptOptions};
use choreo_stage::Stage;
use std::path::Path;
use std::sync::Arc;

/// A script that has run, and its stage.
pub struct SceneToSurvey<'s> {
    pub input: &'s Path,
    pub stage: &'s Arc<Stage>,
    pub registry: &'s Registry,
    /// The registry with all plugin files: test sections may use more of them than the scene.
    pub all_plugins: &'s Registry,
    pub places: &'s Places,
    /// The options with which the script ran.
    pub options: ScriptOptions,
}

/// Messages of `choreo check --notes` that go beyond those of the script's run and its assets: first findings in the order of their places,
/// then errors. `None` if `goes_on` returned false.
pub fn survey(scene: SceneToSurvey<'_>, goes_on: &(dyn Fn() -> bool + Sync)) -> Option<Vec<Diagnostic>> {
    let SceneToSurvey { input, stage, registry, all_plugins, places, options } = scene;
    let (mut problems, on_stage) = look(stage, registry, places, &options.limits, goes_on);
    let text = places.sources.get(&places.main);
    if goes_on() && text.is_some_and(|text| has_sections(text)) {
        problems.extend(of_sections(input, root(input, false), options, all_plugins, goes_on));
    }
    let findings = places.findings(&on_stage).into_iter();
    goes_on().then(|| findings.chain(problems.into_iter().map(Diagnostic::from)).collect())
}
