//! Viewport edits of objects that are keyed, attached or facing a target, and of lights: the literals of the script change.

use crate::place::Place;
use choreo_motion::Time;
use choreo_viewer::editing::placing::placement_at;
use choreo_viewer::geometry::gizmo::Change;
use choreo_viewer::state::selection::Selected;
use egui::vec2;
use egui_kittest::kittest::Queryable;
use glam::{DQuat, DVec3};

const SCRIPT: &str = r##"stage(#{ size: [64, 36], fps: 25, length: 6.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves).key("position", [
    [0.0, [0, 0, 0]], // by the door
    [f(50), [2, 0, 0]], // at the table
]).key("rotation", [[0.0, 0], [4.0, 360]]);
let bob = cast("bob", moves).at(3.0, 0.0, 0.0).turn(90);
let hat = cast("hat", shape("box", #{ size: 0.2 })).at(0.0, 0.1, 0.0).attach(bob.joint("Head"));
let ring = cast("ring", shape("torus", #{ size: 0.2 })).attach(bob).at(1.0, 0.0, 0.0);
let fan = cast("fan", moves).at(0.0, 0.0, -2.0).face(bob);
camera("wide").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);
spot(#{ position: [0.0, 3.0, 0.0], look_at: [0, 0, 0], kelvin: 3200 });
point(#{ position: [1.0, 2.0, 0.0] }).key("intensity", [[0.0, 0], [2.0, 20]]);
"##;

fn assert_ends(text: &str, end: &str) {
    assert!(text.ends_with(end), "{text}");
}

fn at(place: &mut Place, secs: f64) {
    place.viewer.playhead.seek(Time::from_secs(secs));
}

fn world(place: &Place, name: &str) -> DVec3 {
    let scene = place.viewer.scene.as_ref().unwrap();
    let index = scene.stage.actors.iter().position(|a| a.name == name).unwrap();
    let time = place.viewer.playhead.time();
    scene.evaluator.clone().at(time).unwrap().actors[index].world_from_model.translation
}

#[test]
fn moving_a_keyed_actor_writes_a_key_at_the_playhead() {
    let mut place = Place::new(SCRIPT);
    // Between two keys a new one is added, written like the last.
    at(&mut place, 1.0);
    place.viewer.change_actor("ada", Change::Move(DVec3::new(0.0, 0.0, 0.5))).unwrap();
    let new = "by the door\n    [1.0, [1.0, 0.0, 0.5]],\n    [f(50)";
    assert_eq!(place.text(), SCRIPT.replace("by the door\n    [f(50)", new));
    place.reload();
    assert_eq!(place.viewer.message, None, "the actor stands at its new position");
    // A second edit at the same time changes that key.
    place.viewer.change_actor("ada", Change::Move(DVec3::new(0.25, 0.0, 0.0))).unwrap();
    assert_eq!(
        place.text(),
        SCRIPT.replace("by the door\n    [f(50)", &new.replace("[1.0, 0.0, 0.5]", "[1.25, 0.0, 0.5]"))
    );
    place.reload();
    let scene = place.viewer.scene.clone().unwrap();
    assert_eq!(
        placement_at(&scene.stage.actors[0], Time::from_secs(1.0)).translation,
        DVec3::new(1.25, 0.0, 0.5)
    );
    place.viewer.undo().unwrap();
    place.viewer.undo().unwrap();
    assert_eq!(place.text(), SCRIPT);
    place.reload();
    // A rotation: degrees that continue from the previous key.
    at(&mut place, 4.0);
    let (sin, cos) = libm::sincos(core::f64::consts::FRAC_PI_8);
    place.viewer.change_actor("ada", Change::Turn(DQuat::from_xyzw(0.0, sin, 0.0, cos))).unwrap();
    assert_eq!(place.text(), SCRIPT.replace("[4.0, 360]", "[4.0, 405]"));
    place.reload();
    assert_eq!(place.viewer.message, None);
    // The angle between two keys is continuous, too.
    at(&mut place, 2.0);
    place.viewer.change_actor("ada", Change::Turn(DQuat::from_xyzw(0.0, sin, 0.0, cos))).unwrap();
    assert!(place.text().contains("[[0.0, 0], [2.0, 247.5], [4.0, 405]]"), "{}", place.text());
    place.reload();
    // The scale has no keys.
    place.viewer.change_actor("ada", Change::Scale(DVec3::splat(2.0))).unwrap();
    assert!(place.text().contains("cast(\"ada\", moves).scale(2.0).key("), "{}", place.text());
}

#[test]
fn moving_an_actor_with_computed_keys_is_refused_with_the_line() {
    let mut place = Place::new(SCRIPT);
    let computed = SCRIPT.replace("[f(50), [2, 0, 0]]", "[f(50), [\"ab\".len, 0, 0]]");
    place.write(&computed);
    place.reload();
    at(&mut place, 2.0);
    let why = place.viewer.change_actor("ada", Change::Move(DVec3::X)).unwrap_err().to_string();
    assert_ends(&why, "a.rhai: line 3: its position has keys that are computed; change them there");
    assert_eq!(place.text(), computed);
}

/// A change that makes the script fail to load is undone, and the reason is shown; an error made by another program stays.
#[test]
fn a_change_that_does_not_load_is_undone() {
    let script = format!("{SCRIPT}let lamp = point(#{{ intensity: 40.0 }});\n");
    let mut place = Place::new(&script);
    let lamp = Selected::Light(2);
    place.viewer.set_value(&lamp, "intensity", "\"much\"").unwrap();
    assert!(!place.show_version(), "the script has an error");
    assert_eq!((place.text(), place.viewer.is_faulty), (script.clone(), false));
    let why = place.viewer.message.clone().unwrap_or_default();
    assert!(why.starts_with("undone, because the script would not load: "), "{why}");
    assert!(place.show_version());
    assert!(place.viewer.undo().is_err(), "nothing is left to undo");
    place.viewer.set_value(&lamp, "intensity", "50.0").unwrap();
    assert!(place.show_version());
    let faulty = place.text().replace("50.0", "\"much\"");
    place.write(&faulty);
    assert!(!place.show_version());
    assert_eq!((place.text(), place.viewer.is_faulty), (faulty, true));
}

#[test]
fn an_attached_actor_is_moved_in_the_space_of_its_parent() {
    let mut place = Place::new(SCRIPT);
    for name in ["hat", "ring"] {
        place.paint();
        let before = world(&place, name);
        let by = DVec3::new(0.2, 0.1, -0.3);
        place.viewer.change_actor(name, Change::Move(by)).unwrap();
        place.reload();
        assert_eq!(place.viewer.message, None);
        // The actor is at the pointer; values are written to a thousandth.
        assert!((world(&place, name) - before - by).length() < 2e-3, "{name}: {}", world(&place, name));
    }
    // Bob faces along x, so that his x axis is the world's -z.
    assert!(place.text().contains(".attach(bob).at(1.3, 0.1, 0.2);"), "{}", place.text());
    assert!(!place.text().contains(".at(0.0, 0.1, 0.0).attach(bob"), "the hat's literal too");
}

#[test]
fn an_actor_that_faces_a_target_can_be_moved_but_not_turned() {
    let mut place = Place::new(SCRIPT);
    let why =
        place.viewer.change_actor("fan", Change::Turn(DQuat::from_rotation_y(0.5))).unwrap_err().to_string();
    assert_ends(&why, "a.rhai: line 10: .face(…) turns the actor; change or remove that call");
    assert_eq!(place.text(), SCRIPT);
    place.viewer.change_actor("fan", Change::Move(DVec3::X)).unwrap();
    assert_eq!(place.text(), SCRIPT.replace(".at(0.0, 0.0, -2.0)", ".at(1.0, 0.0, -2.0)"));
}

#[test]
fn set_camera_places_a_camera_at_the_free_camera() {
    let mut place = Place::new(SCRIPT);
    place.paint();
    let orbit = {
        let orbit = place.viewer.free_camera(0).unwrap();
        (orbit.center, orbit.distance) = (DVec3::new(0.5, 1.25, 0.0), 4.0);
        (orbit.azimuth, orbit.elevation) = (core::f64::consts::FRAC_PI_2, 0.0);
        *orbit
    };
    let mut harness = place.harness(vec2(1500.0, 1000.0));
    harness.get_by_label("into the script").click();
    harness.run();
    harness.get_by_label("as \"wide\"").click();
    harness.run();
    let place = harness.state_mut();
    assert_eq!(place.viewer.message, None);
    let line = "camera(\"wide\").at(4.5, 1.25, 0.0).look_at([0.5, 1.25, 0.0]);";
    assert_eq!(
        place.text(),
        SCRIPT.replace("camera(\"wide\").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);", line)
    );
    place.reload();
    let scene = place.viewer.scene.clone().unwrap();
    let stands = scene.evaluator.clone().at(Time::ZERO).unwrap().camera.world_from_view;
    let wanted = orbit.camera().world_from_view;
    assert!((stands.translation - wanted.translation).length() < 1e-9);
    assert!((stands.matrix3.z_axis - wanted.matrix3.z_axis).length() < 1e-9);
    // It is one undo step.
    place.viewer.undo().unwrap();
    assert_eq!(place.text(), SCRIPT);
    place.reload();
    // A following camera is not moved.
    let follows = SCRIPT.replace(".at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0])", ".follow(bob, [0, 1, 3])");
    place.write(&follows);
    place.reload();
    let why = place.viewer.set_camera("wide", &orbit).unwrap_err().to_string();
    assert_ends(&why, "a.rhai:11: the camera moves by itself (orbit, follow, …); change that there");
}

#[test]
fn an_added_camera_starts_at_the_playhead_with_the_free_view() {
    for (script, end) in [
        (SCRIPT.to_string(), ".cut(2.0);\n"),
        (SCRIPT.lines().filter(|l| !l.starts_with("camera(")).map(|l| format!("{l}\n")).collect(), "]);\n"),
    ] {
        let mut place = Place::new(&script);
        at(&mut place, 2.0);
        place.paint();
        let stood = *place.viewer.free_camera(0).unwrap();
        let mut harness = place.harness(vec2(1500.0, 1000.0));
        harness.get_by_label("into the script").click();
        harness.run();
        harness
            .get_by_label_contains(if end.contains("cut") { "as a new camera" } else { "as a camera" })
            .click();
        harness.run();
        let place = harness.state_mut();
        assert_eq!(place.viewer.message, None);
        let line = place.text().strip_prefix(&script).unwrap().to_string();
        assert!(line.starts_with("camera(\"view 1\").at(") && line.ends_with(end), "{line}");
        place.reload();
        let scene = place.viewer.scene.clone().unwrap();
        let camera = scene.evaluator.clone().at(Time::from_secs(2.0)).unwrap().camera.world_from_view;
        let wanted = stood.camera().world_from_view;
        // Values are written to a thousandth.
        assert!((camera.translation - wanted.translation).length() < 2e-3, "{camera} {wanted}");
        assert!((camera.matrix3.z_axis - wanted.matrix3.z_axis).length() < 2e-3);
        place.viewer.undo().unwrap();
        assert_eq!(place.text(), script);
    }
}

#[test]
fn a_color_replaces_kelvin_after_confirmation_and_keys_get_numbers() {
    let mut place = Place::new(SCRIPT);
    at(&mut place, 2.0);
    place.viewer.set_value(&Selected::Light(1), "intensity", "35.0").unwrap();
    assert_eq!(place.text(), SCRIPT.replace("[2.0, 20]", "[2.0, 35]"));
    place.reload();
    let mut harness = place.harness(vec2(1500.0, 1000.0));
    let why = harness
        .state_mut()
        .viewer
        .set_value(&Selected::Light(0), "color", "\"#ff8040\"")
        .unwrap_err()
        .to_string();
    assert_ends(&why, "a.rhai: line 12: kelvin: 3200 sets its color; a color would replace that");
    harness.run();
    harness.get_by_label_contains("- spot(").rect();
    harness.get_by_label("Write the color").click();
    harness.run();
    assert!(
        harness.state().text().contains("look_at: [0, 0, 0], color: \"#ff8040\" });"),
        "{}",
        harness.state().text()
    );
    harness.state_mut().reload();
}

/// A view and the script camera set from it show the same, in both directions. Expected values: points in world space projected by the matrices of
/// the renderer.
#[test]
fn a_camera_added_from_a_view_shows_the_same_image() {
    const LENSES: [&str; 5] =
        [".fov(24)", ".focal_length(85)", ".ortho(2.5)", "", ".key(\"fov\", [[0.0, 30], [2.0, 60]])"];
    let script = |lens: &str, other: &str| {
        format!(
            "stage(#{{ size: [640, 360], fps: 25, length: 2.0 }});\ncast(\"box\", shape(\"box\", #{{ size: 1.0 }}));\n\
             camera(\"from\"){lens}.at(1.5, 2.0, 4.0).look_at([0.1, 0.4, 0.2]);\n\
             camera(\"to\"){other}.at(-3.0, 1.0, 2.0).look_at([0.0, 0.0, 0.0]);\n"
        )
    };
    let seen = |camera: &choreo_stage::CameraState| -> Vec<glam::DVec2> {
        let view = choreo_render::plan::View::new(camera, [640, 360]);
        let points =
            [[0.5, 0.5, 0.5], [-0.5, 0.5, 0.5], [0.5, -0.5, -0.5], [0.0, 1.0, 0.0], [0.3, 0.0, -1.0]];
        points
            .map(|point| {
                let clip = view.clip_from_relative
                    * (DVec3::from_array(point) - view.position).as_vec3().extend(1.0);
                glam::DVec2::new(f64::from(clip.x / clip.w) * 320.0, f64::from(clip.y / clip.w) * 180.0)
            })
            .to_vec()
    };
    let of_camera = |place: &Place, name: &str| {
        let mut stage = place.viewer.scene.as_ref().unwrap().stage.as_ref().clone();
        let camera = stage.cameras.iter().position(|camera| camera.name == name).unwrap();
        stage.cuts = vec![choreo_stage::Cut { at: Time::ZERO, camera, dissolve: Time::ZERO }];
        seen(&stage.at(Time::ZERO).unwrap().camera)
    };
    let near = |a: &[glam::DVec2], b: &[glam::DVec2]| a.iter().zip(b).all(|(a, b)| (*a - *b).length() < 0.5);
    for lens in LENSES {
        for other in LENSES {
            let mut place = Place::new(&script(lens, other));
            place.paint();
            let wanted = of_camera(&place, "from");
            // The view is set from the camera.
            let orbit = *place.viewer.free_camera(0).unwrap();
            assert!(near(&seen(&orbit.camera()), &wanted), "{lens}: the view");
            // An existing and a new camera are set from the view.
            place.viewer.edit(|v| v.set_camera("to", &orbit));
            if lens.contains("ortho") && other.contains("key") {
                let why = place.viewer.message.clone().unwrap();
                assert!(why.contains("the \"fov\" of the camera has keys"), "{why}");
                continue;
            }
            assert_eq!(place.viewer.message, None, "{lens} to {other}");
            place.reload();
            assert!(place.viewer.problems.is_empty(), "{:?}", place.viewer.problems);
            assert!(near(&of_camera(&place, "to"), &wanted), "{lens} to {other}:\n{}", place.text());
            place.viewer.edit(|v| v.add_camera_of_view());
            place.reload();
            assert!(near(&of_camera(&place, "view 1"), &wanted), "{lens}:\n{}", place.text());
        }
    }
}
