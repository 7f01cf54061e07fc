//! Each panel in use, without a window: buttons of the tree, messages, performance, cameras, the inspector, times of the
//! sequencer, and operation by keyboard alone.

use crate::place::{Desk, Place, drag};
use choreo_motion::Time;
use choreo_session::ViewportCamera;
use choreo_viewer::geometry::picking;
use choreo_viewer::geometry::projection::ViewProjection;
use choreo_viewer::state::selection::Selected;
use choreo_viewer::state::view::{Resolution, ViewCamera};
use egui::accesskit::Role;
use egui::{Key, Modifiers, pos2, vec2};
use egui_kittest::kittest::Queryable;
use glam::DVec2;
use std::path::{Path, PathBuf};

const SCRIPT: &str = r##"stage(#{ size: [320, 180], fps: 25, length: 4.0, samples: 1, background: "#204060" });
let moves = load("choreo:mannequin");
let ada = cast("ada", load("choreo:mannequin", #{ color: "coral" })).at(-0.6, 0.0, 0.0);
ada.play(moves.clip("Walk")).until(2.0)
    .then(moves.clip("Wave"), #{ fade: 0.8 });
let bob = cast("bob", load("choreo:mannequin", #{ color: "teal" })).at(0.6, 0.0, 0.0);
bob.joint("Head").key("rotation", [[0.0, [0, 30, 0]]]);
let ball = cast("ball", shape("sphere", #{ size: 0.3, roughness: 0.25, metallic: 1.0 })).at(0.0, 2.0, 0.0);
camera("wide").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
camera("near").at(0.0, 1.0, 2.5).look_at([0.0, 1.0, 0.0]).cut(3.0);
effect("vignette", #{ strength: 0.5 }).from(1.0);
marker("hello", 1.0);
"##;

/// A test harness that has drawn the first frame.
fn harness_with_script() -> Desk {
    let mut place = Place::new(SCRIPT);
    place.paint();
    place.harness(vec2(1500.0, 1000.0))
}

fn paint(desk: &mut Desk) {
    while desk.state_mut().paint().is_some() {
        desk.run();
    }
}

/// Search field of the tree, which is on the left; the inspector has other text fields.
fn search(desk: &Desk) -> egui_kittest::Node<'_> {
    let left = |node: &egui_kittest::Node| node.rect().left();
    desk.get_all_by_role(Role::TextInput).min_by(|a, b| left(a).total_cmp(&left(b))).unwrap()
}

fn press(desk: &mut Desk, modifiers: Modifiers, key: Key) {
    desk.key_press_modifiers(modifiers, key);
    desk.run();
}

fn click(desk: &mut Desk, label: &str) {
    desk.get_by_label(label).click();
    desk.run();
}

/// Texts that contain `part`, for the message of a failure.
fn said(desk: &Desk, part: &str) -> Vec<String> {
    desk.query_all_by_label_contains(part).map(|node| format!("{node:?}")).collect()
}

fn has(desk: &Desk, part: &str) -> bool {
    desk.query_all_by_label_contains(part).next().is_some()
}

#[test]
fn the_tree_hides_isolates_and_locks_actors() {
    let mut desk = harness_with_script();
    click(&mut desk, "hide ada");
    let hidden = |desk: &mut Desk| desk.state_mut().viewer.next_request().map(|asked| asked.overrides.hidden);
    assert_eq!(hidden(&mut desk), Some(vec![0]));
    click(&mut desk, "hide ada");
    click(&mut desk, "solo bob");
    desk.state_mut().viewer.views[0].is_waiting = false;
    assert_eq!(hidden(&mut desk), Some(vec![0, 2]));
    click(&mut desk, "solo bob");
    // The search finds joints, too, and typed letters are not shortcuts.
    search(&desk).click();
    desk.run();
    search(&desk).type_text("hea");
    press(&mut desk, Modifiers::NONE, Key::H);
    assert!(has(&desk, "mixamorig:Head"), "{:?}", (said(&desk, "Head"), search(&desk).value()));
    assert!(desk.query_by_label("hide ball").is_none());
    assert!(desk.state().viewer.toggles.hidden.is_empty());
    // A focused field requests no repaint: its cursor does not blink.
    let delay = desk.output().viewport_output[&egui::ViewportId::ROOT].repaint_delay;
    assert!(delay > std::time::Duration::from_secs(60), "{delay:?}");
}

#[test]
fn the_status_bar_shows_a_problem_and_a_click_opens_the_messages() {
    let mut desk = harness_with_script();
    desk.state_mut().load_faulty(&SCRIPT.replace("\"Wave\"", "\"Waev\""));
    desk.run();
    click(&mut desk, "faulty: the last good version is shown");
    assert!(has(&desk, "unknown clip \"Waev\""));
    assert!(desk.query_by_label("time").is_none(), "the messages are in front of the sequencer");
}

#[test]
fn a_camera_s_field_of_view_is_changed_in_the_inspector() {
    let mut desk = harness_with_script();
    for (name, literal) in [("wide", ".fov(61.0)"), ("near", ".key(\"fov\", [[0.0, 61], [2.0, 50]])")] {
        if name == "near" {
            let text = desk
                .state()
                .text()
                .replace("camera(\"near\")", "camera(\"near\").key(\"fov\", [[0.0, 40], [2.0, 50]])");
            desk.state_mut().reload_with(&text);
            desk.run();
        }
        desk.state_mut().viewer.selection = Some(Selected::Camera(name.into()));
        desk.run();
        assert!(has(&desk, "any distance"));
        let viewer = &mut desk.state_mut().viewer;
        viewer.set_field_of_view(name, 61.0, "61.0").unwrap();
        desk.state_mut().reload();
        assert!(desk.state().text().contains(literal), "{}", desk.state().text());
    }
    // A drag of the mouse is one change.
    desk.state_mut().viewer.selection = Some(Selected::Camera("wide".into()));
    desk.run();
    let before = desk.state().text();
    let field = desk.get_by_role_and_label(Role::SpinButton, "field of view").rect().center();
    desk.drag_at(field);
    desk.run();
    desk.hover_at(field + vec2(40.0, 0.0));
    desk.run();
    assert_eq!(desk.state().text(), before, "not before it is let go");
    desk.drop_at(field + vec2(40.0, 0.0));
    desk.run();
    assert_eq!(desk.state().viewer.message, None);
    assert_ne!(desk.state().text(), before);
    assert!(!desk.state().text().contains(".fov(61.0)"));
}

#[test]
fn a_click_on_a_message_goes_to_its_line() {
    let mut desk = harness_with_script();
    desk.state_mut().load_faulty(&SCRIPT.replace("\"Wave\"", "\"Waev\""));
    desk.run();
    press(&mut desk, Modifiers::COMMAND, Key::Num5);
    let message = desk.get_all_by_label_contains("unknown clip").next().unwrap().rect().center();
    desk.hover_at(message);
    desk.drag_at(message);
    desk.drop_at(message);
    desk.run();
    // The script panel shows the file on disk, scrolled to that line.
    desk.get_by_label("as it is on disk; the last good version is shown");
    assert!(has(&desk, "   5     .then(moves.clip(\"Waev\")"));
    // The sequencer marks the problem, too.
    press(&mut desk, Modifiers::COMMAND, Key::Num2);
    assert!(has(&desk, "problems: 1 error: line 5"));
    desk.state_mut().reload_with(SCRIPT);
    desk.run();
    assert!(!has(&desk, "problems:"));
}

#[test]
fn the_performance_panel_counts_draws_and_caps_the_frame_rate() {
    let mut desk = harness_with_script();
    press(&mut desk, Modifiers::COMMAND, Key::Num8);
    desk.get_by_label("frame graph");
    let shown = desk.state().viewer.shown().unwrap();
    let draws = format!("{}, {}", shown.draw_count, shown.triangle_count);
    assert!(shown.draw_count >= 3 && has(&desk, &draws));
    desk.get_by_role_and_label(Role::ComboBox, "at most").click();
    desk.run();
    click(&mut desk, "15 frames a second");
    assert_eq!(desk.state().viewer.performance.max_fps, Some(15));
}

#[test]
fn a_view_follows_an_actor_flies_and_uses_any_camera() {
    let mut desk = harness_with_script();
    let place = |desk: &Desk| match &desk.state().viewer.views[0].camera {
        ViewCamera::Free(orbit) | ViewCamera::Follow { orbit, .. } => {
            orbit.camera().world_from_view.translation
        }
        other => panic!("{other:?}"),
    };
    click(&mut desk, "camera");
    // The name is shown in the tree and in the menu.
    desk.get_all_by_label("near").last().unwrap().click();
    desk.run();
    assert_eq!(desk.state().viewer.views[0].camera, ViewCamera::Named("near".into()));
    let viewport_camera = desk.state_mut().viewer.next_request().unwrap().camera;
    assert_eq!(viewport_camera, ViewportCamera::Camera(1));
    desk.state_mut().viewer.views[0].is_waiting = false;
    click(&mut desk, "script's camera");
    click(&mut desk, "row ada");
    click(&mut desk, "follow");
    let following = desk.state_mut().viewer.next_request().unwrap().camera;
    assert!(matches!(following, ViewportCamera::Following { actor: 0, .. }), "{following:?}");
    desk.state_mut().viewer.views[0].is_waiting = false;
    click(&mut desk, "follow");
    // While W is held with the pointer over the image, the camera walks forward, here along -z.
    let before = place(&desk);
    desk.hover_at(desk.get_by_label("picture").rect().center());
    desk.key_down(Key::W);
    desk.run_steps(6);
    desk.key_up(Key::W);
    desk.run_steps(2);
    let walked = place(&desk) - before;
    assert!(walked.z < -0.01 && walked.x.abs() < 1e-6, "{walked}");
    desk.run_steps(3);
    assert_eq!(place(&desk) - before, walked, "and stands then");
}

/// Picking returns the actor drawn at the pixel. The colors of the image identify the actor, independently of the picking code.
#[test]
fn picking_selects_the_actor_drawn_at_the_pointer() {
    let mut place = Place::new(SCRIPT);
    place.viewer.views[0].resolution = Resolution::Full;
    let frame = place.paint().unwrap();
    let viewer = &place.viewer;
    let (scene, shown) = (viewer.scene.clone().unwrap(), viewer.shown().unwrap());
    let projection = ViewProjection::new(&shown.snapshot.camera, DVec2::ZERO, DVec2::new(320.0, 180.0));
    let kind = |x: usize, y: usize| {
        let at = (y * frame.width as usize + x) * 4;
        let [r, g, b] = [0, 1, 2].map(|c| i32::from(frame.rgba[at + c]));
        match () {
            () if [r - 0x20, g - 0x40, b - 0x60].iter().all(|d| d.abs() <= 1) => Some(None),
            () if r > g + 40 && r > b + 40 => Some(Some(0)),
            () if g > r + 40 && b > r + 40 && g > 70 => Some(Some(1)),
            () => None,
        }
    };
    let mut seen = [0; 3];
    for y in (2..178).step_by(3) {
        for x in (2..318).step_by(3) {
            // Pixels near edges are skipped.
            let Some(expected) = kind(x, y).filter(|k| {
                [(0, 1), (1, 0), (2, 1), (1, 2)].iter().all(|(i, j)| kind(x + i - 1, y + j - 1) == Some(*k))
            }) else {
                continue;
            };
            let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let picked =
                picking::pick_actor(&scene.stage, &shown.snapshot, projection.ray_through(at), |_| true);
            assert_eq!(picked, expected, "at {x}, {y}");
            seen[expected.map_or(2, |a| a)] += 1;
        }
    }
    assert!(seen.iter().all(|count| *count > 30), "shown able to see each: {seen:?}");
}

fn real_model(name: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/assets");
    let folder = std::env::var_os("CHOREO_ASSETS").map_or(beside, PathBuf::from);
    let file = folder.join(name);
    if !file.is_file() {
        println!("SKIP 1: no {name} in {} ($CHOREO_ASSETS)", folder.display());
        return None;
    }
    Some(file)
}

#[test]
fn a_skinned_gltf_model_is_picked_where_it_is_drawn() {
    let Some(file) = real_model("gltf/Fox.glb").or_else(|| real_model("gltf/CesiumMan.glb")) else { return };
    let script = "stage(#{ size: [320, 180], length: 2.0, samples: 1, background: \"#ff00ff\" });\n\
        let fox = load(\"model.glb\");\ncast(\"fox\", fox).play(fox.clip(0));\n";
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(file, folder.path().join("model.glb")).unwrap();
    let mut place = Place::within(folder, script);
    place.viewer.playhead.seek(Time::from_secs(0.4));
    place.viewer.views[0].resolution = Resolution::Full;
    // The file's ground is not an actor, and would hide the background.
    place.viewer.views[0].overlays.grid = false;
    let frame = place.paint().unwrap();
    let (scene, shown) = (place.viewer.scene.clone().unwrap(), place.viewer.shown().unwrap());
    let projection = ViewProjection::new(&shown.snapshot.camera, DVec2::ZERO, DVec2::new(320.0, 180.0));
    let is_back = |x: usize, y: usize| {
        let at = (y * frame.width as usize + x) * 4;
        frame.rgba[at..at + 3] == [255, 0, 255]
    };
    let mut seen = [0; 2];
    for y in (2..178).step_by(4) {
        for x in (2..318).step_by(4) {
            let back = is_back(x, y);
            if (0..3).any(|i| (0..3).any(|j| is_back(x + i - 1, y + j - 1) != back)) {
                continue;
            }
            let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let picked =
                picking::pick_actor(&scene.stage, &shown.snapshot, projection.ray_through(at), |_| true);
            assert_eq!(picked.is_none(), back, "at {x}, {y}");
            seen[usize::from(back)] += 1;
        }
    }
    assert!(seen.iter().all(|count| *count > 50), "shown able to see both: {seen:?}");
}

#[test]
fn a_click_in_the_image_selects_and_locked_actors_are_not_moved() {
    let mut desk = harness_with_script();
    let rect = desk.get_by_label("picture").rect();
    let shown = desk.state().viewer.shown().unwrap();
    // The image fills the panel: 16 : 9, centered.
    let width = rect.width().min(rect.height() * 16.0 / 9.0);
    let size = vec2(width, width * 9.0 / 16.0);
    let corner = rect.center() - size / 2.0;
    let vector = |v: egui::Vec2| DVec2::new(f64::from(v.x), f64::from(v.y));
    let projection = ViewProjection::new(&shown.snapshot.camera, vector(corner.to_vec2()), vector(size));
    let at = projection.project_point(picking::bounds_center(
        &desk.state().viewer.scene.as_ref().unwrap().stage.actors[0].asset,
        &shown.snapshot.actors[0],
    ));
    let at = at.map(|p| pos2(p.x as f32, p.y as f32)).unwrap();
    let click_there = |desk: &mut Desk| {
        desk.hover_at(at);
        desk.run();
        desk.drag_at(at);
        desk.drop_at(at);
        desk.run();
    };
    click_there(&mut desk);
    assert_eq!(desk.state().viewer.selection, Some(Selected::Actor("ada".into())));
    press(&mut desk, Modifiers::NONE, Key::Escape);
    click(&mut desk, "lock ada");
    click_there(&mut desk);
    assert_eq!(desk.state().viewer.selection, None);
}

#[test]
fn the_inspector_shows_layers_materials_joints_and_parameters() {
    let mut desk = harness_with_script();
    // In the middle of the fade, each clip has half of the weight.
    desk.state_mut().viewer.playhead.seek(Time::from_secs(2.4));
    paint(&mut desk);
    click(&mut desk, "row ada");
    let heard = [" 50 % Walk", " 50 % Wave"];
    assert!(heard.iter().all(|part| has(&desk, part)), "{:?}", said(&desk, "%"));
    // Bob's head is rotated from the rest pose by the script; no clip plays on him.
    click(&mut desk, "row bob");
    let joints = desk.get_all_by_label_contains("joints (").last().unwrap().rect().center();
    desk.hover_at(joints);
    desk.drag_at(joints);
    desk.drop_at(joints);
    desk.run();
    assert!(has(&desk, "  30.0°"));
    click(&mut desk, "row ball");
    let materials = desk.get_by_label_contains("materials (1)").rect().center();
    desk.drag_at(materials);
    desk.drop_at(materials);
    desk.run();
    assert!(has(&desk, "metallic 1.00") && has(&desk, "roughness 0.25"));
    // The slider has the range of the manifest, and changes the script.
    click(&mut desk, "vignette on effects");
    let slider = desk.get_by_role_and_label(Role::Slider, "strength").rect();
    let to = pos2(slider.left() + 4.0, slider.center().y);
    desk.drag_at(to);
    desk.run();
    desk.drop_at(to);
    desk.run();
    let text = desk.state().text();
    assert!(text != SCRIPT && text.contains("effect(\"vignette\", #{ strength: 0"), "{text}");
}

#[test]
fn the_sequencer_shows_times_in_the_chosen_unit() {
    let mut desk = harness_with_script();
    desk.get_by_label("marker hello");
    click(&mut desk, "seconds");
    assert!(!desk.state().viewer.in_seconds);
    assert_eq!(desk.state().viewer.time_text(Time::from_secs(1.0)), "frame 25");
    click(&mut desk, "frames");
    // The playback range is set by keys, and removed by its button.
    for (secs, key) in [(1.0, Key::I), (2.0, Key::O)] {
        desk.state_mut().viewer.playhead.seek(Time::from_secs(secs));
        press(&mut desk, Modifiers::NONE, key);
    }
    let range = desk.state().viewer.playhead.range().map(|(a, b)| (a.as_secs(), b.as_secs()));
    assert_eq!(range, Some((1.0, 2.04)));
    click(&mut desk, "1.00 to 2.04 s");
    assert_eq!(desk.state().viewer.playhead.range(), None);
    // Snapping to frames on and off, and the view of the whole scene.
    assert_eq!(desk.state().viewer.snapped(1.013), 1.0);
    click(&mut desk, "Snap");
    assert_eq!(desk.state().viewer.snapped(1.013), 1.013);
    desk.state_mut().viewer.visible_span.zoom(4.0, 0.0, 100.0, 4.0);
    click(&mut desk, "Whole");
    assert_eq!(desk.state().viewer.visible_span, choreo_viewer::state::span::Span::whole(4.0));
    // The end of a bar and a cut are dragged with the mouse.
    for (label, secs, expected) in
        [("end of Walk in row 1", 3.0, ".until(3.0)"), ("start of near in row 0", 2.0, ".cut(2.0)")]
    {
        let ruler = desk.get_by_label("time").rect();
        // Grabbed beside its center, the handle keeps that offset.
        let from = desk.get_by_label(label).rect().center();
        let was = desk.state().viewer.timeline.rows.iter().flat_map(|row| &row.bars);
        let was = was.flat_map(|bar| [bar.start, bar.draggable_end]).map(choreo_motion::Time::as_secs);
        let x = |secs: f64| ruler.left() + ruler.width() * secs as f32 / 4.0;
        let was = was.min_by(|a, b| (x(*a) - from.x).abs().total_cmp(&(x(*b) - from.x).abs())).unwrap();
        drag(&mut desk, from, from + vec2(x(secs) - x(was), 0.0));
        assert_eq!(desk.state().viewer.message, None);
        let text = desk.state().text();
        let near = |text: &str| text.contains(expected) || text.contains(&expected.replace(".0)", ".00"));
        assert!(near(&text), "{text}");
        desk.state_mut().reload();
        desk.run();
    }
}

#[test]
fn the_viewer_is_fully_usable_by_keyboard() {
    let mut desk = harness_with_script();
    let none = Modifiers::NONE;
    // Select, hide, play, step.
    press(&mut desk, none, Key::PageDown);
    assert_eq!(desk.state().viewer.selection, Some(Selected::Actor("ada".into())));
    press(&mut desk, none, Key::H);
    assert!(desk.state().viewer.toggles.hidden.contains("ada"));
    press(&mut desk, none, Key::H);
    press(&mut desk, none, Key::Space);
    assert!(desk.state().viewer.playhead.is_playing());
    press(&mut desk, none, Key::Space);
    press(&mut desk, none, Key::End);
    assert_eq!(desk.state().viewer.playhead.frame(), 99);
    press(&mut desk, none, Key::Home);
    press(&mut desk, none, Key::P);
    let file = desk.state().viewer.screenshot.clone().unwrap();
    assert!(file.ends_with("a_0.png"), "{}", file.display());
    press(&mut desk, none, Key::Escape);
    // Tab moves from button to bar; Enter selects the bar, Alt with arrows moves it, with Shift its end.
    let reach = |desk: &mut Desk, label: &str| {
        for _ in 0..200 {
            press(desk, none, Key::Tab);
            let found = desk.query_all_by_label(label).any(|node| node.is_focused());
            if found {
                return;
            }
        }
        panic!("Tab never comes to {label}");
    };
    reach(&mut desk, "Walk on ada");
    press(&mut desk, none, Key::Enter);
    assert!(matches!(desk.state().viewer.selection, Some(Selected::Cue { cue: 0, .. })));
    press(&mut desk, Modifiers::ALT | Modifiers::SHIFT, Key::ArrowRight);
    assert_eq!(
        desk.state().text(),
        SCRIPT.replace(".until(2.0)", ".until(2.04)"),
        "{:?}",
        desk.state().viewer.message
    );
    press(&mut desk, Modifiers::COMMAND, Key::Z);
    assert_eq!(desk.state().text(), SCRIPT);
    // A number is typed in the inspector.
    press(&mut desk, none, Key::Escape);
    press(&mut desk, none, Key::PageDown);
    reach(&mut desk, "x");
    desk.get_by_role_and_label(Role::SpinButton, "x").type_text("");
    press(&mut desk, Modifiers::COMMAND, Key::A);
    desk.event(egui::Event::Text("1.5".into()));
    desk.run();
    press(&mut desk, none, Key::Enter);
    assert_eq!(desk.state().text(), SCRIPT.replace(".at(-0.6, 0.0", ".at(1.5, 0.0"));
    // Panels are closed and opened, the display scale grows, and the list of shortcuts opens.
    press(&mut desk, Modifiers::COMMAND, Key::Num6);
    assert!(has(&desk, "   1 stage("));
    press(&mut desk, Modifiers::COMMAND, Key::Equals);
    assert_eq!(desk.state().panels.scale, 1.1);
    press(&mut desk, none, Key::F1);
    assert!(has(&desk, "list of shortcuts"));
    press(&mut desk, Modifiers::COMMAND, Key::Q);
    assert!(desk.state().viewer.should_close);
}
