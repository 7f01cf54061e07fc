//! Tangent handles of selected keys in the curve editor: drawn, dragged, chosen from a menu, or edited as numbers.

use super::curves::{MAX_KEYS, Plot, curve_color, key_ref};
use super::gesture;
use super::hint::Hint;
use super::key_menu::KeyAct;
use super::values;
use crate::app::Viewer;
use crate::geometry::round_to_pixel;
use crate::state::keyed::{KeyRef, KeyedProperty};
use crate::state::tangents::{HandleDrag, KeyHandle, TangentChoice};
use choreo_session::edit::KeyShape;
use egui::epaint::CubicBezierShape;
use egui::{Color32, CursorIcon, Id, Pos2, Rect, Response, Sense, Stroke, Ui, pos2, vec2};

/// Smallest length of a dragged handle, as a fraction of the span.
const MIN_HANDLE_LENGTH: f64 = 0.02;

/// One handle: its key, component and side.
struct HandlePlace<'p> {
    property: &'p KeyedProperty,
    key: usize,
    part: usize,
    side: usize,
    color: Color32,
    /// Offset and divisor of the common scale, as in [`crate::state::curves::Curves::scale`].
    scale: (f64, f64),
}

/// Draws the handles at the selected keys of one property. At the end of a drag, returns the key with its new tangents.
pub(super) fn show(
    ui: &Ui,
    viewer: &Viewer,
    plot: &Plot,
    property: &KeyedProperty,
    index: usize,
) -> Option<(KeyRef, KeyShape)> {
    if viewer.curves.shows_speed {
        return None;
    }
    let (mut done, scale) = (None, viewer.curves.scale(property));
    for (key, at) in property.keys.iter().enumerate().take(MAX_KEYS) {
        if !viewer.is_key_selected(&key_ref(property, *at)) {
            continue;
        }
        let handles = property.handles(key);
        for part in (0..property.width()).filter(|part| viewer.curves.is_shown(property, *part)) {
            for (side, handle) in handles.iter().enumerate() {
                let Some(handle) = handle else { continue };
                let color = curve_color(ui, property, index, part);
                let place = HandlePlace { property, key, part, side, color, scale };
                let shape = place.show_handle(ui, viewer, plot, handle);
                done = shape.map(|shape| (key_ref(property, *at), shape)).or(done);
            }
        }
    }
    done
}

impl HandlePlace<'_> {
    fn sign(&self) -> f64 {
        if self.side == 0 { -1.0 } else { 1.0 }
    }

    /// Position in the plot relative to a key: `secs` later, and `change` above its value.
    fn point(&self, plot: &Plot, key: usize, secs: f64, change: f64) -> Pos2 {
        let at = self.property.keys[key];
        let value = self.property.at(at).get(self.part).copied().unwrap_or_default() + change;
        let (add, divide) = self.scale;
        pos2(plot.x_at(at.as_secs() + secs), plot.y((value + add) / divide))
    }

    fn tip_position(&self, plot: &Plot, tangent: f64, weight: f64, span: f64) -> Pos2 {
        let secs = self.sign() * weight * span;
        self.point(plot, self.key, secs, secs * tangent)
    }

    fn show_handle(&self, ui: &Ui, viewer: &Viewer, plot: &Plot, handle: &KeyHandle) -> Option<KeyShape> {
        let (part, span) = (self.part, handle.span);
        let (tangent, weight) = (*handle.tangent.get(part)?, *handle.weight.get(part)?);
        let tip = self.tip_position(plot, tangent, weight, span);
        let hit = Rect::from_center_size(tip, vec2(11.0, 11.0)).intersect(plot.rect);
        let id = ui.id().with(("tangent", &self.property.name, part, self.key, self.side));
        let response = ui.interact(hit, id, Sense::drag()).on_hover_cursor(CursorIcon::Grab);
        let name = format!("{} {}", self.property.title(), self.property.part(part));
        let frame = viewer.playhead.fps().frames_in(self.property.keys[self.key]);
        let way = ["into", "out of"][self.side];
        let label = format!("tangent of {} {way} {frame}", name.trim_end());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Slider, true, label.clone()));
        let drag = self.drag_handle(ui, plot, &response, [tangent, weight, span]);
        let (now, length) = drag.map_or((tangent, weight), |d| (d.tangent, d.weight.unwrap_or(weight)));
        let painter = ui.painter_at(plot.rect);
        let (from, tip) = (self.point(plot, self.key, 0.0, 0.0), self.tip_position(plot, now, length, span));
        painter.line_segment([from, tip], Stroke::new(1.0, self.color));
        let fill =
            if response.hovered() || drag.is_some() { self.color } else { ui.visuals().extreme_bg_color };
        painter.circle(tip, 4.0, fill, Stroke::new(1.5, self.color));
        let shape = drag.and_then(|drag| self.property.shape_after_drag(self.key, &drag));
        if let Some(shape) = &shape {
            self.draw_preview(ui, plot, shape);
            let text = format!("{now:.3} {}/s   {length:.2} of the span", self.property.unit);
            super::bars::draw_text_at_pointer(ui, response.interact_pointer_pos().unwrap_or(tip), &text);
        }
        if !response.drag_stopped() {
            let hint = "drag: direction; with Ctrl: length, too; with Alt: only this side";
            response.hint(format!("{tangent:.3} {}/s\n{hint}", self.property.unit));
            return None;
        }
        shape.filter(|_| now != tangent || length != weight)
    }

    /// The drag of a handle. With Ctrl its length changes, too; with Alt the other side stays.
    fn drag_handle(
        &self,
        ui: &Ui,
        plot: &Plot,
        response: &Response,
        [tangent, weight, span]: [f64; 3],
    ) -> Option<HandleDrag> {
        let pointer = response.interact_pointer_pos();
        let at = pointer.filter(|_| response.dragged() || response.drag_stopped())?;
        let id: Id = response.id.with("from");
        if response.drag_started() {
            let from = ui.input(|i| i.pointer.press_origin()).unwrap_or(at);
            ui.data_mut(|d| d.insert_temp(id, from));
        }
        let from: Pos2 = ui.data(|d| d.get_temp(id)).unwrap_or(at);
        // The handle moves as far as the pointer, independent of where it was grabbed.
        let by = at - from;
        let secs = self.sign() * weight * span + plot.secs(by.x) - plot.secs(0.0);
        let change = self.sign() * weight * span * tangent - plot.value_difference(by.y) * self.scale.1;
        let length = (self.sign() * secs / span).clamp(MIN_HANDLE_LENGTH, 1.0);
        let slope = change / (self.sign() * length * span);
        let modifiers = gesture::modifiers(ui);
        let weight = modifiers.command.then_some((length * 100.0).round() / 100.0);
        let (side, part) = (self.side, self.part);
        let pixel = plot.value_per_pixel(ui) * self.scale.1 / (length * span);
        Some(HandleDrag { side, part, tangent: round_to_pixel(slope, pixel), weight, breaks: modifiers.alt })
    }

    /// Draws the spans next to the key as they will be.
    fn draw_preview(&self, ui: &Ui, plot: &Plot, shape: &KeyShape) {
        let handles = self.property.handles(self.key);
        let sides = [(&shape.incoming, self.key.checked_sub(1)), (&shape.outgoing, Some(self.key + 1))];
        for (side, (new, other)) in sides.into_iter().enumerate() {
            let (Some(other), Some(own)) = (other, &handles[side]) else { continue };
            let other_handles = self.property.handles(other.min(self.property.keys.len() - 1));
            let Some(other_handles) = &other_handles[1 - side] else { continue };
            let component = |all: &Option<Vec<f64>>, fallback: &[f64]| {
                let all = all.as_deref().unwrap_or(fallback);
                all.get(self.part).or(all.first()).copied().unwrap_or_default()
            };
            let sign = if side == 0 { -1.0 } else { 1.0 };
            let near_offset = sign * own.span * component(&new.weight, &own.weight);
            let far_offset = -sign * own.span * other_handles.weight[self.part];
            let points = [
                self.point(plot, self.key, 0.0, 0.0),
                self.point(plot, self.key, near_offset, near_offset * component(&new.tangent, &own.tangent)),
                self.point(plot, other, far_offset, far_offset * other_handles.tangent[self.part]),
                self.point(plot, other, 0.0, 0.0),
            ];
            let stroke = Stroke::new(2.0, self.color.gamma_multiply(0.7));
            let curve = CubicBezierShape::from_points_stroke(points, false, Color32::TRANSPARENT, stroke);
            ui.painter_at(plot.rect).add(curve);
        }
    }
}

/// Menu of tangent choices for the selected keys.
pub(super) fn show_menu(ui: &mut Ui) -> Option<KeyAct> {
    let mut act = None;
    ui.menu_button("Tangents", |ui| {
        for (choice, name) in TangentChoice::ALL {
            if ui.button(name).clicked() {
                act = Some(KeyAct::SetTangents(choice));
            }
        }
    });
    act
}

/// Number fields for the tangents of a key.
pub(super) fn show_number_fields(ui: &mut Ui, property: &KeyedProperty, key: usize) -> Option<KeyAct> {
    let mut act = None;
    for (side, handle) in property.handles(key).iter().enumerate() {
        let Some(handle) = handle else { continue };
        let way = ["into it", "out of it"][side];
        ui.horizontal(|ui| {
            ui.weak(format!("tangent {way}"));
            for (part, tangent) in handle.tangent.iter().enumerate() {
                let part_name = property.part(part);
                ui.weak(part_name);
                let breaks = property.shape(key).is_some_and(|shape| shape.broken);
                let drag = |tangent, weight| HandleDrag { side, part, tangent, weight, breaks };
                let name = format!("tangent {way} {part_name} of {}", property.name);
                let typed = values::number_field(ui, &name, *tangent, 0.05, -1e15..=1e15);
                let name = format!("length {way} {part_name} of {}", property.name);
                let length = values::number_field(ui, &name, handle.weight[part], 0.01, 0.0..=1.0);
                let (number, drag) = match (typed, length) {
                    (Some(tangent), _) => (tangent, drag(tangent, None)),
                    (None, Some(length)) => (length, drag(*tangent, Some(length))),
                    (None, None) => continue,
                };
                let number = values::typed_number(ui, number);
                let what = KeyRef {
                    what: property.what.clone(),
                    property: property.name.clone(),
                    at: property.keys[key],
                };
                act = property
                    .shape_after_drag(key, &drag)
                    .map(|shape| KeyAct::SetShape(what, shape, Some(number)))
                    .or(act.take());
            }
            ui.weak(format!("{}/s, length", property.unit));
        });
    }
    act
}
