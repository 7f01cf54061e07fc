//! Clips with keys of all interpolations in all playback modes: the file keeps the keys, and evaluates to the same values as the stage.

use choreo_plugin::glam::{Quat, Vec3};
use choreo_plugin::motion::{Clip, Curve, FrameRate, Interpolation, Path, Repeat, Time, Transform};
use choreo_plugin::stage::{Cue, Stage};
use choreo_plugin::{AssetBuilder, ExportDeviation, ExportedScene, MemoryFiles, SceneExporter};
use export_gltf::GltfExporter;
use serde_json::Value;
use std::sync::Arc;

fn secs(list: &[f64]) -> Arc<[Time]> {
    list.iter().map(|s| Time::from_secs(*s)).collect()
}

/// An arm of two joints: the shoulder turns (LINEAR), the hand slides (CUBICSPLINE) or jumps (STEP).
fn clip(hand: Interpolation) -> Clip {
    let turn = |angle: f32| Quat::from_rotation_z(angle).to_array();
    let shoulder = Curve {
        joint: 0,
        path: Path::Rotation,
        interpolation: Interpolation::Linear,
        times: secs(&[0.0, 0.3, 0.7, 1.0]),
        values: [0.0, 1.0, -0.4, 0.2].into_iter().flat_map(turn).collect(),
    };
    let places = [Vec3::X, Vec3::new(1.2, 0.3, 0.0), Vec3::new(0.8, -0.2, 0.1)];
    let tangents = [Vec3::Y, Vec3::new(0.5, -1.0, 0.3), Vec3::ZERO];
    let values = match hand {
        Interpolation::CubicSpline => places
            .iter()
            .zip(tangents)
            .flat_map(|(place, tangent)| [tangent * 0.5, *place, tangent])
            .flat_map(|v| v.to_array())
            .collect(),
        _ => places.iter().flat_map(|v| v.to_array()).collect(),
    };
    let times = secs(&[0.0, 0.45, 1.0]);
    let hand = Curve { joint: 1, path: Path::Translation, interpolation: hand, times, values };
    Clip::new("swing".into(), 2, vec![shoulder, hand]).unwrap()
}

/// The file's JSON, and the error that the exporter has measured.
fn exported(cues: impl Fn(&Arc<Clip>) -> Vec<Cue>, hand: Interpolation) -> (Value, ExportDeviation) {
    let mut builder = AssetBuilder::default();
    let shoulder = builder.joint("shoulder", None, Transform::IDENTITY).unwrap();
    let at = Transform { translation: Vec3::X, ..Transform::IDENTITY };
    builder.joint("hand", Some(shoulder), at).unwrap();
    let mut stage = Stage::default();
    let actor = stage.cast("arm", Arc::new(builder.finish("arm").unwrap()));
    cues(&Arc::new(clip(hand))).into_iter().for_each(|cue| stage.play(actor, cue));
    stage.settings.fps = FrameRate { num: 25, den: 1 };
    stage.settings.length = Time::from_secs(4.0);
    let mut scene = ExportedScene::new("arm.rhai", Arc::new(stage));
    scene.extension = "gltf".into();
    let mut files = MemoryFiles::default();
    GltfExporter.export(&scene, &mut files).unwrap();
    (serde_json::from_slice(&files.main).unwrap(), files.deviation.unwrap())
}

fn interpolations(json: &Value) -> Vec<&str> {
    let samplers = json["animations"][0]["samplers"].as_array().unwrap();
    samplers.iter().map(|s| s["interpolation"].as_str().unwrap()).collect()
}

#[test]
fn linear_and_stepped_keys_survive_all_playback_modes() {
    type Cues = fn(&Arc<Clip>) -> Vec<Cue>;
    let ways: [(&str, Cues); 8] = [
        ("looped", |c| vec![Cue::new(c.clone())]),
        ("once", |c| vec![Cue { repeat: Repeat::Once, start: Time::from_secs(0.5), ..Cue::new(c.clone()) }]),
        ("there and back", |c| vec![Cue { repeat: Repeat::PingPong, speed: 1.3, ..Cue::new(c.clone()) }]),
        ("backwards", |c| vec![Cue { speed: -0.7, ..Cue::new(c.clone()) }]),
        ("there and back, backwards", |c| {
            vec![Cue { speed: -0.9, repeat: Repeat::PingPong, ..Cue::new(c.clone()) }]
        }),
        ("a part", |c| {
            let trim = (Time::from_secs(0.2), Time::from_secs(0.83));
            vec![Cue { trim, speed: 2.1, start: Time::from_secs(-0.37), ..Cue::new(c.clone()) }]
        }),
        ("held", |c| vec![Cue { end: Some(Time::from_secs(1.6)), ..Cue::new(c.clone()) }]),
        ("one after the other", |c| {
            let then = Cue { start: Time::from_secs(1.25), speed: 0.5, ..Cue::new(c.clone()) };
            vec![Cue::new(c.clone()), then]
        }),
    ];
    for (name, cues) in ways {
        let (json, worst) = exported(cues, Interpolation::Step);
        assert!(worst.metres < 2e-6, "{name}: {worst:?}");
        // Curves of different times share none.
        assert_eq!(interpolations(&json), ["LINEAR", "STEP"], "{name}");
        assert_eq!(json["animations"][0]["channels"].as_array().unwrap().len(), 2, "{name}");
    }
}

#[test]
fn splines_are_kept_whole_and_sampled_where_they_are_cut() {
    let whole = |c: &Arc<Clip>| vec![Cue { speed: 0.8, ..Cue::new(c.clone()) }];
    let (json, worst) = exported(whole, Interpolation::CubicSpline);
    assert!(worst.metres < 1e-4, "{worst:?}");
    // The first and the last round are cut, unless the stage ends with one: 4 s at 0.8 are 3.2 rounds.
    assert_eq!(interpolations(&json), ["LINEAR", "LINEAR"]);
    let rounds = |c: &Arc<Clip>| vec![Cue::new(c.clone())];
    let (json, worst) = exported(rounds, Interpolation::CubicSpline);
    assert!(worst.metres < 5e-6, "{worst:?}");
    assert_eq!(interpolations(&json), ["LINEAR", "CUBICSPLINE"]);
    let back = |c: &Arc<Clip>| vec![Cue { speed: -2.0, ..Cue::new(c.clone()) }];
    let (json, worst) = exported(back, Interpolation::CubicSpline);
    assert!(worst.metres < 5e-6, "{worst:?}");
    assert_eq!(interpolations(&json), ["LINEAR", "CUBICSPLINE"]);
    for repeat in [Repeat::PingPong, Repeat::Once] {
        let way = |c: &Arc<Clip>| vec![Cue { repeat, ..Cue::new(c.clone()) }];
        let (json, worst) = exported(way, Interpolation::CubicSpline);
        assert!(worst.metres < 5e-6, "{repeat:?}: {worst:?}");
        assert_eq!(interpolations(&json), ["LINEAR", "CUBICSPLINE"], "{repeat:?}");
    }
}
