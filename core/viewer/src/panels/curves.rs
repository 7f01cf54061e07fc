//! Curve editor: keyed values of the selection over time as evaluated by the stage, with the keys as draggable points.

use super::bars::draw_text_at_pointer;
use super::fixed_digits;
use super::gesture;
use super::headers;
use super::hint::Hint;
use super::key_menu::{self, KeyAct};
use super::marks::SELECTED_COLOR;
use super::overlay::{X_COLOR, Y_COLOR, Z_COLOR};
use super::sequencer::{LABELS_WIDTH, RULER_HEIGHT, draw_beats_and_playhead, show_ruler};
use super::tangents;
use super::toolbar::Toolbar;
use crate::app::Viewer;
use crate::editing::ValueDrag;
use crate::geometry::round_to_pixel;
use crate::state::curves::KeyDrag;
use crate::state::keyed::{KeyRef, KeyedProperty, ValueKind};
use crate::state::selection::Selected;
use crate::state::span::Span;
use choreo_motion::Time;
use egui::{
    Align2, Color32, CursorIcon, FontId, PointerButton, Pos2, Rect, Response, Sense, Shape, Stroke,
    StrokeKind, Ui, UiBuilder, pos2, vec2,
};
use std::sync::Arc;

/// Distance between two samples of a curve, points.
const SAMPLE_DISTANCE: f32 = 2.0;
/// Half width of a key, points.
const KEY_HALF_WIDTH: f32 = 3.5;
/// Distance that a key must be dragged along an axis before it moves along that axis, points.
const DRAG_THRESHOLD: f32 = 4.0;
/// Largest number of keys that can be pointed at.
pub(super) const MAX_KEYS: usize = 1000;
const ROW_HEIGHT: f32 = 20.0;
/// Colors of curves with one component; those of axes are red, green and blue.
const SINGLE_COMPONENT_COLORS: [Color32; 6] = [
    Color32::from_rgb(0xe6, 0x9f, 0x00),
    Color32::from_rgb(0x2f, 0xb3, 0xa3),
    Color32::from_rgb(0xb4, 0x7a, 0xe0),
    Color32::from_rgb(0xe0, 0x7a, 0xa8),
    Color32::from_rgb(0x9a, 0xa6, 0x3a),
    Color32::from_rgb(0x8a, 0x98, 0xa8),
];

/// The area in which curves are drawn.
pub(super) struct Plot {
    pub rect: Rect,
    time_span: Span,
    value_span: Span,
}

impl Plot {
    fn x(&self, time: Time) -> f32 {
        self.x_at(time.as_secs())
    }

    pub(super) fn x_at(&self, secs: f64) -> f32 {
        self.rect.left() + self.time_span.x_of(secs, self.rect.width())
    }

    pub(super) fn y(&self, value: f64) -> f32 {
        let part = (value - self.value_span.from) / (self.value_span.to - self.value_span.from);
        self.rect.bottom() - (part.clamp(-1e4, 1e4) * f64::from(self.rect.height())) as f32
    }

    /// Difference in value per pixel of the screen.
    pub(super) fn value_per_pixel(&self, ui: &Ui) -> f64 {
        self.value_difference(1.0 / ui.ctx().pixels_per_point())
    }

    /// Difference in value for a height in points.
    pub(super) fn value_difference(&self, points: f32) -> f64 {
        f64::from(points / self.rect.height().max(1.0)) * (self.value_span.to - self.value_span.from)
    }

    pub(super) fn secs(&self, x: f32) -> f64 {
        self.time_span.secs_at(x - self.rect.left(), self.rect.width())
    }
}

pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer) {
    viewer.curves.was_drawn = true;
    let Some((what, all)) = displayed_properties(viewer) else {
        ui.label(
            "select an actor, a camera, a light, an effect or a title: its keys are shown here as curves",
        );
        return;
    };
    show_toolbar(ui, viewer, &what, &all);
    let area = ui.available_rect_before_wrap();
    let ruler = Rect::from_min_max(
        pos2(area.left() + LABELS_WIDTH, area.top()),
        pos2(area.right(), area.top() + RULER_HEIGHT),
    );
    if ruler.width() < 20.0 || area.height() < RULER_HEIGHT + 20.0 {
        return;
    }
    let rect = Rect::from_min_max(pos2(ruler.left(), ruler.bottom()), area.max);
    viewer.curves.hovered = ui.rect_contains_pointer(area);
    if viewer.curves.fits_to_keys {
        fit_view(viewer, &all);
    } else if viewer.curves.changes_object(&what, &all) {
        fit_when_first_shown(viewer, &all);
    }
    zoom_and_pan_with_wheel(ui, viewer, rect);
    show_ruler(ui, viewer, (ruler, viewer.curves.time), "time of the curves");
    let plot = Plot { rect, time_span: viewer.curves.time, value_span: viewer.curves.values };
    draw_grid(ui, viewer, &plot, &all);
    show_property_names(ui, viewer, Rect::from_min_max(area.min, pos2(ruler.left(), area.bottom())), &all);
    handle_background(ui, viewer, &plot, &what, &all);
    for (index, property) in all.iter().enumerate() {
        draw_curve_lines(ui, viewer, &plot, property, index);
    }
    let mut act = None;
    for (index, property) in all.iter().enumerate() {
        act = show_bezier_ease_handles(ui, viewer, &plot, property, index).or(act);
        let shaped = tangents::show(ui, viewer, &plot, property, index);
        act = shaped.map(|(key, shape)| Act::Key(KeyAct::SetShape(key, shape, None))).or(act);
        act = show_keys(ui, viewer, &plot, property, index).or(act);
    }
    draw_beats_and_playhead(ui, viewer, area, (ruler, viewer.curves.time));
    if all.is_empty() {
        let text = "no keys yet: press K, or click the diamond beside a value in the inspector";
        let color = ui.visuals().weak_text_color();
        ui.painter_at(rect).text(
            rect.center(),
            Align2::CENTER_CENTER,
            text,
            FontId::proportional(13.0),
            color,
        );
    }
    if let Some(act) = act {
        run(ui, viewer, act);
    }
    ui.allocate_rect(area, Sense::hover());
}

/// The object whose curves are shown, and its properties that have keys.
fn displayed_properties(viewer: &mut Viewer) -> Option<(Selected, Arc<Vec<KeyedProperty>>)> {
    let what = viewer.keyed_selection()?;
    let (_, keyed) = viewer.known_properties(&what)?;
    Some((what, keyed))
}

enum Act {
    Key(KeyAct),
    Click(KeyRef, bool),
    FinishDrag(KeyDrag),
    /// Sets the Bézier easing of the span before a key: its control points.
    SetEase(KeyRef, [f64; 4]),
}

fn run(ui: &Ui, viewer: &mut Viewer, act: Act) {
    if matches!(act, Act::FinishDrag(_) | Act::SetEase(..)) && headers::refuses_locked(viewer) {
        return;
    }
    match act {
        Act::Key(act) => key_menu::run(ui, viewer, act),
        Act::Click(key, true) => viewer.select_more_keys(&[key]),
        Act::Click(key, false) => viewer.select_keys(vec![key]),
        Act::FinishDrag(KeyDrag { key, part, by, value }) => {
            let keys = viewer.selected_keys().to_vec();
            let value = ValueDrag { property: key.property.clone(), part, offset: value };
            viewer.edit(|v| v.drag_keys(&keys, by, Some(&value)));
        }
        Act::SetEase(key, points) => {
            let [x1, y1, x2, y2] = points.map(choreo_session::edit::format_number);
            let ease = format!("[{x1}, {y1}, {x2}, {y2}]");
            viewer.edit(|v| v.set_key_ease(&[key], Some(&ease)));
        }
    }
}

fn show_toolbar(ui: &mut Ui, viewer: &mut Viewer, what: &Selected, all: &[KeyedProperty]) {
    ui.horizontal(|ui| {
        let mut bar = Toolbar::new("curves");
        let name = match what {
            Selected::Actor(name) | Selected::Camera(name) => name.clone(),
            Selected::Light(index) => viewer.light_name(*index),
            Selected::Effect(index) => viewer.effect_name(*index),
            Selected::Title(index) => format!("title {}", index + 1),
            Selected::Cue { actor, .. } => actor.clone(),
            Selected::Sky => "sky".to_string(),
        };
        let hint = "show all keys, or those that are selected (Home)";
        bar.add_button("Fit", hint, |viewer: &mut Viewer| viewer.curves.fits_to_keys = true);
        let hint = "show the change of each value per second instead of the value";
        bar.add_toggle(viewer.curves.shows_speed, "Speed", hint, |viewer| {
            viewer.curves.shows_speed ^= true;
            viewer.curves.fit_values(all, Time::ZERO, None);
        });
        let hint = "scale each property to the full height, whatever its unit";
        bar.add_toggle(viewer.curves.normalized, "Normalize", hint, |viewer| {
            viewer.curves.normalized ^= true;
            viewer.curves.fit_values(all, Time::ZERO, None);
        });
        let hint = "dragged times snap to whole frames (N)";
        bar.add_toggle(viewer.snap, "Snap", hint, |viewer| viewer.snap ^= true);
        let hint = "set keys of the visible curves at the playhead (K)";
        bar.add_button("Set key", hint, key_menu::set_keys);
        // The name follows the buttons, so that its length does not move them.
        bar.add_widget("name", true, move |ui, _| drop(ui.strong(name)));
        let frame = viewer.playhead.frame();
        let time = format!("{:.3} s   frame {frame}", viewer.playhead.time().as_secs());
        bar.add_text(&time, "", egui::TextStyle::Monospace);
        bar.show(ui, viewer, 0.0);
    });
}

/// Fits the view to all keys, or to the selected ones, with a margin.
fn fit_view(viewer: &mut Viewer, all: &[KeyedProperty]) {
    viewer.curves.fits_to_keys = false;
    let selected: Vec<Time> = viewer.selected_keys().iter().map(|key| key.at).collect();
    let times: Vec<Time> = match selected.len() {
        0 | 1 => all.iter().flat_map(|property| property.keys.iter().copied()).collect(),
        _ => selected,
    };
    let (Some(first), Some(last)) = (times.iter().min().copied(), times.iter().max().copied()) else {
        viewer.curves.time = Span::whole(viewer.playhead.length().as_secs());
        return;
    };
    viewer.curves.time = span_with_margin(first, last);
    viewer.curves.fit_values(all, Time::ZERO, Some((first, last)));
}

/// Fits the view when curves are shown for the first time: the values, and the times if a key is outside the visible range.
fn fit_when_first_shown(viewer: &mut Viewer, all: &[KeyedProperty]) {
    viewer.curves.fit_values(all, Time::ZERO, None);
    let keys = || all.iter().flat_map(|property| &property.keys);
    let (Some(first), Some(last)) = (keys().min(), keys().max()) else { return };
    let shown = viewer.curves.time;
    if first.as_secs() < shown.from || last.as_secs() > shown.to {
        viewer.curves.time = span_with_margin(*first, *last);
    }
}

/// A time span with a margin.
fn span_with_margin(first: Time, last: Time) -> Span {
    let margin = ((last - first).as_secs() * 0.06).max(0.2);
    Span { from: first.as_secs() - margin, to: last.as_secs() + margin }
}

/// The wheel zooms time, as in the sequencer; with Ctrl it zooms values, with Shift it pans.
fn zoom_and_pan_with_wheel(ui: &Ui, viewer: &mut Viewer, rect: Rect) {
    let Some(pointer) = ui.ctx().pointer_hover_pos().filter(|p| rect.contains(*p) && viewer.curves.hovered)
    else {
        return;
    };
    let (scroll, zoom) =
        ui.input_mut(|i| (std::mem::take(&mut i.smooth_scroll_delta), f64::from(i.zoom_delta())));
    let length = viewer.playhead.length().as_secs();
    let (x, width) = (pointer.x - rect.left(), rect.width());
    if scroll.y != 0.0 {
        viewer.curves.time.zoom(libm::exp(f64::from(scroll.y) / 200.0), x, width, length);
    }
    if scroll.x != 0.0 {
        viewer.curves.time.pan(scroll.x, width, length);
    }
    if zoom != 1.0 {
        let part = f64::from((rect.bottom() - pointer.y) / rect.height().max(1.0));
        viewer.curves.values.zoom_values(zoom, part);
    }
}

/// Draws lines at round values, with the unit.
fn draw_grid(ui: &Ui, viewer: &Viewer, plot: &Plot, all: &[KeyedProperty]) {
    let painter = ui.painter_at(plot.rect);
    let visuals = ui.visuals();
    painter.rect_filled(plot.rect, 0.0, visuals.extreme_bg_color);
    let units: std::collections::BTreeSet<&str> = all.iter().map(|property| property.unit).collect();
    let unit = match (units.len(), units.first()) {
        (1, Some(unit)) if !unit.is_empty() => format!(" {unit}"),
        _ => String::new(),
    };
    let unit = if viewer.curves.shows_speed { format!("{unit}/s") } else { unit };
    let step = plot.value_span.ruler_interval(plot.rect.height(), 28.0);
    let digits = (-libm::log10(step)).ceil().clamp(0.0, 6.0) as usize;
    let line = visuals.weak_text_color().gamma_multiply(0.25);
    let mut value = (plot.value_span.from / step).ceil() * step;
    while value <= plot.value_span.to {
        let y = plot.y(value);
        let strong = if value.abs() < step * 1e-6 { 2.5 } else { 1.0 };
        painter.hline(plot.rect.x_range(), y, Stroke::new(1.0, line.gamma_multiply(strong)));
        let has_room = y - 12.0 > plot.rect.top();
        if has_room && (!viewer.curves.normalized || viewer.curves.shows_speed) {
            let text = format!("{}{unit}", fixed_digits(value, digits));
            let at = pos2(plot.rect.left() + 4.0, y - 1.0);
            painter.text(
                at,
                Align2::LEFT_BOTTOM,
                text,
                FontId::proportional(10.0),
                visuals.weak_text_color(),
            );
        }
        value += step;
    }
    let step = plot.time_span.ruler_interval(plot.rect.width(), 56.0);
    let mut secs = (plot.time_span.from / step).ceil() * step;
    while secs <= plot.time_span.to {
        painter.vline(plot.x(Time::from_secs(secs)), plot.rect.y_range(), Stroke::new(1.0, line));
        secs += step;
    }
}

/// Draws the names of the curves: a click hides or shows a curve, with Ctrl it is shown alone.
fn show_property_names(ui: &mut Ui, viewer: &mut Viewer, rect: Rect, all: &[KeyedProperty]) {
    let mut toggled = None;
    let mut ui = ui.new_child(UiBuilder::new().max_rect(rect));
    ui.set_clip_rect(rect.intersect(ui.clip_rect()));
    egui::ScrollArea::vertical().id_salt("curves").auto_shrink([false, false]).show(&mut ui, |ui| {
        ui.spacing_mut().item_spacing.y = 0.0;
        for (index, property) in all.iter().enumerate() {
            for part in 0..property.width() {
                let (row, response) = ui.allocate_exact_size(vec2(rect.width(), ROW_HEIGHT), Sense::click());
                let shown = viewer.curves.is_shown(property, part);
                let name = format!("{} {}", property.title(), property.part(part)).trim_end().to_string();
                let label = format!("curve {name}");
                response.widget_info(|| {
                    egui::WidgetInfo::selected(egui::WidgetType::Checkbox, true, shown, label.clone())
                });
                let color = curve_color(ui, property, index, part);
                let swatch =
                    Rect::from_center_size(pos2(row.left() + 12.0, row.center().y), vec2(10.0, 10.0));
                match shown {
                    true => ui.painter().rect_filled(swatch, 2.0, color),
                    false => {
                        ui.painter().rect_stroke(swatch, 2.0, Stroke::new(1.0, color), StrokeKind::Inside)
                    }
                };
                let text = if shown { ui.visuals().text_color() } else { ui.visuals().weak_text_color() };
                let galley = super::truncated_text(ui.painter(), &name, 12.0, text, row.width() - 78.0);
                ui.painter().galley(
                    pos2(row.left() + 24.0, row.center().y - galley.size().y / 2.0),
                    galley,
                    text,
                );
                let now = property.at(viewer.playhead.time());
                let value = now
                    .get(part)
                    .map_or(String::new(), |v| format!("{} {}", fixed_digits(*v, 2), property.unit));
                let font = FontId::monospace(10.5);
                let weak = ui.visuals().weak_text_color();
                ui.painter().text(
                    pos2(row.right() - 6.0, row.center().y),
                    Align2::RIGHT_CENTER,
                    value,
                    font,
                    weak,
                );
                if response.hint("click: hide or show it; Ctrl click: show it alone").clicked() {
                    let curve = (property.what.clone(), property.name.clone(), part);
                    toggled = Some((curve, gesture::modifiers(ui).command));
                }
            }
        }
    });
    let Some((curve, alone)) = toggled else { return };
    let hidden = &mut viewer.curves.hidden;
    if alone {
        let parts = |p: &KeyedProperty| {
            let part = |part| (p.what.clone(), p.name.clone(), part);
            (0..p.width()).map(part).collect::<Vec<_>>()
        };
        let others: Vec<_> = all.iter().flat_map(parts).filter(|other| *other != curve).collect();
        let is_alone = others.iter().all(|other| hidden.contains(other));
        hidden.retain(|(what, ..)| *what != curve.0);
        hidden.extend(others.into_iter().filter(|_| !is_alone));
    } else if !hidden.remove(&curve) {
        hidden.insert(curve);
    }
    viewer.curves.fit_values(all, Time::ZERO, None);
}

/// Color of a component: red, green and blue for colors and axes.
pub(super) fn curve_color(ui: &Ui, property: &KeyedProperty, index: usize, part: usize) -> Color32 {
    let color = match (property.width(), part) {
        // A single angle is about y.
        (1, _) if property.kind == ValueKind::Rotation => Y_COLOR,
        (1, _) => SINGLE_COMPONENT_COLORS[index % SINGLE_COMPONENT_COLORS.len()],
        (_, 0) => X_COLOR,
        (_, 1) => Y_COLOR,
        (_, 2) => Z_COLOR,
        _ => Color32::GRAY,
    };
    theme_color(color, property.kind == ValueKind::Rotation, ui.visuals().dark_mode)
}

/// Color adapted to the theme. Rotations contrast more with the background than positions along the same axis.
fn theme_color(color: Color32, is_rotation: bool, dark_mode: bool) -> Color32 {
    let of = |value: u8| match (dark_mode, is_rotation) {
        (true, false) => value,
        (true, true) => value + (255 - value) / 2,
        (false, false) => (u16::from(value) * 3 / 4) as u8,
        (false, true) => value / 2,
    };
    Color32::from_rgb(of(color.r()), of(color.g()), of(color.b()))
}

/// A drag over empty places selects keys in a box, the middle button pans, a double click on a curve sets a key.
fn handle_background(ui: &Ui, viewer: &mut Viewer, plot: &Plot, what: &Selected, all: &[KeyedProperty]) {
    let response = ui.interact(plot.rect, ui.id().with("plot"), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Other, true, "curves"));
    if response.dragged_by(PointerButton::Middle) {
        let by = response.drag_delta();
        viewer.curves.time.pan(by.x, plot.rect.width(), viewer.playhead.length().as_secs());
        viewer.curves.values.pan_values(f64::from(by.y / plot.rect.height().max(1.0)));
        return;
    }
    let pointer = response.interact_pointer_pos();
    if let (true, Some(at)) = (response.double_clicked(), pointer) {
        if let Some(property) = curve_at(viewer, plot, all, at) {
            let time = Time::from_secs(viewer.snapped(plot.secs(at.x)));
            let name = property.name.clone();
            if !headers::refuses_locked(viewer) {
                viewer.edit(|v| v.set_keys_at(what, &[&name], time));
            }
        }
        return;
    }
    if response.clicked() {
        viewer.select_keys(Vec::new());
    }
    let id = response.id.with("from");
    if response.drag_started_by(PointerButton::Primary) {
        let from = ui.input(|i| i.pointer.press_origin());
        ui.data_mut(|d| d.insert_temp(id, from));
    }
    let from: Option<Option<Pos2>> = ui.data(|d| d.get_temp(id));
    let (Some(Some(from)), Some(to)) = (from, pointer) else { return };
    let area = Rect::from_two_pos(from, to).intersect(plot.rect);
    let color = ui.visuals().selection.stroke.color;
    let painter = ui.ctx().layer_painter(egui::LayerId::new(egui::Order::Foreground, id));
    painter.rect_stroke(area, 0.0, Stroke::new(1.0, color), StrokeKind::Inside);
    if !response.drag_stopped() {
        return;
    }
    ui.data_mut(|d| d.remove::<Option<Pos2>>(id));
    let mut keys = Vec::new();
    for property in all {
        let scale = viewer.curves.scale(property);
        for key in &property.keys {
            let shown = viewer.curves.displayed_values(property, *key, scale);
            let mut parts =
                shown.iter().enumerate().filter(|(part, _)| viewer.curves.is_shown(property, *part));
            if parts.any(|(_, value)| area.contains(pos2(plot.x(*key), plot.y(*value)))) {
                keys.push(key_ref(property, *key));
            }
        }
    }
    if gesture::adds_to_selection(ui) {
        keys.extend(viewer.selected_keys().iter().cloned());
    }
    viewer.select_keys(keys);
}

pub(super) fn key_ref(property: &KeyedProperty, at: Time) -> KeyRef {
    KeyRef { what: property.what.clone(), property: property.name.clone(), at }
}

/// The property whose curve is under the pointer.
fn curve_at<'p>(
    viewer: &Viewer,
    plot: &Plot,
    all: &'p [KeyedProperty],
    at: Pos2,
) -> Option<&'p KeyedProperty> {
    let time = Time::from_secs(plot.secs(at.x));
    all.iter().find(|property| {
        let values = viewer.curves.displayed_values(property, time, viewer.curves.scale(property));
        let mut shown = values.iter().enumerate().filter(|(part, _)| viewer.curves.is_shown(property, *part));
        shown.any(|(_, value)| (plot.y(*value) - at.y).abs() < 8.0)
    })
}

/// Draws the curves of one property, sampled from the stage.
fn draw_curve_lines(ui: &Ui, viewer: &Viewer, plot: &Plot, property: &KeyedProperty, index: usize) {
    let painter = ui.painter_at(plot.rect);
    let from = Time::from_secs(plot.time_span.from.max(0.0));
    let to =
        Time::from_secs(plot.time_span.to.min(viewer.playhead.length().as_secs()).max(plot.time_span.from));
    let count = (plot.rect.width() / SAMPLE_DISTANCE) as usize;
    let samples = viewer.curves.samples(property, from, to, count);
    for part in (0..property.width()).filter(|part| viewer.curves.is_shown(property, *part)) {
        let points = samples.iter().filter_map(|(time, v)| Some(pos2(plot.x(*time), plot.y(*v.get(part)?))));
        let color = curve_color(ui, property, index, part);
        painter.add(Shape::line(points.collect(), Stroke::new(1.5, color)));
    }
}

/// Draws the keys of one property as points, and returns the user's action.
fn show_keys(
    ui: &Ui,
    viewer: &mut Viewer,
    plot: &Plot,
    property: &KeyedProperty,
    index: usize,
) -> Option<Act> {
    let mut act = None;
    let (fps, scale) = (viewer.playhead.fps(), viewer.curves.scale(property));
    let first = property.keys.partition_point(|at| plot.x(*at) < plot.rect.left() - KEY_HALF_WIDTH);
    for (number, at) in property.keys.iter().enumerate().skip(first).take(MAX_KEYS) {
        let x = plot.x(*at);
        if !plot.rect.expand(KEY_HALF_WIDTH).x_range().contains(x) {
            continue;
        }
        let key = key_ref(property, *at);
        let selected = viewer.is_key_selected(&key);
        let values = viewer.curves.displayed_values(property, *at, scale);
        let parts =
            (0..property.width().min(values.len())).filter(|part| viewer.curves.is_shown(property, *part));
        for part in parts.collect::<Vec<_>>() {
            let place = pos2(x, plot.y(values[part]));
            if !plot.rect.expand(KEY_HALF_WIDTH).contains(place) {
                continue;
            }
            let hit = Rect::from_center_size(place, vec2(12.0, 12.0)).intersect(plot.rect);
            let id = ui.id().with(("key", &property.name, part, number));
            let response = ui.interact(hit, id, Sense::click_and_drag()).on_hover_cursor(CursorIcon::Grab);
            let name = format!("{} {}", property.title(), property.part(part)).trim_end().to_string();
            let label = format!("key {name} at {}", fps.frames_in(*at));
            response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, true, label.clone()));
            act = drag_key(ui, viewer, plot, property, &key, part, &response).or(act);
            let by = viewer.curves.drag.as_ref().filter(|_| selected);
            let place =
                by.map_or(place, |drag| dragged_key_position(viewer, plot, property, part, *at, drag));
            show_key(ui, plot, place, curve_color(ui, property, index, part), selected || response.hovered());
            if response.clicked() {
                act = Some(Act::Click(key.clone(), gesture::adds_to_selection(ui)));
            }
            act = key_menu::open_on_right_click(&response, viewer, std::slice::from_ref(&key))
                .map(Act::Key)
                .or(act);
            let number = fixed_digits(property.at(*at).get(part).copied().unwrap_or_default(), 3);
            response.hint(format!("{name} {number} {}\n{}", property.unit, viewer.time_text(*at)));
        }
    }
    act
}

fn show_key(ui: &Ui, plot: &Plot, at: Pos2, color: Color32, strong: bool) {
    let painter = ui.painter_at(plot.rect.expand(KEY_HALF_WIDTH));
    let diamond_points = |half: f32| {
        vec![at + vec2(0.0, -half), at + vec2(half, 0.0), at + vec2(0.0, half), at + vec2(-half, 0.0)]
    };
    let (fill, half) =
        if strong { (SELECTED_COLOR, KEY_HALF_WIDTH + 1.5) } else { (color, KEY_HALF_WIDTH + 0.5) };
    let line = Stroke::new(1.0, ui.visuals().extreme_bg_color);
    painter.add(Shape::convex_polygon(diamond_points(half + 1.0), fill, line));
}

/// Position of a selected key during a drag.
fn dragged_key_position(
    viewer: &Viewer,
    plot: &Plot,
    property: &KeyedProperty,
    part: usize,
    at: Time,
    drag: &KeyDrag,
) -> Pos2 {
    let mut numbers = property.at(at);
    if drag.key.property == property.name && drag.part == part {
        numbers[part] = (numbers[part] + drag.value).clamp(property.range[0], property.range[1]);
    }
    let (add, divide) = viewer.curves.scale(property);
    let drawn = match viewer.curves.shows_speed {
        true => viewer.curves.displayed_values(property, at, (add, divide))[part],
        false => (numbers[part] + add) / divide,
    };
    pos2(plot.x(at + Time::from_secs(drag.by)), plot.y(drawn))
}

/// Handles the drag of a key in time and value; with Shift only along one axis.
fn drag_key(
    ui: &Ui,
    viewer: &mut Viewer,
    plot: &Plot,
    property: &KeyedProperty,
    key: &KeyRef,
    part: usize,
    response: &Response,
) -> Option<Act> {
    if !response.dragged_by(PointerButton::Primary) && !response.drag_stopped_by(PointerButton::Primary) {
        return None;
    }
    let (from, to) = (ui.input(|i| i.pointer.press_origin()), response.interact_pointer_pos()?);
    let id = response.id.with("from");
    if response.drag_started() {
        ui.data_mut(|d| d.insert_temp(id, from.unwrap_or(to)));
        if !viewer.is_key_selected(key) {
            viewer.select_keys(vec![key.clone()]);
        }
    }
    let from: Pos2 = ui.data(|d| d.get_temp(id)).unwrap_or(to);
    let mut by = to - from;
    if gesture::modifiers(ui).shift {
        by = if by.x.abs() > by.y.abs() { vec2(by.x, 0.0) } else { vec2(0.0, by.y) };
    }
    let secs = match by.x.abs() < DRAG_THRESHOLD {
        true => 0.0,
        false => {
            let wanted = key.at.as_secs() + plot.secs(by.x) - plot.secs(0.0);
            let snap_distance = plot.secs(6.0) - plot.secs(0.0);
            viewer.snap_target(wanted, snap_distance, None).unwrap_or_else(|| viewer.snapped(wanted))
                - key.at.as_secs()
        }
    };
    let (_, divide) = viewer.curves.scale(property);
    let keeps_value =
        by.y.abs() < DRAG_THRESHOLD || viewer.curves.shows_speed || !property.has_editable_components();
    let value = if keeps_value { 0.0 } else { -plot.value_difference(by.y) * divide };
    let now = property.at(key.at).get(part).copied().unwrap_or_default();
    let value =
        if keeps_value { 0.0 } else { round_to_pixel(now + value, plot.value_per_pixel(ui) * divide) - now };
    let drag = KeyDrag { key: key.clone(), part, by: secs, value };
    let time = viewer.time_text(key.at + Time::from_secs(secs));
    let unit = property.unit;
    let number = fixed_digits((now + value).clamp(property.range[0], property.range[1]), 3);
    draw_text_at_pointer(ui, to, &format!("{time}   {} {number} {unit}", property.part(part)));
    if response.drag_stopped() {
        viewer.curves.drag = None;
        ui.data_mut(|d| d.remove::<Pos2>(id));
        return (secs != 0.0 || value != 0.0).then_some(Act::FinishDrag(drag));
    }
    viewer.curves.drag = Some(drag);
    None
}

/// Draws the control points of Bézier easings at selected keys, which can be dragged.
fn show_bezier_ease_handles(
    ui: &Ui,
    viewer: &Viewer,
    plot: &Plot,
    property: &KeyedProperty,
    index: usize,
) -> Option<Act> {
    let written = property.written.as_ref().filter(|_| !viewer.curves.shows_speed)?;
    let (mut act, scale) = (None, viewer.curves.scale(property));
    for number in 1..property.keys.len().min(MAX_KEYS) {
        let (before, at) = (property.keys[number - 1], property.keys[number]);
        let near = [before, at].map(|at| viewer.is_key_selected(&key_ref(property, at)));
        let ease = written.keys.get(number).and_then(|key| key.shape.as_ref()?.ease.as_deref());
        let ease = ease.and_then(parse_bezier);
        let Some(ease) = ease.filter(|_| near.contains(&true)) else { continue };
        let [from, to] = [before, at].map(|at| viewer.curves.displayed_values(property, at, scale));
        for part in
            (0..property.width().min(from.len())).filter(|part| viewer.curves.is_shown(property, *part))
        {
            let ends = [pos2(plot.x(before), plot.y(from[part])), pos2(plot.x(at), plot.y(to[part]))];
            for side in 0..2 {
                let id = ui.id().with(("ease", &property.name, part, number, side));
                let color = curve_color(ui, property, index, part);
                if let Some(points) = show_bezier_ease_handle(ui, plot, id, ends, ease, side, color) {
                    act = Some(Act::SetEase(key_ref(property, at), points));
                }
            }
        }
    }
    act
}

/// One of the two control points of an easing between two keys. At the end of a drag, returns the new control points.
fn show_bezier_ease_handle(
    ui: &Ui,
    plot: &Plot,
    id: egui::Id,
    ends: [Pos2; 2],
    ease: [f64; 4],
    side: usize,
    color: Color32,
) -> Option<[f64; 4]> {
    let size = ends[1] - ends[0];
    let place =
        |ease: [f64; 4]| ends[0] + vec2(size.x * ease[2 * side] as f32, size.y * ease[2 * side + 1] as f32);
    let hit = Rect::from_center_size(place(ease), vec2(11.0, 11.0));
    let response = ui.interact(hit.intersect(plot.rect), id, Sense::drag()).on_hover_cursor(CursorIcon::Grab);
    let label = ["start of the easing", "end of the easing"][side];
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Slider, true, label));
    let mut now = ease;
    if let Some(at) = gesture::dragged_position(ui, &response, place(ease)) {
        let part = |at: f32, from: f32, size: f32| f64::from((at - from) / size).clamp(0.0, 1.0);
        let hundredth = |value: f64| (value * 100.0).round() / 100.0;
        if size.x.abs() > 1.0 {
            now[2 * side] = hundredth(part(at.x, ends[0].x, size.x));
        }
        if size.y.abs() > 1.0 {
            now[2 * side + 1] = hundredth(part(at.y, ends[0].y, size.y));
        }
    }
    let painter = ui.painter_at(plot.rect);
    painter.line_segment([ends[side], place(now)], Stroke::new(1.0, color));
    painter.circle(place(now), 4.0, ui.visuals().extreme_bg_color, Stroke::new(1.5, color));
    (response.drag_stopped() && now != ease).then_some(now)
}

/// Control points of an easing that is written as a Bézier curve.
fn parse_bezier(ease: &str) -> Option<[f64; 4]> {
    let inside = ease.strip_prefix('[')?.strip_suffix(']')?;
    let numbers: Vec<f64> = inside.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::{X_COLOR, Y_COLOR, Z_COLOR, theme_color};

    #[test]
    fn rotation_curves_have_other_colors_than_position_curves() {
        for dark_mode in [true, false] {
            for axis in [X_COLOR, Y_COLOR, Z_COLOR] {
                let [place, rotation] = [false, true].map(|is| theme_color(axis, is, dark_mode));
                let apart = |of: fn(&egui::Color32) -> u8| of(&place).abs_diff(of(&rotation));
                let apart = u32::from(apart(egui::Color32::r))
                    + u32::from(apart(egui::Color32::g))
                    + u32::from(apart(egui::Color32::b));
                assert!(apart > 80, "{place:?} {rotation:?}");
            }
        }
    }
}
