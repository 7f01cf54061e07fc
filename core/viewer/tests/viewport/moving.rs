//! Images while the view moves: fewer pixels where the frame rate needs it, with a note about the reduced quality; and the mouse wheel.

use crate::place::{Desk, Place};
use choreo_motion::Time;
use choreo_viewer::app::Dragging;
use choreo_viewer::geometry::gizmo::{Change, Drag, Handle, Tool};
use choreo_viewer::panels::Panels;
use choreo_viewer::state::selection::Selected;
use choreo_viewer::state::settings::Settings;
use egui::{Event, MouseWheelUnit, Pos2, Rect, Shape, TouchPhase, pos2, vec2};
use egui_kittest::kittest::Queryable;
use glam::{DAffine3, DVec2, DVec3};

const SCRIPT: &str = r##"stage(#{ size: [64, 36], fps: 25, length: 4.0, samples: 1 });
let box_1 = cast("box", shape("box", #{ size: 1.0 })).key("position", [[0.0, [0, 0, 0]], [4.0, [1, 0, 0]]]);
camera("wide").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
effect("motion_blur");
"##;

fn harness_with_script() -> Desk {
    Place::new(SCRIPT).harness(vec2(900.0, 700.0))
}

#[test]
fn an_image_fills_the_viewport_and_shrinks_while_it_plays_too_slowly() {
    let mut desk = harness_with_script();
    let viewer = &mut desk.state_mut().viewer;
    let room = viewer.views[0].panel_size;
    let whole = viewer.next_request().unwrap();
    // 16 : 9, as large as fits, although the script has 64 by 36.
    let expected = (room[0].min(room[1] * 16 / 9), room[1].min(room[0] * 9 / 16));
    assert!(
        whole.size[0].abs_diff(expected.0) <= 1 && whole.size[1].abs_diff(expected.1) <= 1,
        "{:?}",
        whole.size
    );
    assert!(!whole.moving);
    viewer.views[0].is_waiting = false;
    viewer.playhead.play(0.0);
    viewer.reduction.record_duration(90.0, 40.0);
    let half = viewer.next_request().unwrap();
    assert!(half.moving);
    assert!((half.size[0] * 2).abs_diff(whole.size[0]) <= 1, "{:?} of {:?}", half.size, whole.size);
    // The image has full resolution again once the view rests.
    viewer.views[0].is_waiting = false;
    viewer.playhead.pause();
    assert_eq!(viewer.next_request().unwrap().size, whole.size);
}

#[test]
fn the_reduced_quality_note_is_shown_while_the_image_moves() {
    let place = reduced(1.0);
    assert_eq!(place.viewer.shown().unwrap().deferred_parts, ["motion blur"]);
    let mut desk = place.harness(vec2(900.0, 700.0));
    let said = |desk: &Desk| desk.query_all_by_label_contains("no motion blur while moving").next().is_some();
    assert!(said(&desk));
    assert!(desk.query_all_by_label_contains("½ resolution").next().is_some());
    desk.state_mut().viewer.playhead.pause();
    desk.state_mut().paint();
    desk.run();
    assert!(!said(&desk));
    assert!(desk.state().viewer.shown().unwrap().deferred_parts.is_empty());
}

/// Rectangles of the drawn texts that contain `words`.
fn drawn(desk: &Desk, words: &str) -> Vec<Rect> {
    let shapes = desk.output().shapes.iter();
    let texts = shapes.filter_map(|shape| match &shape.shape {
        Shape::Text(text) if text.galley.text().contains(words) => Some(text.visual_bounding_rect()),
        _ => None,
    });
    texts.collect()
}

/// A scene that plays from a time on at half resolution, however fast the image was drawn.
fn reduced(secs: f64) -> Place {
    let mut place = Place::new(SCRIPT);
    place.viewer.views[0].panel_size = [64, 36];
    place.viewer.playhead.seek(Time::from_secs(secs));
    place.viewer.playhead.play(0.0);
    place.paint();
    place.viewer.reduction = Default::default();
    place.viewer.reduction.record_duration(90.0, 40.0);
    place
}

/// A narrow viewport elides the text with …, and a tooltip shows all of it.
#[test]
fn the_reduced_quality_note_is_elided_with_a_tooltip() {
    let mut place = reduced(0.0);
    place.viewer.reduction.dropped = 3;
    let layout = serde_json::json!({
        "right": 0.15, "first": { "tabs": ["Viewport"] }, "second": { "tabs": ["Script"] },
    });
    place.panels = Panels::new(&Settings { layout: Some(layout), ..Settings::default() });
    let mut desk = place.harness(vec2(1200.0, 500.0));
    let image = desk.state().viewer.views[0].image_rect;
    let texts = drawn(&desk, "½ resolution");
    assert_eq!(texts.len(), 1);
    assert!(texts[0].right() <= image[2], "{texts:?} in {image:?}");
    desk.hover_at(pos2(image[0] + 20.0, image[1] + 10.0));
    desk.run_steps(8);
    assert_eq!(drawn(&desk, "3 frames dropped").len(), 2, "the text and the hint");
}

/// The note ends before the axes, also in a small window.
#[test]
fn the_reduced_quality_note_does_not_cover_the_axes() {
    let mut place = reduced(0.0);
    place.viewer.reduction.dropped = 3;
    let layout = serde_json::json!({
        "right": 0.3, "first": { "tabs": ["Viewport"] }, "second": { "tabs": ["Script"] },
    });
    place.panels = Panels::new(&Settings { layout: Some(layout), ..Settings::default() });
    let desk = place.harness(vec2(900.0, 600.0));
    let texts = drawn(&desk, "no motion blur while moving");
    assert_eq!(texts.len(), 1);
    for side in ["Front", "Back", "Right", "Left", "Top", "Bottom"] {
        let end = desk.get_by_label(&format!("{side} view")).rect();
        assert!(!texts[0].expand(3.0).intersects(end), "{side}: {end:?}, {texts:?}");
    }
}

/// The values of a drag are shown next to the note about the reduced quality.
#[test]
fn drag_values_are_shown_beside_the_reduced_quality_note() {
    let mut place = reduced(0.0);
    place.viewer.selection = Some(Selected::Actor("box".into()));
    let (tool, handle) = (Tool::Move, Handle::Axis(0));
    let drag = Drag { tool, handle, world_from_model: DAffine3::IDENTITY, from: DVec2::ZERO };
    place.viewer.dragging = Some(Dragging { actor: "box".into(), drag, change: Change::Move(DVec3::X) });
    let desk = place.harness(vec2(900.0, 700.0));
    let (lacks, numbers) = (drawn(&desk, "½ resolution"), drawn(&desk, "+1.000 +0.000 +0.000 m"));
    assert_eq!((lacks.len(), numbers.len()), (1, 1));
    assert!(!lacks[0].expand(3.0).intersects(numbers[0]), "{lacks:?} {numbers:?}");
}

fn turn(desk: &mut Desk, at: Pos2) {
    desk.hover_at(at);
    desk.run();
    let (unit, delta) = (MouseWheelUnit::Point, vec2(0.0, 50.0));
    let modifiers = egui::Modifiers::NONE;
    desk.event(Event::MouseWheel { unit, delta, phase: TouchPhase::Move, modifiers });
    desk.run_steps(60);
}

#[test]
fn the_wheel_zooms_the_sequencer_and_scrolls_over_the_names() {
    let mut desk = harness_with_script();
    let ruler = desk.get_by_label("time").rect();
    let before = desk.state().viewer.visible_span;
    turn(&mut desk, pos2(ruler.left() - 40.0, ruler.bottom() + 30.0));
    assert_eq!(desk.state().viewer.visible_span, before);
    let at = pos2(ruler.left() + ruler.width() * 0.25, ruler.bottom() + 30.0);
    turn(&mut desk, at);
    let after = desk.state().viewer.visible_span;
    assert!(after.to - after.from < (before.to - before.from) * 0.9, "{after:?}");
    // The time under the pointer stays in place.
    let under = |span: choreo_viewer::state::span::Span| span.from + 0.25 * (span.to - span.from);
    assert!((under(after) - under(before)).abs() < 1e-3, "{after:?}");
}

const REACHED: &str = r##"stage(#{ size: [64, 36], fps: 25, length: 4.0, samples: 1 });
let moves = load("choreo:mannequin");
let ball = cast("ball", shape("sphere", #{ size: 0.1 })).at(0.3, 1.2, 0.5);
let cap = cast("cap", shape("box", #{ size: 0.1 })).at(0.0, 0.3, 0.0).attach(ball);
let ada = cast("ada", moves);
ada.reach("RightHand", ball, #{ at: [0.0, 0.05, 0.0] });
ada.look_at(ball);
camera("wide").follow(ball, [0.0, 0.0, 4.0]);
"##;

fn actors(place: &mut Place) -> Vec<choreo_stage::ActorState> {
    place.paint().unwrap();
    place.viewer.shown().unwrap().snapshot.actors.clone()
}

#[test]
fn constraints_and_attached_actors_follow_an_actor_during_a_drag() {
    let mut place = Place::new(REACHED);
    place.viewer.views[0].panel_size = [64, 36];
    // The constraints have faded in.
    place.viewer.playhead.seek(Time::from_secs(1.0));
    let before = actors(&mut place);
    let camera = place.viewer.shown().unwrap().snapshot.camera;
    let by = DVec3::new(-0.2, 0.25, 0.1);
    let drag = Drag {
        tool: Tool::Move,
        handle: Handle::Middle,
        world_from_model: before[0].world_from_model,
        from: DVec2::ZERO,
    };
    place.viewer.dragging = Some(Dragging { actor: "ball".into(), drag, change: Change::Move(by) });
    let dragged = actors(&mut place);
    let seen = place.viewer.shown().unwrap().snapshot.camera;
    assert_eq!(seen, camera, "the image keeps the camera with which the drag began");
    place.reload_with(&REACHED.replace(".at(0.3, 1.2, 0.5)", ".at(0.1, 1.45, 0.6)"));
    let placed = actors(&mut place);
    assert_eq!(dragged.len(), placed.len());
    for (dragged, placed) in dragged.iter().zip(&placed) {
        assert!(dragged.world_from_model.abs_diff_eq(placed.world_from_model, 1e-6));
        assert_eq!(dragged.model_from_joint.len(), placed.model_from_joint.len());
        let joints = dragged.model_from_joint.iter().zip(&placed.model_from_joint);
        assert!(joints.into_iter().all(|(a, b)| a.abs_diff_eq(*b, 1e-6)));
    }
    let turned = before[2].model_from_joint.iter().zip(&placed[2].model_from_joint);
    assert!(turned.into_iter().any(|(a, b)| !a.abs_diff_eq(*b, 1e-2)), "the arm follows the ball");
}
