//! Icons of lights, cameras and IK targets over the image: a click selects an object, a drag moves it in the script.

use super::canvas::Canvas;
use super::overlay::{draw_line, to_pos2};
use crate::app::Viewer;
use crate::geometry::gizmo::distance_to_segment;
use crate::geometry::projection::ViewProjection;
use crate::geometry::rig;
use crate::state::dragged_icon::{DraggedIcon, IconObject};
use crate::state::view::ViewCamera;
use choreo_asset::{LightKind, Projection};
use choreo_session::{FrameInfo, Scene};
use choreo_stage::{ConstraintKind, Target};
use egui::{Color32, Painter, Rect, Stroke, Ui};
use glam::{DVec2, DVec3};

/// Distance from the center of an icon within which the mouse picks it, points.
const PICK_RADIUS: f64 = 14.0;
/// Distance from a line of an icon within which the mouse picks it, points.
const LINE_PICK_RADIUS: f64 = 5.0;
/// Distance of a sun's icon from the point that it shines on, metres.
const SUN_ICON_DISTANCE: f64 = 3.0;

/// An icon in the viewport.
#[derive(Clone, Debug)]
struct SceneIcon {
    what: IconObject,
    at: DVec3,
    kind: IconKind,
}

#[derive(Clone, Debug)]
enum IconKind {
    /// World position that it shines on.
    Sun(DVec3),
    Point,
    /// Direction as a unit vector in world space, and half the cone's angle, radians.
    Spot(DVec3, f64),
    /// World position of the target, and the vertical field of view, radians.
    Camera(DVec3, f64),
    /// IK target; holds the world position of the joint that reaches for it.
    Reach(DVec3),
}

fn collect_icons(viewer: &Viewer, index: usize, scene: &Scene) -> Vec<SceneIcon> {
    let stage = &scene.stage;
    let Some(shown) = &viewer.views[index].shown else { return Vec::new() };
    let lights = scene.evaluator.stage_lights(&shown.snapshot).into_iter().enumerate();
    let lights = lights.filter_map(|(number, light)| {
        let light = light?;
        let direction = light.direction.as_dvec3();
        let (at, kind) = match light.light.kind {
            LightKind::Directional => {
                (viewer.sun_target() - direction * SUN_ICON_DISTANCE, IconKind::Sun(viewer.sun_target()))
            }
            LightKind::Spot { outer, .. } => (light.position, IconKind::Spot(direction, f64::from(outer))),
            LightKind::Point => (light.position, IconKind::Point),
        };
        Some(SceneIcon { what: IconObject::Light(number), at, kind })
    });
    let cameras = stage.cameras.iter().filter_map(|camera| {
        let [at, target] = rig::rig_points(stage, &shown.snapshot, camera)?;
        let angle = match camera.projection {
            Projection::Perspective { yfov, .. } => f64::from(yfov),
            Projection::Orthographic { .. } => 0.0,
        };
        Some(SceneIcon {
            what: IconObject::Camera(camera.name.clone()),
            at,
            kind: IconKind::Camera(target, angle),
        })
    });
    lights.chain(cameras).chain(reach_targets(scene, shown)).collect()
}

/// Icons of points that joints reach for at the time of the image.
fn reach_targets(scene: &Scene, shown: &FrameInfo) -> Vec<SceneIcon> {
    let mut icons = Vec::new();
    for (actor, state) in scene.stage.actors.iter().zip(&shown.snapshot.actors).filter(|(_, s)| s.visible) {
        for (number, constraint) in actor.constraints.iter().enumerate() {
            let now = constraint.start <= shown.time && constraint.end.is_none_or(|end| shown.time < end);
            let ConstraintKind::Reach(reach) = &constraint.kind else { continue };
            let (Target::Point(point), true) = (&reach.target, now) else { continue };
            let joint = reach.joints.last().and_then(|joint| state.model_from_joint.get(*joint as usize));
            let Some(joint) = joint.map(|m| m.translation.as_dvec3()) else { continue };
            icons.push(SceneIcon {
                what: IconObject::Reach(actor.name.clone(), number),
                at: *point + reach.offset.unwrap_or(DVec3::ZERO),
                kind: IconKind::Reach(state.world_from_model.transform_point3(joint)),
            });
        }
    }
    icons
}

/// Parts of an icon that the mouse picks: its disc, and the cone of a spot light.
struct PickArea {
    disc: Option<DVec2>,
    lines: Vec<[DVec2; 2]>,
}

impl PickArea {
    fn of(viewer: &Viewer, icon: &SceneIcon, projection: &ViewProjection) -> PickArea {
        let is_selected = viewer.selection == Some(icon.what.selected());
        let lines = icon.beam(is_selected).map(|beam| beam.cone()).unwrap_or_default();
        let lines = lines.into_iter().filter_map(|[a, b]| projection.project_line(a, b));
        PickArea { disc: projection.project_point(icon.at), lines: lines.collect() }
    }

    /// Distance of a pointer position in points, or `None` if it is out of reach. Lines count as farther away than discs.
    fn distance(&self, at: DVec2) -> Option<f64> {
        let to_disc = self.disc.map(|disc| (disc - at).length()).filter(|d| *d <= PICK_RADIUS);
        let to_line = self.lines.iter().map(|[a, b]| distance_to_segment(at, *a, *b)).min_by(f64::total_cmp);
        to_disc.or(to_line.filter(|d| *d <= LINE_PICK_RADIUS).map(|d| PICK_RADIUS + d))
    }
}

impl SceneIcon {
    /// The cone of a spot light, as drawn.
    fn beam(&self, is_selected: bool) -> Option<Beam> {
        let IconKind::Spot(direction, angle) = self.kind else { return None };
        Some(Beam { at: self.at, direction, angle, length: if is_selected { 1.0 } else { 0.4 } })
    }
}

/// Draws the icons and handles the mouse. Returns whether the mouse is over one of them or drags it.
pub(super) fn show(ui: &Ui, viewer: &mut Viewer, canvas: &Canvas) -> bool {
    let Canvas { index, response, projection, .. } = canvas;
    // The image of a camera of the script has no icons, since it is shown as it will be rendered.
    let view = &viewer.views[*index];
    if !view.overlays.icons || matches!(view.camera, ViewCamera::Script | ViewCamera::Named(_)) {
        return false;
    }
    let Some(scene) = viewer.scene.clone() else { return false };
    let mut icons = collect_icons(viewer, *index, &scene);
    if let Some(dragged) = &viewer.dragged_icon {
        icons.iter_mut().filter(|icon| icon.what == dragged.what).for_each(|icon| icon.at = dragged.to);
    }
    let pick_areas: Vec<PickArea> = icons.iter().map(|icon| PickArea::of(viewer, icon, projection)).collect();
    let near = |at: DVec2| {
        let reached = icons
            .iter()
            .zip(&pick_areas)
            .filter_map(|(icon, pick_area)| Some((icon, pick_area.distance(at)?)));
        reached.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(icon, _)| icon.clone())
    };
    let hovered = canvas.hover_position().and_then(near);
    for icon in &icons {
        let is_selected = viewer.selection == Some(icon.what.selected());
        let is_hovered = hovered.as_ref().is_some_and(|hovered| hovered.what == icon.what);
        draw_icon(&canvas.painter(ui), icon, is_selected, is_hovered, projection);
    }
    if let Some(hovered) = &hovered {
        canvas.response.clone().on_hover_text_at_pointer(icon_hint(&hovered.what));
        if response.clicked() {
            viewer.selection = Some(hovered.what.selected());
        }
    }
    drag_icon(ui, viewer, canvas, &scene, near) || hovered.is_some()
}

/// Drags an icon in the plane of the image, at its own depth. Returns whether one is being dragged.
fn drag_icon(
    ui: &Ui,
    viewer: &mut Viewer,
    canvas: &Canvas,
    scene: &Scene,
    near: impl Fn(DVec2) -> Option<SceneIcon>,
) -> bool {
    let Canvas { index, response, projection, .. } = canvas;
    let start = canvas.drag_start_position(ui);
    if let Some((icon, start)) = start.and_then(|start| Some((near(start)?, start))) {
        let (what, from) = (icon.what, icon.at);
        let grab_position = point_at_depth_of(projection, from, start).unwrap_or(from);
        viewer.selection = Some(what.selected());
        viewer.dragged_icon = Some(DraggedIcon { view: *index, what, from, to: from, grab_position });
    }
    // An icon dragged in another viewport is handled there.
    let Some(dragged) = viewer.dragged_icon.as_mut().filter(|dragged| dragged.view == *index) else {
        return false;
    };
    let pointer = canvas.pointer_position().filter(|_| response.dragged());
    if let Some(at) = pointer.and_then(|at| point_at_depth_of(projection, dragged.from, at)) {
        dragged.to = dragged.from + (at - dragged.grab_position);
    }
    let at = dragged.to.to_array().map(|v| super::rounded(v, 1e3));
    if ui.input(|i| i.key_pressed(egui::Key::Escape)) {
        viewer.dragged_icon = None;
    } else if response.drag_stopped() {
        let dragged = viewer.dragged_icon.take();
        if let Some(dragged) = dragged.filter(|d| d.from != d.to) {
            write_position(viewer, scene, &dragged, DVec3::from_array(at));
        }
    } else if !response.dragged() {
        viewer.dragged_icon = None;
    }
    true
}

/// World position under a point of the window, at the same depth as another position.
fn point_at_depth_of(projection: &ViewProjection, place: DVec3, at: DVec2) -> Option<DVec3> {
    let (origin, direction) = projection.ray_through(at);
    let normal = projection.forward();
    let distance = (place - origin).dot(normal) / direction.dot(normal);
    (distance.is_finite() && distance > 0.0).then(|| origin + direction * distance)
}

/// Writes the new position of an icon into the script.
fn write_position(viewer: &mut Viewer, scene: &Scene, dragged: &DraggedIcon, at: DVec3) {
    let list = |v: DVec3| {
        let [x, y, z] = v.to_array().map(|v| super::rounded(v, 1e3));
        format!("[{x:?}, {y:?}, {z:?}]")
    };
    // The object stays at its new position until the reload shows it.
    viewer.placement_override = viewer.icon_placement(&scene.stage, dragged);
    match &dragged.what {
        IconObject::Light(number) => {
            let light = scene.stage.lights.get(*number);
            let sun = light.is_some_and(|l| matches!(l.light.kind, LightKind::Directional));
            let (name, value) = match sun {
                true => ("direction", list(viewer.sun_direction_from(at))),
                false => ("position", list(at)),
            };
            viewer.edit(|v| v.set_value(&dragged.what.selected(), name, &value));
        }
        IconObject::Camera(name) => viewer.edit(|v| v.move_camera(name, at)),
        IconObject::Reach(name, number) => viewer.edit(|v| v.move_target(name, *number, at)),
    }
    if viewer.message.is_some() {
        viewer.placement_override = None;
    }
}

fn icon_hint(what: &IconObject) -> String {
    match what {
        IconObject::Light(index) => format!("light {}: drag to move it", index + 1),
        IconObject::Camera(name) => format!("camera {name}: drag to move it"),
        IconObject::Reach(name, _) => format!("target that {name} reaches for: drag to move it"),
    }
}

fn draw_icon(
    painter: &Painter,
    icon: &SceneIcon,
    is_selected: bool,
    hovered: bool,
    projection: &ViewProjection,
) {
    let Some(at) = projection.project_point(icon.at).map(to_pos2) else { return };
    let color = match (is_selected, hovered) {
        (true, _) => Color32::from_rgb(0xff, 0xa0, 0x50),
        (_, true) => Color32::from_rgb(0xff, 0xe0, 0x70),
        _ => Color32::from_gray(225),
    };
    let stroke = Stroke::new(1.5, color);
    let thin = Stroke::new(1.0, color.gamma_multiply(0.6));
    // A dark disc makes the icon visible on dark and on light backgrounds.
    painter.circle_filled(at, 9.0, Color32::from_black_alpha(150));
    let ray = |angle: f32, from: f32, to: f32| {
        let direction = egui::Vec2::angled(angle);
        painter.line_segment([at + direction * from, at + direction * to], stroke);
    };
    let turn = std::f32::consts::TAU;
    match &icon.kind {
        IconKind::Sun(on) => {
            painter.circle_filled(at, 3.5, color);
            (0..8).for_each(|i| ray(turn * i as f32 / 8.0, 5.5, 8.0));
            draw_line(painter, projection, icon.at, *on, thin);
        }
        IconKind::Point => {
            painter.circle_stroke(at, 4.0, stroke);
            painter.circle_filled(at, 1.5, color);
            (0..4).for_each(|i| ray(turn * (i as f32 + 0.5) / 4.0, 5.5, 8.0));
        }
        IconKind::Spot(..) => {
            painter.circle_filled(at, 3.0, color);
            let lines = icon.beam(is_selected).map(|beam| beam.cone()).unwrap_or_default();
            lines.into_iter().for_each(|[a, b]| draw_line(painter, projection, a, b, stroke));
        }
        IconKind::Reach(joint) => {
            painter.circle_stroke(at, 6.0, stroke);
            (0..4).for_each(|i| ray(turn * i as f32 / 4.0, 2.0, 9.0));
            draw_line(painter, projection, icon.at, *joint, thin);
        }
        IconKind::Camera(target, angle) => {
            let body = Rect::from_center_size(at, egui::vec2(9.0, 7.0));
            painter.rect_stroke(body, 1.0, stroke, egui::StrokeKind::Inside);
            let beak = [at + egui::vec2(4.5, 0.0), at + egui::vec2(8.0, -3.5), at + egui::vec2(8.0, 3.5)];
            painter.add(egui::Shape::convex_polygon(beak.to_vec(), color, Stroke::NONE));
            let toward = (*target - icon.at).normalize_or(DVec3::NEG_Z);
            let length = if is_selected { 1.0 } else { 0.5 };
            draw_frustum(
                painter,
                projection,
                &Beam { at: icon.at, direction: toward, angle: *angle, length },
                thin,
            );
        }
    }
}

/// A cone of light, or the view frustum of a camera.
struct Beam {
    at: DVec3,
    /// Direction, unit vector in world space.
    direction: DVec3,
    /// Half angle of the cone, or field of view of the camera, radians.
    angle: f64,
    /// Length as drawn, metres.
    length: f64,
}

/// Two unit vectors perpendicular to a direction: right and up.
fn perpendicular_axes(direction: DVec3) -> [DVec3; 2] {
    let right = direction.cross(DVec3::Y).normalize_or(DVec3::X);
    [right, right.cross(direction)]
}

impl Beam {
    /// Lines of a cone: its ring and its sides.
    fn cone(&self) -> Vec<[DVec3; 2]> {
        let Beam { at, direction, angle, length } = *self;
        let [right, up] = perpendicular_axes(direction);
        let radius = libm::tan(angle.min(1.4)) * length;
        let ring = (0..=16).map(|i| {
            let (sin, cos) = libm::sincos(f64::from(i) / 16.0 * core::f64::consts::TAU);
            at + direction * length + (right * cos + up * sin) * radius
        });
        let ring: Vec<DVec3> = ring.collect();
        let sides = [0, 4, 8, 12].map(|i: usize| [at, ring[i]]);
        ring.windows(2).map(|ends| [ends[0], ends[1]]).chain(sides).collect()
    }
}

/// Draws the view frustum of a camera, with an aspect ratio of 16:9.
fn draw_frustum(painter: &Painter, projection: &ViewProjection, beam: &Beam, stroke: Stroke) {
    let Beam { at, direction, angle, length } = *beam;
    let [right, up] = perpendicular_axes(direction);
    let half_height = if angle > 0.0 { libm::tan(angle / 2.0) * length } else { 0.3 };
    let half_width = half_height * 16.0 / 9.0;
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y)| at + direction * length + right * (x * half_width) + up * (y * half_height));
    for i in 0..4 {
        draw_line(painter, projection, at, corners[i], stroke);
        draw_line(painter, projection, corners[i], corners[(i + 1) % 4], stroke);
    }
}
