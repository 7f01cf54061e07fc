//! The messages of `choreo check` about a scene that is shown, beyond those of its script's run.

use choreo_command_line::{SceneToSurvey, survey};
use choreo_session::{Problem, Scene, SceneSource};

/// Examines frames over the whole length of the scene, and runs the statements of its tests. `None` where `goes_on` has said no.
pub fn messages(
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
    survey(scene, goes_on)
}
