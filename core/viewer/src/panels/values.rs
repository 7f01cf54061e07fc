//! Numbers that are dragged or typed, and taken once the hand lets go: each is one change of the script.

use egui::{DragValue, Response, Slider, Ui};
use std::ops::RangeInclusive;

/// The new value, once it is meant.
fn settled(
    ui: &mut Ui,
    id: egui::Id,
    value: f64,
    add: impl FnOnce(&mut Ui, &mut f64) -> Response,
) -> Option<f64> {
    let mut now: f64 = ui.data(|d| d.get_temp(id)).unwrap_or(value);
    let response = add(ui, &mut now);
    let holds = response.dragged() || response.has_focus();
    let done = response.drag_stopped() || response.lost_focus() || (response.changed() && !holds);
    if holds && !done {
        ui.data_mut(|d| d.insert_temp(id, now));
    } else {
        ui.data_mut(|d| d.remove::<f64>(id));
    }
    (done && now != value && now.is_finite()).then_some(now)
}

fn named(response: Response, name: &str) -> Response {
    let text = name.to_string();
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::DragValue, true, text.clone()));
    response
}

pub fn number(ui: &mut Ui, name: &str, value: f64, speed: f64, range: RangeInclusive<f64>) -> Option<f64> {
    let id = ui.id().with(("number", name));
    settled(ui, id, value, |ui, now| {
        let widget = DragValue::new(now).speed(speed).range(range).max_decimals(3);
        named(ui.add(widget), name)
    })
}

pub fn slider(ui: &mut Ui, name: &str, value: f64, range: RangeInclusive<f64>) -> Option<f64> {
    let id = ui.id().with(("slider", name));
    let wide = *range.start() > 0.0 && range.end() / range.start() > 1e3;
    settled(ui, id, value, |ui, now| {
        named(ui.add(Slider::new(now, range).logarithmic(wide).max_decimals(3)), name)
    })
}

/// sRGB bytes, as it was and as it is now meant.
pub fn color(ui: &mut Ui, name: &str, value: [u8; 3]) -> Option<[u8; 3]> {
    let id = ui.id().with(("color", name));
    let mut now: [u8; 3] = ui.data(|d| d.get_temp(id)).unwrap_or(value);
    let response = egui::color_picker::color_edit_button_srgb(ui, &mut now);
    // The picker is a window of its own: it is over when it is closed.
    let is_open = egui::Popup::is_any_open(ui.ctx());
    if response.changed() || (now != value && is_open) {
        ui.data_mut(|d| d.insert_temp(id, now));
        return None;
    }
    if now != value && !is_open {
        ui.data_mut(|d| d.remove::<[u8; 3]>(id));
        return Some(now);
    }
    None
}
