//! The edit of a small scene, in each format, against what its cuts and titles state.

use choreo_plugin::glam::{DVec2, DVec3, Vec4};
use choreo_plugin::motion::{Clip, FrameRate, Time, Transform};
use choreo_plugin::stage::{Align, Camera, Cue, Cut, Font, Layer2d, Layer2dContent, Rig, Stage};
use choreo_plugin::{AssetBuilder, ExportedScene, MemoryFiles, OptionValue, SceneExporter};
use export_edit::EditExporter;
use serde_json::Value;
use std::sync::Arc;

fn secs(secs: f64) -> Time {
    Time::from_secs(secs)
}

fn title(words: &str, from: f64, until: Option<f64>) -> Layer2d {
    let content = Layer2dContent::Text {
        words: words.into(),
        font: Font::built_in(),
        size: 0.1,
        width: None,
        align: Align::default(),
        line_height: 1.2,
        color: Vec4::ONE,
        outline: None,
        panel: None,
    };
    Layer2d { start: secs(from), end: until.map(secs), at: DVec2::new(0.5, 0.9), ..Layer2d::new(content) }
}

/// Ten seconds: "wide", from 4 s on "close" after a dissolve of half a second, from 7.02 s on "wide" again.
fn scene(fps: FrameRate) -> ExportedScene {
    let mut builder = AssetBuilder::default();
    builder.joint("root", None, Transform::IDENTITY).unwrap();
    let mut stage = Stage::default();
    let ada = stage.cast("ada", Arc::new(builder.finish("figure").unwrap()));
    let clip = |name: &str| Arc::new(Clip::new(name.into(), 1, Vec::new()).unwrap());
    stage.play(ada, Cue::new(clip("walk")));
    let run = Cue {
        start: secs(2.0),
        fade_in: secs(0.5),
        speed: 1.5,
        end: Some(secs(5.0)),
        ..Cue::new(clip("run"))
    };
    stage.play(ada, run);
    stage.play(ada, Cue { start: secs(6.0), ..Cue::new(clip("idle")) });
    for name in ["wide", "close"] {
        let rig = Rig::Fixed { position: DVec3::Z, rotation: Default::default(), look_at: None };
        stage.shoot(Camera::new(name, rig));
    }
    stage.cuts = vec![
        Cut { dissolve: secs(0.5), ..Cut::new(secs(4.0), 1) },
        Cut::new(secs(5.0), 1),
        Cut::new(secs(7.02), 0),
        Cut::new(secs(99.0), 1),
    ];
    stage.layers_2d =
        vec![title("The\n\nend", 8.0, None), title("Hello", 1.25, Some(3.0)), title("there", 2.5, Some(4.0))];
    stage.markers = vec![("beat".into(), secs(3.0)), ("start".into(), secs(0.5))];
    stage.settings.fps = fps;
    stage.settings.length = secs(10.0);
    ExportedScene::new("talk.rhai", Arc::new(stage))
}

fn text(extension: &str, mut scene: ExportedScene) -> String {
    let mut files = MemoryFiles::default();
    scene.extension = extension.into();
    EditExporter.export(&scene, &mut files).unwrap_or_else(|e| panic!("{e}"));
    String::from_utf8(files.main).unwrap()
}

const FPS: FrameRate = FrameRate { num: 24, den: 1 };

#[test]
fn an_edl_has_an_event_for_each_shot() {
    let expected = "TITLE: talk.rhai\nFCM: NON-DROP FRAME\n\n\
        001  AX       V     C        00:00:00:00 00:00:04:00 00:00:00:00 00:00:04:00\n\
        * FROM CLIP NAME: wide\n* SOURCE FILE: out.mp4\n\
        002  AX       V     C        00:00:04:00 00:00:04:00 00:00:04:00 00:00:04:00\n\
        002  AX       V     D    012 00:00:04:00 00:00:07:01 00:00:04:00 00:00:07:01\n\
        * FROM CLIP NAME: wide\n* TO CLIP NAME: close\n* SOURCE FILE: out.mp4\n\
        003  AX       V     C        00:00:07:01 00:00:10:00 00:00:07:01 00:00:10:00\n\
        * FROM CLIP NAME: wide\n* SOURCE FILE: out.mp4\n";
    assert_eq!(text("edl", scene(FPS)), expected);
}

#[test]
fn subtitles_are_the_titles_by_start() {
    let expected = "1\n00:00:01,250 --> 00:00:03,000\nHello\n\n2\n00:00:02,500 --> 00:00:04,000\nthere\n\n\
        3\n00:00:08,000 --> 00:00:10,000\nThe\nend\n\n";
    assert_eq!(text("srt", scene(FPS)), expected);
}

/// A text that a viewer does not read as a subtitle is left out, counted, and written where all texts are asked for.
#[test]
fn decorative_titles_are_not_subtitles() {
    let mut scene = scene(FPS);
    let others = [
        Layer2d { at: DVec2::new(0.5, 0.2), ..title("THE TITLE", 0.5, Some(2.0)) },
        Layer2d { at: DVec2::new(0.06, 0.8), ..title("Noa", 0.5, Some(2.0)) },
        Layer2d { under: true, ..title("BEHIND", 0.5, Some(2.0)) },
        title("a logo", 0.0, None),
    ];
    let before = text("srt", scene.clone());
    Arc::make_mut(&mut scene.stage).layers_2d.extend(others);
    scene.extension = "srt".into();
    let mut files = MemoryFiles::default();
    let notes = EditExporter.export(&scene, &mut files).unwrap();
    assert_eq!(String::from_utf8(files.main).unwrap(), before);
    assert!(
        notes.len() == 1 && notes[0].starts_with("4 texts are left out, as they are not subtitles: "),
        "{notes:?}"
    );
    scene.options.0.insert("texts".into(), OptionValue::Text("all".into()));
    let all = text("srt", scene);
    for words in ["THE TITLE", "Noa", "BEHIND", "a logo", "Hello"] {
        assert!(all.contains(&format!("\n{words}\n")), "{words}: {all}");
    }
}

/// Name, start and frames of each item of a track.
fn items(track: &Value) -> Vec<(String, f64, f64)> {
    let items = track["children"].as_array().unwrap();
    let frames = |item: &Value, key: &str| item["source_range"][key]["value"].as_f64().unwrap_or(-1.0);
    let name = |item: &Value| match item["OTIO_SCHEMA"].as_str().unwrap() {
        "Gap.1" => "(gap)".to_string(),
        "Transition.1" => format!("(dissolve {})", item["out_offset"]["value"]),
        _ => item["name"].as_str().unwrap().to_string(),
    };
    items.iter().map(|item| (name(item), frames(item, "start_time"), frames(item, "duration"))).collect()
}

#[test]
fn a_timeline_has_shots_titles_cues_and_markers_in_frames() {
    let mut scene = scene(FPS);
    scene.options.0.insert("media".into(), OptionValue::Text("talk.mov".into()));
    let timeline: Value = serde_json::from_str(&text("otio", scene.clone())).unwrap();
    let tracks = timeline["tracks"]["children"].as_array().unwrap();
    let names: Vec<&str> = tracks.iter().map(|track| track["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["shots", "titles", "titles 2", "ada"]);
    let owned = |items: &[(&str, f64, f64)]| -> Vec<(String, f64, f64)> {
        items.iter().map(|(name, from, length)| (name.to_string(), *from, *length)).collect()
    };
    let shots =
        [("wide", 0.0, 96.0), ("(dissolve 12.0)", -1.0, -1.0), ("close", 96.0, 73.0), ("wide", 169.0, 71.0)];
    assert_eq!(items(&tracks[0]), owned(&shots));
    let titles =
        [("(gap)", 0.0, 30.0), ("Hello", 0.0, 42.0), ("(gap)", 0.0, 120.0), ("The\n\nend", 0.0, 48.0)];
    assert_eq!(items(&tracks[1]), owned(&titles));
    let cues = [
        ("walk", 0.0, 48.0),
        ("(dissolve 12.0)", -1.0, -1.0),
        ("run", 0.0, 72.0),
        ("(gap)", 0.0, 24.0),
        ("idle", 0.0, 96.0),
    ];
    assert_eq!(items(&tracks[3]), owned(&cues));
    assert_eq!(tracks[3]["children"][2]["effects"][0]["time_scalar"], 1.5);
    let markers = timeline["tracks"]["markers"].as_array().unwrap();
    let starts: Vec<f64> =
        markers.iter().map(|m| m["marked_range"]["start_time"]["value"].as_f64().unwrap()).collect();
    assert_eq!((starts, &markers[0]["name"]), (vec![12.0, 72.0], &"start".into()));
    let media = &tracks[0]["children"][0]["media_references"]["DEFAULT_MEDIA"];
    assert_eq!(media["target_url"], "talk.mov");
}

#[test]
fn ntsc_rates_are_kept_and_a_partial_scene_is_an_error() {
    let mut scene = scene(FrameRate { num: 30_000, den: 1001 });
    let timeline: Value = serde_json::from_str(&text("otio", scene.clone())).unwrap();
    let shots = items(&timeline["tracks"]["children"][0]);
    // 4 s are 119.88 frames: frame 120 is the first one at or after the cut.
    assert_eq!(shots[0], ("wide".into(), 0.0, 120.0));
    assert!(text("edl", scene.clone()).contains("C        00:00:00:00 00:00:04:00"));
    scene.times.pop();
    let error = EditExporter.export(&scene, &mut MemoryFiles::default()).unwrap_err();
    assert_eq!(error.to_string(), "an edit holds the whole scene; remove --frames");
}
