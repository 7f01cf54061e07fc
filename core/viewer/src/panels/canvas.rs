//! The displayed image of a viewport, with the pointer on it. Overlays draw on it, and the mouse picks in it.

use crate::geometry::projection::ViewProjection;
use egui::{Painter, PointerButton, Pos2, Rect, Response, Ui};
use glam::DVec2;

pub(super) struct Canvas<'a> {
    /// Index of the viewport.
    pub index: usize,
    pub response: &'a Response,
    /// Rectangle of the image in the window, points.
    pub place: Rect,
    /// Projection of the displayed camera.
    pub projection: ViewProjection,
}

impl Canvas<'_> {
    pub fn painter(&self, ui: &Ui) -> Painter {
        ui.painter_at(self.place)
    }

    /// Position of the pointer, hovering or dragging, in points of the window.
    pub fn pointer(&self) -> Option<DVec2> {
        self.response.interact_pointer_pos().or(self.response.hover_pos()).map(vector)
    }

    /// Position of the pointer over the image while nothing is dragged.
    pub fn hovered(&self) -> Option<DVec2> {
        let still = self.response.hover_pos().filter(|_| !self.response.dragged());
        still.filter(|at| self.place.contains(*at)).map(vector)
    }

    /// Position of a click on the image.
    pub fn clicked(&self) -> Option<DVec2> {
        let at = self.response.interact_pointer_pos().filter(|_| self.response.clicked());
        at.filter(|at| self.place.contains(*at)).map(vector)
    }

    /// Position at which a drag with the primary button begins in this frame.
    pub fn drag_start(&self, ui: &Ui) -> Option<DVec2> {
        let starts = self.response.drag_started_by(PointerButton::Primary);
        ui.input(|i| i.pointer.press_origin()).filter(|_| starts).map(vector)
    }
}

fn vector(at: Pos2) -> DVec2 {
    DVec2::new(f64::from(at.x), f64::from(at.y))
}
