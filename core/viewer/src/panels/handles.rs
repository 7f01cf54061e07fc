//! Gizmo of the selected actor in a viewport: draws and drags it.

use super::canvas::Canvas;
use super::gesture;
use super::overlay::{X_COLOR, Y_COLOR, Z_COLOR, draw_line, to_pos2};
use crate::app::{Dragging, Viewer};
use crate::geometry::gizmo::{ARM_LENGTH, Change, Drag, Handle, Tool, arm_direction, handle_at, ring_points};
use crate::geometry::projection::ViewProjection;
use crate::state::selection::{Selected, actor};
use egui::{Color32, Painter, Rect, Stroke, StrokeKind, Ui, vec2};
use glam::{DAffine3, DVec2};

const AXIS_COLORS: [Color32; 3] = [X_COLOR, Y_COLOR, Z_COLOR];

/// Draws the gizmo and handles the mouse. Returns whether the mouse is over it or drags it.
pub(super) fn show(ui: &Ui, viewer: &mut Viewer, canvas: &Canvas) -> bool {
    let Some(Selected::Actor(name)) = viewer.selection.clone() else { return false };
    let (Some(scene), Some(shown)) = (&viewer.scene, &viewer.views[canvas.index].shown) else { return false };
    if viewer.toggles.locked.contains(&name) {
        return false;
    }
    let state = actor(&scene.stage, &name).and_then(|i| shown.snapshot.actors.get(i)).filter(|s| s.visible);
    let Some(world_from_model) = state.map(|s| s.world_from_model) else { return false };
    let dragging = viewer.dragging.as_ref().filter(|d| d.actor == name).map(|d| d.drag);
    let Canvas { response, projection, .. } = canvas;
    let at = canvas.pointer_position();
    let hovered_handle = match dragging {
        Some(drag) => Some(drag.handle),
        None => at.and_then(|at| handle_at(viewer.tool, &world_from_model, projection, at)),
    };
    let painter = canvas.painter(ui);
    draw_gizmo(&painter, viewer.tool, &world_from_model, hovered_handle, projection);
    if let Some(from) = canvas.drag_start_position(ui)
        && let Some(handle) = handle_at(viewer.tool, &world_from_model, projection, from)
    {
        let drag = Drag { tool: viewer.tool, handle, world_from_model, from };
        viewer.dragging = Some(Dragging { actor: name.clone(), drag, change: Change::none(viewer.tool) });
    }
    let in_steps = gesture::modifiers(ui).command;
    let Some(dragging) = viewer.dragging.as_mut().filter(|d| d.actor == name) else { return false };
    if let Some(at) = at.filter(|_| response.dragged()) {
        dragging.change = dragging.drag.change(projection, at, in_steps);
    }
    let text = change_text(&dragging.change);
    // The text about reduced quality is above.
    let corner = canvas.image_rect.left_top() + vec2(8.0, 8.0 + super::viewport::QUALITY_NOTE_HEIGHT);
    painter.text(corner, egui::Align2::LEFT_TOP, text, egui::FontId::monospace(13.0), Color32::WHITE);
    if ui.input(|i| i.key_pressed(egui::Key::Escape)) {
        viewer.dragging = None;
    } else if response.drag_stopped() {
        let change = dragging.change;
        // The object stays at its new transform until the reload shows it.
        if change == Change::none(dragging.drag.tool) {
            viewer.dragging = None;
        } else {
            viewer.edit(|v| v.change_actor(&name, change));
            if viewer.message.is_some() {
                viewer.dragging = None;
            }
        }
    }
    true
}

fn change_text(change: &Change) -> String {
    match change {
        Change::Move(by) => {
            let [x, y, z] = by.to_array().map(|v| super::rounded(v, 1e3));
            format!("{x:+.3} {y:+.3} {z:+.3} m")
        }
        Change::Turn(by) => {
            let degrees = 2.0 * libm::atan2(by.x + by.y + by.z, by.w).to_degrees();
            format!("{degrees:+.1}°")
        }
        Change::Scale(by) => format!("× {:.3} {:.3} {:.3}", by.x, by.y, by.z),
    }
}

fn draw_gizmo(
    painter: &Painter,
    tool: Tool,
    world_from_model: &DAffine3,
    hovered_handle: Option<Handle>,
    projection: &ViewProjection,
) {
    let center = world_from_model.translation;
    let length = ARM_LENGTH * projection.metres_per_point(center);
    let Some(middle) = projection.project_point(center) else { return };
    for (axis, color) in AXIS_COLORS.into_iter().enumerate() {
        let is_hot = hovered_handle == Some(Handle::Axis(axis));
        let color = if is_hot { Color32::from_rgb(0xff, 0xe0, 0x70) } else { color };
        let stroke = Stroke::new(if is_hot { 3.5 } else { 2.5 }, color);
        if tool == Tool::Turn {
            let points: Vec<_> = ring_points(center, axis, length).collect();
            points.windows(2).for_each(|w| draw_line(painter, projection, w[0], w[1], stroke));
            continue;
        }
        let tip = center + arm_direction(tool, axis, world_from_model) * length;
        draw_line(painter, projection, center, tip, stroke);
        let Some(at) = projection.project_point(tip) else { continue };
        if tool == Tool::Scale {
            painter.rect_filled(Rect::from_center_size(to_pos2(at), vec2(10.0, 10.0)), 1.0, color);
        } else {
            let along = (at - middle).normalize_or_zero() * 11.0;
            let across = DVec2::new(-along.y, along.x) * 0.45;
            let corners = [at + along, at + across, at - across].map(to_pos2).to_vec();
            painter.add(egui::Shape::convex_polygon(corners, color, Stroke::NONE));
        }
    }
    if tool != Tool::Turn {
        let color = if hovered_handle == Some(Handle::Middle) {
            Color32::from_rgb(0xff, 0xe0, 0x70)
        } else {
            Color32::WHITE
        };
        let square = Rect::from_center_size(to_pos2(middle), vec2(11.0, 11.0));
        painter.rect_stroke(square, 1.0, Stroke::new(2.0, color), StrokeKind::Inside);
    }
}
