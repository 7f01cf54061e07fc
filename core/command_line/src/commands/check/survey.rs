//! Messages of `check` about a scene that another program has already opened, such as the viewer.

use super::{check_stage, section_problems, tests_root};
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
/// then errors. `None` if `should_continue` returned false.
pub fn survey_scene(
    scene: SceneToSurvey<'_>,
    should_continue: &(dyn Fn() -> bool + Sync),
) -> Option<Vec<Diagnostic>> {
    let SceneToSurvey { input, stage, registry, all_plugins, places, options } = scene;
    let (mut problems, on_stage) = check_stage(stage, registry, places, &options.limits, should_continue);
    let text = places.sources.get(&places.main);
    if should_continue() && text.is_some_and(|text| has_sections(text)) {
        problems.extend(section_problems(
            input,
            tests_root(input, false),
            options,
            all_plugins,
            should_continue,
        ));
    }
    let findings = places.findings(&on_stage).into_iter();
    should_continue().then(|| findings.chain(problems.into_iter().map(Diagnostic::from)).collect())
}
