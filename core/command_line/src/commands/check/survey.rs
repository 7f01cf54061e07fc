//! The messages of `check` about a scene that another program holds already.

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
    /// The same with all plugin files, of which the sections of tests may use more.
    pub all_plugins: &'s Registry,
    pub places: &'s Places,
    /// The options with which it ran.
    pub options: ScriptOptions,
}

/// The messages of `choreo check --notes` beyond those of the script's run and its assets, in its order: findings by their places, then
/// errors. `None` where `goes_on` has said no.
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
