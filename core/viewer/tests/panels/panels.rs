//! The panels without a window: found by their labels, clicked, dragged and typed into.

use crate::place::Place;
use choreo_motion::Time;
use choreo_render::{CpuRenderer, Renderer};
use choreo_session::{FrameRenderer, FrameReply, SceneSource, SceneVersion, Session};
use choreo_viewer::app::Viewer;
use choreo_viewer::panels::Panels;
use choreo_viewer::state::selection::Selected;
use choreo_viewer::state::view::ViewCamera;
use egui::{Key, TextureId, pos2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

const SCRIPT: &str = r#"stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", load("choreo:mannequin", #{ color: "coral" }));
ada.play(moves.clip("Walk")).from(0.5).until(2.0)
    .then(moves.clip("Wave"), #{ fade: 0.5 });
cast("floor", shape("box", #{ size: [4.0, 0.1, 4.0] })).at(0, -0.1, 0);
camera("wide").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);
camera("near").at(0.0, 1.0, 3.0).look_at([0.0, 1.0, 0.0]).cut(2.0);
stage_marker
"#;

struct TestApp {
    viewer: Viewer,
    panels: Panels,
    /// Time of the clock, seconds.
    now: f64,
}

struct Studio {
    folder: tempfile::TempDir,
    session: Session,
    painter: FrameRenderer,
    reply: Receiver<FrameReply>,
}

fn script(change: &str) -> String {
    SCRIPT.replace("stage_marker", change)
}

impl Studio {
    fn new() -> Studio {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.rhai"), script("")).unwrap();
        let source = SceneSource::new(folder.path().join("a.rhai"));
        let session = Session::new(source, &choreo::registry(), false).unwrap();
        let (to, reply) = channel();
        let start = Box::new(|| {
            let renderer: Box<dyn Renderer> = Box::new(CpuRenderer::new(&[]));
            Ok((renderer, None))
        });
        let painter = FrameRenderer::start(start, move |p| drop(to.send(p))).unwrap();
        Studio { folder, session, painter, reply }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("a.rhai")
    }

    fn save(&mut self, text: &str) -> SceneVersion {
        fs::write(self.path(), text).unwrap();
        self.session.build(BTreeSet::from([self.path()]))
    }

    fn open(&mut self) -> Harness<'static, TestApp> {
        let mut viewer = Viewer::new("a.rhai");
        viewer.take_version(self.session.build(BTreeSet::new()));
        let desk = TestApp { viewer, panels: Panels::default(), now: 10.0 };
        let ui = |ui: &mut egui::Ui, desk: &mut TestApp| {
            desk.panels.show(
                ui,
                &mut desk.viewer,
                &[Some(TextureId::User(0)), Some(TextureId::User(1))],
                desk.now,
            );
        };
        let mut harness = Harness::builder().with_size(vec2(1280.0, 860.0)).build_ui_state(ui, desk);
        harness.run();
        self.paint(&mut harness);
        harness.run();
        harness
    }

    /// Draws the requested frames. Returns whether any was requested.
    fn paint(&self, harness: &mut Harness<'_, TestApp>) -> bool {
        let viewer = &mut harness.state_mut().viewer;
        let Some(asked) = viewer.next_request() else { return false };
        self.painter.request_frame(asked);
        let reply = self.reply.recv_timeout(Duration::from_secs(600)).unwrap();
        assert!(viewer.take_frame(reply).is_some(), "{:?}", viewer.renderer_problems);
        true
    }
}

fn frame(harness: &Harness<'_, TestApp>) -> i64 {
    harness.state().viewer.playhead.frame()
}

#[test]
fn play_pause_and_step_with_buttons_and_keys() {
    let mut harness = Studio::new().open();
    harness.get_by_label("Play").click();
    harness.run();
    assert!(harness.state().viewer.playhead.is_playing());
    harness.get_by_label("Pause").click();
    harness.run();
    assert!(!harness.state().viewer.playhead.is_playing());
    harness.get_by_label("One frame forward").click();
    harness.run();
    assert_eq!(frame(&harness), 1);
    for (key, expected) in [(Key::ArrowRight, 2), (Key::ArrowLeft, 1), (Key::End, 99), (Key::Home, 0)] {
        harness.key_press(key);
        harness.run();
        assert_eq!(frame(&harness), expected, "{key:?}");
    }
    harness.key_press(Key::Space);
    harness.run();
    assert!(harness.state().viewer.playhead.is_playing());
    assert!(harness.state().viewer.playhead.looping);
    harness.get_by_label("Loop").click();
    harness.run();
    assert!(!harness.state().viewer.playhead.looping);
}

#[test]
fn a_drag_on_the_ruler_moves_the_playhead_to_where_the_mouse_is() {
    let mut harness = Studio::new().open();
    let ruler = harness.get_by_label("time").rect();
    for (part, expected) in [(0.25, 25), (0.5, 50), (0.75, 75)] {
        let at = pos2(ruler.left() + ruler.width() * part + 0.5, ruler.center().y);
        harness.drag_at(at);
        harness.run();
        harness.drop_at(at);
        harness.run();
        assert_eq!(frame(&harness), expected);
    }
}

#[test]
fn bars_lie_at_their_times_and_a_click_selects_their_object() {
    let mut harness = Studio::new().open();
    let timeline = &harness.state().viewer.timeline;
    let row = timeline.rows.iter().find(|r| r.label == "ada").unwrap();
    let times: Vec<_> =
        row.bars.iter().map(|b| (b.label.as_str(), b.start, b.end, b.fade_in, b.place.line)).collect();
    let secs = Time::from_secs;
    // The walk continues during the fade.
    let expected =
        [("Walk", secs(0.5), secs(2.5), Time::ZERO, 4), ("Wave", secs(2.0), secs(4.0), secs(0.5), 5)];
    assert_eq!(times, expected);
    let cameras: Vec<_> = timeline.rows[0].bars.iter().map(|b| (b.label.as_str(), b.start, b.end)).collect();
    assert_eq!(cameras, [("wide", Time::ZERO, secs(2.0)), ("near", secs(2.0), secs(4.0))]);
    harness.get_by_label("Wave on ada").click();
    harness.run();
    let expected = Selected::Cue { actor: "ada".into(), layer: 0, cue: 1 };
    assert_eq!(harness.state().viewer.selection, Some(expected));
    // The inspector shows it with its line.
    harness.get_by_label("ada: Wave");
    harness.get_by_label_contains("a.rhai:5");
    harness.get_by_label("row floor").click();
    harness.run();
    assert_eq!(harness.state().viewer.selection, Some(Selected::Actor("floor".into())));
    harness.key_press(Key::Escape);
    harness.run();
    assert_eq!(harness.state().viewer.selection, None);
}

#[test]
fn the_free_camera_starts_at_the_scene_camera_and_orbits_with_a_drag() {
    let mut studio = Studio::new();
    let mut harness = studio.open();
    // The icon of the nearer camera would be under the pointer.
    harness.state_mut().viewer.views[0].overlays.icons = false;
    let script_camera = harness.state().viewer.shown().unwrap().snapshot.camera.world_from_view;
    harness.key_press(Key::C);
    harness.run();
    let ViewCamera::Free(orbit) = harness.state().viewer.views[0].camera.clone() else { panic!("not free") };
    assert!((orbit.camera().world_from_view.translation - script_camera.translation).length() < 1e-9);
    let center = harness.get_by_label("picture").rect().center();
    harness.drag_at(center);
    harness.run();
    harness.hover_at(center + vec2(60.0, 20.0));
    harness.run();
    harness.drop_at(center + vec2(60.0, 20.0));
    harness.run();
    let ViewCamera::Free(turned) = harness.state().viewer.views[0].camera.clone() else { panic!("not free") };
    assert!(turned.azimuth < orbit.azimuth && turned.elevation > orbit.elevation);
    assert_eq!((turned.distance, turned.center), (orbit.distance, orbit.center));
    assert!(studio.paint(&mut harness), "it is drawn anew");
    harness.get_by_label("script's camera").click();
    harness.run();
    assert_eq!(harness.state().viewer.views[0].camera.clone(), ViewCamera::Script);
}

#[test]
fn a_faulty_script_keeps_the_last_good_scene_and_reports_the_error() {
    let mut studio = Studio::new();
    let mut harness = studio.open();
    harness.get_by_label("Wave on ada").click();
    harness.run();
    {
        let viewer = &mut harness.state_mut().viewer;
        viewer.playhead.seek(Time::from_secs(2.5));
        viewer.playhead.play(10.0);
    }
    harness.key_press(Key::C);
    harness.run_steps(2);
    let before = (harness.state().viewer.views[0].camera.clone(), harness.state().viewer.selection.clone());
    let faulty = studio.save(&script("").replace("\"Wave\"", "\"Waev\""));
    harness.state_mut().viewer.take_version(faulty);
    harness.run_steps(2);
    harness.get_by_label("faulty: the last good version is shown");
    let viewer = &harness.state().viewer;
    assert!(
        viewer.is_faulty && viewer.problems[0].to_string().contains("Waev") && viewer.problems[0].line == 5
    );
    assert_eq!((viewer.views[0].camera.clone(), viewer.selection.clone()), before);
    assert_eq!((viewer.playhead.frame(), viewer.playhead.is_playing()), (62, true));
    assert!(viewer.timeline.rows.iter().any(|r| r.label == "ada" && r.bars.len() == 2));
    let mended = studio.save(&script("").replace("fade: 0.5", "fade: 0.25"));
    harness.state_mut().viewer.take_version(mended);
    harness.run_steps(2);
    assert!(harness.query_by_label("faulty: the last good version is shown").is_none());
    let viewer = &harness.state().viewer;
    assert_eq!((viewer.views[0].camera.clone(), viewer.selection.clone()), before);
    assert_eq!(viewer.timeline.rows[1].bars[1].fade_in, Time::from_secs(0.25));
    assert_eq!((viewer.playhead.frame(), viewer.playhead.is_playing()), (62, true));
    // A selected object is deselected if the script no longer creates it.
    let without = script("").replace(".then(moves.clip(\"Wave\"), #{ fade: 0.5 })", "");
    let version = studio.save(&without);
    harness.state_mut().viewer.take_version(version);
    assert_eq!(harness.state().viewer.selection, None);
}

#[test]
fn no_frame_is_requested_while_nothing_changes() {
    let mut studio = Studio::new();
    let mut harness = studio.open();
    // The panels have been laid out: from now on no repaint is requested.
    while studio.paint(&mut harness) {
        harness.run();
    }
    harness.run();
    assert!(!studio.paint(&mut harness));
    harness.key_press(Key::ArrowRight);
    harness.run();
    assert!(studio.paint(&mut harness), "shown able to see a change");
    assert!(!studio.paint(&mut harness));
}

#[test]
fn the_tree_filters_by_name_and_closed_panels_reopen() {
    let mut harness = Studio::new().open();
    harness.get_by_label("near").click();
    harness.run();
    assert_eq!(harness.state().viewer.selection, Some(Selected::Camera("near".into())));
    harness.get_by_label("Panels").click();
    harness.run();
    let check = egui::accesskit::Role::CheckBox;
    harness.get_by_role_and_label(check, "Sequencer").click();
    harness.run();
    assert!(harness.query_by_label("time").is_none(), "the sequencer is closed");
    // The menu stays open for the next panel; choosing a layout closes it.
    harness.get_by_role_and_label(check, "Sequencer").click();
    harness.run();
    harness.get_by_label("time");
    harness.get_by_role_and_label(egui::accesskit::Role::Button, "Lighting").click();
    harness.run();
    assert!(harness.query_by_role_and_label(check, "Sequencer").is_none(), "the menu is closed");
    harness.get_by_label("Viewport 2 tab");
}

/// A window moved to a screen of another scale: panels keep their size, the image gets more pixels.
#[test]
fn the_image_is_redrawn_at_each_display_scale() {
    let script = SCRIPT_OF_A_LARGE_STAGE;
    let mut harness = Place::new(script).harness(vec2(1200.0, 800.0));
    let native = |harness: &mut Harness<'static, Place>, scale: f32| {
        let viewport = harness.input_mut().viewports.get_mut(&egui::ViewportId::ROOT).unwrap();
        viewport.native_pixels_per_point = Some(scale);
        harness.run();
        harness.run();
        let rect = harness.get_by_label("picture").rect();
        let viewer = &mut harness.state_mut().viewer;
        let asked = viewer.next_request();
        viewer.views[0].is_waiting = false;
        (rect, viewer.views[0].panel_size, asked.map(|a| a.size))
    };
    let (first, room, size) = native(&mut harness, 1.0);
    let size = size.unwrap();
    for scale in [2.0, 1.0, 1.5, 1.0] {
        let (rect, now, asked) = native(&mut harness, scale);
        let off = (rect.min - first.min).length().max((rect.max - first.max).length());
        assert!(off <= 1.0, "as large in points, up to a pixel: {rect:?} for {first:?}");
        let wanted = room.map(|r| (r as f32 * scale) as i64);
        assert!(
            now.iter().zip(wanted).all(|(n, w)| (i64::from(*n) - w).abs() <= 1),
            "{now:?} for {wanted:?}"
        );
        let asked = asked.expect("an image of its own");
        let wanted = size.map(|s| (s as f32 * scale) as i64);
        assert!(
            asked.iter().zip(wanted).all(|(n, w)| (i64::from(*n) - w).abs() <= 2),
            "{asked:?} for {wanted:?}"
        );
        // The selection and the playhead stay.
        assert_eq!(harness.state().viewer.playhead.frame(), 0);
    }
}

const SCRIPT_OF_A_LARGE_STAGE: &str =
    "stage(#{ size: [3840, 2160], length: 1.0 });\ncast(\"ada\", load(\"choreo:mannequin\"));\n";
