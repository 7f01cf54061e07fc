//! Axes in a corner of a viewport; a click on an end looks along that axis. A menu offers the same views.

use super::hint::Hint;
use super::overlay::{X_COLOR, Y_COLOR, Z_COLOR, to_pos2};
use crate::app::Viewer;
use crate::state::orbit::Orbit;
use crate::state::side::Side;
use crate::state::view::ViewCamera;
use choreo_asset::Projection;
use egui::{Align2, Color32, FontId, Rect, Sense, Stroke, Ui, vec2};
use glam::{DAffine3, DVec2};

/// Length of an axis, and radius of its ends, points.
const AXIS_LENGTH: f32 = 30.0;
const AXIS_END_RADIUS: f32 = 8.0;
/// Label of the menu if the view is not along an axis.
const NO_SIDE_LABEL: &str = "View";

/// Rectangle of the axes, if they are shown.
pub(super) fn axes_rect(viewer: &Viewer, index: usize, place: Rect) -> Option<Rect> {
    let has_room = place.width() >= 200.0 && place.height() >= 120.0;
    let side = 2.0 * (AXIS_LENGTH + AXIS_END_RADIUS);
    let corner = place.right_top() + vec2(-10.0 - side, 10.0);
    let is_shown = viewer.views[index].overlays.axes && has_room;
    is_shown.then(|| Rect::from_min_size(corner, vec2(side, side)))
}

/// Draws the axes and handles clicks. Returns whether the mouse is over an end.
pub(super) fn show(
    ui: &Ui,
    viewer: &mut Viewer,
    index: usize,
    place: Rect,
    world_from_view: &DAffine3,
) -> bool {
    let Some(middle) = axes_rect(viewer, index, place).map(|own| own.center()) else { return false };
    let painter = ui.painter_at(place);
    let view_from_world = world_from_view.matrix3.inverse();
    let mut ends: Vec<_> =
        Side::ALL.into_iter().map(|side| (side, view_from_world * side.direction())).collect();
    // Nearer ends are drawn over farther ones.
    ends.sort_by(|a, b| a.1.z.total_cmp(&b.1.z));
    let mut is_hovered = false;
    for (side, toward) in ends {
        let at = to_pos2(
            DVec2::new(f64::from(middle.x), f64::from(middle.y))
                + DVec2::new(toward.x, -toward.y) * f64::from(AXIS_LENGTH),
        );
        let (letter, color) = match side {
            Side::Right | Side::Left => ("X", X_COLOR),
            Side::Top | Side::Bottom => ("Y", Y_COLOR),
            Side::Front | Side::Back => ("Z", Z_COLOR),
        };
        let positive = matches!(side, Side::Right | Side::Top | Side::Front);
        let id = ui.id().with(("axis", index, side.name()));
        let response = ui.interact(
            Rect::from_center_size(at, vec2(2.0 * AXIS_END_RADIUS, 2.0 * AXIS_END_RADIUS)),
            id,
            Sense::click(),
        );
        response.widget_info(|| {
            egui::WidgetInfo::labeled(egui::WidgetType::Button, true, format!("{} view", side.name()))
        });
        is_hovered |= response.hovered();
        if positive {
            painter.line_segment([middle, at], Stroke::new(2.0, color));
            painter.circle_filled(at, AXIS_END_RADIUS, color);
            painter.text(at, Align2::CENTER_CENTER, letter, FontId::proportional(11.0), Color32::BLACK);
        } else {
            painter.circle_filled(at, AXIS_END_RADIUS - 1.5, color.gamma_multiply(0.35));
            painter.circle_stroke(at, AXIS_END_RADIUS - 1.5, Stroke::new(1.5, color));
        }
        if response.hovered() {
            painter.circle_stroke(at, AXIS_END_RADIUS + 2.0, Stroke::new(1.5, Color32::WHITE));
        }
        if response.hint(format!("{} view, orthographic", side.name())).clicked() {
            viewer.active_view = index;
            // A second click on the same end looks from the opposite side, whose end is hidden behind it.
            let same = free_orbit(viewer, index).as_ref().and_then(Side::of) == Some(side);
            if let Some(orbit) = viewer.free_camera(index) {
                orbit.look_from(if same { side.opposite() } else { side });
            }
        }
    }
    is_hovered
}

fn free_orbit(viewer: &Viewer, index: usize) -> Option<Orbit> {
    match &viewer.views[index].camera {
        ViewCamera::Free(orbit) | ViewCamera::Follow { orbit, .. } => Some(*orbit),
        _ => None,
    }
}

/// Label of the menu: the side of the present view.
pub(super) fn menu_label(viewer: &Viewer, index: usize) -> &'static str {
    free_orbit(viewer, index).as_ref().and_then(Side::of).map_or(NO_SIDE_LABEL, Side::name)
}

/// All labels of the menu.
pub(super) fn menu_labels() -> impl Iterator<Item = &'static str> {
    [NO_SIDE_LABEL].into_iter().chain(Side::ALL.map(Side::name))
}

pub(super) fn show_view_menu(ui: &mut Ui, viewer: &mut Viewer, index: usize) {
    let orbit = free_orbit(viewer, index);
    let side = orbit.as_ref().and_then(Side::of);
    let flat = orbit.is_some_and(|o| matches!(o.projection, Projection::Orthographic { .. }));
    if ui.selectable_label(orbit.is_some() && !flat, "Perspective").clicked()
        && let Some(orbit) = viewer.free_camera(index)
    {
        orbit.look_in_perspective();
    }
    for listed_side in Side::ALL {
        if ui.selectable_label(side == Some(listed_side), listed_side.name()).clicked()
            && let Some(orbit) = viewer.free_camera(index)
        {
            orbit.look_from(listed_side);
        }
    }
}
