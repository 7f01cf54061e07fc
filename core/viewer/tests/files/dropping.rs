//! Keys that are dragged, models and clips that are dropped, and refusals that are read beside the pointer.

use crate::place::Place;
use choreo_motion::Time;
use choreo_motion::retarget::bind_or_retarget;
use choreo_session::{SceneSource, Session};
use choreo_viewer::state::dropped_models::DroppedModels;
use choreo_viewer::state::selection::Selected;
use egui::{Pos2, pos2, vec2};
use egui_kittest::Harness;
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

type Desk = Harness<'static, Place>;

fn drag(desk: &mut Desk, from: Pos2, to: Pos2) {
    desk.drag_at(from);
    desk.run();
    desk.hover_at(to);
    desk.run();
    desk.drop_at(to);
    desk.run();
}

/// Points that a second takes in the sequencer.
fn second(desk: &Desk) -> f32 {
    desk.get_by_label("time").rect().width() / 4.0
}

#[test]
fn a_dragged_key_moves_and_the_cut_below_it_stays() {
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
fn a_refusal_is_read_beside_the_pointer_with_its_line_as_a_link() {
    let mut desk = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    let marks: Vec<Pos2> =
        desk.query_all_by_label("event scale on ada").map(|node| node.rect().center()).collect();
    let (from, by) = (marks[1], second(&desk));
    let to = from + vec2(by * 0.5, 0.0);
    drag(&mut desk, from, to);
    assert_eq!(desk.state().text(), SCRIPT);
    let link = desk.get_by_label("go to line 7").rect();
    assert!((link.left_top() - to).length() < 80.0, "{link:?} is not beside {to:?}");
    desk.get_by_label("go to line 7").click();
    desk.run();
    assert!(desk.query_by_label("go to line 7").is_none());
    let shown = |desk: &Desk| desk.query_all_by_label_contains("   7 ada.key").next().is_some();
    assert!(shown(&desk), "the script's panel is in front");
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
    // A box has no joint that could follow.
    let mut place = Place::new(SCRIPT);
    let why = place.viewer.add_clip("hat", "ada", "Wave", 1.0).unwrap_err().to_string();
    assert!(why.ends_with("a.rhai:5: no joint of hat follows Wave of ada"), "{why}");
    assert_eq!(place.text(), SCRIPT);
}

/// Reads models as the window does, and puts them on stage.
fn put(place: &mut Place, files: &[PathBuf], at: DVec3) {
    let (source, _) = SceneSource::of_models(files.to_vec(), place.session.source()).unwrap();
    let version = Session::new(source, &choreo::registry(), false).unwrap().build(BTreeSet::new());
    let dropped = DroppedModels { files: files.to_vec(), at };
    place.viewer.edit(|v| v.add_models(&dropped, &version));
}

const TRIANGLE: &str = "mtllib t.mtl\nusemtl red\nv -1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

fn model(folder: &Path) -> PathBuf {
    fs::write(folder.join("t.mtl"), "newmtl red\nKd 1 0 0\n").unwrap();
    fs::write(folder.join("tri.obj"), TRIANGLE).unwrap();
    folder.join("tri.obj")
}

#[test]
fn a_model_from_elsewhere_is_copied_with_what_it_reads_if_the_user_agrees() {
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

/// The point below the pointer is found by the image: the middle of the picture is one metre above the ground.
#[test]
fn a_model_that_is_dropped_on_the_image_stands_on_the_ground_under_the_pointer() {
    let mut place = Place::new(SCRIPT);
    place.paint();
    let mut desk = place.harness(vec2(1500.0, 1000.0));
    let file = model(&desk.state().folder.path().canonicalize().unwrap());
    let [left, top, right, bottom] = desk.state().viewer.views[0].place;
    let at = pos2(left + (right - left) * 0.75, top + (bottom - top) * 0.9);
    desk.hover_at(at);
    desk.run();
    desk.input_mut().dropped_files.push(std::sync::Arc::new(Dropped(file.clone())));
    desk.run_steps(60);
    let dropped = desk.state_mut().viewer.dropped_models.take().unwrap();
    assert_eq!(dropped.files, [file]);
    // Computed by hand: the camera stands 4 m away and 1 m high and looks level.
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
    assert_eq!(place.viewer.selection, None::<Selected>);
}
