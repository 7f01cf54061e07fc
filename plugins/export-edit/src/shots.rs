//! Shots, in frames: the spans between cuts, each with its camera.

use choreo_plugin::ExportedScene;

/// The span of time that one camera shows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Shot {
    /// The camera's name.
    pub camera: String,
    /// First frame, and the frame after the last.
    pub frames: (i64, i64),
    /// Length of the dissolve from the shot before, in frames from the shot's first frame on.
    pub dissolve: i64,
}

/// Number of frames of the scene.
pub(crate) fn frame_count(scene: &ExportedScene) -> i64 {
    scene.fps.frames_in(scene.stage.settings.length).max(1)
}

/// The shots of the scene in order. A shot begins at the first frame at or after its cut. Cuts to the camera that is already on, and
/// cuts that no frame shows, are left out.
pub(crate) fn shots(scene: &ExportedScene) -> Vec<Shot> {
    let (stage, total) = (&scene.stage, frame_count(scene));
    let name = |camera: usize| stage.cameras.get(camera).map_or("camera", |camera| &camera.name).to_string();
    let mut shots = vec![Shot { camera: name(0), frames: (0, total), dissolve: 0 }];
    for cut in &stage.cuts {
        let at = scene.fps.frames_in(cut.at);
        let last = shots.len() - 1;
        if at >= total || shots[last].camera == name(cut.camera) {
            continue;
        }
        let dissolve = scene.fps.frames_in(cut.at + cut.dissolve) - at;
        let shot = Shot { camera: name(cut.camera), frames: (at, total), dissolve };
        match at == shots[last].frames.0 {
            true => shots[last] = Shot { dissolve: if at == 0 { 0 } else { dissolve }, ..shot },
            false => {
                shots[last].frames.1 = at;
                shots.push(shot);
            }
        }
    }
    for shot in &mut shots {
        shot.dissolve = shot.dissolve.min(shot.frames.1 - shot.frames.0);
    }
    shots
}
