//! Scene export to glTF and USD: error of exported keyframes, file size and time by tolerance.

use crate::images::stage;
use crate::scenes::import_file;
use crate::{BUDGET_SECS, Section};
use choreo_bench::plots::{Choice, Row};
use choreo_bench::reference::{ErrorStats, model_from_joint, pose};
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::Time;
use choreo_plugin::{ExportedScene, MemoryFiles, OptionValue, Registry};
use choreo_stage::{Evaluator, Stage};
use std::sync::Arc;

/// Tolerances in metres.
const TOLERANCES: [f64; 6] = [1e-5, 1e-4, 5e-4, 1e-3, 5e-3, 2e-2];
const DEFAULT_TOLERANCE: f64 = 1e-4;
/// Number of times, also between frames, at which joints are compared.
const TIME_COUNT: u32 = 211;

/// A walk with root motion that fades into a dance, with foot locking, a hand moved by a callback, and a head that looks at it.
const SCENE: &str = r#"
    stage(#{ fps: 30, length: 6 });
    let m = load("choreo:mannequin");
    let anna = cast("anna", m);
    anna.root_motion();
    anna.plant_feet();
    anna.play(m.clip("Walk")).until(2.5).then(m.clip("Dance_Groove"), #{ fade: 0.5 });
    anna.aim("Head", [0.0, 1.5, 8.0]);
    let spot = cast("spot", shape("box", #{ size: 0.05 })).attach(anna.joint("Hips")).at(0.3, 0.2, 0.3);
    on_frame(|t| spot.at(0.3 + 0.2 * sin(5.0 * t), 0.2, 0.3));
    anna.reach("RightHand", spot);
"#;

fn tolerance_name(metres: f64) -> String {
    format!("{} mm", metres * 1e3)
}

fn export_scene(registry: &Registry, scene: &Arc<Stage>, file: &str, metres: f64) -> Result<Vec<u8>, String> {
    let exporter = registry.scene_exporter_for(file).ok_or(format!("no exporter writes {file}"))?;
    let mut scene = ExportedScene::new("scene.rhai", scene.clone());
    scene.extension = file.rsplit('.').next().unwrap_or_default().into();
    scene.options = exporter.manifest().complete(&scene.options).map_err(|e| e.message)?;
    scene.options.0.insert("tolerance".into(), OptionValue::Number(metres));
    let mut files = MemoryFiles::default();
    exporter.export(&scene, &mut files).map_err(|e| e.to_string())?;
    Ok(files.main)
}

/// Errors of joint positions in metres, and the place of the worst.
fn joint_errors(
    scene: &Arc<Stage>,
    registry: &Registry,
    (file, bytes): (&str, Vec<u8>),
) -> Result<(ErrorStats, String), String> {
    let again = import_file(registry, file, bytes, &[])?;
    let clip = again.clips.first().ok_or("the file has no animation")?;
    let names = scene.actors[0].asset.skeleton.names();
    let joints: Vec<usize> = names
        .iter()
        .map(|name| again.skeleton.find(name).ok_or(format!("the file has no node {name}")))
        .collect::<Result<_, _>>()?;
    let (mut evaluator, mut error, mut place) =
        (Evaluator::new(scene.clone()), ErrorStats::default(), String::new());
    for i in 0..TIME_COUNT {
        let time = Time::from_secs(5.99 * (f64::from(i) + 0.377) / f64::from(TIME_COUNT));
        let snapshot = evaluator.at(time).map_err(|e| e.to_string())?;
        let model = model_from_joint(&again.skeleton, &pose(clip, &again.skeleton, time));
        for (joint, other) in joints.iter().enumerate() {
            let truth = snapshot.actors[0].world_from_joint(joint).ok_or("a joint is not posed")?;
            if error.add(truth.translation.distance(model[*other].translation)) {
                place = format!("{}, {:.2} s", names[joint], time.as_secs());
            }
        }
    }
    Ok((error, place))
}

/// Rows for the tolerances of one format.
fn compare_tolerances(
    registry: &Registry,
    scene: &Arc<Stage>,
    (file, key, format): (&str, &str, &str),
) -> Result<Choice, String> {
    let mut choice = Choice::new(key, format!("How far may joints of a scene exported as {format} be off?"));
    choice.error_unit = "mm";
    choice.reference = format!(
        "the scene itself at {TIME_COUNT} times between its frames; the file's keys, read again, with slerp in f64"
    );
    choice.per = "export of 6 s of one character".into();
    for metres in TOLERANCES {
        let written = export_scene(registry, scene, file, metres)?;
        let bytes = written.len() as f64;
        let (error, place) = joint_errors(scene, registry, (file, written))?;
        choice.rows.push(
            Row::new(tolerance_name(metres))
                .error(error.worst * 1e3, error.mean() * 1e3)
                .at(place)
                .bytes(bytes),
        );
    }
    let case = |metres: &f64| {
        let metres = *metres;
        Case::new(1, move || drop(std::hint::black_box(export_scene(registry, scene, file, metres))))
    };
    let nanos =
        interleaved(Clock::Process, 4.0 * BUDGET_SECS, &mut TOLERANCES.iter().map(case).collect::<Vec<_>>());
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    Ok(choice)
}

pub(crate) fn section() -> Result<Section, String> {
    let registry = choreo::registry();
    let scene = stage(SCENE, &registry)?;
    let mut gltf = compare_tolerances(&registry, &scene, ("out.glb", "gltf_export", "glTF"))?;
    gltf.choose(
        &tolerance_name(DEFAULT_TOLERANCE),
        "an error that no player shows, for a file that is a third larger than with 1 mm",
    );
    let mut usd = compare_tolerances(&registry, &scene, ("out.usdc", "usd_export", "USD"))?;
    usd.choose(
        &tolerance_name(DEFAULT_TOLERANCE),
        "the same as for glTF, so that a scene is as exact in all programs",
    );
    Ok(Section {
        title: "Exported animation",
        text: "Keys of a glTF file have straight lines and slerp between them, but a callback, a locked \
               foot or a reaching arm moves along other curves. Where the interpolation is off by more than \
               half of the tolerance, more keys are sampled; keys that follow from the others are removed \
               within the other half (decision 61). All joints of a USD skeleton share their key times, so \
               a key of one joint is a key of all. The mesh is part of each size."
            .into(),
        choices: vec![gltf, usd],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}
