//! Number fields that are dragged or typed, also as expressions. The value is taken when the pointer or the keyboard is released: each is one edit
//! of the script.

use crate::editing::expression;
use choreo_session::edit::{TypedNumber, format_number};
use egui::emath::format_with_decimals_in_range;
use egui::{DragValue, Id, Key, Popup, Rect, Response, SetOpenCommand, Slider, Ui, WidgetInfo, WidgetType};
use std::ops::RangeInclusive;

/// A number field.
pub(super) struct NumberField<'n> {
    pub name: &'n str,
    pub value: f64,
    /// Change of the value per point of a drag if the number is 0; see [`speed_of_drag`].
    pub speed: f64,
    pub range: RangeInclusive<f64>,
    /// Value that the context menu resets the number to.
    pub default: Option<f64>,
    /// Whether the number is a time, which can be typed as frames: `f(12)`.
    pub is_time: bool,
}

/// Message for a number that is not a time but was typed as frames.
pub(super) const NOT_A_TIME: &str = "f(…) is a time, but this value is not: write a number";

/// Sets the frame rate for times typed as frames, frames per second.
pub(crate) fn set_frame_rate(ui: &Ui, fps: f64) {
    ui.data_mut(|d| d.insert_temp(frame_rate_id(), fps));
}

fn frame_rate_id() -> Id {
    Id::new("frames a second")
}

/// Parser of typed text, `1/3`, or `f(12)` for times. Keeps the text and its value for [`typed_number`].
fn parser(ui: &Ui, id: Id, is_time: bool) -> impl Fn(&str) -> Option<f64> + 'static {
    let fps: f64 = ui.data(|d| d.get_temp(frame_rate_id())).unwrap_or(30.0);
    let context = ui.ctx().clone();
    move |text| {
        let is_refused = !is_time && expression::counts_frames(text);
        context.data_mut(|d| d.insert_temp(refused_flag_id(id), is_refused));
        if is_refused {
            return None;
        }
        let value = expression::evaluate(text, fps)?;
        context.data_mut(|d| d.insert_temp(typed_number_id(), (text.to_string(), value)));
        Some(value)
    }
}

fn typed_number_id() -> Id {
    Id::new("typed last")
}

/// Key of a flag: whether the text of a field counts frames although it is not a time.
fn refused_flag_id(id: Id) -> Id {
    id.with("frames")
}

/// Whether a field was left in this frame with an input that [`NOT_A_TIME`] refuses. Resets the flag.
pub(super) fn take_refused_flag(ui: &Ui) -> bool {
    ui.data_mut(|d| d.remove_temp(refused_flag_id(frame_rate_id()))).unwrap_or(false)
}

/// A number with the text that was typed for it, if that was an expression: `1.0 / 3.0` or `f(12)`.
pub(super) fn typed_number(ui: &Ui, value: f64) -> TypedNumber {
    let last =
        ui.data(|d| d.get_temp::<(String, f64)>(typed_number_id())).filter(|(_, meant)| *meant == value);
    let text = last.and_then(|(text, _)| expression::to_script_syntax(&text));
    text.map_or_else(|| TypedNumber::from(value), |text| TypedNumber { value, text })
}

/// Source text of a number; see [`typed_number`].
pub(super) fn source_text(ui: &Ui, value: f64) -> String {
    typed_number(ui, value).text
}

/// Source text of a list of numbers, separated by commas, of which the one at `index` was changed to `to`. `stated`: the present source text, whose
/// other numbers stay as they are written or computed.
pub(super) fn number_list_text(ui: &Ui, stated: Option<&str>, now: &[f64], index: usize, to: f64) -> String {
    let inside = stated.unwrap_or_default().trim();
    let inside = inside.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).unwrap_or(inside);
    let parts: Vec<&str> = inside.split(',').map(str::trim).collect();
    let count = now.len();
    let component_text = |(part, now): (usize, &f64)| {
        let is_current =
            |text: &&&str| expression::evaluate(text, 1.0).is_none_or(|read| (read - now).abs() < 5e-4);
        match parts.get(part).filter(|_| parts.len() == count).filter(is_current) {
            _ if part == index => source_text(ui, to),
            Some(stated) => stated.to_string(),
            None => format_number(*now),
        }
    };
    now.iter().enumerate().map(component_text).collect::<Vec<_>>().join(", ")
}

/// Largest width of a small range, in which dragging has the same speed everywhere.
const SMALL_RANGE_WIDTH: f64 = 2.0;
/// Largest width of a range with a slider; in wider ranges a point of the slider would be too large a step.
const WIDE_RANGE_WIDTH: f64 = 10.0;
/// Largest number of decimal places.
const MAX_DECIMALS: usize = 3;

/// Change of a number per point of a drag (with Shift a tenth of it): 1/200 of a small range, else 1/100 of the number. `step`: change for the
/// number 0; numbers near 0 change by at least a tenth of it.
fn speed_of_drag(value: f64, step: f64, range: &RangeInclusive<f64>) -> f64 {
    let width = range.end() - range.start();
    if width <= SMALL_RANGE_WIDTH {
        width / 200.0
    } else if value == 0.0 {
        step
    } else {
        (value.abs() / 100.0).max(step / 10.0)
    }
}

/// Displayed text of a number; a number that rounds to zero has no sign.
fn number_text(value: f64, decimals: RangeInclusive<usize>) -> String {
    let value = if super::rounded(value, 1e3) == 0.0 { 0.0 } else { value };
    format_with_decimals_in_range(value, decimals)
}

/// A number field with 3 decimal places that accepts expressions. `now`: the number during a drag.
fn drag_value<'n>(ui: &Ui, id: Id, number: &NumberField, now: &'n mut f64) -> DragValue<'n> {
    // The number of decimal places does not depend on the value.
    let min_decimals = libm::log10(1.0 / number.speed).ceil().clamp(0.0, MAX_DECIMALS as f64) as usize;
    DragValue::new(now)
        .speed(speed_of_drag(number.value, number.speed, &number.range))
        .range(number.range.clone())
        .max_decimals(MAX_DECIMALS)
        .custom_formatter(move |number, _| number_text(number, min_decimals..=MAX_DECIMALS))
        .custom_parser(parser(ui, id, number.is_time))
}

/// Shows a field, and returns the new value at the end of a drag or of typing.
fn finish_edit(
    ui: &mut Ui,
    id: Id,
    value: f64,
    default: Option<f64>,
    add: impl FnOnce(&mut Ui, &mut f64) -> Response,
) -> Option<f64> {
    let held: Option<f64> = ui.data(|d| d.get_temp(id));
    let mut now = held.unwrap_or(value);
    let response = add(ui, &mut now);
    super::inspected::record_focus(ui, &response);
    if response.lost_focus() {
        let is_refused = ui.data_mut(|d| d.remove_temp(refused_flag_id(id))).unwrap_or(false);
        if is_refused && !ui.input(|i| i.key_pressed(Key::Escape)) {
            ui.data_mut(|d| d.insert_temp(refused_flag_id(frame_rate_id()), true));
        }
    }
    let holds = response.dragged() || response.has_focus();
    let done = response.drag_stopped() || response.lost_focus() || (response.changed() && !holds);
    if holds && !done {
        ui.data_mut(|d| d.insert_temp(id, now));
    } else {
        ui.data_mut(|d| d.remove::<f64>(id));
    }
    // A field that was left unchanged holds the rounded digits that it displays.
    let is_as_shown = response.lost_focus() && (super::rounded(value, 1e3) - now).abs() < 1e-9;
    if default.is_none() {
        open_name_menu(&response);
    }
    let reset = default.and_then(|default| reset_menu(&response, default));
    if reset.is_some() || done && !response.lost_focus() {
        // A dragged number is not the one that was typed last, even if the values are equal.
        ui.data_mut(|d| d.remove::<(String, f64)>(typed_number_id()));
    }
    // An expression replaces digits with the same value, but only once: leaving a field takes two passes.
    let is_expression = done && held.is_some() && typed_number(ui, now).text != format_number(now);
    let set = reset.or_else(|| (done && (!is_as_shown || is_expression)).then_some(now));
    set.filter(|now| (*now != value || is_expression) && now.is_finite())
}

/// The name of a field, whose context menu also opens on the numbers next to it.
#[derive(Clone, Copy)]
struct NameLabel {
    id: Id,
    rect: Rect,
}

fn name_id() -> Id {
    Id::new("name of a field")
}

/// Key of a flag: whether a number has requested the context menu of a name.
fn menu_flag_id(name: Id) -> Id {
    name.with("menu")
}

/// Context menu of a field's name and of the numbers next to it.
pub(super) fn name_menu(name: &Response) -> Popup<'_> {
    let of_row = NameLabel { id: name.id, rect: name.rect };
    let is_asked = name.ctx.data_mut(|d| {
        d.insert_temp(name_id(), of_row);
        d.remove_temp(menu_flag_id(name.id)).unwrap_or(false)
    });
    let menu = Popup::context_menu(name);
    if is_asked { menu.open_memory(Some(SetOpenCommand::Bool(true))) } else { menu }
}

/// Opens the context menu of the name if a number next to it is clicked with the right button.
fn open_name_menu(number: &Response) {
    let name: Option<NameLabel> = number.ctx.data(|d| d.get_temp(name_id()));
    let is_beside = |name: &NameLabel| {
        let apart = (name.rect.center().y - number.rect.center().y).abs();
        number.rect.left() >= name.rect.right() && apart < 0.5 * (name.rect.height() + number.rect.height())
    };
    if let Some(name) = name.filter(|name| number.secondary_clicked() && is_beside(name)) {
        number.ctx.data_mut(|d| d.insert_temp(menu_flag_id(name.id), true));
        number.ctx.request_repaint();
    }
}

/// Forgets the last name, since no more numbers follow it.
pub(super) fn forget_name(ui: &Ui) {
    ui.data_mut(|d| d.remove::<NameLabel>(name_id()));
}

/// Context menu that resets a number. Returns the default if it was chosen.
pub(super) fn reset_menu(response: &Response, default: f64) -> Option<f64> {
    let mut chosen = None;
    response.context_menu(|ui| {
        let default_text = format_number(default);
        if ui.button(format!("Reset to {default_text}")).clicked() {
            chosen = Some(default);
            ui.close();
        }
    });
    chosen
}

/// A number that the script does not state: displays `derived`, the value that applies instead, in a weak color, or nothing, until something is
/// typed.
pub(super) fn derived_number_field(
    ui: &mut Ui,
    name: &str,
    derived: Option<f64>,
    range: RangeInclusive<f64>,
    is_time: bool,
) -> Option<f64> {
    let id = ui.id().with(("number", name));
    let weak = ui.visuals().weak_text_color();
    let from = derived.unwrap_or(*range.start());
    let number = NumberField { name, value: from, speed: 0.01, range, default: None, is_time };
    finish_edit(ui, id, from, None, |ui, now| {
        let is_untouched = *now == from;
        let widget = drag_value(ui, id, &number, now);
        let widget = match derived {
            None if is_untouched => widget.custom_formatter(|_, _| String::new()),
            _ => widget,
        };
        let color = is_untouched.then_some(weak);
        let add = |ui: &mut Ui| {
            ui.visuals_mut().override_text_color = color;
            ui.add(widget)
        };
        set_widget_name(ui.scope(add).inner, WidgetType::DragValue, name)
    })
}

/// Names a field for assistive technologies and tests.
pub(super) fn set_widget_name(response: Response, kind: WidgetType, name: &str) -> Response {
    let enabled = response.enabled();
    response.widget_info(|| WidgetInfo::labeled(kind, enabled, name));
    response
}

pub(super) fn number_field(
    ui: &mut Ui,
    name: &str,
    value: f64,
    speed: f64,
    range: RangeInclusive<f64>,
) -> Option<f64> {
    NumberField { name, value, speed, range, default: None, is_time: false }.show(ui)
}

/// A time in seconds, which can also be typed as frames.
pub(super) fn time_field(
    ui: &mut Ui,
    name: &str,
    value: f64,
    speed: f64,
    range: RangeInclusive<f64>,
) -> Option<f64> {
    NumberField { name, value, speed, range, default: None, is_time: true }.show(ui)
}

/// A number that returns source text; see [`NumberField::show_source`].
pub(super) fn number_source_field(
    ui: &mut Ui,
    name: &str,
    value: f64,
    speed: f64,
    range: RangeInclusive<f64>,
    stated: Option<&String>,
) -> Option<String> {
    let number = NumberField { name, value, speed, range, default: None, is_time: false };
    number.show_source(ui, stated.map(String::as_str))
}

impl NumberField<'_> {
    pub(super) fn show(self, ui: &mut Ui) -> Option<f64> {
        self.show_with_text(ui, None)
    }

    /// Shows the field and returns the new value as source text, which is an expression if one was typed; see [`NumberField::show_with_source`].
    pub(super) fn show_source(self, ui: &mut Ui, stated: Option<&str>) -> Option<String> {
        let now = self.show_with_source(ui, stated)?;
        Some(source_text(ui, now))
    }

    /// Shows the field and returns the new value. `stated`: source text of the value, displayed if it is an expression.
    pub(super) fn show_with_source(self, ui: &mut Ui, stated: Option<&str>) -> Option<f64> {
        let fps: f64 = ui.data(|d| d.get_temp(frame_rate_id())).unwrap_or(30.0);
        let is_current = |text: &&str| {
            let meant = expression::to_script_syntax(text).and_then(|text| expression::evaluate(&text, fps));
            meant.is_some_and(|meant| (meant - self.value).abs() <= 1e-6 * meant.abs())
        };
        let shown = stated.filter(is_current);
        self.show_with_text(ui, shown)
    }

    fn show_with_text(self, ui: &mut Ui, shown: Option<&str>) -> Option<f64> {
        let NumberField { name, value, default, .. } = self;
        let id = ui.id().with(("number", name));
        let set = finish_edit(ui, id, value, default, |ui, now| {
            let shown = shown.filter(|_| *now == value);
            let mut widget = drag_value(ui, id, &self, now);
            if let Some(shown) = shown {
                widget = widget.custom_formatter(move |_, _| shown.to_string());
            }
            set_widget_name(ui.add(widget), WidgetType::DragValue, name)
        });
        // The displayed expression is already in the script.
        let current_source = shown.and_then(expression::to_script_syntax);
        set.filter(|now| {
            *now != value
                || current_source.is_none_or(|current_source| current_source != typed_number(ui, *now).text)
        })
    }

    /// The same field with a slider, unless the range is wide.
    pub(super) fn show_slider(self, ui: &mut Ui) -> Option<f64> {
        let NumberField { name, value, default, .. } = self;
        let id = ui.id().with(("slider", name));
        let is_wide = self.range.end() - self.range.start() > WIDE_RANGE_WIDTH;
        finish_edit(ui, id, value, default, |ui, now| {
            ui.horizontal(|ui| {
                let slider = (!is_wide).then(|| {
                    let widget = Slider::new(now, self.range.clone()).show_value(false);
                    set_widget_name(ui.add(widget), WidgetType::Slider, name)
                });
                let widget = drag_value(ui, id, &self, now);
                let typed = set_widget_name(ui.add(widget), WidgetType::DragValue, &format!("{name} number"));
                let is_typed = typed.gained_focus() || typed.has_focus() || typed.lost_focus();
                match slider {
                    Some(slider) if is_typed => typed.union(slider),
                    Some(slider) => slider.union(typed),
                    None => typed,
                }
            })
            .inner
        })
    }
}

/// A color as sRGB bytes: a color picker, and hexadecimal digits as text.
pub(super) fn color_field(ui: &mut Ui, name: &str, value: [u8; 3]) -> Option<[u8; 3]> {
    ui.horizontal(|ui| {
        let picked = color_picker(ui, name, value);
        hex_field(ui, name, value).filter(|now| *now != value).or(picked)
    })
    .inner
}

/// A field for `#rrggbb` or `rrggbb`, taken when the field is left.
fn hex_field(ui: &mut Ui, name: &str, [r, g, b]: [u8; 3]) -> Option<[u8; 3]> {
    let id = ui.id().with(("hex", name));
    let now = format!("#{r:02x}{g:02x}{b:02x}");
    let mut text: String = ui.data(|d| d.get_temp(id)).unwrap_or_else(|| now.clone());
    let field = egui::TextEdit::singleline(&mut text).font(egui::TextStyle::Monospace);
    // A grid column may be narrower than the digits.
    let response = ui.add_sized([66.0, ui.spacing().interact_size.y], field);
    let response = set_widget_name(response, WidgetType::TextEdit, &format!("{name} hex"));
    super::inspected::record_focus(ui, &response);
    if response.has_focus() {
        ui.data_mut(|d| d.insert_temp(id, text));
        return None;
    }
    ui.data_mut(|d| d.remove::<String>(id));
    let digits = text.trim().trim_start_matches('#');
    let is_color = digits.len() == 6 && digits.chars().all(|c| c.is_ascii_hexdigit());
    let number = u32::from_str_radix(digits, 16).ok().filter(|_| is_color && response.lost_focus())?;
    let [_, r, g, b] = number.to_be_bytes();
    Some([r, g, b])
}

fn color_picker(ui: &mut Ui, name: &str, value: [u8; 3]) -> Option<[u8; 3]> {
    let id = ui.id().with(("color", name));
    let mut now: [u8; 3] = ui.data(|d| d.get_temp(id)).unwrap_or(value);
    let response = egui::color_picker::color_edit_button_srgb(ui, &mut now);
    let response = set_widget_name(response, WidgetType::ColorButton, name);
    // The picker is a popup; the color is taken when it closes.
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

#[cfg(test)]
mod tests {
    use super::speed_of_drag;

    #[test]
    fn the_drag_speed_grows_with_the_value() {
        let speed = |value, step, range| speed_of_drag(value, step, &range);
        // An opacity, a threshold, the size of a title, an intensity, and a position.
        for (speed, expected) in [
            (speed(0.5, 0.01, 0.0..=1.0), 0.005),
            (speed(0.0, 0.01, 0.0..=1.0), 0.005),
            (speed(0.9, 0.01, 0.0..=100.0), 0.009),
            (speed(0.12, 0.01, 0.001..=10.0), 0.0012),
            (speed(5000.0, 0.05, 0.0..=1e9), 50.0),
            (speed(-3.0, 0.01, -1e9..=1e9), 0.03),
            (speed(0.0, 0.01, -1e9..=1e9), 0.01),
            (speed(1e-6, 0.01, -1e9..=1e9), 0.001),
        ] {
            assert!((speed - expected).abs() < 1e-12, "{speed} for {expected}");
        }
    }
}
