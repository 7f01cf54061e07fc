//! Messages of `choreo check` about a displayed scene, in addition to those of its script's run.

use choreo_command_line::{SceneToSurvey, survey_scene};
use choreo_session::{Problem, Scene, SceneSource};

/// Checks frames over the whole length of the scene, and runs the statements of its tests. `None` if `goes_on` returned `false`.
pub fn check_scene(
    scene: &Scene,
    source: &SceneSource,
    goes_on: &(dyn Fn() -> bool + Sync),
) -> Option<Vec<Problem>> {
    let scene = SceneToSurvey {
        input: &source.input,
        stage: &scene.stage,
        registry: &scene.registry,
        all_plugins: &scene.all_plugins,
        places: &scene.places,
        options: source.script_options(&scene.assets),
    };
    survey_scene(scene, goes_on)
}
