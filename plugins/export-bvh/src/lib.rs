//! The motion of one actor as BVH: its joints in the world, one line of angles for each frame.

mod bones;

use bones::{Bones, Pose};
use choreo_plugin::glam::{DQuat, EulerRot};
use choreo_plugin::stage::Stage;
use choreo_plugin::suggest::did_you_mean;
use choreo_plugin::{ExportError, ExportedScene, Manifest, SceneExporter, SceneFiles};
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::sync::LazyLock;

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("bvh", env!("CARGO_PKG_VERSION"), "the motion of one actor as BVH motion capture")
        .extensions(["bvh"])
        .text("actor", "name of the actor to export; needed where several actors have joints", "", &[])
        .number("units", "file units per metre: 100 for centimetres", 100.0, 1e-3..=1e6)
});

/// Distance in metres from its rest offset at which a joint gets position channels.
const MOVEMENT_TOLERANCE: f64 = 1e-5;

/// Writes BVH. Contents and limits: README.md.
#[derive(Clone, Copy, Debug, Default)]
pub struct BvhExporter;

impl SceneExporter for BvhExporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
        let actor = find_actor(&scene.stage, scene.options.text("actor").unwrap_or_default())?;
        let units = scene.options.number("units").unwrap_or(100.0);
        let frame_time = frame_time(scene)?;
        let mut evaluator = scene.evaluator();
        let first = scene.times.first().copied().unwrap_or_default();
        let mut bones = Bones::of(&scene.stage.actors[actor], &evaluator.at(first)?.actors[actor]);
        // The scene is evaluated twice, first to find the channels, so that memory does not grow with the length.
        for time in &scene.times {
            let pose = bones.pose(&evaluator.at(*time)?.actors[actor]);
            bones.find_moving(&pose, MOVEMENT_TOLERANCE);
        }

        let out = files.main();
        out.write_all(hierarchy(&bones, units).as_bytes())?;
        writeln!(out, "MOTION\nFrames: {}\nFrame Time: {frame_time:.10}", scene.times.len())?;
        let order: Vec<usize> = bones.depth_first().into_iter().map(|(bone, _)| bone).collect();
        let mut angles = vec![[0.0; 3]; order.len()];
        let mut line = String::new();
        for time in &scene.times {
            let pose = bones.pose(&evaluator.at(*time)?.actors[actor]);
            line.clear();
            frame((&bones, &order), &pose, units, &mut angles, &mut line);
            out.write_all(line.as_bytes())?;
        }
        Ok(notes(&bones, units))
    }
}

/// Index of the actor to export, by name or as the only one with joints.
fn find_actor(stage: &Stage, name: &str) -> Result<usize, ExportError> {
    let names: Vec<&str> = stage.actors.iter().map(|actor| actor.name.as_str()).collect();
    if !name.is_empty() {
        return names.iter().position(|known| *known == name).ok_or_else(|| {
            let guess = did_you_mean(name, names.iter().copied());
            ExportError::Format(format!("no actor is called \"{name}\"{guess}"))
        });
    }
    let moving: Vec<usize> =
        (0..names.len()).filter(|actor| stage.actors[*actor].asset.skeleton.len() > 1).collect();
    match moving[..] {
        [] => Err(ExportError::Format("the scene has no actor with joints".into())),
        [only] => Ok(only),
        [..] => {
            let names: Vec<&str> = moving.iter().map(|actor| names[*actor]).collect();
            let what = "BVH holds one actor; choose it with --export actor=NAME";
            Err(ExportError::Format(format!("{what}: {}", names.join(", "))))
        }
    }
}

/// Seconds between frames.
///
/// # Errors
/// The frames are not evenly spaced, beyond the rounding of times.
fn frame_time(scene: &ExportedScene) -> Result<f64, ExportError> {
    let secs: Vec<f64> = scene.times.iter().map(|time| time.as_secs()).collect();
    let (Some(first), Some(last), true) = (secs.first(), secs.last(), secs.len() > 1) else {
        return Ok(f64::from(scene.fps.den) / f64::from(scene.fps.num));
    };
    let step = (last - first) / (secs.len() - 1) as f64;
    let even = secs.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() < 1e-6);
    match even {
        true => Ok(step),
        false => Err(ExportError::Format("BVH has one frame time; give --frames in even steps".into())),
    }
}

/// The HIERARCHY section, with children within the braces of their parent.
fn hierarchy(bones: &Bones, units: f64) -> String {
    let mut text = String::from("HIERARCHY\n");
    let mut last_depth = 0;
    for (bone, depth) in bones.depth_first() {
        close_joints(last_depth, depth, &mut text);
        last_depth = depth + 1;
        let indent = "\t".repeat(depth);
        let word = if depth == 0 { "ROOT" } else { "JOINT" };
        let [x, y, z] = (bones.offsets[bone] * units).to_array();
        let _ = writeln!(text, "{indent}{word} {}\n{indent}{{", bones.names[bone]);
        let _ = writeln!(text, "{indent}\tOFFSET {x:.6} {y:.6} {z:.6}");
        let channels = match bones.has_position_channels[bone] {
            true => "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation",
            false => "3 Zrotation Xrotation Yrotation",
        };
        let _ = writeln!(text, "{indent}\tCHANNELS {channels}");
        if bones.is_leaf(bone) {
            let [x, y, z] = (bones.end_site_offset(bone) * units).to_array();
            let _ = writeln!(text, "{indent}\tEnd Site\n{indent}\t{{");
            let _ = writeln!(text, "{indent}\t\tOFFSET {x:.6} {y:.6} {z:.6}\n{indent}\t}}");
        }
    }
    close_joints(last_depth, 0, &mut text);
    text
}

/// Closes the braces of open bones down to a depth.
fn close_joints(open: usize, down_to: usize, text: &mut String) {
    for depth in (down_to..open).rev() {
        let _ = writeln!(text, "{}}}", "\t".repeat(depth));
    }
}

/// One line of the MOTION section: positions in the file's units, and angles in degrees that are continuous over the frames.
fn frame(
    (bones, order): (&Bones, &[usize]),
    pose: &Pose,
    units: f64,
    angles: &mut [[f64; 3]],
    line: &mut String,
) {
    for bone in order.iter().copied() {
        if bones.has_position_channels[bone] {
            let [x, y, z] = (bones.local_position(pose, bone) * units).to_array();
            let _ = write!(line, "{x:.6} {y:.6} {z:.6} ");
        }
        let last = angles[bone];
        angles[bone] = zxy_angles_near(bones.local_rotation(pose, bone), last);
        let [z, x, y] = angles[bone].map(f64::to_degrees);
        let _ = write!(line, "{z:.6} {x:.6} {y:.6} ");
    }
    line.pop();
    line.push('\n');
}

/// Euler angles of Z · X · Y in radians. Of the two solutions and their full turns, those nearest to the last frame's.
fn zxy_angles_near(rotation: DQuat, last: [f64; 3]) -> [f64; 3] {
    let (z, x, y) = rotation.to_euler(EulerRot::ZXY);
    let near = |angles: [f64; 3]| {
        let mut turned = angles;
        for (angle, last) in turned.iter_mut().zip(last) {
            *angle += ((last - *angle) / TAU).round() * TAU;
        }
        turned
    };
    let distance = |angles: &[f64; 3]| angles.iter().zip(last).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
    let (one, other) = (near([z, x, y]), near([z + PI, PI - x, y + PI]));
    if distance(&other) < distance(&one) { other } else { one }
}

/// Notes for the user.
fn notes(bones: &Bones, units: f64) -> Vec<String> {
    let mut notes = Vec::new();
    let moving = bones.has_position_channels.iter().filter(|moving| **moving).count().saturating_sub(1);
    if moving > 0 {
        notes.push(format!(
            "joints besides the root with position channels, because their offsets change: {moving}"
        ));
    }
    let scale = 1.0 / units;
    notes.push(format!(
        "the file does not state its unit; choreo reads it with load(…, #{{ scale: {scale} }})"
    ));
    notes
}
