//! The picture, and the camera that the mouse moves.

use crate::app::{Resolution, ViewCamera, Viewer};
use egui::{Color32, Key, PointerButton, Rect, Sense, TextureId, Ui, Vec2, pos2};
use glam::{DVec2, DVec3};

/// Metres a second on foot.
const PACE: f64 = 3.0;

pub fn toggle_camera(viewer: &mut Viewer) {
    match viewer.camera {
        ViewCamera::Script => drop(viewer.free_camera()),
        ViewCamera::Free(_) => viewer.camera = ViewCamera::Script,
    }
}

/// The free camera turns around what is selected.
pub fn focus(viewer: &mut Viewer) {
    let Some(point) = viewer.point_of_interest() else { return };
    if let Some(orbit) = viewer.free_camera() {
        orbit.center = point;
        orbit.distance = orbit.distance.clamp(2.0, 8.0);
    }
}

pub fn show(ui: &mut Ui, viewer: &mut Viewer, picture: Option<TextureId>) {
    ui.horizontal(|ui| {
        let free = viewer.camera != ViewCamera::Script;
        if ui.selectable_label(!free, "script's camera").clicked() {
            viewer.camera = ViewCamera::Script;
        }
        if ui.selectable_label(free, "free camera").clicked() && !free {
            toggle_camera(viewer);
        }
        ui.separator();
        let full = viewer.resolution == Resolution::Full;
        if ui.selectable_label(full, "full size").on_hover_text("as many pixels as render gives it").clicked()
        {
            viewer.resolution = if full { Resolution::Fitted } else { Resolution::Full };
        }
    });
    let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Image, true, "picture"));
    let pixels = ui.ctx().pixels_per_point();
    viewer.room = [rect.width(), rect.height()].map(|points| (points * pixels).round().max(1.0) as u32);
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 0.0, Color32::from_gray(24));
    let size = viewer.shown.as_ref().map(|shown| shown.size);
    let Some((texture, size)) = picture.zip(size) else {
        let text = if viewer.faulty { "nothing to show yet: see Messages" } else { "…" };
        let font = egui::TextStyle::Body.resolve(ui.style());
        painter.text(rect.center(), egui::Align2::CENTER_CENTER, text, font, Color32::GRAY);
        return;
    };
    let place = placed(rect, size, pixels);
    let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    painter.image(texture, place, whole, Color32::WHITE);
    mouse(ui, viewer, &response, place.height());
}

/// In the middle; pixel on pixel where there is room, else as large as it can be. Edges lie on the screen's pixels.
fn placed(room: Rect, size: [u32; 2], pixels_per_point: f32) -> Rect {
    let size = Vec2::new(size[0] as f32, size[1] as f32) / pixels_per_point;
    let scale = (room.width() / size.x).min(room.height() / size.y).min(1.0);
    let size = size * scale;
    let on_pixels = |v: f32| (v * pixels_per_point).round() / pixels_per_point;
    let corner = room.center() - size / 2.0;
    Rect::from_min_size(pos2(on_pixels(corner.x), on_pixels(corner.y)), size)
}

fn mouse(ui: &Ui, viewer: &mut Viewer, response: &egui::Response, height: f32) {
    let by = response.drag_delta();
    let by = DVec2::new(f64::from(by.x), f64::from(by.y)) / f64::from(height.max(1.0));
    let shift = ui.input(|i| i.modifiers.shift);
    if by != DVec2::ZERO {
        let pans = response.dragged_by(PointerButton::Middle) || shift;
        let turns = response.dragged_by(PointerButton::Primary) && !shift;
        if let Some(orbit) = viewer.free_camera() {
            match (pans, turns) {
                (true, _) => orbit.pan(by),
                (_, true) => orbit.turn(by),
                _ => orbit.zoom(-by.y * 10.0),
            }
        }
    }
    if !response.hovered() {
        return;
    }
    let notches = ui.input(|i| f64::from(i.smooth_scroll_delta.y) / 50.0);
    if notches != 0.0
        && let Some(orbit) = viewer.free_camera()
    {
        orbit.zoom(notches);
    }
    let held = |a, b| ui.input(|i| f64::from(i8::from(i.key_down(a)) - i8::from(i.key_down(b))));
    let step = DVec3::new(held(Key::D, Key::A), held(Key::E, Key::Q), held(Key::W, Key::S));
    if step != DVec3::ZERO && !ui.ctx().egui_wants_keyboard_input() {
        let secs = ui.input(|i| f64::from(i.stable_dt.min(0.1)));
        if let Some(orbit) = viewer.free_camera() {
            orbit.walk(step * PACE * secs);
        }
        ui.ctx().request_repaint();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_picture_lies_on_whole_pixels_and_keeps_its_shape() {
        let room = Rect::from_min_max(pos2(10.3, 20.7), pos2(1033.9, 811.1));
        for (size, pixels) in [([1280, 720], 1.0), ([640, 361], 1.0), ([1280, 720], 1.5)] {
            let place = placed(room, size, pixels);
            for edge in [place.min.x, place.min.y] {
                assert!((edge * pixels - (edge * pixels).round()).abs() < 1e-3);
            }
            let shape = place.width() / place.height();
            assert!((shape - size[0] as f32 / size[1] as f32).abs() < 1e-3);
            assert!(place.width() <= size[0] as f32 / pixels + 1e-3, "never blown up");
        }
    }
}
