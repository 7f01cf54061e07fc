//! Marks in a row of the sequencer in addition to its bars: events and foot contacts. A click moves the playhead there.

use super::bars::draw_text_at_pointer;
use super::foot_contacts::FootContacts;
use super::gesture;
use super::hint::Hint;
use super::key_menu::{self, KeyAct};
use super::sequencer::{BAR_COLORS, FOOT_STRIP_HEIGHT};
use crate::app::Viewer;
use crate::editing::file_name;
use crate::state::events::{Event, EventKind};
use crate::state::keyed::KeyRef;
use crate::state::selection::{Selected, actor};
use crate::state::timeline::{Row, RowNumber};
use choreo_motion::Time;
use choreo_script::{Place, Severity};
use egui::{Color32, Rect, Sense, Shape, Stroke, Ui, pos2, vec2};

/// Half width of a mark, points.
const MARK_HALF_WIDTH: f32 = 4.0;
/// Height of the part at the top of a row with bars where marks take the pointer, points. It ends above the middle of the bars, so that handles can
/// be grabbed below it if a mark lies on an edge.
pub(super) const MARK_BAND_HEIGHT: f32 = 2.0 * MARK_HALF_WIDTH;
/// Color of a selected key.
pub(super) const SELECTED_COLOR: Color32 = Color32::from_rgb(0xff, 0x8a, 0x2a);
/// Largest number of marks in one row that can be pointed at.
const MAX_MARKS: usize = 400;

/// File name and line of a position: `dance.rhai:12`.
pub(super) fn file_and_line(place: &Place) -> String {
    format!("{}:{}", file_name(&place.file), place.line)
}

/// An action of the user on a mark.
pub(super) enum MarkAct {
    /// A click; `true`: adds to the selection, with Ctrl or Shift.
    Click(Event, bool),
    /// A drag by seconds.
    Move(Event, f64),
    Key(KeyAct),
}

/// Key of the time by which keys are dragged in this frame, seconds; other selected keys are drawn with the same offset.
fn dragged_id() -> egui::Id {
    egui::Id::new("keys dragged")
}

/// Draws the marks of a row, and returns the user's action.
pub(super) fn show_events(
    ui: &Ui,
    viewer: &Viewer,
    row: &Row,
    number: RowNumber,
    lane: Rect,
) -> Option<MarkAct> {
    // Marks are above the names of bars.
    let y = mark_center_y(row, lane);
    let painter = ui.painter_at(lane);
    let severity = viewer.severity(&row.place);
    let mut last = f32::NEG_INFINITY;
    let mut act = None;
    let mut count = 0;
    let shared_drag_secs: Option<f64> = ui.data(|d| d.get_temp(dragged_id()));
    let row_name = viewer.timeline.row_name(number);
    for event in &row.events {
        let x = lane.left() + viewer.visible_span.x_of(event.at.as_secs(), lane.width());
        if !(lane.left() - MARK_HALF_WIDTH..=lane.right() + MARK_HALF_WIDTH).contains(&x)
            || x - last < 2.0
            || count >= MAX_MARKS
        {
            continue;
        }
        last = x;
        count += 1;
        let mut place = Rect::from_center_size(
            pos2(x, y),
            vec2(2.0 * MARK_HALF_WIDTH + 2.0, 2.0 * MARK_HALF_WIDTH + 2.0),
        );
        if !row.bars.is_empty() {
            place.max.y = lane.top() + MARK_BAND_HEIGHT;
        }
        // Drags are sensed, too; otherwise they would reach the widget below.
        let sense = Sense::click_and_drag();
        let response = ui.interact(place.intersect(lane), ui.id().with(("event", number, count)), sense);
        let label = format!("event {} on {row_name}", event.label.replace('\n', ", "));
        response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, true, label.clone()));
        let keys = event.key_refs();
        let selected = keys.iter().any(|key| viewer.is_key_selected(key));
        let fill = match severity {
            Some(Severity::Error) => Color32::from_rgb(0xff, 0x60, 0x50),
            Some(Severity::Warning) => Color32::from_rgb(0xf0, 0xa8, 0x30),
            _ if selected => SELECTED_COLOR,
            _ if response.hovered() || response.has_focus() => Color32::from_rgb(0xff, 0xd2, 0x5a),
            _ => Color32::from_gray(235),
        };
        let dragged = response.dragged_by(egui::PointerButton::Primary) || response.drag_stopped();
        let pointer = response.interact_pointer_pos().filter(|_| dragged);
        let to = pointer.map(|at| snapped_drag_time(viewer, event, lane, at.x));
        let by = to.map(|secs| secs - event.at.as_secs());
        if let Some(by) = by {
            let moves_selection = keys.iter().all(|key| viewer.is_key_selected(key));
            ui.data_mut(|d| match moves_selection && !response.drag_stopped() {
                true => drop(d.insert_temp(dragged_id(), by)),
                false => d.remove::<f64>(dragged_id()),
            });
        }
        let by = by.or(shared_drag_secs.filter(|_| selected));
        let shown =
            by.map_or(x, |by| lane.left() + viewer.visible_span.x_of(event.at.as_secs() + by, lane.width()));
        painter.add(marker_shape(event.kind, pos2(shown, y), fill));
        if let (Some(by), Some(at), true) = (by, pointer, dragged) {
            draw_text_at_pointer(ui, at, &viewer.time_text(event.at + Time::from_secs(by)));
            if response.drag_stopped() && by != 0.0 {
                act = Some(MarkAct::Move(event.clone(), by));
            }
        }
        if !keys.is_empty() {
            act = key_menu::open_on_right_click(&response, viewer, &keys).map(MarkAct::Key).or(act);
        }
        let add = gesture::adds_to_selection(ui);
        if response.hint(event_hint(viewer, event)).clicked() {
            act = Some(MarkAct::Click(event.clone(), add));
        }
    }
    act
}

/// Height of the marks of a row.
fn mark_center_y(row: &Row, lane: Rect) -> f32 {
    if row.bars.is_empty() { lane.center().y } else { lane.top() + 1.0 + MARK_HALF_WIDTH }
}

/// Keys of a row whose marks lie in a rectangle.
pub(crate) fn keys_within(viewer: &Viewer, row: &Row, lane: Rect, area: Rect) -> Vec<KeyRef> {
    let y = mark_center_y(row, lane);
    if area.bottom() < y - MARK_HALF_WIDTH || area.top() > y + MARK_HALF_WIDTH {
        return Vec::new();
    }
    let x = |event: &Event| lane.left() + viewer.visible_span.x_of(event.at.as_secs(), lane.width());
    row.events.iter().filter(|event| area.x_range().contains(x(event))).flat_map(Event::key_refs).collect()
}

/// New time of a dragged mark, seconds, snapped to nearby times, else to frames.
fn snapped_drag_time(viewer: &Viewer, event: &Event, lane: Rect, x: f32) -> f64 {
    let secs = |x: f32| viewer.visible_span.secs_at(x, lane.width());
    let secs_at_pointer = secs(x - lane.left());
    let snap_distance = secs(6.0) - secs(0.0);
    let near = viewer
        .snap_target(secs_at_pointer, snap_distance, None)
        .filter(|at| (at - event.at.as_secs()).abs() > 1e-9);
    near.unwrap_or_else(|| viewer.snapped(secs_at_pointer))
}

fn event_hint(viewer: &Viewer, event: &Event) -> String {
    let mut text = format!("{}\n{}", event.label, viewer.time_text(event.at));
    if event.place.line > 0 {
        text += &format!("\n{}", file_and_line(&event.place));
    }
    text
}

/// Shape of a mark: a diamond for a key, a circle for an entrance, a square for an actor's event, a flag for a marker.
fn marker_shape(kind: EventKind, at: egui::Pos2, fill: Color32) -> Shape {
    let line = Stroke::new(1.0, Color32::from_gray(20));
    let points = |all: &[(f32, f32)]| all.iter().map(|(x, y)| at + vec2(*x, *y) * MARK_HALF_WIDTH).collect();
    match kind {
        EventKind::Key => {
            Shape::convex_polygon(points(&[(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)]), fill, line)
        }
        EventKind::Visibility => Shape::Vec(vec![
            Shape::circle_filled(at, MARK_HALF_WIDTH - 0.5, fill),
            Shape::circle_stroke(at, MARK_HALF_WIDTH - 0.5, line),
        ]),
        EventKind::Constraint => {
            Shape::convex_polygon(points(&[(-0.8, -0.8), (0.8, -0.8), (0.8, 0.8), (-0.8, 0.8)]), fill, line)
        }
        EventKind::Marker => {
            Shape::convex_polygon(points(&[(-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)]), fill, line)
        }
    }
}

/// Draws foot contacts, a line for each foot. Returns the start of a clicked contact.
pub(super) fn draw_foot_contacts(ui: &Ui, viewer: &Viewer, row: &Row, lane: Rect) -> Option<Time> {
    let (Some(scene), Some(Selected::Actor(name))) = (&viewer.scene, &row.what) else { return None };
    let is_base = row.bars.iter().any(|b| matches!(b.what, Selected::Cue { layer: 0, .. }));
    let index = actor(&scene.stage, name).filter(|_| is_base)?;
    let id = egui::Id::new("foot contacts");
    let mut contacts: FootContacts = ui.data(|d| d.get_temp(id)).unwrap_or_default();
    let found = contacts.get(scene.number, &scene.stage, index);
    ui.data_mut(|d| d.insert_temp(id, contacts));
    let found = found?;
    let painter = ui.painter_at(lane);
    let line_height = FOOT_STRIP_HEIGHT / found.len() as f32;
    for (foot, part) in found.iter().enumerate() {
        let [r, g, b] = BAR_COLORS[foot % BAR_COLORS.len()];
        let top = lane.bottom() - FOOT_STRIP_HEIGHT + foot as f32 * line_height;
        for (from, to) in &part.spans {
            let x = |secs: f64| lane.left() + viewer.visible_span.x_of(secs, lane.width());
            let part = Rect::from_min_max(pos2(x(*from), top), pos2(x(*to), top + line_height));
            painter.rect_filled(part.intersect(lane), 0.0, Color32::from_rgb(r, g, b).gamma_multiply(1.4));
        }
    }
    // The clickable area is a little higher than the lines.
    let band = Rect::from_min_max(pos2(lane.left(), lane.bottom() - FOOT_STRIP_HEIGHT - 1.0), lane.max);
    let response = ui.interact(band, ui.id().with(("feet", index)), Sense::click());
    let label = format!("feet of {name}");
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Label, true, label.clone()));
    let pointer = response.hover_pos().or(response.interact_pointer_pos())?;
    let secs = viewer.visible_span.secs_at(pointer.x - lane.left(), lane.width());
    let standing = found.iter().flat_map(|foot| {
        let on = foot.spans.iter().filter(|(from, to)| *from <= secs && secs < *to);
        on.map(|span| (&foot.name, *span))
    });
    let standing: Vec<(&String, (f64, f64))> = standing.collect();
    let text = standing.iter().map(|(name, (from, to))| {
        let [from, to] = [*from, *to].map(|t| viewer.time_text(Time::from_secs(t)));
        format!("{name} on the floor, {from} to {to}")
    });
    let text = text.collect::<Vec<_>>().join("\n");
    // The latest contact decides.
    let down = standing.iter().map(|(_, (from, _))| *from).max_by(f64::total_cmp);
    let clicked = response.clicked();
    if !text.is_empty() {
        response.hint(text);
    }
    down.filter(|_| clicked).map(Time::from_secs)
}
