//! The example scripts, all of which cast this figure: they run without a warning, and every frame of theirs is finite.

use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_script::{Script, ScriptOptions, run_file};
use std::path::{Path, PathBuf};

fn run(path: &Path, set: &[(&str, &str)]) -> Result<Script, String> {
    let mut registry = Registry::default();
    registry.add_importer(import_mannequin::Mannequin);
    registry.add_effect(effect_vignette::Vignette);
    let set = set.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
    run_file(path, &registry, &ScriptOptions { set, ..ScriptOptions::default() })
        .map_err(|errors| errors.iter().map(|e| e.to_string()).collect::<Vec<_>>().join("\n"))
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts")
}

#[test]
fn every_example_runs_without_a_warning() {
    let mut scripts: Vec<PathBuf> = std::fs::read_dir(folder())
        .expect("the folder of examples")
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|path| path.extension().is_some_and(|e| e == "rhai"))
        .collect();
    scripts.sort();
    assert!(scripts.len() >= 7, "{scripts:?}");
    for path in scripts {
        let script = run(&path, &[]).unwrap_or_else(|e| panic!("{e}"));
        assert!(script.warnings.is_empty(), "{}: {}", path.display(), script.warnings[0]);
        let length = script.stage.settings.length.as_secs();
        for k in 0..=20 {
            let at = Time::from_secs(length * f64::from(k) / 20.0);
            let shot = script.stage.at(at).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            let finite = |actor: &choreo_stage::ActorState| {
                actor.world_from_model.is_finite() && actor.model_from_joint.iter().all(|m| m.is_finite())
            };
            assert!(shot.actors.iter().all(finite), "{} at {} s", path.display(), at.as_secs());
        }
    }
}

#[test]
fn the_template_takes_parameters_and_refuses_bad_ones() {
    let template = folder().join("06_template.rhai");
    let script = run(&template, &[("name", "Zoe"), ("dancers", "5"), ("clip", "Jump")]).expect("good values");
    assert_eq!(script.stage.actors.len(), 6, "five and a floor");
    assert_eq!(script.stage.actors[0].name, "Zoe");
    let error = run(&template, &[("dancers", "12")]).unwrap_err();
    assert!(error.contains("dancers must be 1 to 9, got 12"), "{error}");
    let error = run(&template, &[("clip", "Jmp")]).unwrap_err();
    assert!(error.contains("did you mean \"Jump\""), "{error}");
}

/// Between two frames of the first script no joint goes farther than a fast hand does, cuts and fades included.
#[test]
fn nobody_jumps_in_the_first_dance() {
    let script = run(&folder().join("01_first_dance.rhai"), &[]).unwrap_or_else(|e| panic!("{e}"));
    let frames = (script.stage.settings.length.as_secs() * 30.0) as i64;
    let places = |frame: i64| {
        let shot = script.stage.at(Time::from_secs(frame as f64 / 30.0)).expect("a frame");
        let joint = |a: &choreo_stage::ActorState, m: &glam::Affine3A| {
            a.world_from_model.transform_point3(glam::Vec3::from(m.translation).as_dvec3())
        };
        shot.actors
            .iter()
            .flat_map(|a| a.model_from_joint.iter().map(|m| joint(a, m)).collect::<Vec<_>>())
            .collect::<Vec<_>>()
    };
    let mut before = places(0);
    for frame in 1..frames {
        let now = places(frame);
        let far = before.iter().zip(&now).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(far < 0.40, "frame {frame}: a joint goes {far:.2} m in a thirtieth of a second");
        before = now;
    }
}
