//! Why a change was not made, beside the pointer that made it, with the line that decides as a link.

use crate::app::Viewer;
use egui::{Area, Frame, Key, Order, Pos2, RichText, Ui, vec2};

/// Points.
const WIDEST: f32 = 420.0;

/// The place at which a refusal is read, and how many there were.
#[derive(Default)]
pub struct Refusals {
    seen: u64,
    at: Option<Pos2>,
}

pub fn show(refusals: &mut Refusals, ui: &Ui, viewer: &mut Viewer) {
    if refusals.seen != viewer.refusals {
        refusals.seen = viewer.refusals;
        let pointer = ui.input(|i| i.pointer.latest_pos());
        refusals.at = Some(pointer.unwrap_or_else(|| ui.ctx().content_rect().center()));
    }
    let (Some(at), Some(why)) = (refusals.at, viewer.message.clone()) else {
        refusals.at = None;
        return;
    };
    let area = Area::new(egui::Id::new("refusal")).order(Order::Foreground).fixed_pos(at + vec2(14.0, 18.0));
    let shown = area.constrain(true).show(ui.ctx(), |ui| {
        Frame::popup(ui.style()).show(ui, |ui| {
            ui.set_max_width(WIDEST);
            ui.label(RichText::new(&why).color(ui.visuals().warn_fg_color));
            if let Some(line) = viewer.message_line
                && ui.link(format!("go to line {line}")).clicked()
            {
                viewer.go_to = Some(line);
                refusals.at = None;
            }
        });
    });
    let inside = |at: Pos2| shown.response.rect.contains(at);
    let elsewhere =
        ui.input(|i| i.pointer.any_pressed() && i.pointer.interact_pos().is_some_and(|p| !inside(p)));
    if elsewhere || ui.input(|i| i.key_pressed(Key::Escape)) {
        refusals.at = None;
    }
}
