//! Shots: what each camera shows from its cut to the next, in frames.

use choreo_plugin::ExportedScene;

/// The span of time that one camera shows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shot {
    /// The camera's name.
    pub camera: String,
    /// The first frame, and the one after the last.
    pub frames: (i64, i64),
    /// Frames from its first one on in which the image of the shot before goes over into its own.
    pub dissolve: i64,
}

/// Number of frames of the scene.
pub fn total(scene: &ExportedScene) -> i64 {
    scene.fps.frames_in(scene.stage.settings.length).max(1)
}

/// The shots of the scene, one after the other. A frame belongs to the last cut that is not after it; cuts to the camera that is on and
/// those that no frame shows are left out.
pub fn shots(scene: &ExportedScene) -> Vec<Shot> {
    let (stage, total) = (&scene.stage, total(scene));
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
