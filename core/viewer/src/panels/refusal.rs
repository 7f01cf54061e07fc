//! Text next to the pointer that says why an edit was refused, with a link to the line that caused it. Not used while a dialog shows the reason.

use super::hint;
use crate::app::Viewer;
use egui::{
    Area, CursorIcon, Frame, Key, Order, Pos2, RichText, Sense, Stroke, TextStyle, Ui, WidgetInfo,
    WidgetText, WidgetType, vec2,
};

/// Largest width, points.
const MAX_WIDTH: f32 = 420.0;

/// Position of the displayed refusal, and number of refusals shown so far.
#[derive(Default)]
pub(super) struct Refusals {
    shown_count: u64,
    position: Option<Pos2>,
}

pub(super) fn show(refusals: &mut Refusals, ui: &Ui, viewer: &mut Viewer) {
    if refusals.shown_count != viewer.refusals {
        refusals.shown_count = viewer.refusals;
        let pointer = ui.input(|i| i.pointer.latest_pos());
        refusals.position = Some(pointer.unwrap_or_else(|| ui.ctx().content_rect().center()));
    }
    if viewer.offer.is_some() || viewer.documents.dialog.is_some() {
        refusals.position = None;
    }
    let shown = refusals.position.zip(viewer.message.clone());
    // A tooltip at the mouse would cover the text.
    hint::set_hints_hidden(ui.ctx(), shown.is_some());
    let Some((at, why)) = shown else {
        refusals.position = None;
        return;
    };
    let place = at + vec2(14.0, 18.0);
    // Clicks pass through the text to the widgets below it; only the link takes clicks.
    let area = Area::new(egui::Id::new("refusal")).order(Order::Foreground).fixed_pos(place);
    let room = area.constrain(true).interactable(false).show(ui.ctx(), |ui| {
        let popup = Frame::popup(ui.style()).show(ui, |ui| {
            ui.set_max_width(MAX_WIDTH);
            ui.label(RichText::new(&why).color(ui.visuals().warn_fg_color));
            let text = format!("go to line {}", viewer.message_line?);
            let galley = WidgetText::from(text.as_str()).into_galley(ui, None, MAX_WIDTH, TextStyle::Body);
            let place = ui.allocate_space(galley.size()).1;
            Some((place, text, galley, ui.painter().clone()))
        });
        popup.inner
    });
    let mut pressed_link = false;
    if let Some((place, text, galley, painter)) = room.inner {
        // The link is an area of its own that takes clicks and draws nothing, because egui remembers the order of areas and could put the text
        // above it.
        let link = Area::new(egui::Id::new("refusal line")).order(Order::Foreground).fixed_pos(place.min);
        let link = link.constrain(false).show(ui.ctx(), |ui| {
            let link = ui.allocate_response(place.size(), Sense::click());
            link.widget_info(|| WidgetInfo::labeled(WidgetType::Link, true, text.as_str()));
            link.on_hover_cursor(CursorIcon::PointingHand)
        });
        let color = ui.visuals().hyperlink_color;
        painter.galley(place.min, galley, color);
        let thickness = if link.inner.has_focus() { 2.0 } else { 1.0 };
        painter.hline(place.x_range(), place.bottom(), Stroke::new(thickness, color));
        pressed_link = link.response.contains_pointer();
        if link.inner.clicked() {
            viewer.script_scroll_line = viewer.message_line;
            refusals.position = None;
        }
    }
    let pressed_elsewhere = ui.input(|i| i.pointer.any_pressed()) && !pressed_link;
    if pressed_elsewhere || ui.input(|i| i.key_pressed(Key::Escape)) {
        refusals.position = None;
    }
}
