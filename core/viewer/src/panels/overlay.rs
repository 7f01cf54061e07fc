//! Overlays on the image: skeletons, bounds, safe areas. The window draws them and not the renderer, so that they are visible through all objects.

use super::canvas::Canvas;
use crate::app::Viewer;
use crate::geometry::picking;
use crate::geometry::projection::ViewProjection;
use crate::state::selection::Selected;
use egui::{Align2, Color32, FontId, Painter, Rect, Stroke, StrokeKind, Ui, pos2, vec2};
use glam::{DVec2, DVec3};

/// Largest total number of joints that are drawn.
const MAX_JOINTS: usize = 20_000;

pub(super) const X_COLOR: Color32 = Color32::from_rgb(0xe0, 0x55, 0x4d);
pub(super) const Y_COLOR: Color32 = Color32::from_rgb(0x6a, 0xb0, 0x3f);
pub(super) const Z_COLOR: Color32 = Color32::from_rgb(0x4c, 0x8d, 0xe8);

pub(super) fn to_pos2(p: DVec2) -> egui::Pos2 {
    pos2(p.x as f32, p.y as f32)
}

pub(super) fn draw_line(painter: &Painter, projection: &ViewProjection, a: DVec3, b: DVec3, stroke: Stroke) {
    let clip = painter.clip_rect();
    let ends = projection.project_line(a, b).and_then(|ends| clip_segment(ends, clip.expand(8.0)));
    if let Some(ends) = ends {
        painter.line_segment(ends.map(to_pos2), stroke);
    }
}

/// The part of a line inside a rectangle (Liang and Barsky 1984). Without clipping, a line close to the camera could extend for kilometres.
fn clip_segment([a, b]: [DVec2; 2], to: Rect) -> Option<[DVec2; 2]> {
    let by = b - a;
    let (mut from, mut until) = (0.0_f64, 1.0_f64);
    let low = DVec2::new(f64::from(to.left()), f64::from(to.top()));
    let high = DVec2::new(f64::from(to.right()), f64::from(to.bottom()));
    for axis in 0..2 {
        if by[axis] == 0.0 {
            if a[axis] < low[axis] || a[axis] > high[axis] {
                return None;
            }
            continue;
        }
        let (enter, leave) = ((low[axis] - a[axis]) / by[axis], (high[axis] - a[axis]) / by[axis]);
        (from, until) = (from.max(enter.min(leave)), until.min(enter.max(leave)));
    }
    (from <= until && by.is_finite()).then(|| [a + by * from, a + by * until])
}

pub(super) fn show(ui: &Ui, viewer: &Viewer, canvas: &Canvas) {
    let (view, projection) = (&viewer.views[canvas.index], &canvas.projection);
    let (Some(scene), Some(shown)) = (&viewer.scene, &view.shown) else { return };
    let painter = canvas.painter(ui);
    let selected = viewer.selection.as_ref().and_then(Selected::actor);
    let mut joints = 0;
    for (actor, state) in scene.stage.actors.iter().zip(&shown.snapshot.actors).filter(|(_, s)| s.visible) {
        let is_selected = selected == Some(actor.name.as_str());
        if view.overlays.bounds
            && let Some((low, high)) = picking::bounds(&actor.asset, state)
        {
            let color = if is_selected {
                Color32::from_rgb(0xff, 0xa0, 0x50)
            } else {
                Color32::from_white_alpha(110)
            };
            draw_bounds(&painter, projection, low, high, Stroke::new(1.0, color));
        }
        joints += actor.asset.skeleton.len();
        if view.overlays.skeletons && joints <= MAX_JOINTS {
            let color = if is_selected {
                Color32::from_rgb(0xff, 0xd0, 0x60)
            } else {
                Color32::from_rgb(0x90, 0xc0, 0xe0)
            };
            let at = |joint: usize| -> Option<DVec3> {
                let place = state.model_from_joint.get(joint)?.translation;
                Some(state.world_from_model.transform_point3(place.as_dvec3()))
            };
            for (joint, parent) in actor.asset.skeleton.parents().iter().enumerate() {
                let Some(to) = at(joint) else { continue };
                if let Some(from) = parent.and_then(|p| at(p as usize)) {
                    draw_line(&painter, projection, from, to, Stroke::new(1.5, color));
                }
                if let Some(p) = projection.project_point(to) {
                    painter.circle_filled(to_pos2(p), 2.0, color);
                }
            }
        }
    }
    if view.overlays.safe_areas {
        draw_safe_areas(&painter, canvas.image_rect, scene.stage.settings.size);
    }
}

fn draw_bounds(painter: &Painter, projection: &ViewProjection, low: DVec3, high: DVec3, stroke: Stroke) {
    let corner = |i: usize| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    for i in 0..8usize {
        for axis in 0..3 {
            if i >> axis & 1 == 0 {
                draw_line(painter, projection, corner(i), corner(i | 1 << axis), stroke);
            }
        }
    }
}

/// Safe areas of 93 % for action and 90 % for titles (EBU R 95), the center, and the size of the rendered image.
fn draw_safe_areas(painter: &Painter, place: Rect, size: [u32; 2]) {
    let stroke = Stroke::new(1.0, Color32::from_white_alpha(150));
    for share in [0.93, 0.90] {
        let inside = Rect::from_center_size(place.center(), place.size() * share);
        painter.rect_stroke(inside, 0.0, stroke, StrokeKind::Inside);
    }
    painter.rect_stroke(place, 0.0, stroke, StrokeKind::Inside);
    let arm = 8.0;
    let c = place.center();
    painter.line_segment([c - vec2(arm, 0.0), c + vec2(arm, 0.0)], stroke);
    painter.line_segment([c - vec2(0.0, arm), c + vec2(0.0, arm)], stroke);
    let text = format!("{}×{}", size[0], size[1]);
    let at = place.left_bottom() + vec2(6.0, -4.0);
    painter.text(at, Align2::LEFT_BOTTOM, text, FontId::proportional(11.0), Color32::from_white_alpha(190));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlay_lines_are_clipped_to_the_image() {
        let to = Rect::from_min_max(pos2(0.0, 0.0), pos2(100.0, 50.0));
        let line = |a: (f64, f64), b: (f64, f64)| clip_segment([DVec2::from(a), DVec2::from(b)], to);
        assert_eq!(line((50.0, 25.0), (50.0, 1e12)), Some([DVec2::new(50.0, 25.0), DVec2::new(50.0, 50.0)]));
        assert_eq!(line((-1e9, 10.0), (1e9, 10.0)).map(|l| l[1].x.round()), Some(100.0));
        assert_eq!(line((-10.0, -10.0), (-5.0, 90.0)), None);
        assert_eq!(line((10.0, 60.0), (90.0, 60.0)), None);
        assert_eq!(line((0.0, f64::NAN), (10.0, 10.0)), None);
    }
}
