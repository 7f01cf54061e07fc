//! Reordering of the sequencer's rows by dragging their names.

use super::sequencer::visible_row_rects;
use crate::app::Viewer;
use choreo_session::edit::RowSide;
use egui::{Id, LayerId, Order, Rect, Response, Stroke, Ui};

/// Marks the target of a dragged row; at the end of the drag, returns the row next to it and the side.
pub(super) fn drag_row(
    ui: &Ui,
    viewer: &Viewer,
    row: usize,
    response: &Response,
) -> Option<(usize, RowSide)> {
    if !response.dragged() && !response.drag_stopped() {
        return None;
    }
    let pointer = response.interact_pointer_pos()?;
    let places = visible_row_rects(ui, viewer);
    let &(to, rect) = places.iter().find(|(_, rect)| rect.y_range().contains(pointer.y))?;
    let rows = viewer.drop_target_rows(row, to);
    let is_target_row = |index: &usize| rows.as_ref().is_some_and(|rows| rows.contains(index));
    let target_rect: Rect = places
        .iter()
        .filter(|(index, _)| is_target_row(index))
        .map(|(_, rect)| *rect)
        .reduce(Rect::union)
        .unwrap_or(rect);
    let side = if pointer.y < target_rect.center().y { RowSide::Above } else { RowSide::Below };
    if response.drag_stopped() {
        return (to != row).then_some((to, side));
    }
    let color = match rows {
        Some(_) => ui.visuals().selection.stroke.color,
        None => ui.visuals().error_fg_color,
    };
    let y = if side == RowSide::Above { target_rect.top() } else { target_rect.bottom() };
    let painter = ui.ctx().layer_painter(LayerId::new(Order::Foreground, Id::new("row order")));
    painter.hline(target_rect.x_range(), y, Stroke::new(2.0, color));
    None
}
