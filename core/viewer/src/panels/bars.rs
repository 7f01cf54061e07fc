//! Bars in a row of the sequencer: drawn, selected, and dragged by their center, ends and handles.

use super::bar_menu::{self, Command};
use super::gesture;
use super::headers;
use super::hint::Hint;
use super::inspector::ClipDrag;
use super::marks;
use super::sequencer::{FOOT_STRIP_HEIGHT, bar_color, count_following_joints, visible_row_rects};
use crate::app::Viewer;
use crate::editing::{ClipSource, EditError};
use crate::state::selection::Selected;
use crate::state::timeline::Bar;
use choreo_motion::{Repeat, Time};
use choreo_session::edit::CueTime;
use egui::{
    Align2, Color32, CornerRadius, CursorIcon, FontId, Modifiers, Painter, PointerButton, Pos2, Rect,
    Response, Sense, Stroke, StrokeKind, Ui, pos2, vec2,
};
use std::borrow::Cow;

/// Distance within which a dragged time snaps to another, points.
const SNAP_DISTANCE: f32 = 6.0;
/// Distance from its row within which a dragged bar stays in it, points.
const ROW_SLACK: f32 = 5.0;
/// Width of an end's handle inside the bar, points; narrower for narrow bars.
const INNER_HANDLE_WIDTH: f32 = 6.0;
/// Width of an end's handle outside the bar, where no other bar is, points.
const OUTER_HANDLE_WIDTH: f32 = 4.0;
/// Length of the dashes of a whole clip's outline, points.
const DASH_LENGTH: f32 = 5.0;
/// Largest number of round marks in a bar; more could not be distinguished.
const MAX_ROUND_MARKS: usize = 200;

/// An action of the user on a bar.
pub(super) enum Act {
    /// Selects a bar; `true`: adds it to the selection.
    Select(Bar, bool),
    Move(Bar, f64, MoveKind),
    /// Moves a bar to a time and to the row with this index.
    MoveTo(Bar, f64, usize),
    /// Slips a clip by clip seconds.
    Slip(Selected, f64),
    /// Sets a time by dragging its handle; `true`: the content stays in place.
    SetTime(Bar, CueTime, f64, bool),
    Stretch(Selected, f64),
    SetWeight(Selected, f64),
    /// A drag in a locked row, which is refused.
    RefuseLocked(Bar),
    RunCommand(Command),
}

/// Kind of a move.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum MoveKind {
    Alone,
    /// Ripple: all later bars of the layer move, too.
    Ripple,
    /// Overlap: the start moves over the previous bar.
    Overlap,
}

/// A row's lane, which converts between times and positions.
pub(super) struct Lane {
    pub rect: Rect,
    /// Index of the row.
    pub row: usize,
}

impl Lane {
    pub(super) fn x(&self, viewer: &Viewer, secs: f64) -> f32 {
        self.rect.left() + viewer.visible_span.x_of(secs, self.rect.width())
    }

    pub(super) fn secs(&self, viewer: &Viewer, x: f32) -> f64 {
        viewer.visible_span.secs_at(x - self.rect.left(), self.rect.width())
    }

    /// Distance within which a dragged time snaps to another, seconds.
    fn snap_distance(&self, viewer: &Viewer) -> f64 {
        self.secs(viewer, SNAP_DISTANCE) - self.secs(viewer, 0.0)
    }

    /// Time at a dragged position, snapped to nearby times of other bars, else to a frame. `excluded`: the dragged bar.
    pub(super) fn snapped(&self, viewer: &Viewer, x: f32, excluded: Option<&Bar>) -> f64 {
        let secs = self.secs(viewer, x);
        let near = viewer.snap_target(secs, self.snap_distance(viewer), excluded);
        near.unwrap_or_else(|| self.snapped_to_frame(viewer, secs))
    }

    /// The nearest tenth of a second if it falls on a frame, since such numbers are easier to read; else the nearest frame.
    fn snapped_to_frame(&self, viewer: &Viewer, secs: f64) -> f64 {
        let tenth = (secs * 10.0).round() / 10.0;
        let is_near =
            (tenth - secs).abs() <= self.snap_distance(viewer) / 2.0 && viewer.snapped(tenth) == tenth;
        if viewer.snap && is_near { tenth } else { viewer.snapped(secs) }
    }

    fn bar_rect(&self, viewer: &Viewer, from: f64, to: f64) -> Rect {
        let (left, right) = (self.x(viewer, from), self.x(viewer, to));
        let bottom = self.rect.bottom() - FOOT_STRIP_HEIGHT - 1.0;
        Rect::from_min_max(pos2(left, self.rect.top() + 1.5), pos2(right, bottom))
    }
}

/// Draws the bars of a row, and returns the user's action.
pub(super) fn show(
    ui: &Ui,
    viewer: &Viewer,
    bars: &[Bar],
    label: &str,
    lane: &Lane,
    locked: bool,
) -> Option<Act> {
    let (mut act, mut hovered_bar) = (None, None);
    for (number, bar) in bars.iter().enumerate() {
        let place = lane.bar_rect(viewer, bar.start.as_secs(), bar.end.as_secs()).intersect(lane.rect);
        if place.width() <= 0.0 {
            continue;
        }
        let response = ui.interact(place, ui.id().with(("bar", lane.row, number)), Sense::click_and_drag());
        let name = format!("{} on {label}", bar.label);
        response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, true, name.clone()));
        let selected = viewer.is_bar_selected(bar);
        let severity = viewer.severity(&bar.place);
        draw_bar(&ui.painter_at(lane.rect), viewer, bar, place, lane, (selected, severity));
        if response.clicked() {
            act = Some(Act::Select(bar.clone(), gesture::adds_to_selection(ui)));
        }
        act = match locked {
            true => response
                .drag_started_by(PointerButton::Primary)
                .then(|| Act::RefuseLocked(bar.clone()))
                .or(act),
            false => drag_bar(ui, viewer, bar, &response, lane).or(act),
        };
        act = bar_menu::show(&response, viewer, bar).or(act);
        if response.hint(bar_hint(viewer, bar)).hovered() {
            hovered_bar = Some(number);
        }
        if locked {
            continue;
        }
        for (part, at) in handle_times(bar) {
            act = show_time_handle(ui, viewer, (bars, number), part, at, lane).or(act);
        }
        if viewer.selection.as_ref() == Some(&bar.what) && bar.strip.is_some() {
            act = show_speed_handle(ui, viewer, bar, number, lane).or(act);
            act = show_weight_handle(ui, bar, number, lane, place).or(act);
        }
    }
    let painter = ui.painter_at(lane.rect);
    let shows_whole_clip =
        |(number, bar): &(usize, &Bar)| hovered_bar == Some(*number) || viewer.is_selected(&bar.what);
    bars.iter()
        .enumerate()
        .filter(shows_whole_clip)
        .for_each(|(_, bar)| draw_whole_clip(&painter, viewer, bar, lane));
    act
}

/// Performs an action.
pub(super) fn run(ui: &Ui, viewer: &mut Viewer, act: Act) {
    match act {
        Act::Select(bar, adds) => viewer.select_bar(bar, adds),
        Act::Move(bar, secs, kind) => viewer.edit(|v| v.move_bar(&bar, secs, kind)),
        Act::MoveTo(bar, secs, row) => viewer.edit(|v| v.move_bar_to(&bar, secs, row)),
        Act::Slip(what, by) => viewer.edit(|v| v.slip_cue(&what, by)),
        Act::SetTime(bar, part, secs, keeps_content) => {
            viewer.edit(|v| v.change_time(&bar, part, secs, keeps_content))
        }
        Act::Stretch(what, end) => viewer.edit(|v| v.stretch_cue(&what, end)),
        Act::SetWeight(what, weight) => viewer.edit(|v| v.set_weight(&what, weight)),
        Act::RefuseLocked(bar) => {
            let why = headers::locked_row_message(bar.what.actor().unwrap_or_default());
            viewer.edit(|_| Err(EditError::refused(why)));
        }
        Act::RunCommand(command) => bar_menu::run(ui, viewer, command),
    }
}

impl Viewer {
    /// The actor of a row, if the clip of a bar can be moved there.
    fn actor_accepting(&self, bar: &Bar, row: usize) -> Result<&str, Cow<'static, str>> {
        let Selected::Cue { actor, .. } = &bar.what else {
            return Err("only actors play clips; this bar stays in its own rows".into());
        };
        match self.timeline.rows.get(row).and_then(|row| row.what.as_ref()) {
            Some(Selected::Actor(name)) if name == actor => {
                Err("a layer of an actor is made by .on(…): set the joints in the inspector".into())
            }
            Some(Selected::Actor(name)) if self.toggles.locked.contains(name) => {
                Err(headers::locked_row_message(name).into())
            }
            Some(Selected::Actor(name)) => Ok(name),
            _ => Err("only actors play clips: drop the clip on the row of an actor".into()),
        }
    }

    /// Moves a bar, with the other selected bars, to the row of another actor.
    fn move_bar_to(&mut self, bar: &Bar, secs: f64, row: usize) -> Result<(), EditError> {
        let name = self
            .actor_accepting(bar, row)
            .map_err(|why| EditError::refused_at(&bar.place, &why))?
            .to_string();
        let all = self.selected_bars();
        let all = if all.contains(&bar.what) { all } else { vec![bar.what.clone()] };
        self.move_cues_to(&all, &name, secs - bar.start.as_secs())
    }

    /// Changes a time of a bar, as by dragging its handle. `keeps_content`: the content stays in place.
    pub(super) fn change_time(
        &mut self,
        bar: &Bar,
        part: CueTime,
        secs: f64,
        keeps_content: bool,
    ) -> Result<(), EditError> {
        match (bar.cut, part) {
            (_, CueTime::End) if matches!(bar.what, Selected::Camera(_)) => self.set_camera_end(bar, secs),
            (Some(cut), _) => self.set_cut(cut, secs),
            (None, CueTime::Start) if keeps_content && bar.strip.is_some() => self.trim_cue(&bar.what, secs),
            (None, CueTime::End) => self.set_bar_end(bar, secs),
            (None, part) => self.set_cue_time(&bar.what, part, secs),
        }
    }

    /// Moves a bar, with the other selected bars.
    pub(super) fn move_bar(&mut self, bar: &Bar, secs: f64, kind: MoveKind) -> Result<(), EditError> {
        let all = self.selected_bars();
        match (bar.cut, kind) {
            (Some(cut), MoveKind::Ripple) => return self.ripple_cuts(cut, secs),
            (Some(cut), _) => return self.set_cut(cut, secs),
            (None, _) => {}
        }
        match (&bar.what, kind) {
            (Selected::Camera(_), _) => {
                let why = "the first camera is on from the start; drag the cut at its end";
                Err(EditError::refused_at(&bar.place, why))
            }
            (Selected::Cue { .. }, MoveKind::Overlap) => self.overlap_cue(&bar.what, secs),
            (Selected::Cue { .. }, MoveKind::Ripple) => self.move_cue(&bar.what, secs, true),
            (_, MoveKind::Alone) if !self.selected_keys().is_empty() && all.contains(&bar.what) => {
                self.move_selected(secs - bar.start.as_secs())
            }
            _ if all.len() > 1 && all.contains(&bar.what) => self.move_bars(&all, secs - bar.start.as_secs()),
            (Selected::Cue { .. }, _) => self.move_cue(&bar.what, secs, false),
            _ => self.move_bars(std::slice::from_ref(&bar.what), secs - bar.start.as_secs()),
        }
    }
}

/// Handles of a bar, with their times.
fn handle_times(bar: &Bar) -> Vec<(CueTime, Time)> {
    match bar.what {
        Selected::Cue { .. } | Selected::Title(_) => {
            let fade = (bar.start + bar.fade_in).min(bar.end);
            let mut all = vec![(CueTime::Start, bar.start), (CueTime::End, bar.draggable_end)];
            all.extend((bar.fade_in > Time::ZERO).then_some((CueTime::FadeIn, fade)));
            // A title has one fade for both ends.
            let fades_out = bar.strip.is_some() && bar.fade_out > Time::ZERO;
            all.extend(fades_out.then_some((CueTime::FadeOut, (bar.end - bar.fade_out).max(bar.start))));
            all
        }
        Selected::Effect(_) => vec![(CueTime::Start, bar.start), (CueTime::End, bar.draggable_end)],
        _ if bar.cut.is_some() => vec![(CueTime::Start, bar.start)],
        _ => Vec::new(),
    }
}

/// Draws the preview of a dragged bar; at the end of the drag, returns its move or slip.
fn drag_bar(ui: &Ui, viewer: &Viewer, bar: &Bar, response: &Response, lane: &Lane) -> Option<Act> {
    if !response.dragged_by(PointerButton::Primary) && !response.drag_stopped() {
        return None;
    }
    let id = response.id.with("grabbed");
    if response.drag_started() {
        let origin = ui.input(|i| i.pointer.press_origin())?;
        ui.data_mut(|d| d.insert_temp(id, origin.x - lane.x(viewer, bar.start.as_secs())));
    }
    // Distance from the start of the bar to the point where it was grabbed, points.
    let grab_offset: f32 = ui.data(|d| d.get_temp(id))?;
    let pointer = response.interact_pointer_pos()?.x - grab_offset;
    let Modifiers { alt, shift, command, .. } = gesture::modifiers(ui);
    let length = (bar.end - bar.start).as_secs();
    let painter = ui.painter_at(lane.rect);
    if let (true, Some(strip)) = (alt, bar.strip) {
        // The content follows the pointer: dragging right shows an earlier part at a given time.
        let moved = bar.start.as_secs() - lane.secs(viewer, pointer);
        let by = moved.signum() * lane.snapped_to_frame(viewer, moved.abs()) * strip.speed.abs();
        let start = bar.start.as_secs() - (strip.secs_before_trim() + by) / strip.speed.abs();
        let ghost = lane.bar_rect(viewer, start, start + strip.clip_secs / strip.speed.abs());
        draw_outline(&painter, ghost);
        return (response.drag_stopped() && by != 0.0).then(|| Act::Slip(bar.what.clone(), by));
    }
    let (start_at_pointer, snap_distance) = (lane.secs(viewer, pointer), lane.snap_distance(viewer));
    // The edge that is nearest to a snap position decides.
    let starts = viewer.snap_target(start_at_pointer, snap_distance, Some(bar));
    let ends =
        viewer.snap_target(start_at_pointer + length, snap_distance, Some(bar)).map(|end| end - length);
    let near = starts.into_iter().chain(ends);
    let near = near.min_by(|a, b| (a - start_at_pointer).abs().total_cmp(&(b - start_at_pointer).abs()));
    let start = near.unwrap_or_else(|| lane.snapped_to_frame(viewer, start_at_pointer));
    let start = start.max(0.0);
    if let Some(other) = target_lane(ui, viewer, bar, lane, response.interact_pointer_pos()?) {
        let painter = ui.ctx().layer_painter(egui::LayerId::new(egui::Order::Foreground, id));
        let ghost = other.bar_rect(viewer, start, start + length).intersect(other.rect);
        draw_outline(&painter, ghost);
        if let Some(text) = drop_text(ui, viewer, bar, other.row) {
            draw_text_at_pointer(ui, response.interact_pointer_pos()?, &text);
        }
        return response.drag_stopped().then(|| Act::MoveTo(bar.clone(), start, other.row));
    }
    let ghost = lane.bar_rect(viewer, start, start + length);
    draw_outline(&painter, ghost);
    let kind = match (shift, command) {
        (true, _) => MoveKind::Ripple,
        (_, true) => MoveKind::Overlap,
        _ => MoveKind::Alone,
    };
    let by = start - bar.start.as_secs();
    let all = viewer.selected_bars();
    let all = if kind == MoveKind::Alone && all.contains(&bar.what) { all } else { vec![bar.what.clone()] };
    let end = viewer.moved_end_note(&bar.what, &all, by).filter(|_| by != 0.0 && kind != MoveKind::Overlap);
    if let Some(end) = end {
        draw_text_at_pointer(ui, response.interact_pointer_pos()?, &end);
    }
    let moved = response.drag_stopped() && by != 0.0;
    moved.then(|| Act::Move(bar.clone(), start, kind))
}

/// The row under the pointer when a bar is dragged out of its own row. For a clip any row counts; for other bars rows of actors do, which refuse
/// them.
fn target_lane(ui: &Ui, viewer: &Viewer, bar: &Bar, lane: &Lane, at: Pos2) -> Option<Lane> {
    if lane.rect.expand(ROW_SLACK).y_range().contains(at.y) {
        return None;
    }
    let (row, place) =
        visible_row_rects(ui, viewer).into_iter().find(|(_, place)| place.y_range().contains(at.y))?;
    let is_actor = matches!(viewer.timeline.rows[row].what, Some(Selected::Actor(_)));
    let rect = Rect::from_x_y_ranges(lane.rect.x_range(), place.y_range());
    (row != lane.row && (bar.strip.is_some() || is_actor)).then_some(Lane { rect, row })
}

/// Text for a clip held over a row: the reason why the row refuses it, else the number of joints that follow.
fn drop_text(ui: &Ui, viewer: &Viewer, bar: &Bar, row: usize) -> Option<String> {
    let on = match viewer.actor_accepting(bar, row) {
        Ok(on) => on,
        Err(why) => return Some(why.to_string()),
    };
    let source = ClipSource::Actor(bar.what.actor()?.to_string());
    let (joints, moved) =
        count_following_joints(ui, viewer, &ClipDrag { source, clip: bar.label.clone() }, on)?;
    if joints == 0 && moved > 0 {
        return Some(format!("no joint of {on} follows {} of {}", bar.label, bar.what.actor()?));
    }
    Some(format!("on {on}: {joints} of {moved} joints follow"))
}

/// An area that drags a point (`anchor`). Returns the position of the point during the drag, like [`gesture::dragged_position`].
fn drag_area(
    ui: &Ui,
    (place, anchor): (Rect, Pos2),
    id: egui::Id,
    label: String,
    cursor: CursorIcon,
) -> (Response, Option<Pos2>) {
    let response = ui.interact(place, id, Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Slider, true, label.clone()));
    let dragged = gesture::dragged_position(ui, &response, anchor);
    (response.on_hover_cursor(cursor), dragged)
}

/// Draws a handle of a bar. At the end of a drag, returns the new time, snapped.
fn show_time_handle(
    ui: &Ui,
    viewer: &Viewer,
    (bars, number): (&[Bar], usize),
    part: CueTime,
    at: Time,
    lane: &Lane,
) -> Option<Act> {
    let bar = &bars[number];
    let x = lane.x(viewer, at.as_secs());
    let rect = lane.rect;
    let place = handle_rect(viewer, (bars, number), part, x, lane);
    if place.width() <= 0.0 {
        return None;
    }
    let id = ui.id().with(("handle", lane.row, number, part as u8));
    let name = match part {
        CueTime::Start => "start of",
        CueTime::End => "end of",
        CueTime::FadeIn => "fade of",
        CueTime::FadeOut => "fade-out of",
    };
    let label = format!("{name} {} in row {}", bar.label, lane.row);
    let (response, dragged) =
        drag_area(ui, (place, pos2(x, rect.top())), id, label, CursorIcon::ResizeHorizontal);
    if response.clicked() {
        // The area of a handle may reach over the next bar.
        let secs = response.interact_pointer_pos().map(|pointer| lane.secs(viewer, pointer.x));
        let is_there =
            |bar: &&Bar| secs.is_some_and(|secs| (bar.start.as_secs()..bar.end.as_secs()).contains(&secs));
        let clicked = bars.iter().rev().find(is_there).unwrap_or(bar);
        return Some(Act::Select(clicked.clone(), gesture::adds_to_selection(ui)));
    }
    let Some(pointer) = dragged else { return bar_menu::show(&response, viewer, bar) };
    let keeps_content = gesture::modifiers(ui).alt;
    // The end rolls the boundary with Alt, like the start of the next clip.
    let next = bars.get(number + 1).filter(|next| next.strip.is_some() && bar.meets(next));
    let (bar, part) = match next.filter(|_| keeps_content && part == CueTime::End) {
        Some(next) => (next, CueTime::Start),
        None => (bar, part),
    };
    let secs = lane.snapped(viewer, pointer.x, Some(bar));
    let [outer, inner] = outline_colors(ui.visuals());
    for (width, color) in [(4.0, outer), (2.0, inner)] {
        ui.painter_at(rect).vline(lane.x(viewer, secs), rect.y_range(), Stroke::new(width, color));
    }
    let value = match part {
        CueTime::FadeIn => (secs - bar.start.as_secs()).max(0.0),
        CueTime::FadeOut => (bar.end.as_secs() - secs).max(0.0),
        _ => secs,
    };
    if let (CueTime::Start, Some(strip)) = (part, bar.strip) {
        let text = match (keeps_content, strip.repeat) {
            (false, _) => "moves the start and the content; hold Alt to keep the content in place",
            (true, Repeat::Once) => "trims the start; the content stays in place",
            (true, _) => "moves the cut; the loop starts again at the cut",
        };
        let end =
            viewer.moved_end_note(&bar.what, &[], secs - bar.start.as_secs()).filter(|_| !keeps_content);
        let text = end.map_or_else(|| text.to_string(), |end| format!("{text}\n{end}"));
        draw_text_at_pointer(ui, pos2(lane.x(viewer, secs), rect.top()), &text);
    }
    let before = match part {
        CueTime::FadeIn => bar.fade_in,
        CueTime::FadeOut => bar.fade_out,
        _ => at,
    };
    let is_moved = (value - before.as_secs()).abs() > 1e-6;
    (response.drag_stopped() && is_moved).then(|| Act::SetTime(bar.clone(), part, value, keeps_content))
}

/// The rectangle of a handle at `x`, within the row; without width if the handle is out of view.
fn handle_rect(viewer: &Viewer, (bars, number): (&[Bar], usize), part: CueTime, x: f32, lane: &Lane) -> Rect {
    let bar = &bars[number];
    let rect = lane.rect;
    // The handle of a fade is at the top, or below the keys if the row has some; those of the ends have the full height.
    let is_fade = matches!(part, CueTime::FadeIn | CueTime::FadeOut);
    let has_keys = viewer.timeline.rows.get(lane.row).is_some_and(|row| !row.events.is_empty());
    let fade_handle_height = if has_keys { marks::MARK_BAND_HEIGHT + 6.0 } else { marks::MARK_BAND_HEIGHT };
    let bottom = if is_fade { rect.top() + fade_handle_height } else { rect.bottom() };
    // The handles of two bars that meet are on both sides of the boundary: the end on its left, the start on its right.
    let is_met = number.checked_sub(1).is_some_and(|before| bars[before].meets(bar));
    let meets = bars.get(number + 1).is_some_and(|next| bar.meets(next));
    let width = lane.x(viewer, bar.draggable_end.as_secs()) - lane.x(viewer, bar.start.as_secs());
    let inside = (width / 3.0).clamp(OUTER_HANDLE_WIDTH, INNER_HANDLE_WIDTH);
    let (left, right) = match part {
        CueTime::Start => (x - if is_met { 0.0 } else { OUTER_HANDLE_WIDTH }, x + inside),
        CueTime::End => (x - inside, x + if meets { 0.0 } else { OUTER_HANDLE_WIDTH }),
        _ => (x - OUTER_HANDLE_WIDTH, x + OUTER_HANDLE_WIDTH),
    };
    Rect::from_min_max(pos2(left, rect.top()), pos2(right, bottom)).intersect(rect)
}

/// Speed handle of a selected clip: a triangle at the bottom, next to the handle of the end. Dragging it changes the speed.
fn show_speed_handle(ui: &Ui, viewer: &Viewer, bar: &Bar, number: usize, lane: &Lane) -> Option<Act> {
    let (x, bottom) =
        (lane.x(viewer, bar.played_until().as_secs()), lane.rect.bottom() - FOOT_STRIP_HEIGHT - 1.0);
    let place = Rect::from_min_max(
        pos2(x - INNER_HANDLE_WIDTH - 11.0, bottom - 7.0),
        pos2(x - INNER_HANDLE_WIDTH - 1.0, bottom),
    )
    .intersect(lane.rect);
    if place.width() <= 0.0 {
        return None;
    }
    let id = ui.id().with(("speed", lane.row, number));
    let area_and_anchor = (place, pos2(x, bottom));
    let (response, dragged) =
        drag_area(ui, area_and_anchor, id, format!("speed of {}", bar.label), CursorIcon::ResizeEast);
    let corner = vec![place.right_top(), place.right_bottom(), place.left_bottom()];
    let edge = Stroke::new(1.0, Color32::BLACK);
    ui.painter_at(lane.rect).add(egui::Shape::convex_polygon(corner, Color32::WHITE, edge));
    let speed = bar.strip.map_or(1.0, |strip| strip.speed);
    let Some(pointer) = dragged else {
        response.hint(format!("speed {speed:.2}: drag to play it faster or slower"));
        return None;
    };
    let end = lane.snapped(viewer, pointer.x, Some(bar));
    let length = (bar.played_until() - bar.start).as_secs() / (end - bar.start.as_secs()).max(1e-3);
    let ghost = lane.bar_rect(viewer, bar.start.as_secs(), end);
    draw_outline(&ui.painter_at(lane.rect), ghost);
    draw_text_at_pointer(ui, pointer, &format!("speed {:.2}", speed * length));
    response.drag_stopped().then(|| Act::Stretch(bar.what.clone(), end))
}

/// Weight handle of a selected clip: a line at the height of its weight, dragged up and down.
fn show_weight_handle(ui: &Ui, bar: &Bar, number: usize, lane: &Lane, bar_place: Rect) -> Option<Act> {
    // The first clip of the base layer always has the full weight.
    if matches!(bar.what, Selected::Cue { layer: 0, cue: 0, .. }) {
        return None;
    }
    let weight = bar.strip.map_or(1.0, |strip| strip.weight);
    let y = |weight: f64| bar_place.bottom() - bar_place.height() * weight as f32;
    let middle = bar_place.center().x;
    let place =
        Rect::from_min_max(pos2(middle - 12.0, y(weight) - 3.0), pos2(middle + 12.0, y(weight) + 3.0));
    let id = ui.id().with(("weight", lane.row, number));
    let area_and_anchor = (place, pos2(middle, y(weight)));
    let (response, dragged) =
        drag_area(ui, area_and_anchor, id, format!("weight of {}", bar.label), CursorIcon::ResizeVertical);
    let to = dragged.map_or(weight, |at| {
        // Rounded to hundredths, as a person would write.
        let part = f64::from((bar_place.bottom() - at.y) / bar_place.height().max(1.0));
        (part.clamp(0.0, 1.0) * 100.0).round() / 100.0
    });
    let painter = ui.painter_at(lane.rect);
    let [edge, fill] = [Color32::BLACK, Color32::WHITE];
    // A light line with a dark edge is visible on light rows and dark bars.
    for (width, color) in [(3.0, edge), (1.0, fill)] {
        painter.hline(bar_place.x_range(), y(to), Stroke::new(width, color));
    }
    let grip = Rect::from_center_size(pos2(middle, y(to)), vec2(14.0, 4.0));
    painter.rect(grip, 1.0, fill, Stroke::new(1.0, edge), StrokeKind::Outside);
    let Some(at) = dragged else {
        response.hint(format!("weight {weight:.2}: drag up or down"));
        return None;
    };
    draw_text_at_pointer(ui, at, &format!("weight {to:.2}"));
    (response.drag_stopped() && to != weight).then(|| Act::SetWeight(bar.what.clone(), to))
}

/// Draws a short text next to the pointer.
pub(super) fn draw_text_at_pointer(ui: &Ui, at: egui::Pos2, text: &str) {
    let painter = ui.ctx().layer_painter(egui::LayerId::new(egui::Order::Tooltip, egui::Id::new("beside")));
    let galley = painter.layout_no_wrap(text.to_string(), FontId::proportional(12.0), Color32::WHITE);
    let rect = Rect::from_min_size(at + vec2(14.0, -22.0), galley.size()).expand(3.0);
    painter.rect_filled(rect, 3.0, Color32::from_black_alpha(230));
    painter.galley(rect.min + vec2(3.0, 3.0), galley, Color32::WHITE);
}

fn bar_hint(viewer: &Viewer, bar: &Bar) -> String {
    let mut text = format!("{}\n{} to {}", bar.label, viewer.time_text(bar.start), viewer.time_text(bar.end));
    if bar.fade_in > Time::ZERO {
        text += &format!("\nfades in over {:.3} s", bar.fade_in.as_secs());
    }
    if let Some(strip) = bar.strip {
        text += &format!("\n{:.3} to {:.3} s of {:.3} s", strip.trim[0], strip.trim[1], strip.clip_secs);
        if strip.speed != 1.0 {
            text += &format!(", speed {:.2}", strip.speed);
        }
        if strip.weight < 1.0 {
            text += &format!("\nweight {:.2}", strip.weight);
        }
    }
    if bar.place.line > 0 {
        text += &format!("\n{}", marks::file_and_line(&bar.place));
    }
    text
}

/// Colors of bars with an error or a warning.
pub(super) const ERROR_BAR_COLOR: Color32 = Color32::from_rgb(0xc0, 0x30, 0x28);
pub(super) const WARNING_BAR_COLOR: Color32 = Color32::from_rgb(0xa0, 0x68, 0x00);
/// Opacity of a disabled bar's color.
pub(super) const DISABLED_OPACITY: f32 = 0.35;

/// Color of the name of a disabled bar, through which the panel is visible.
pub(super) fn disabled_text_color(visuals: &egui::Visuals) -> Color32 {
    visuals.strong_text_color()
}

type BarState = (bool, Option<choreo_script::Severity>);

fn draw_bar(
    painter: &Painter,
    viewer: &Viewer,
    bar: &Bar,
    place: Rect,
    lane: &Lane,
    (selected, severity): BarState,
) {
    let color = match severity {
        Some(choreo_script::Severity::Error) => ERROR_BAR_COLOR,
        Some(choreo_script::Severity::Warning) => WARNING_BAR_COLOR,
        _ => bar_color(bar.color_index),
    };
    let x = |time: Time| lane.x(viewer, time.as_secs());
    let corner_radius = CornerRadius::same(3);
    let is_disabled = bar.strip.is_some_and(|strip| strip.weight <= 0.0);
    painter.rect_filled(
        place,
        corner_radius,
        if is_disabled { color.gamma_multiply(DISABLED_OPACITY) } else { color },
    );
    if let Some(holds) = bar.holds_from {
        // The clip holds its last pose after its end.
        let held = Rect::from_min_max(pos2(x(holds), place.top()), place.max).intersect(place);
        painter.rect_filled(held, corner_radius, Color32::from_black_alpha(90));
    }
    let wedge = |from: f32, to: f32, low: f32| {
        let points = vec![pos2(from, place.top()), pos2(to, place.top()), pos2(low, place.bottom())];
        painter.add(egui::Shape::convex_polygon(points, Color32::from_black_alpha(110), Stroke::NONE));
    };
    if bar.fade_in > Time::ZERO {
        let end = x((bar.start + bar.fade_in).min(bar.end));
        wedge(x(bar.start), end, x(bar.start));
    }
    if bar.fade_out > Time::ZERO {
        let begin = x((bar.end - bar.fade_out).max(bar.start));
        wedge(begin, x(bar.end), x(bar.end));
    }
    let text_color =
        if is_disabled { disabled_text_color(&painter.ctx().global_style().visuals) } else { Color32::WHITE };
    draw_round_starts(painter, viewer, bar, place, lane, text_color);
    let text = painter.with_clip_rect(place.shrink2(vec2(4.0, 0.0)).intersect(painter.clip_rect()));
    let left = pos2(place.left() + 5.0, place.center().y);
    text.text(left, Align2::LEFT_CENTER, &bar.label, FontId::proportional(11.5), text_color);
    if is_disabled {
        painter.hline(place.x_range(), place.center().y, Stroke::new(1.0, text_color));
    }
    if selected {
        draw_outline(painter, place);
    }
}

/// Colors of the two lines of an outline, the outer one first. One of them contrasts with any bar, and the outer one with the panel.
pub(super) fn outline_colors(visuals: &egui::Visuals) -> [Color32; 2] {
    [visuals.strong_text_color(), if visuals.dark_mode { Color32::BLACK } else { Color32::WHITE }]
}

/// Draws an outline that is visible on bars and on the panel.
fn draw_outline(painter: &Painter, place: Rect) {
    let [outer, inner] = outline_colors(&painter.ctx().global_style().visuals);
    let line = |place: Rect, width: f32, round: u8, color: Color32| {
        painter.rect_stroke(place, CornerRadius::same(round), Stroke::new(width, color), StrokeKind::Inside);
    };
    // A narrow bar only has room for the outer line.
    if place.width() > 8.0 {
        line(place.shrink(2.0), 1.0, 2, inner);
    }
    line(place, 2.0, 3, outer);
}

/// Draws the outline of a whole clip that is cut short, over the following bars. Only for selected bars and the one under the mouse, since it would
/// look like part of the next bar.
fn draw_whole_clip(painter: &Painter, viewer: &Viewer, bar: &Bar, lane: &Lane) {
    let Some(strip) = bar.strip.filter(|strip| !strip.is_keyed && strip.round_secs() > 1e-3) else { return };
    let (start, end) = (bar.start.as_secs(), bar.end.as_secs());
    if start + strip.round_secs() > end + 1e-3 {
        let ghost = lane.bar_rect(viewer, start, start + strip.round_secs());
        let beyond = Rect::from_min_max(pos2(lane.x(viewer, end), ghost.top()), ghost.max);
        let painter = painter.with_clip_rect(beyond.intersect(painter.clip_rect()));
        // Dashes in both colors: one of them is visible on any bar, and no selected bar looks like that.
        let [line, dashes] = outline_colors(&painter.ctx().global_style().visuals);
        let ghost = ghost.shrink(0.75);
        painter.rect_stroke(ghost, CornerRadius::ZERO, Stroke::new(1.5, line), StrokeKind::Middle);
        let (first, last) = (ghost.left_top(), ghost.right_bottom());
        let around = [first, ghost.right_top(), last, ghost.left_bottom(), first];
        painter.extend(egui::Shape::dashed_line(&around, Stroke::new(1.5, dashes), DASH_LENGTH, DASH_LENGTH));
    }
}

/// Marks the starts of further rounds of a clip.
fn draw_round_starts(
    painter: &Painter,
    viewer: &Viewer,
    bar: &Bar,
    place: Rect,
    lane: &Lane,
    text_color: Color32,
) {
    let Some(strip) = bar.strip.filter(|strip| !strip.is_keyed && strip.round_secs() > 1e-3) else { return };
    if strip.repeat == Repeat::Once {
        return;
    }
    let (start, end) = (bar.start.as_secs(), bar.end.as_secs());
    for round in 1..MAX_ROUND_MARKS {
        let at = start + round as f64 * strip.round_secs();
        if at >= end {
            break;
        }
        let x = lane.x(viewer, at);
        let stroke = Stroke::new(1.0, text_color);
        painter.vline(x, place.top()..=place.top() + 4.0, stroke);
        painter.vline(x, place.bottom() - 4.0..=place.bottom(), stroke);
    }
}
