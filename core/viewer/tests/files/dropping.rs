//! Dragged keys, dropped models and clips, and refusal messages at the pointer.

use crate::place::{Desk, Place, drag};
use choreo_motion::Time;
use choreo_motion::retarget::bind_or_retarget;
use choreo_session::{SceneSource, Session};
use choreo_viewer::editing::ClipSource;
use choreo_viewer::state::dropped_models::DroppedModels;
use choreo_viewer::state::selection::Selected;
use choreo_viewer::state::side::Side;
use egui::{Order, Pos2, Shape, pos2, vec2};
use egui_kittest::kittest::Queryable;
use glam::DVec3;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

const SCRIPT: &str = r##"stage(#{ size: [320, 180], fps: 25, length: 4.0, samples: 1 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves);
ada.play(moves.clip("Walk")).until(2.0);
let hat = cast("hat", shape("box", #{ size: 0.2 })).at(0.0, 2.0, 0.0);
let n = 1;
ada.key("scale", [[0.0, 1], [1.0 * n, 2]]);
camera("wide").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
camera("near").at(0.0, 1.0, 2.5).look_at([0.0, 1.0, 0.0]).key("fov", [[0.0, 40], [2.0, 50]]).cut(2.0);
"##;

/// Width of one second in the sequencer, points.
fn second(desk: &Desk) -> f32 {
    desk.get_by_label("time").rect().width() / 4.0
}

#[test]
fn dragging_a_key_above_a_cut_moves_only_the_key() {
    let mut desk = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    let keys = desk.query_all_by_label("event near field of view on camera");
    let key = keys.map(|node| node.rect().center()).max_by(|a, b| a.x.total_cmp(&b.x)).unwrap();
    let by = second(&desk);
    drag(&mut desk, key, key + vec2(by, 0.0));
    let place = desk.state_mut();
    assert_eq!(place.viewer.message, None);
    assert_eq!(place.text(), SCRIPT.replace("[2.0, 50]", "[3.0, 50]"));
    place.viewer.undo().unwrap();
    assert_eq!(place.text(), SCRIPT);
}

#[test]
fn a_rejected_edit_shows_its_reason_and_line_link_at_the_pointer() {
    let script =
        SCRIPT.replace(".until(2.0)", ".until(two)").replace("let moves", "let two = 2.0; let moves");
    let mut desk = Place::new(&script).harness(vec2(1500.0, 1000.0));
    let by = second(&desk);
    // The drag does not start on the key in the middle of the bar.
    let from = desk.get_by_label("Walk on ada").rect().center() + vec2(by * 0.4, 0.0);
    let to = from + vec2(by * 0.5, 0.0);
    drag(&mut desk, from, to);
    assert_eq!(desk.state().text(), script);
    let link = desk.get_by_label("go to line 4").rect();
    assert!((link.left_top() - to).length() < 80.0, "{link:?} is not beside {to:?}");
    // The link takes clicks, but the text above it lets them through to what it covers.
    let taken_by = |at| desk.ctx.layer_id_at(at).map(|layer| layer.order);
    assert_eq!(taken_by(link.center()), Some(Order::Foreground));
    assert_eq!(taken_by(link.center() - vec2(0.0, link.height())), Some(Order::Background));
    desk.get_by_label("go to line 4").click();
    desk.run();
    assert!(desk.query_by_label("go to line 4").is_none());
    let shown = |desk: &Desk| desk.query_all_by_label_contains("   4 ada.play").next().is_some();
    assert!(shown(&desk), "the script's panel is in front");
}

/// If a line could be added instead, a dialog shows the reason in place of the text at the pointer, and blocks clicks, keys and the wheel.
#[test]
fn a_modal_dialog_covers_other_text_and_takes_all_input() {
    let mut desk = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    let refused = |desk: &mut Desk| {
        let marks: Vec<Pos2> =
            desk.query_all_by_label("event scale on ada").map(|node| node.rect().center()).collect();
        let by = second(desk);
        drag(desk, marks[1], marks[1] + vec2(by * 0.5, 0.0));
        desk.get_by_label("Change the script?");
        // Only the dialog has a link.
        desk.get_by_label("go to line 7");
    };
    refused(&mut desk);
    desk.state_mut().viewer.selection = None;
    desk.run();
    let (row, ruler) = (desk.get_by_label("row hat").rect().center(), desk.get_by_label("time").rect());
    let span = desk.state().viewer.visible_span;
    desk.hover_at(row);
    desk.run();
    desk.drag_at(row);
    desk.drop_at(row);
    desk.run();
    desk.key_press(egui::Key::Space);
    desk.run();
    desk.hover_at(ruler.center() + vec2(0.0, 40.0));
    desk.run();
    let (unit, delta) = (egui::MouseWheelUnit::Point, vec2(0.0, 50.0));
    let (phase, modifiers) = (egui::TouchPhase::Move, egui::Modifiers::NONE);
    desk.event(egui::Event::MouseWheel { unit, delta, phase, modifiers });
    desk.run_steps(8);
    let viewer = &desk.state().viewer;
    assert_eq!(
        (viewer.selection.clone(), viewer.playhead.is_playing(), viewer.visible_span),
        (None, false, span)
    );
    desk.key_press(egui::Key::Escape);
    desk.run();
    assert!(desk.state().viewer.offer.is_none());
    assert!(desk.query_by_label("go to line 7").is_none(), "the text at the pointer does not come after it");
    desk.get_by_label("row hat").click();
    desk.run();
    assert_eq!(desk.state().viewer.selection, Some(Selected::Actor("hat".into())));
    refused(&mut desk);
    desk.get_by_label("go to line 7").click();
    desk.run();
    assert!(desk.state().viewer.offer.is_none());
    assert!(desk.query_all_by_label_contains("   7 ada.key").next().is_some());
    assert_eq!(desk.state().text(), SCRIPT);
}

/// Whether a shape is filled at a point.
fn covers(shape: &Shape, at: Pos2) -> bool {
    match shape {
        Shape::Rect(rect) => rect.fill.a() > 0 && rect.rect.contains(at),
        Shape::Vec(shapes) => shapes.iter().any(|shape| covers(shape, at)),
        _ => false,
    }
}

/// A refusal without a line between two with one: the box of the second does not cover the link of the third.
#[test]
fn a_second_rejected_edit_shows_its_own_line() {
    let mut desk = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    for (at, line) in
        [(pos2(300.0, 300.0), Some(7)), (pos2(500.0, 400.0), None), (pos2(700.0, 300.0), Some(7))]
    {
        desk.hover_at(at);
        let viewer = &mut desk.state_mut().viewer;
        (viewer.message, viewer.message_line) = (Some("it cannot be done".into()), line);
        viewer.refusals += 1;
        desk.run_steps(8);
        if line.is_some() {
            let link = desk.get_by_label("go to line 7").rect().center();
            let shapes = &desk.output().shapes;
            let is_link =
                |shape: &Shape| matches!(shape, Shape::Text(text) if text.galley.text() == "go to line 7");
            let drawn = shapes.iter().rposition(|shape| is_link(&shape.shape)).unwrap();
            assert!(!shapes[drawn..].iter().any(|shape| covers(&shape.shape, link)), "at {at:?}");
        }
        desk.key_press(egui::Key::Escape);
        desk.run();
        assert!(desk.query_by_label("go to line 7").is_none());
    }
}

#[test]
fn a_clip_on_another_character_is_retargeted_and_the_joints_that_follow_are_counted() {
    let script =
        SCRIPT.replace("shape(\"box\", #{ size: 0.2 })", "load(\"choreo:mannequin\", #{ color: \"teal\" })");
    let mut place = Place::new(&script);
    place.viewer.edit(|v| v.add_clip("hat", "ada", "Wave", 1.0));
    assert_eq!(place.viewer.message, None);
    assert!(place.text().contains("\nhat.play(moves.clip(\"Wave\")).from(1.0);\n"), "{}", place.text());
    let stage = place.viewer.scene.clone().unwrap().stage.clone();
    let (from, to) = (&stage.actors[0].asset, &stage.actors[1].asset);
    let clip = from.clips.iter().find(|c| c.name == "Wave").unwrap();
    let (_, coverage, _) = bind_or_retarget(clip, &from.skeleton, &to.skeleton);
    let followed = format!("{} of {} animated joints", coverage.followed(), coverage.moved);
    assert!(
        coverage.moved > 10 && place.viewer.note.as_ref().unwrap().contains(&followed),
        "{:?}",
        place.viewer.note
    );
    place.reload();
    assert_eq!(place.viewer.scene.as_ref().unwrap().stage.actors[1].layers[0].cues.len(), 1);
    // A box has no joints that a clip could animate.
    let mut place = Place::new(SCRIPT);
    let why = place.viewer.add_clip("hat", "ada", "Wave", 1.0).unwrap_err().to_string();
    assert!(why.ends_with("a.rhai:5: no joint of hat follows Wave of ada"), "{why}");
    assert_eq!(place.text(), SCRIPT);
}

/// Reads dropped models as the window does, and adds them to the stage.
fn put(place: &mut Place, files: &[PathBuf], at: DVec3) {
    put_as(place, &DroppedModels { files: files.to_vec(), at, beside: false });
}

fn put_as(place: &mut Place, dropped: &DroppedModels) {
    let files = &dropped.files;
    let (source, _) = SceneSource::of_models(files.clone(), place.session.source()).unwrap();
    let version = Session::new(source, &choreo::registry(), false).unwrap().build(BTreeSet::new());
    place.viewer.edit(|v| v.add_models(dropped, &version));
}

const TRIANGLE: &str = "mtllib t.mtl\nusemtl red\nv -1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

fn model(folder: &Path) -> PathBuf {
    fs::write(folder.join("t.mtl"), "newmtl red\nKd 1 0 0\n").unwrap();
    fs::write(folder.join("tri.obj"), TRIANGLE).unwrap();
    folder.join("tri.obj")
}

#[test]
fn a_dropped_model_is_copied_with_its_dependencies_after_confirmation() {
    let mut desk = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    let elsewhere = tempfile::tempdir().unwrap();
    let file = model(&elsewhere.path().canonicalize().unwrap());
    put(desk.state_mut(), &[file], DVec3::new(1.0, 0.0, -0.5));
    assert_eq!(desk.state().viewer.message, None);
    desk.run();
    assert_eq!(desk.state().text(), SCRIPT, "not before the user agrees");
    desk.get_by_label_contains("2 files from outside the script's folder");
    desk.get_by_label("Copy and add").click();
    desk.run();
    let place = desk.state_mut();
    assert_eq!(place.viewer.message, None);
    let line = "let tri = cast(\"tri\", load(\"assets/tri/tri.obj\")).at(1.0, 0.0, -0.5);\n";
    assert_eq!(place.text(), format!("{SCRIPT}{line}"));
    assert_eq!(fs::read_to_string(place.folder.path().join("assets/tri/tri.obj")).unwrap(), TRIANGLE);
    assert!(place.folder.path().join("assets/tri/t.mtl").is_file());
    place.reload();
    assert_eq!(place.viewer.scene.as_ref().unwrap().stage.actors.len(), 3);
    assert_eq!(place.viewer.selection, Some(Selected::Actor("tri".into())));
}

#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        fs::read(&self.0).map_err(|error| error.to_string())
    }
}

/// The ground point under the pointer is found from the image, whose center is one metre above the ground.
#[test]
fn a_model_dropped_on_the_viewport_is_placed_on_the_ground_under_the_pointer() {
    let mut place = Place::new(SCRIPT);
    place.paint();
    let mut desk = place.harness(vec2(1500.0, 1000.0));
    let file = model(&desk.state().folder.path().canonicalize().unwrap());
    let [left, top, right, bottom] = desk.state().viewer.views[0].image_rect;
    let at = pos2(left + (right - left) * 0.75, top + (bottom - top) * 0.9);
    desk.hover_at(at);
    desk.run();
    desk.input_mut().dropped_files.push(std::sync::Arc::new(Dropped(file.clone())));
    desk.run_steps(60);
    let dropped = desk.state_mut().viewer.dropped_models.take().unwrap();
    assert_eq!(dropped.files, [file]);
    // Computed by hand: the camera is 4 m away, 1 m high and level.
    let scene = desk.state().viewer.scene.clone().unwrap();
    let choreo_asset::Projection::Perspective { yfov, .. } = scene.stage.cameras[0].projection else {
        panic!()
    };
    let half = f64::from(yfov / 2.0).tan();
    let [across, down] = [0.25 * f64::from(right - left), 0.4 * f64::from(bottom - top)]
        .map(|points| points / f64::from(bottom - top) * 2.0 * half);
    let expected = DVec3::new(across / down, 0.0, 4.0 - 1.0 / down);
    assert!((dropped.at - expected).length() < 1e-3, "{} for {expected}", dropped.at);
    put(desk.state_mut(), &dropped.files, dropped.at);
    let place = desk.state_mut();
    assert_eq!(place.viewer.message, None);
    place.reload();
    let stage = &place.viewer.scene.as_ref().unwrap().stage;
    assert!((stage.actors[2].transform.translation - expected).length() < 0.01);
    assert_eq!(place.viewer.playhead.time(), Time::ZERO);
    assert_eq!(place.viewer.selection, Some(Selected::Actor("tri".into())));
}

/// Orthographic views, and the sky of a perspective one: the dropped model lies under the pointer. Expected values: the projection of the renderer.
#[test]
fn a_model_is_dropped_under_the_pointer_in_every_view() {
    let mut place = Place::new(SCRIPT);
    place.paint();
    place.viewer.free_camera(0);
    let mut desk = place.harness(vec2(1500.0, 1000.0));
    let file = model(&desk.state().folder.path().canonicalize().unwrap());
    for (view, part) in [
        ("Perspective", [0.75, 0.9]),
        ("Perspective", [0.3, 0.2]),
        ("Top", [0.7, 0.3]),
        ("Bottom", [0.2, 0.3]),
        ("Front", [0.8, 0.1]),
        ("Left", [0.1, 0.95]),
    ] {
        let place = desk.state_mut();
        let orbit = place.viewer.free_camera(0).unwrap();
        match Side::ALL.into_iter().find(|side| side.name() == view) {
            Some(side) => orbit.look_from(side),
            None => orbit.projection = choreo_asset::Projection::default(),
        }
        place.paint();
        desk.run();
        let [left, top, right, bottom] = desk.state().viewer.views[0].image_rect;
        let at = pos2(left + (right - left) * part[0], top + (bottom - top) * part[1]);
        desk.hover_at(at);
        desk.run();
        desk.input_mut().dropped_files.push(std::sync::Arc::new(Dropped(file.clone())));
        desk.run_steps(60);
        let dropped = desk.state_mut().viewer.dropped_models.take().unwrap();
        assert!(dropped.at.y.abs() < 1e-9, "{view}: on the ground, {}", dropped.at);
        let viewer = &desk.state().viewer;
        let camera = viewer.views[0].displayed_camera(&viewer.scene.as_ref().unwrap().stage).unwrap();
        let seen = choreo_render::plan::View::new(&camera, [right - left, bottom - top].map(|v| v as u32));
        let clip = seen.clip_from_relative * (dropped.at - seen.position).as_vec3().extend(1.0);
        let on_screen = pos2(
            left + (clip.x / clip.w + 1.0) / 2.0 * (right - left),
            top + (clip.y / clip.w + 1.0) / 2.0 * (bottom - top),
        );
        let off = on_screen - at;
        // In a view from the side, the model is as far to the side as the pointer.
        let lies_there = matches!(view, "Top" | "Bottom") || part == [0.75, 0.9];
        let off = if lies_there { off.length() } else { off.x.abs() };
        // In a perspective view the ground point is farther away than the point at pointer height.
        let limit = if part == [0.3, 0.2] { 40.0 } else { 1.0 };
        assert!(off < limit, "{view}: {on_screen:?} for {at:?}");
    }
}

/// Models added from the asset browser are placed beside the others, whatever their sizes. Expected values: the posed vertices of all models.
#[test]
fn models_dropped_together_do_not_overlap() {
    let script = SCRIPT.replace(
        "camera(\"wide\")",
        "cast(\"ground\", shape(\"plane\", #{ size: 30.0 }));\ncamera(\"wide\")",
    );
    let mut place = Place::new(&script);
    let folder = place.folder.path().canonicalize().unwrap();
    fs::write(folder.join("small.obj"), "v -0.1 0 -0.1\nv 0.1 0 0.1\nv 0 0.2 0\nf 1 2 3\n").unwrap();
    fs::write(folder.join("aside.obj"), "v 3 0 0\nv 5 0 0.5\nv 4 2 0\nf 1 2 3\n").unwrap();
    let tri = model(&folder);
    for files in [
        vec![tri.clone()],
        vec![tri.clone()],
        vec![folder.join("small.obj"), folder.join("aside.obj")],
        vec![tri],
    ] {
        put_as(&mut place, &DroppedModels { files, at: DVec3::ZERO, beside: true });
        assert_eq!(place.viewer.message, None);
        place.reload();
    }
    place.viewer.add_object(&choreo_session::edit::Addition::Shape("torus")).unwrap();
    place.reload();
    let stage = &place.viewer.scene.as_ref().unwrap().stage;
    let snapshot = stage.at(Time::ZERO).unwrap();
    let mut all: Vec<(String, [f64; 4])> = Vec::new();
    for (actor, state) in
        stage.actors.iter().zip(&snapshot.actors).filter(|(actor, _)| actor.name != "ground")
    {
        let vertices: Vec<DVec3> = choreo_stage::posed_meshes(&actor.asset, state)
            .into_iter()
            .flat_map(|posed| posed.primitives)
            .flat_map(|primitive| primitive.positions)
            .collect();
        let of =
            |pick: fn(f64, f64) -> f64, axis: usize| vertices.iter().map(|v| v[axis]).reduce(pick).unwrap();
        all.push((actor.name.clone(), [of(f64::min, 0), of(f64::max, 0), of(f64::min, 2), of(f64::max, 2)]));
    }
    assert_eq!(all.len(), 8);
    for (index, (name, a)) in all.iter().enumerate() {
        for (other, b) in all[..index].iter().filter(|(other, _)| other != "hat" && name != "hat") {
            let meet = a[0] < b[1] && b[0] < a[1] && a[2] < b[3] && b[2] < a[3];
            assert!(!meet, "{name} {a:?} and {other} {b:?}\n{}", place.text());
        }
        assert!(a[0].abs() < 12.0, "{name} is far away: {a:?}");
    }
}

/// The add button of a clip in the inspector adds it at the playhead, or after the last clip if another one starts there and would hide it.
#[test]
fn adding_a_clip_at_the_start_of_another_keeps_the_other() {
    const PLAIN: &str = "stage(#{ fps: 25, length: 10.0 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Idle\"));
";
    let mut place = Place::new(PLAIN);
    place.viewer.selection = Some(Selected::Actor("ada".into()));
    let mut desk = place.harness(vec2(1500.0, 1400.0));
    let starts = |desk: &Desk| -> Vec<(String, f64)> {
        let stage = &desk.state().viewer.scene.as_ref().unwrap().stage;
        let cues = stage.actors[0].layers[0].cues.iter();
        cues.map(|cue| (cue.clip.name.clone(), cue.start.as_secs())).collect()
    };
    let idle = desk.state().viewer.scene.as_ref().unwrap().stage.actors[0].layers[0].cues[0].clip.duration;
    for (clip, playhead) in [("Walk", 0.0), ("Run", 0.0), ("Wave", 8.0)] {
        desk.state_mut().viewer.playhead.seek(Time::from_secs(playhead));
        desk.run();
        desk.get_by_label(&format!("play {clip}")).click();
        desk.run();
        assert_eq!(desk.state().viewer.message, None);
        desk.state_mut().reload();
        desk.run();
    }
    let starts = starts(&desk);
    let names: Vec<&str> = starts.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["Idle", "Walk", "Run", "Wave"], "{starts:?}");
    assert_eq!((starts[0].1, starts[3].1), (0.0, 8.0));
    assert!((starts[1].1 - idle.as_secs()).abs() < 0.021, "{starts:?}");
    assert!(starts[2].1 > starts[1].1 + 0.5 && starts[2].1 < 8.0, "{starts:?}");
}

/// A clip of the asset browser is added after the others, or dropped on a row at the pointer; a note says how it affects the others.
#[test]
fn adding_a_clip_appends_it_or_reports_the_interrupted_clip() {
    const PLAIN: &str = "stage(#{ fps: 25, length: 10.0 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
PLAYS
";
    let of = || ClipSource::Actor("ada".into());
    let length = |name: &str| {
        let place = Place::new(&PLAIN.replace("PLAYS", ""));
        let stage = &place.viewer.scene.as_ref().unwrap().stage;
        let clip = stage.actors[0].asset.clips.iter().find(|clip| clip.name == name).unwrap().clone();
        clip.duration.as_secs()
    };
    let (wave, walk) = (length("Wave"), length("Walk"));
    for (plays, playhead, starts, note) in [
        ("", 1.0, 1.0, None),
        ("ada.play(moves.clip(\"Walk\")).until(2.0);", 0.0, 2.0, None),
        ("ada.play(moves.clip(\"Wave\")).once();", 0.0, wave - 0.3, None),
        ("ada.play(moves.clip(\"Walk\"));", 0.0, walk, Some("takes over from Walk at")),
        ("ada.play(moves.clip(\"Walk\"));", 3.0, 3.0, Some("takes over from Walk at 3.000 s")),
        // Half of the remaining scene, if the present round ends after it.
        ("ada.play(moves.clip(\"Walk\")).from(9.5);", 0.0, 9.8, Some("takes over from Walk at")),
    ] {
        let mut place = Place::new(&PLAIN.replace("PLAYS", plays));
        place.viewer.playhead.seek(Time::from_secs(playhead));
        place.viewer.edit(|v| v.add_clip_to_layer("ada", &of(), "Run", None, 0));
        assert_eq!(place.viewer.message, None);
        let said = place.viewer.note.clone();
        match note {
            Some(part) => assert!(said.as_ref().is_some_and(|said| said.contains(part)), "{plays}: {said:?}"),
            None => assert_eq!(said, None, "{plays}"),
        }
        place.reload();
        let stage = &place.viewer.scene.as_ref().unwrap().stage;
        let run = stage.actors[0].layers[0].cues.iter().find(|cue| cue.clip.name == "Run").unwrap();
        assert!(
            (run.start.as_secs() - starts).abs() < 0.021,
            "{plays}: {} for {starts}",
            run.start.as_secs()
        );
        let fade = if plays.is_empty() { 0.0 } else { 0.3 };
        assert!((run.fade_in.as_secs() - fade).abs() < 1e-9, "{plays}");
    }
    let plays = "ada.play(moves.clip(\"Walk\")).until(4.0);\nada.play(moves.clip(\"Wave\")).from(6.0);\n\
                 ada.play(moves.clip(\"Wave\")).on(\"Head\");";
    for (secs, layer, parts) in [
        (1.0, 0, vec!["Run takes over from Walk at 1.000 s until Wave at 6.000 s", "set a mask"]),
        (5.0, 0, vec!["Run plays until Wave takes over at 6.000 s"]),
        (8.0, 1, vec!["Run has no mask, unlike row +1: it plays on all joints of ada", "set a mask"]),
    ] {
        let mut place = Place::new(&PLAIN.replace("PLAYS", plays));
        place.viewer.edit(|v| v.add_clip_to_layer("ada", &of(), "Run", Some(secs), layer));
        let said = place.viewer.note.clone().unwrap_or_default();
        assert!(parts.iter().all(|part| said.contains(part)), "{secs}: {said}");
        assert_eq!(said.contains("mask"), parts.len() == 2, "{said}");
        place.reload();
    }
}
