//! Files dropped on the window: models dropped on a viewport are added to the scene under the pointer; all others are previewed.

use crate::app::Viewer;
use crate::geometry::projection::ViewProjection;
use crate::state::dropped_models::DroppedModels;
use egui::{Event, Pos2, Rect, Ui};
use glam::{DVec2, DVec3};
use std::path::PathBuf;

/// Seconds to wait for the position of the pointer, after which the last known one is used. While files are dragged, the pointer belongs to their
/// source; its position is known again when it moves.
const POINTER_WAIT_SECS: f64 = 0.4;
/// Distance beyond which the ground counts as sky, metres.
const MAX_GROUND_DISTANCE: f64 = 500.0;
/// Smallest sine of the angle between an orthographic view direction and the ground at which the ground counts as visible.
const MIN_VIEW_TO_GROUND_SINE: f64 = 0.05;

/// Dropped files whose position is not known yet, and the time of the drop in seconds.
#[derive(Default)]
pub(super) struct PendingDrop {
    files: Vec<PathBuf>,
    dropped_at: f64,
}

pub(super) fn take_dropped_files(pending: &mut PendingDrop, ui: &Ui, viewer: &mut Viewer) {
    let (dropped, now) = ui.input(|i| (i.raw.dropped_files.clone(), i.time));
    for file in dropped {
        let path = file.path().to_path_buf();
        // A dropped object that is not a file has an empty path.
        if !path.as_os_str().is_empty() {
            pending.files.push(path);
            pending.dropped_at = now;
        }
    }
    if pending.files.is_empty() {
        return;
    }
    let moved = ui.input(|i| i.events.iter().any(|event| matches!(event, Event::PointerMoved(_))));
    if !moved && now - pending.dropped_at < POINTER_WAIT_SECS {
        ui.ctx().request_repaint_after(std::time::Duration::from_secs_f64(POINTER_WAIT_SECS));
        return;
    }
    let files = std::mem::take(&mut pending.files);
    let is_model = |file: &PathBuf| !file.extension().is_some_and(|e| e.eq_ignore_ascii_case("rhai"));
    let scene = viewer.path.is_some()
        && viewer.scene.is_some()
        && viewer.previewed_files.is_empty()
        && !viewer.is_faulty;
    let pointer = ui.input(|i| i.pointer.latest_pos());
    let at = pointer.and_then(|at| ground_point(viewer, at)).filter(|_| scene && files.iter().all(is_model));
    match at {
        Some(at) => viewer.dropped_models = Some(DroppedModels { files, at, beside: false }),
        None => viewer.dropped_files.extend(files),
    }
}

/// World position on the ground under a point of a viewport. If that is the sky, the point below it at the distance of the view's center of
/// interest.
pub(super) fn ground_point(viewer: &Viewer, at: Pos2) -> Option<DVec3> {
    let scene = viewer.scene.as_ref()?;
    let inside = |view: &&crate::state::view::View| {
        let [left, top, right, bottom] = view.image_rect;
        view.is_visible && Rect::from_min_max(Pos2::new(left, top), Pos2::new(right, bottom)).contains(at)
    };
    let view = viewer.views.iter().find(inside)?;
    let [left, top, right, bottom] = view.image_rect.map(f64::from);
    let projection = ViewProjection::new(
        &view.displayed_camera(&scene.stage)?,
        DVec2::new(left, top),
        DVec2::new(right - left, bottom - top),
    );
    let (origin, direction) = projection.ray_through(DVec2::new(f64::from(at.x), f64::from(at.y)));
    let distance = -origin.y / direction.y;
    let meets_ground = match projection.is_perspective() {
        true => distance > 0.0 && distance < MAX_GROUND_DISTANCE,
        // Orthographic rays begin next to the camera, on either side of the ground.
        false => direction.y.abs() > MIN_VIEW_TO_GROUND_SINE,
    };
    if distance.is_finite() && meets_ground {
        return Some(origin + direction * distance);
    }
    // The ray misses the ground or is parallel to it, so the distance of the center of interest is used.
    let middle = viewer.point_of_interest().unwrap_or(DVec3::ZERO);
    let forward = projection.forward();
    let distance = (middle - origin).dot(forward) / direction.dot(forward);
    let point = if distance > 0.0 && distance.is_finite() { origin + direction * distance } else { middle };
    Some(DVec3::new(point.x, 0.0, point.z))
}
