//! Viewport: the image, the camera moved by the mouse, and picking.

use super::assets::ModelDrag;
use super::canvas::Canvas;
use super::hint::Hint;
use super::toolbar::Toolbar;
use super::{axes, handles, icons, overlay, scene_icons, trails};
use crate::app::Viewer;
use crate::geometry::gizmo::Tool;
use crate::geometry::picking;
use crate::geometry::projection::ViewProjection;
use crate::state::dropped_models::DroppedModels;
use crate::state::selection::{Selected, actor};
use crate::state::view::{Resolution, ViewCamera};
use egui::{Color32, Key, PointerButton, Rect, Sense, Stroke, StrokeKind, TextureId, Ui, Vec2, pos2};
use glam::{DVec2, DVec3};

/// Walking speed, metres per second.
const WALKING_SPEED: f64 = 3.0;
/// Height of the text at the top of an image about its reduced quality, points.
pub(super) const QUALITY_NOTE_HEIGHT: f32 = 22.0;

pub(crate) fn toggle_camera(viewer: &mut Viewer) {
    let active = viewer.active_view.min(viewer.views.len() - 1);
    match viewer.view().camera {
        ViewCamera::Script => drop(viewer.free_camera(active)),
        _ => viewer.view_mut().camera = ViewCamera::Script,
    }
}

/// Centers the orbit of the free camera on the selection.
pub(super) fn focus_selection(viewer: &mut Viewer) {
    let Some(point) = viewer.point_of_interest() else { return };
    let active = viewer.active_view.min(viewer.views.len() - 1);
    if let Some(orbit) = viewer.free_camera(active) {
        orbit.center = point;
        orbit.distance = orbit.distance.clamp(2.0, 8.0);
    }
}

/// Saves the next image of the active viewport next to the script: `NAME_12.png`, numbered by frame.
pub(super) fn request_screenshot(viewer: &mut Viewer) {
    let folder = viewer.path.as_ref().and_then(|p| p.parent()).unwrap_or(std::path::Path::new(""));
    let stem = viewer.name.rsplit_once('.').map_or(viewer.name.as_str(), |(stem, _)| stem).to_string();
    viewer.screenshot = Some(folder.join(format!("{stem}_{}.png", viewer.playhead.frame())));
    // The frame is requested again, so that there is an image to save.
    viewer.view_mut().requested = None;
}

pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer, index: usize, frame_texture: Option<TextureId>) {
    show_toolbar(ui, viewer, index);
    let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
    let name = if index == 0 { "picture".to_string() } else { format!("image {}", index + 1) };
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Image, true, name.clone()));
    if response.hovered() || response.clicked() || response.dragged() {
        viewer.active_view = index;
    }
    let pixels = ui.ctx().pixels_per_point();
    let view = &mut viewer.views[index];
    view.is_visible = true;
    view.panel_size = [rect.width(), rect.height()].map(|points| (points * pixels).round().max(1.0) as u32);
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 0.0, Color32::from_gray(24));
    let size = view.shown.as_ref().map(|shown| shown.size);
    let Some((texture, size)) = frame_texture.zip(size) else {
        let first = viewer.problems.first().filter(|_| viewer.is_faulty);
        let text = first.map_or("…".to_string(), |problem| format!("nothing to show yet\n\n{problem}"));
        let font = egui::TextStyle::Body.resolve(ui.style());
        let galley = painter.layout(text, font, Color32::from_gray(190), rect.width() - 40.0);
        painter.galley(rect.center() - galley.size() / 2.0, galley, Color32::GRAY);
        return;
    };
    if let Some(model) = response.dnd_release_payload::<ModelDrag>()
        && let Some(at) = ui.ctx().pointer_interact_pos().and_then(|at| super::drop::ground_point(viewer, at))
    {
        viewer.dropped_models = Some(DroppedModels { files: vec![model.0.clone()], at, beside: false });
    }
    viewer.is_scrubbing |= response.dragged();
    let fills_panel = viewer.views[index].resolution == Resolution::Fitted;
    let place = image_rect(rect, size, pixels, fills_panel);
    viewer.views[index].image_rect = [place.left(), place.top(), place.right(), place.bottom()];
    let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    painter.image(texture, place, whole, Color32::WHITE);
    if viewer.is_faulty {
        // A border shows that the script has an error, and that the image is of an earlier version.
        let stroke = Stroke::new(3.0, ui.visuals().error_fg_color);
        painter.rect_stroke(place, 0.0, stroke, StrokeKind::Inside);
    }
    draw_quality_note(ui, viewer, index, place);
    let camera = viewer.scene.as_ref().and_then(|scene| viewer.views[index].displayed_camera(&scene.stage));
    if let Some(camera) = camera {
        let vector = |x: f32, y: f32| DVec2::new(f64::from(x), f64::from(y));
        let corner = vector(place.left(), place.top());
        let projection = ViewProjection::new(&camera, corner, vector(place.width(), place.height()));
        let canvas = Canvas { index, response: &response, image_rect: place, projection };
        overlay::show(ui, viewer, &canvas);
        let is_over_axes = axes::show(ui, viewer, index, place, &camera.world_from_view);
        let is_over_icon = scene_icons::show(ui, viewer, &canvas);
        let is_over_joint = trails::show(ui, viewer, &canvas);
        let drags_icon = viewer.dragged_icon.is_some();
        let is_over_gizmo = !drags_icon && handles::show(ui, viewer, &canvas);
        if is_over_gizmo || viewer.dragged_icon.is_some() {
            return;
        }
        let is_over_overlay = is_over_axes || is_over_icon || is_over_joint;
        if let Some(at) = canvas.click_position().filter(|_| !is_over_overlay) {
            pick_at(viewer, index, &canvas.projection, at);
        }
    }
    handle_mouse(ui, viewer, index, &response, place.height());
}

fn show_toolbar(ui: &mut Ui, viewer: &mut Viewer, index: usize) {
    ui.horizontal(|ui| {
        let mut bar = Toolbar::new(("viewport", index));
        let free = matches!(viewer.views[index].camera, ViewCamera::Free(_) | ViewCamera::Follow { .. });
        let script = viewer.views[index].camera == ViewCamera::Script;
        bar.add_toggle(script, "script's camera", "", move |viewer: &mut Viewer| {
            viewer.views[index].camera = ViewCamera::Script;
        });
        add_camera_menu(&mut bar, viewer, index);
        bar.add_toggle(free, "free camera", "", move |viewer| {
            if !free {
                let _ = viewer.free_camera(index);
            }
        });
        add_script_menu(&mut bar, viewer, index);
        add_follow_toggle(&mut bar, viewer, index);
        let side = axes::menu_label(viewer, index);
        bar.add_menu(side, "", move |ui, viewer| axes::show_view_menu(ui, viewer, index));
        bar.reserve_width_for(axes::menu_labels());
        bar.add_separator();
        let full = viewer.views[index].resolution == Resolution::Full;
        let hint = "show as many pixels as the rendered image has";
        bar.add_icon_toggle(icons::FRAME_CORNERS, full, "full size", hint, move |viewer| {
            viewer.views[index].resolution = if full { Resolution::Fitted } else { Resolution::Full };
        });
        bar.add_menu("Show", "", move |ui, viewer| {
            for (_, name, shown) in viewer.views[index].overlays.all() {
                ui.checkbox(shown, name);
            }
        });
        bar.keep_menu_open();
        bar.add_separator();
        for (tool, icon, name, key) in [
            (Tool::Move, icons::ARROWS_OUT_CARDINAL, "Move", "G"),
            (Tool::Turn, icons::ARROWS_CLOCKWISE, "Turn", "R"),
            (Tool::Scale, icons::RESIZE, "Scale", "B"),
        ] {
            bar.add_icon_toggle(icon, viewer.tool == tool, name, key, move |viewer| viewer.tool = tool);
        }
        bar.add_separator();
        bar.add_icon(icons::CAMERA, "Save image", "saves it beside the script (P)", move |viewer| {
            viewer.active_view = index;
            request_screenshot(viewer);
        });
        bar.show(ui, viewer, 0.0);
    });
}

fn add_camera_menu(bar: &mut Toolbar<'_, Viewer>, viewer: &Viewer, index: usize) {
    let Some(scene) = viewer.scene.clone().filter(|scene| !scene.stage.cameras.is_empty()) else { return };
    const NO_CAMERA_LABEL: &str = "camera";
    let name = match &viewer.views[index].camera {
        ViewCamera::Named(name) => name.as_str(),
        _ => NO_CAMERA_LABEL,
    };
    let names = scene.clone();
    bar.add_menu(name, "", move |ui, viewer| {
        let view = &mut viewer.views[index];
        for camera in &scene.stage.cameras {
            let on = view.camera == ViewCamera::Named(camera.name.clone());
            if ui.selectable_label(on, &camera.name).clicked() {
                view.camera = ViewCamera::Named(camera.name.clone());
            }
        }
    });
    bar.reserve_width_for(
        names.stage.cameras.iter().map(|camera| camera.name.as_str()).chain([NO_CAMERA_LABEL]),
    );
}

/// Menu that writes the free camera into the script: into one of its cameras, or as a new one.
fn add_script_menu(bar: &mut Toolbar<'_, Viewer>, viewer: &Viewer, index: usize) {
    let Some(scene) = viewer.scene.clone().filter(|_| viewer.path.is_some()) else { return };
    let orbit = match viewer.views[index].camera {
        ViewCamera::Free(orbit) => Some(orbit),
        _ => None,
    };
    let hint = "writes the free camera into the script, as .at and .look_at of a camera";
    bar.add_menu("into the script", hint, move |ui, viewer| {
        let Some(orbit) = orbit else { return };
        for camera in &scene.stage.cameras {
            if ui.button(format!("as \"{}\"", camera.name)).clicked() {
                viewer.edit(|v| v.set_camera(&camera.name, &orbit));
            }
        }
        let text = match scene.stage.cameras.is_empty() {
            true => "as a camera".to_string(),
            false => format!("as a new camera, from {} on", viewer.time_text(viewer.playhead.time())),
        };
        if ui.button(text).clicked() {
            viewer.edit(|v| v.add_camera(&orbit));
        }
    });
    // The entry is disabled and not hidden, so that the entries after it do not move.
    bar.set_enabled(orbit.is_some());
}

fn add_follow_toggle(bar: &mut Toolbar<'_, Viewer>, viewer: &Viewer, index: usize) {
    if viewer.scene.is_none() {
        return;
    }
    let following = matches!(viewer.views[index].camera, ViewCamera::Follow { .. });
    let selected = viewer.selection.as_ref().and_then(Selected::actor).is_some();
    let hint = "follow the selected actor";
    bar.add_icon_toggle(icons::CROSSHAIR, following, "follow", hint, move |viewer| {
        toggle_follow(viewer, index)
    });
    bar.set_enabled(following || selected);
}

/// Starts or stops following the selected actor with the camera of a view.
fn toggle_follow(viewer: &mut Viewer, index: usize) {
    let Some(scene) = viewer.scene.clone() else { return };
    let find = |name: &str| actor(&scene.stage, name).map(|i| (name.to_string(), i));
    let following = match &viewer.views[index].camera {
        ViewCamera::Follow { actor, .. } => Some(actor.clone()),
        _ => None,
    };
    let selected = viewer.selection.as_ref().and_then(Selected::actor).map(str::to_string);
    let pivot = viewer.point_of_interest().unwrap_or(DVec3::ZERO);
    let view = &mut viewer.views[index];
    match (following, selected) {
        (Some(name), _) => {
            // The orbit is converted to world space, so that the camera stays where it is.
            view.follow(find(&name), pivot);
            if let (ViewCamera::Follow { orbit, .. }, Some(shown), Some((_, index))) =
                (&view.camera, &view.shown, find(&name))
            {
                let mut orbit = *orbit;
                orbit.center +=
                    shown.snapshot.actors.get(index).map_or(DVec3::ZERO, |a| a.world_from_model.translation);
                view.camera = ViewCamera::Free(orbit);
            }
        }
        (None, Some(name)) => view.follow(find(&name), pivot),
        (None, None) => {}
    }
}

/// Selects the actor under the pointer, or nothing.
fn pick_at(viewer: &mut Viewer, index: usize, projection: &ViewProjection, at: DVec2) {
    let (Some(scene), Some(shown)) = (viewer.scene.clone(), &viewer.views[index].shown) else { return };
    let toggles = &viewer.toggles;
    let pickable = |i: usize| scene.stage.actors.get(i).is_some_and(|a| !toggles.locked.contains(&a.name));
    let picked = picking::pick_actor(&scene.stage, &shown.snapshot, projection.ray_through(at), pickable);
    let picked = picked.map(|i| Selected::Actor(scene.stage.actors[i].name.clone()));
    viewer.select_all(picked.into_iter().collect());
}

/// Text about the reduced quality of the image while the view moves: resolution, effects, frames.
fn draw_quality_note(ui: &Ui, viewer: &Viewer, index: usize, place: Rect) {
    let view = &viewer.views[index];
    let Some(requested) = view.requested.as_ref().filter(|key| key.moving) else { return };
    let mut parts: Vec<String> = Vec::new();
    if view.resolution == Resolution::Fitted {
        match viewer.reduction.divisor(requested.moving) {
            2 => parts.push("½ resolution".into()),
            4 => parts.push("¼ resolution".into()),
            _ => {}
        }
    }
    let waiting = view.shown.as_ref().map(|shown| shown.deferred_parts.join(", "));
    let waiting = waiting.filter(|waiting| !waiting.is_empty());
    parts.extend(waiting.map(|waiting| format!("no {waiting} while moving")));
    if viewer.playhead.is_playing() && viewer.reduction.dropped > 0 {
        parts.push(format!("{} frames dropped", viewer.reduction.dropped));
    }
    if parts.is_empty() {
        return;
    }
    let text = parts.join(" · ");
    let label = Rect::from_min_size(place.left_top(), egui::vec2(place.width(), QUALITY_NOTE_HEIGHT));
    let response = ui.interact(label, ui.id().with(("reduced", index)), Sense::hover());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Label, true, text.clone()));
    let painter = ui.painter_at(place);
    // The axes are to the right of the text.
    let right = axes::axes_rect(viewer, index, place).map_or(place.right(), |axes| axes.left());
    let galley = super::truncated_text(&painter, &text, 11.5, Color32::WHITE, right - place.left() - 12.0);
    if galley.elided {
        response.hint(text);
    }
    let background_rect =
        Rect::from_min_size(place.left_top() + egui::vec2(6.0, 6.0), galley.size()).expand(3.0);
    painter.rect_filled(background_rect, 3.0, Color32::from_black_alpha(170));
    painter.galley(background_rect.min + egui::vec2(3.0, 3.0), galley, Color32::WHITE);
}

/// Centered rectangle of an image: as large as possible if `fills_panel`, else at most one screen pixel per pixel of the image. Edges are aligned to
/// screen pixels.
fn image_rect(room: Rect, size: [u32; 2], pixels_per_point: f32, fills_panel: bool) -> Rect {
    let size = Vec2::new(size[0] as f32, size[1] as f32) / pixels_per_point;
    let largest = if fills_panel { f32::INFINITY } else { 1.0 };
    let scale = (room.width() / size.x).min(room.height() / size.y).min(largest);
    let size = size * scale;
    let on_pixels = |v: f32| (v * pixels_per_point).round() / pixels_per_point;
    let corner = room.center() - size / 2.0;
    Rect::from_min_size(pos2(on_pixels(corner.x), on_pixels(corner.y)), size)
}

fn handle_mouse(ui: &Ui, viewer: &mut Viewer, index: usize, response: &egui::Response, height: f32) {
    let by = response.drag_delta();
    let by = DVec2::new(f64::from(by.x), f64::from(by.y)) / f64::from(height.max(1.0));
    let shift = super::gesture::modifiers(ui).shift;
    if by != DVec2::ZERO {
        let pans = response.dragged_by(PointerButton::Middle) || shift;
        let turns = response.dragged_by(PointerButton::Primary) && !shift;
        if let Some(orbit) = viewer.free_camera(index) {
            match (pans, turns) {
                (true, _) => orbit.pan(by),
                (_, true) => orbit.turn(by),
                _ => orbit.look_around(by),
            }
        }
    }
    if !response.hovered() {
        return;
    }
    let notches = ui.input(|i| f64::from(i.smooth_scroll_delta.y) / 50.0);
    if notches != 0.0
        && let Some(orbit) = viewer.free_camera(index)
    {
        orbit.zoom(notches);
    }
    let axis_input = |a, b| ui.input(|i| f64::from(i8::from(i.key_down(a)) - i8::from(i.key_down(b))));
    let step = DVec3::new(axis_input(Key::D, Key::A), axis_input(Key::E, Key::Q), axis_input(Key::W, Key::S));
    // If letters are shortcuts, they walk only while the right button is held.
    let command = ui.input(|i| i.modifiers.command)
        || super::actions::uses_walking_keys(viewer) && !ui.input(|i| i.pointer.secondary_down());
    if step != DVec3::ZERO && !command && !ui.ctx().egui_wants_keyboard_input() {
        let secs = ui.input(|i| f64::from(i.stable_dt.min(0.1)));
        let pace = if shift { WALKING_SPEED * 4.0 } else { WALKING_SPEED };
        if let Some(orbit) = viewer.free_camera(index) {
            orbit.walk(step * pace * secs);
        }
        ui.ctx().request_repaint();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_image_lies_on_whole_pixels_and_keeps_its_aspect_ratio() {
        let room = Rect::from_min_max(pos2(10.3, 20.7), pos2(1033.9, 811.1));
        for (size, pixels) in [([1280, 720], 1.0), ([640, 361], 1.0), ([1280, 720], 1.5)] {
            let place = image_rect(room, size, pixels, false);
            for edge in [place.min.x, place.min.y] {
                assert!((edge * pixels - (edge * pixels).round()).abs() < 1e-3);
            }
            let shape = place.width() / place.height();
            assert!((shape - size[0] as f32 / size[1] as f32).abs() < 1e-3);
            assert!(place.width() <= size[0] as f32 / pixels + 1e-3, "pixel on pixel");
            let filled = image_rect(room, size, pixels, true);
            let free = (room.size() - filled.size()).min_elem();
            assert!(free.abs() < 1.0, "{filled:?} in {room:?}");
        }
    }
}
