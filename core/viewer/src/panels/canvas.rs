//! The displayed image of a viewport, with the pointer on it. Overlays draw on it, and the mouse picks in it.

use crate::geometry::projection::ViewProjection;
use egui::{Painter, PointerButton, Pos2, Rect, Response, Ui};
use glam::DVec2;

pub(super) struct Canvas<'a> {
    /// Index of the viewport.
    pub index: usize,
    pub response: &'a Response,
    /// Rectangle of the image in the window, points.
    pub image_rect: Rect,
    /// Projection of the displayed camera.
    pub projection: ViewProjection,
}

impl Canvas<'_> {
    pub(super) fn painter(&self, ui: &Ui) -> Painter {
        ui.painter_at(self.image_rect)
    }

    /// Position of the pointer, hovering or dragging, in points of the window.
    pub(super) fn pointer_position(&self) -> Option<DVec2> {
        self.response.interact_pointer_pos().or(self.response.hover_pos()).map(to_dvec2)
    }

    /// Position of the pointer over the image while nothing is dragged.
    pub(super) fn hover_position(&self) -> Option<DVec2> {
        let still = self.response.hover_pos().filter(|_| !self.response.dragged());
        still.filter(|at| self.image_rect.contains(*at)).map(to_dvec2)
    }

    /// Position of a click on the image.
    pub(super) fn click_position(&self) -> Option<DVec2> {
        let at = self.response.interact_pointer_pos().filter(|_| self.response.clicked());
        at.filter(|at| self.image_rect.contains(*at)).map(to_dvec2)
    }

    /// Position at which a drag with the primary button begins in this frame.
    pub(super) fn drag_start_position(&self, ui: &Ui) -> Option<DVec2> {
        let starts = self.response.drag_started_by(PointerButton::Primary);
        ui.input(|i| i.pointer.press_origin()).filter(|_| starts).map(to_dvec2)
    }
}

fn to_dvec2(at: Pos2) -> DVec2 {
    DVec2::new(f64::from(at.x), f64::from(at.y))
}
