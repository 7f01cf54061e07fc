//! Joints over the image: picking where skeletons are shown, motion trails, and onion skins of the selected actor.

use super::canvas::Canvas;
use super::overlay::{draw_line, to_pos2};
use crate::app::Viewer;
use crate::geometry::projection::ViewProjection;
use crate::state::selection::Selected;
use crate::state::trail::{JointRef, Trail};
use choreo_motion::Time;
use egui::{Color32, Painter, Stroke, Ui};
use glam::{DVec2, DVec3};

/// Distance within which the mouse picks a joint, points.
const PICK_RADIUS: f64 = 7.0;
/// Offsets of the onion skins from the playhead, frames.
const ONION_SKIN_OFFSETS: [i64; 4] = [-10, -5, 5, 10];
pub(crate) const PAST_COLOR: Color32 = Color32::from_rgb(0x5a, 0xa9, 0xf0);
pub(super) const FUTURE_COLOR: Color32 = Color32::from_rgb(0xf0, 0x9a, 0x4a);
const PRESENT_COLOR: Color32 = Color32::from_rgb(0xff, 0xe0, 0x70);

/// Draws the overlays and handles the mouse. Returns whether the mouse is over a joint.
pub(super) fn show(ui: &Ui, viewer: &mut Viewer, canvas: &Canvas) -> bool {
    let projection = &canvas.projection;
    let overlays = viewer.views[canvas.index].overlays;
    let painter = canvas.painter(ui);
    let selected = viewer.selection.as_ref().and_then(Selected::actor).map(str::to_string);
    viewer.selected_joint.take_if(|joint| selected.as_ref() != Some(&joint.actor));
    if let (Some(actor), Some(scene)) = (&selected, viewer.scene.clone())
        && (overlays.trail || overlays.onion_skins)
    {
        let context = ui.ctx().clone();
        if let Some(trail) = viewer.trails.of(&scene, actor, move || context.request_repaint()) {
            let now =
                viewer.views[canvas.index].shown.as_ref().map_or(viewer.playhead.time(), |shown| shown.time);
            if overlays.onion_skins {
                let parents = scene.stage.actors.iter().find(|a| a.name == *actor);
                let parents = parents.map_or(&[][..], |a| a.asset.skeleton.parents());
                draw_onion_skins(
                    &painter,
                    projection,
                    &trail,
                    now,
                    parents,
                    viewer.playhead.fps().time_of(1),
                );
            }
            if overlays.trail {
                draw_trail(
                    &painter,
                    projection,
                    &trail,
                    now,
                    viewer.selected_joint.as_ref().map_or(0, |joint| joint.joint),
                );
            }
        }
    }
    if overlays.skeletons { pick_joint(viewer, canvas, &painter) } else { false }
}

/// Shows the name of the joint under the mouse; a click selects it.
fn pick_joint(viewer: &mut Viewer, canvas: &Canvas, painter: &Painter) -> bool {
    let shown = &viewer.views[canvas.index].shown;
    let (Some(scene), Some(shown)) = (viewer.scene.clone(), shown) else { return false };
    let at_joint = |actor: usize, joint: usize| -> Option<DVec2> {
        let state = shown.snapshot.actors.get(actor).filter(|state| state.visible)?;
        let at = state.model_from_joint.get(joint)?.translation.as_dvec3();
        canvas.projection.project_point(state.world_from_model.transform_point3(at))
    };
    let names = &scene.stage.actors;
    if let Some(JointRef { actor, joint }) = &viewer.selected_joint
        && let Some(number) = names.iter().position(|a| a.name == *actor)
        && let Some(at) = at_joint(number, *joint)
    {
        painter.circle_stroke(to_pos2(at), 6.0, Stroke::new(2.0, PRESENT_COLOR));
    }
    let Some(mouse) = canvas.hover_position() else { return false };
    let mut best: Option<(f64, usize, usize)> = None;
    for (number, actor) in names.iter().enumerate().filter(|(_, a)| !viewer.toggles.locked.contains(&a.name))
    {
        for joint in 0..actor.asset.skeleton.len() {
            let distance = at_joint(number, joint).map_or(f64::INFINITY, |at| (at - mouse).length());
            if distance <= PICK_RADIUS && best.is_none_or(|(least, ..)| distance < least) {
                best = Some((distance, number, joint));
            }
        }
    }
    let Some((_, number, joint)) = best else { return false };
    let actor = &names[number];
    let name = actor.asset.skeleton.names().get(joint).cloned().unwrap_or_default();
    if let Some(at) = at_joint(number, joint) {
        painter.circle_filled(to_pos2(at), 4.5, PRESENT_COLOR);
    }
    canvas.response.clone().on_hover_text_at_pointer(format!("{}: {name}", actor.name));
    if canvas.response.clicked() {
        viewer.selection = Some(Selected::Actor(actor.name.clone()));
        viewer.selected_joint = Some(JointRef { actor: actor.name.clone(), joint });
    }
    true
}

/// Draws the trail of a joint: a line through all frames, with a dot for each and a larger one for the present frame.
fn draw_trail(painter: &Painter, projection: &ViewProjection, trail: &Trail, now: Time, joint: usize) {
    let at = |index: usize| -> Option<DVec3> { trail.frames.get(index)?.1.get(joint).copied() };
    for index in 0..trail.frames.len() {
        let Some(here) = at(index) else { continue };
        let color = if trail.frames[index].0 < now { PAST_COLOR } else { FUTURE_COLOR };
        if let Some(next) = at(index + 1) {
            draw_line(painter, projection, here, next, Stroke::new(1.5, color));
        }
        if let Some(dot) = projection.project_point(here) {
            painter.circle_filled(to_pos2(dot), 1.8, color);
        }
    }
    if let Some(dot) = trail.nearest_frame(now).and_then(at).and_then(|at| projection.project_point(at)) {
        painter.circle_filled(to_pos2(dot), 4.0, PRESENT_COLOR);
    }
}

/// Draws skeletons some frames before and after the present one; farther ones are fainter.
fn draw_onion_skins(
    painter: &Painter,
    projection: &ViewProjection,
    trail: &Trail,
    now: Time,
    parents: &[Option<u32>],
    frame: Time,
) {
    for skin in ONION_SKIN_OFFSETS {
        let time = Time(now.0 + skin * frame.0);
        let ends = trail.frames.first().zip(trail.frames.last());
        let Some(index) =
            trail.nearest_frame(time).filter(|_| ends.is_some_and(|(a, b)| a.0 <= time && time <= b.0))
        else {
            continue;
        };
        let joints = &trail.frames[index].1;
        let color = if skin < 0 { PAST_COLOR } else { FUTURE_COLOR };
        let stroke = Stroke::new(2.0, color.gamma_multiply(if skin.abs() > 5 { 0.35 } else { 0.65 }));
        for (joint, parent) in parents.iter().enumerate() {
            let ends = joints.get(joint).zip(parent.and_then(|parent| joints.get(parent as usize)));
            if let Some((to, from)) = ends {
                draw_line(painter, projection, *from, *to, stroke);
            }
        }
    }
}
