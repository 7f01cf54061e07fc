//! Viewports: views along the axes, icons of lights and cameras, joints and their trails, the grid.

use crate::place::{Desk, Place, drag};
use choreo_asset::Projection;
use choreo_motion::Time;
use choreo_viewer::geometry::picking::bounds_center;
use choreo_viewer::geometry::projection::ViewProjection;
use choreo_viewer::panels::Panels;
use choreo_viewer::state::selection::Selected;
use choreo_viewer::state::settings::Settings;
use choreo_viewer::state::side::Side;
use choreo_viewer::state::trail::JointRef;
use choreo_viewer::state::view::ViewCamera;
use egui::{Pos2, pos2, vec2};
use egui_kittest::kittest::Queryable;
use glam::{DVec2, DVec3};
use std::time::{Duration, Instant};

const SCRIPT: &str = r##"stage(#{ size: [640, 360], fps: 25, length: 2.0, samples: 1 });
let ada = cast("ada", load("choreo:mannequin"));
ada.play(load("choreo:mannequin").clip("Walk"));
camera("wide").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);
camera("side").at(1.2, 1.5, 1.0).look_at(ada);
ada.reach("RightHand", [-0.35, 1.25, 0.35]).fade(0.0);
let lamp = point(#{ position: [-1.2, 1.8, 0.5], intensity: 40.0 });
"##;

fn harness_with_script() -> Desk {
    let mut place = Place::new(SCRIPT);
    place.paint();
    // A free camera at the position of the script's camera.
    place.viewer.free_camera(0);
    let mut desk = place.harness(vec2(1280.0, 860.0));
    painted(&mut desk);
    desk
}

fn painted(desk: &mut Desk) {
    desk.run();
    desk.state_mut().paint();
    desk.run();
}

/// Screen position of a point in world space.
fn on_screen(desk: &Desk, world: DVec3) -> Pos2 {
    on_screen_in(desk, 0, world)
}

/// Screen position of a point in world space in one of the viewports.
fn on_screen_in(desk: &Desk, view: usize, world: DVec3) -> Pos2 {
    let viewer = &desk.state().viewer;
    let view = &viewer.views[view];
    let [left, top, right, bottom] = view.image_rect.map(f64::from);
    let camera = view.displayed_camera(&viewer.scene.as_ref().unwrap().stage).unwrap();
    let projection =
        ViewProjection::new(&camera, DVec2::new(left, top), DVec2::new(right - left, bottom - top));
    let at = projection.project_point(world).unwrap();
    pos2(at.x as f32, at.y as f32)
}

fn click_at(desk: &mut Desk, at: Pos2) {
    desk.hover_at(at);
    desk.run();
    desk.drag_at(at);
    desk.drop_at(at);
    desk.run();
}

#[test]
fn clicking_an_axis_end_sets_an_orthographic_view_along_it() {
    let mut desk = harness_with_script();
    for side in Side::ALL {
        desk.get_by_label(&format!("{} view", side.name())).click();
        desk.run();
        let ViewCamera::Free(orbit) = &desk.state().viewer.views[0].camera else { panic!("{side:?}") };
        assert_eq!(Side::of(orbit), Some(side));
        painted(&mut desk);
        let camera = desk.state().viewer.shown().unwrap().snapshot.camera;
        assert!(matches!(camera.projection, Projection::Orthographic { .. }), "{side:?}");
        // Two points behind each other project to the same point of the screen.
        let middle = desk.state().viewer.shown().unwrap().snapshot.actors[0].world_from_model.translation;
        let (a, b) = (on_screen(&desk, middle), on_screen(&desk, middle + side.direction()));
        assert!((a - b).length() < 0.1, "{side:?}: {a:?} {b:?}");
    }
    // The menu lists the same views and is named after the present one.
    desk.get_by_label("Back").click();
    desk.run();
    desk.get_by_label("Perspective").click();
    desk.run();
    let ViewCamera::Free(orbit) = &desk.state().viewer.views[0].camera else { panic!() };
    assert!(matches!(orbit.projection, Projection::Perspective { .. }));
}

#[test]
fn a_light_and_a_camera_are_picked_and_dragged_by_their_icons() {
    let mut desk = harness_with_script();
    let lamp = DVec3::new(-1.2, 1.8, 0.5);
    let at = on_screen(&desk, lamp);
    click_at(&mut desk, at);
    assert_eq!(desk.state().viewer.selection, Some(Selected::Light(0)));
    // In the plane parallel to the image through the light: half a metre to the left, and up.
    let to = on_screen(&desk, lamp + DVec3::new(-0.5, 0.2, 0.0));
    drag(&mut desk, at, to);
    let text = desk.state().text();
    let line = text.lines().find(|line| line.starts_with("let lamp")).unwrap();
    let numbers = line.split('[').nth(1).unwrap().split(']').next().unwrap();
    let numbers: Vec<f64> = numbers.split(',').map(|n| n.trim().parse().unwrap()).collect();
    let off = DVec3::from_slice(&numbers) - (lamp + DVec3::new(-0.5, 0.2, 0.0));
    assert!(off.length() < 0.01, "{line}");
    assert_eq!(text.lines().count(), SCRIPT.lines().count(), "{text}");
    // The target of the camera stays.
    desk.state_mut().reload();
    painted(&mut desk);
    let side = DVec3::new(1.2, 1.5, 1.0);
    let (from, to) = (on_screen(&desk, side), on_screen(&desk, side + DVec3::new(0.0, 0.5, 0.0)));
    drag(&mut desk, from, to);
    let text = desk.state().text();
    let line = text.lines().find(|line| line.starts_with("camera(\"side\")")).unwrap();
    let height = line.split("1.2, ").nth(1).and_then(|rest| rest.split(',').next());
    let height: f64 = height.unwrap_or_else(|| panic!("{line}")).parse().unwrap();
    assert!((height - 2.0).abs() < 0.01 && line.ends_with(".look_at(ada);"), "{line}");
}

/// The ring of a spot is also a handle: it moves with the pointer, and the view stays.
#[test]
fn a_spot_is_dragged_by_its_ring() {
    let spot = "let spot = spot(#{ position: [-1.0, 2.0, 0.0], direction: [0.0, -1.0, 0.0], outer: 40.0 });";
    let mut place = Place::new(&format!("{SCRIPT}{spot}\n"));
    place.paint();
    place.viewer.free_camera(0);
    let mut desk = place.harness(vec2(1280.0, 860.0));
    painted(&mut desk);
    let camera = desk.state().viewer.views[0].camera.clone();
    // The left end of the ring, which is 0.4 m below the spot.
    let ring = DVec3::new(-1.0 - 0.4 * 40f64.to_radians().tan(), 1.6, 0.0);
    let (from, to) = (on_screen(&desk, ring), on_screen(&desk, ring + DVec3::new(0.2, 0.3, 0.0)));
    assert!((from - on_screen(&desk, DVec3::new(-1.0, 2.0, 0.0))).length() > 30.0);
    drag(&mut desk, from, to);
    assert_eq!(desk.state().viewer.message, None);
    assert_eq!(desk.state().viewer.views[0].camera, camera, "the view is not turned");
    assert_eq!(desk.state().viewer.selection, Some(Selected::Light(1)));
    let text = desk.state().text();
    let line = text.lines().find(|line| line.starts_with("let spot")).unwrap();
    let numbers = line.split('[').nth(1).unwrap().split(']').next().unwrap();
    let numbers: Vec<f64> = numbers.split(',').map(|n| n.trim().parse().unwrap()).collect();
    let off = DVec3::from_slice(&numbers) - DVec3::new(-0.8, 2.3, 0.0);
    assert!(off.length() < 0.01, "{line}");
}

/// Dragging a following camera changes its offset, dragging an orbiting one its distance and angles; nothing else changes.
#[test]
fn cameras_that_follow_and_circle_are_dragged_by_their_icons() {
    let behind = "camera(\"behind\").follow(box, [0.0, 0.5, 2]);\n";
    let round = "camera(\"round\").orbit([0.0, 1.0, 0.0], #{ distance: 1.5, elevation: 0, azimuth: 60, speed: 0 });\n";
    let script =
        format!("{SCRIPT}let box = cast(\"box\", shape(\"box\")).at(1.0, 0.0, 0.0);\n{behind}{round}");
    let mut place = Place::new(&script);
    place.paint();
    place.viewer.free_camera(0);
    let mut desk = place.harness(vec2(1280.0, 860.0));
    painted(&mut desk);
    let middle = {
        let stage = &desk.state().viewer.scene.as_ref().unwrap().stage;
        let number = stage.actors.iter().position(|actor| actor.name == "box").unwrap();
        stage.actors[number].asset.rest_bounds().center().as_dvec3() + DVec3::X
    };
    let at = middle + DVec3::new(0.0, 0.5, 2.0);
    let (from, to) = (on_screen(&desk, at), on_screen(&desk, at + DVec3::new(0.2, 0.1, 0.0)));
    drag(&mut desk, from, to);
    let text = desk.state().text();
    let numbers = |text: &str, line: &str| -> Vec<f64> {
        let line = text.lines().find(|l| l.starts_with(line)).unwrap_or_else(|| panic!("{text}"));
        let parts = line.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'));
        parts.filter(|part| part.contains(|c: char| c.is_ascii_digit())).map(|n| n.parse().unwrap()).collect()
    };
    let off = DVec3::from_slice(&numbers(&text, "camera(\"behind\")")) - DVec3::new(0.2, 0.6, 2.0);
    assert!(off.length() < 0.01, "{text}");
    assert_eq!(text.lines().count(), script.lines().count(), "{text}");
    desk.state_mut().reload();
    painted(&mut desk);
    let angle = 60f64.to_radians();
    let at = DVec3::new(1.5 * angle.sin(), 1.0, 1.5 * angle.cos());
    // A drag straight up in the image plane keeps the ground distance and the azimuth.
    let (from, to) = (on_screen(&desk, at), on_screen(&desk, at + DVec3::new(0.0, 0.5, 0.0)));
    drag(&mut desk, from, to);
    let text = desk.state().text();
    let [.., distance, elevation, azimuth, speed] = numbers(&text, "camera(\"round\")")[..] else {
        panic!("{text}")
    };
    let wanted = (1.5f64.hypot(0.5), (0.5f64 / 1.5).atan().to_degrees());
    assert!((distance - wanted.0).abs() < 0.02 && (elevation - wanted.1).abs() < 0.5, "{text}");
    assert!((azimuth - 60.0).abs() < 0.5 && speed == 0.0, "{text}");
}

/// The icon of a sun shows its direction, and does not follow a selected or moving actor.
#[test]
fn the_sun_icon_does_not_move_with_selection_or_actors() {
    let script = SCRIPT.replace(
        "let lamp = point(",
        "let bob = cast(\"bob\", shape(\"box\")).key(\"position\", [[0.0, [1.5, 0, 0]], [1.0, [3.5, 0, 0]]]);\nlet lamp = point(",
    );
    let script = format!("{script}sun(#{{ direction: [0.4, -0.3, 0.0] }});\n");
    let mut place = Place::new(&script);
    place.paint();
    place.viewer.free_camera(0);
    let mut desk = place.harness(vec2(1280.0, 860.0));
    painted(&mut desk);
    let viewer = &desk.state().viewer;
    let (stage, shown) = (viewer.scene.as_ref().unwrap().stage.clone(), viewer.shown().unwrap());
    let actors = stage.actors.iter().zip(&shown.snapshot.actors);
    let middle = actors.map(|(actor, state)| bounds_center(&actor.asset, state)).sum::<DVec3>() / 2.0;
    let at = on_screen(&desk, middle - DVec3::new(0.4, -0.3, 0.0).normalize() * 3.0);
    for selected in [None, Some("ada"), Some("bob")] {
        desk.state_mut().viewer.selection = selected.map(|name| Selected::Actor(name.into()));
        desk.run();
        click_at(&mut desk, at);
        assert_eq!(desk.state().viewer.selection, Some(Selected::Light(1)), "after {selected:?}");
    }
    desk.state_mut().viewer.selection = None;
    desk.state_mut().viewer.playhead.seek(Time::from_secs(1.0));
    painted(&mut desk);
    assert_eq!(desk.state().viewer.shown().unwrap().snapshot.actors[1].world_from_model.translation.x, 3.5);
    click_at(&mut desk, at);
    assert_eq!(desk.state().viewer.selection, Some(Selected::Light(1)), "while bob moves");
}

#[test]
fn an_icon_is_dragged_in_either_of_two_free_viewports() {
    for view in [0, 1] {
        let mut place = Place::new(SCRIPT);
        let layout = serde_json::json!({
            "below": 0.7,
            "first": { "right": 0.5, "first": { "tabs": ["Viewport"] }, "second": { "tabs": ["Viewport 2"] } },
            "second": { "tabs": ["Sequencer"] },
        });
        place.panels = Panels::new(&Settings { layout: Some(layout), ..Settings::default() });
        place.paint();
        let mut desk = place.harness(vec2(1280.0, 860.0));
        let paint_all = |desk: &mut Desk| (0..5).for_each(|_| painted(desk));
        paint_all(&mut desk);
        for view in [0, 1] {
            assert!(desk.state_mut().viewer.free_camera(view).is_some());
        }
        paint_all(&mut desk);
        let before: Vec<ViewCamera> = desk.state().viewer.views.iter().map(|v| v.camera.clone()).collect();
        let lamp = DVec3::new(-1.2, 1.8, 0.5);
        let from = on_screen_in(&desk, view, lamp);
        let to = on_screen_in(&desk, view, lamp + DVec3::new(-0.3, 0.2, 0.0));
        drag(&mut desk, from, to);
        let text = desk.state().text();
        assert_ne!(text, SCRIPT, "viewport {view}: {:?}", desk.state().viewer.message);
        let line = text.lines().find(|line| line.starts_with("let lamp")).unwrap();
        assert!(!line.contains("[-1.2, 1.8, 0.5]"), "{line}");
        let after: Vec<ViewCamera> = desk.state().viewer.views.iter().map(|v| v.camera.clone()).collect();
        assert_eq!(after, before, "neither view turns");
    }
}

#[test]
fn a_joint_is_picked_and_its_trail_is_where_frames_have_it() {
    let mut desk = harness_with_script();
    desk.state_mut().viewer.views[0].overlays.skeletons = true;
    desk.state_mut().viewer.views[0].overlays.trail = true;
    desk.state_mut().viewer.views[0].overlays.onion_skins = true;
    painted(&mut desk);
    let viewer = &desk.state().viewer;
    let scene = viewer.scene.clone().unwrap();
    let names = scene.stage.actors[0].asset.skeleton.names();
    let hand = names.iter().position(|name| name.ends_with("LeftHand")).unwrap();
    let place = |snapshot: &choreo_stage::Snapshot| {
        let state = &snapshot.actors[0];
        state.world_from_model.transform_point3(state.model_from_joint[hand].translation.as_dvec3())
    };
    let at = on_screen(&desk, place(&viewer.shown().unwrap().snapshot));
    click_at(&mut desk, at);
    let wanted = JointRef { actor: "ada".into(), joint: hand };
    assert_eq!(desk.state().viewer.selected_joint, Some(wanted));
    assert_eq!(desk.state().viewer.selection, Some(Selected::Actor("ada".into())));
    let end = Instant::now() + Duration::from_secs(60);
    let trail = loop {
        let viewer = &mut desk.state_mut().viewer;
        if let Some(trail) = viewer.trails.of(&scene, "ada", || ()) {
            break trail;
        }
        assert!(Instant::now() < end);
        std::thread::sleep(Duration::from_millis(10));
    };
    assert_eq!(trail.frames.len(), 50);
    // Expected values: the stage itself, evaluated at each time.
    for (time, joints) in trail.frames.iter().step_by(7) {
        let expected = place(&scene.stage.at(*time).unwrap());
        assert!((joints[hand] - expected).length() < 1e-6, "{time:?}");
    }
    assert_eq!(trail.nearest_frame(scene.stage.settings.fps.time_of(20)), Some(20));
    desk.run();
}

#[test]
fn a_target_of_inverse_kinematics_is_dragged_and_the_hand_follows() {
    let mut desk = harness_with_script();
    let target = DVec3::new(-0.35, 1.25, 0.35);
    let to = target + DVec3::new(0.0, 0.15, 0.0);
    let (from, until) = (on_screen(&desk, target), on_screen(&desk, to));
    drag(&mut desk, from, until);
    let text = desk.state().text();
    let line = text.lines().find(|line| line.starts_with("ada.reach")).unwrap();
    assert!(line.starts_with("ada.reach(\"RightHand\", [-0.35, 1.4"), "{line}");
    desk.state_mut().reload();
    painted(&mut desk);
    let viewer = &desk.state().viewer;
    let names = viewer.scene.as_ref().unwrap().stage.actors[0].asset.skeleton.names();
    let hand = names.iter().position(|name| name.ends_with("RightHand")).unwrap();
    let state = &viewer.shown().unwrap().snapshot.actors[0];
    let at = state.world_from_model.transform_point3(state.model_from_joint[hand].translation.as_dvec3());
    assert!((at - to).length() < 0.02, "{at} for {to}");
}

/// During the drag of an icon, and until the script is reloaded, the image shows the object at the dragged position.
#[test]
fn a_dragged_scene_icon_shows_its_object_at_the_new_position() {
    let mut desk = harness_with_script();
    let hand = |desk: &Desk| {
        let viewer = &desk.state().viewer;
        let names = viewer.scene.as_ref().unwrap().stage.actors[0].asset.skeleton.names();
        let joint = names.iter().position(|name| name.ends_with("RightHand")).unwrap();
        let state = &viewer.shown().unwrap().snapshot.actors[0];
        state.world_from_model.transform_point3(state.model_from_joint[joint].translation.as_dvec3())
    };
    let lamp = |desk: &Desk| desk.state().viewer.shown().unwrap().snapshot.lights[0].position;
    for (at, by, place) in [
        (DVec3::new(-0.35, 1.25, 0.35), DVec3::new(0.0, 0.15, 0.0), &hand as &dyn Fn(&Desk) -> DVec3),
        (DVec3::new(-1.2, 1.8, 0.5), DVec3::new(0.3, 0.0, 0.0), &lamp),
    ] {
        let (from, to) = (on_screen(&desk, at), on_screen(&desk, at + by));
        assert!((place(&desk) - at).length() < 0.02, "{}", place(&desk));
        desk.hover_at(from);
        desk.run();
        desk.drag_at(from);
        desk.run();
        desk.hover_at(to);
        desk.run();
        desk.run();
        painted(&mut desk);
        assert_eq!(desk.state().text(), SCRIPT, "the mouse button is still down");
        assert!((place(&desk) - (at + by)).length() < 0.02, "{} for {}", place(&desk), at + by);
        desk.drop_at(to);
        desk.run();
        painted(&mut desk);
        assert!((place(&desk) - (at + by)).length() < 0.02, "until the reload: {}", place(&desk));
        desk.state_mut().reload();
        painted(&mut desk);
        assert!((place(&desk) - (at + by)).length() < 0.02, "by the script: {}", place(&desk));
        desk.state_mut().reload_with(SCRIPT);
        painted(&mut desk);
        assert!((place(&desk) - at).length() < 0.02, "as it was: {}", place(&desk));
    }
}

/// The grid is drawn only in the viewport, not in a saved image, and objects in front hide it.
#[test]
fn the_grid_is_in_the_viewport_and_in_no_saved_image() {
    let script =
        SCRIPT.replace("samples: 1", "samples: 1, background: #{ top: \"#000000\", bottom: \"#000000\" }");
    let mut place = Place::new(&script);
    place.viewer.views[0].panel_size = [640, 360];
    place.viewer.views[0].overlays.grid = false;
    let without = place.paint().unwrap();
    place.viewer.views[0].overlays.grid = true;
    let with = place.paint().unwrap();
    place.viewer.screenshot = Some("x.png".into());
    let saved = place.paint().unwrap();
    assert!(saved.rgba == without.rgba, "a saved image has no grid");
    let different =
        with.rgba.chunks_exact(4).zip(without.rgba.chunks_exact(4)).filter(|(a, b)| a != b).count();
    assert!(different > 500, "{different} pixels of a grid");
    // Pixels on the chest, far above the horizon, and in the sky are unchanged.
    let row = |y: usize| y * 640 * 4..(y + 1) * 640 * 4;
    for y in 0..150 {
        assert!(with.rgba[row(y)] == without.rgba[row(y)], "row {y}");
    }
}
