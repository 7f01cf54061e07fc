//! Rows of bars over time: cues, active cameras; the playhead, and how to move it.

use super::inspector::ClipDrag;
use super::{markers, marks};
use crate::app::Viewer;
use crate::state::selection::Selected;
use crate::state::span::Span;
use crate::state::timeline::{Bar, Timeline};
use choreo_motion::Time;
use choreo_session::edit::CueTime;
use egui::{Align2, Color32, CornerRadius, FontId, Painter, Rect, Sense, Stroke, StrokeKind, Ui, pos2, vec2};

const LABELS: f32 = 120.0;
const ROW: f32 = 22.0;
/// Height of the strip of feet at a row's bottom.
pub(crate) const STRIP: f32 = 3.0;
const RULER: f32 = 22.0;

/// Colors that can also be distinguished with a red-green deficiency (after Okabe and Ito, "Color Universal Design").
pub const COLORS: [[u8; 3]; 8] = [
    [0x00, 0x72, 0xb2],
    [0x00, 0x8a, 0x66],
    [0xa8, 0x5c, 0x00],
    [0x8c, 0x4f, 0x78],
    [0x2f, 0x7f, 0xa8],
    [0x7a, 0x72, 0x10],
    [0x9e, 0x3f, 0x1a],
    [0x5b, 0x64, 0x70],
];

pub fn show(ui: &mut Ui, viewer: &mut Viewer, now: f64) {
    transport(ui, viewer, now);
    let area = ui.available_rect_before_wrap();
    let ruler =
        Rect::from_min_max(pos2(area.left() + LABELS, area.top()), pos2(area.right(), area.top() + RULER));
    if ruler.width() < 20.0 {
        return;
    }
    scrub(ui, viewer, ruler);
    ui.allocate_rect(Rect::from_min_max(area.min, pos2(area.right(), ruler.bottom())), Sense::hover());
    let rows = viewer.timeline.rows.len();
    egui::ScrollArea::vertical().auto_shrink([false, false]).show_rows(ui, ROW, rows, |ui, shown| {
        ui.spacing_mut().item_spacing.y = 0.0;
        for index in shown {
            row(ui, viewer, index, ruler);
        }
    });
    wheel(ui, viewer, area, ruler);
    over_all(ui, viewer, area, ruler);
    markers::show(ui, viewer, area, ruler);
    wrong(ui, viewer, Rect::from_min_max(area.min, pos2(ruler.left(), ruler.bottom())));
}

fn transport(ui: &mut Ui, viewer: &mut Viewer, now: f64) {
    // Else it makes the panel wider than there is room for.
    ui.horizontal_wrapped(|ui| {
        let playhead = &mut viewer.playhead;
        if ui.button("|◀").on_hover_text("first frame (Home)").clicked() {
            playhead.step(i64::MIN / 2);
        }
        if ui.button("◀").on_hover_text("one frame back (←)").clicked() {
            playhead.step(-1);
        }
        let label = if playhead.is_playing() { "Pause" } else { "Play" };
        if ui.button(label).on_hover_text("Space").clicked() {
            playhead.toggle(now);
        }
        if ui.button("▶").on_hover_text("one frame on (→)").clicked() {
            playhead.step(1);
        }
        if ui.button("▶|").on_hover_text("last frame (End)").clicked() {
            playhead.step(i64::MAX / 2);
        }
        ui.toggle_value(&mut playhead.looping, "Loop").on_hover_text("again and again, or once (L)");
        if let Some((from, to)) = playhead.range() {
            let text = format!("{:.2} to {:.2} s", from.as_secs(), to.as_secs());
            if ui.button(text).on_hover_text("the part that is played; a click: all of it").clicked() {
                playhead.set_range(None);
            }
        }
        ui.toggle_value(&mut viewer.snap, "Snap").on_hover_text("dragged times are whole frames (N)");
        ui.separator();
        let playhead = &viewer.playhead;
        let text = format!(
            "{:.3} s   frame {} of {}   {} frames a second",
            playhead.time().as_secs(),
            playhead.frame(),
            playhead.frames(),
            playhead.fps().as_fps()
        );
        ui.monospace(text);
        ui.separator();
        let units = if viewer.in_seconds { "seconds" } else { "frames" };
        if ui.button(units).on_hover_text("times as seconds or as frames (T)").clicked() {
            viewer.in_seconds = !viewer.in_seconds;
        }
        if ui.button("◀ event").on_hover_text("to what begins, ends or happens before (↑)").clicked() {
            viewer.seek_to_next(true);
        }
        if ui.button("event ▶").on_hover_text("to what begins, ends or happens next (↓)").clicked() {
            viewer.seek_to_next(false);
        }
        if ui.button("Whole").on_hover_text("show the whole scene").clicked() {
            viewer.span = Span::whole(viewer.playhead.length().as_secs());
        }
    });
}

/// The ruler: a press or a drag on it moves the playhead.
fn scrub(ui: &mut Ui, viewer: &mut Viewer, ruler: Rect) {
    let response = ui.interact(ruler, ui.id().with("ruler"), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Slider, true, "time"));
    if let Some(pointer) = response.interact_pointer_pos() {
        let time = |x: f32| {
            let secs = viewer.span.secs_at(x - ruler.left(), ruler.width());
            Time::from_secs(secs.clamp(0.0, viewer.playhead.length().as_secs()))
        };
        let from = ui.input(|i| i.pointer.press_origin()).map_or(pointer.x, |p| p.x);
        let (from, to) = (time(from), time(pointer.x));
        match ui.input(|i| i.modifiers.shift) {
            true if response.dragged() => viewer.playhead.set_range(Some((from, to))),
            true => {}
            false => viewer.playhead.seek(to),
        }
    }
    let painter = ui.painter_at(ruler);
    let visuals = ui.visuals();
    painter.rect_filled(ruler, 0.0, visuals.extreme_bg_color);
    if let Some((from, to)) = viewer.playhead.range() {
        let x = |time: Time| ruler.left() + viewer.span.x_of(time.as_secs(), ruler.width());
        let part = Rect::from_min_max(pos2(x(from), ruler.top()), pos2(x(to), ruler.bottom()));
        painter.rect_filled(part.intersect(ruler), 0.0, visuals.selection.bg_fill.gamma_multiply(0.6));
    }
    let font = FontId::proportional(10.5);
    let fps = viewer.playhead.fps().as_fps();
    // If times are shown as frames, the lines lie on whole frames.
    let unit = if viewer.in_seconds { 1.0 } else { 1.0 / fps };
    let in_units = Span { from: viewer.span.from / unit, to: viewer.span.to / unit };
    let step = in_units.ruler(ruler.width(), 56.0);
    let step = if viewer.in_seconds { step } else { step.max(1.0) };
    let mut line = (in_units.from / step).ceil();
    while line * step <= in_units.to {
        let x = ruler.left() + in_units.x_of(line * step, ruler.width());
        painter.vline(x, ruler.bottom() - 5.0..=ruler.bottom(), Stroke::new(1.0, visuals.weak_text_color()));
        let text = match viewer.in_seconds {
            true if step < 0.01 => format!("{:.3}", line * step),
            true if step < 0.1 => format!("{:.2}", line * step),
            true if step < 1.0 => format!("{:.1}", line * step),
            _ => format!("{:.0}", line * step),
        };
        // The first and the last are read whole, too.
        let galley = painter.layout_no_wrap(text, font.clone(), visuals.weak_text_color());
        let half = galley.size().x / 2.0;
        let middle = x.min(ruler.right() - half).max(ruler.left() + half);
        painter.galley(pos2(middle - half, ruler.top() + 2.0), galley, visuals.weak_text_color());
        line += 1.0;
    }
}

fn row(ui: &mut Ui, viewer: &mut Viewer, index: usize, ruler: Rect) {
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), ROW), Sense::hover());
    let label = Rect::from_min_max(rect.min, pos2(ruler.left(), rect.bottom()));
    let lane = Rect::from_min_max(pos2(ruler.left(), rect.top()), pos2(ruler.right(), rect.bottom()));
    let visuals = ui.visuals().clone();
    let row = &viewer.timeline.rows[index];
    let selected_actor = row.what.is_some() && row.what == viewer.selection;
    if index % 2 == 1 {
        ui.painter().rect_filled(rect, 0.0, visuals.faint_bg_color);
    }
    let mut moment = None;
    if index > 0 && !row.bars.is_empty() {
        moment = marks::feet(ui, viewer, row, lane);
    }
    let mut clicked = None;
    let mut dragged = None;
    let mut moved = None;
    let response = ui.interact(label, ui.id().with(("row", index)), Sense::click());
    response.widget_info(|| {
        egui::WidgetInfo::labeled(egui::WidgetType::Label, true, format!("row {}", row.label))
    });
    if response.clicked() {
        clicked = row.what.clone();
    }
    let color = match Timeline::is_marked(&row.place, &viewer.problems) {
        true if viewer.faulty => visuals.error_fg_color,
        true => visuals.warn_fg_color,
        false if selected_actor => visuals.strong_text_color(),
        false => visuals.text_color(),
    };
    name(ui, &row.label, label, color);
    response.on_hover_text(&row.label);
    for (number, bar) in row.bars.iter().enumerate() {
        let x = |time: Time| lane.left() + viewer.span.x_of(time.as_secs(), lane.width());
        let bottom = lane.bottom() - STRIP - 1.0;
        let place = Rect::from_min_max(pos2(x(bar.start), lane.top() + 1.5), pos2(x(bar.end), bottom));
        let place = place.intersect(lane);
        if place.width() <= 0.0 {
            continue;
        }
        let is_clip = matches!(bar.what, Selected::Cue { .. });
        let sense = if is_clip { Sense::click_and_drag() } else { Sense::click() };
        let response = ui.interact(place, ui.id().with(("bar", index, number)), sense);
        let name = format!("{} on {}", bar.label, row.label);
        response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, true, name.clone()));
        if response.clicked() {
            clicked = Some(bar.what.clone());
        }
        let selected = viewer.selection.as_ref() == Some(&bar.what);
        let wrong = Timeline::is_marked(&bar.place, &viewer.problems);
        draw(&ui.painter_at(lane), bar, place, &x, selected, wrong);
        if let Some(secs) = carried(ui, viewer, bar, &response, lane) {
            moved = Some((bar.what.clone(), secs));
        }
        response.on_hover_text(hover(viewer, bar));
        for (part, at) in handles(bar) {
            if let Some(change) = handle(ui, viewer, bar, part, at, (index, number), lane) {
                dragged = Some((bar.what.clone(), bar.cut, part, change));
            }
        }
    }
    if let Some((at, what)) = marks::events(ui, viewer, row, index, lane) {
        moment = Some(at);
        clicked = what.filter(|what| viewer.selection.as_ref() != Some(what));
    }
    let dropped = dropped(ui, viewer, index, lane);
    if let Some(at) = moment {
        viewer.playhead.seek(at);
    }
    match dragged {
        Some((_, Some(cut), _, secs)) => {
            viewer.message = viewer.set_cut(cut, secs).err().map(|e| e.to_string())
        }
        Some((what, None, part, secs)) => {
            viewer.message = viewer.set_cue(&what, part, secs).err().map(|e| e.to_string())
        }
        None => {}
    }
    if let Some((what, secs)) = moved {
        let ripple = ui.input(|i| i.modifiers.shift);
        viewer.message = viewer.move_cue(&what, secs, ripple).err().map(|e| e.to_string());
    }
    if let Some((clip, secs)) = dropped {
        viewer.message = viewer.add_clip(&clip.actor, &clip.clip, secs).err().map(|e| e.to_string());
    }
    if let Some(what) = clicked {
        viewer.selection = if viewer.selection.as_ref() == Some(&what) { None } else { Some(what) };
    }
}

/// The name of a row; which layer it is stays to be seen however long the actor's name is.
fn name(ui: &Ui, name: &str, place: Rect, color: Color32) {
    let painter = ui.painter_at(place);
    let (name, layer) = match name.rsplit_once(" +") {
        Some((name, layer)) if layer.bytes().all(|b| b.is_ascii_digit()) => (name, format!(" +{layer}")),
        _ => (name, String::new()),
    };
    let layer = painter.layout_no_wrap(layer, FontId::proportional(12.0), color);
    let left = place.left() + 6.0;
    let name = super::elided(&painter, name, 12.0, color, place.right() - 4.0 - layer.size().x - left);
    let at = |x: f32, height: f32| pos2(x, place.center().y - height / 2.0);
    let (width, height) = (name.size().x, name.size().y);
    painter.galley(at(left, height), name, color);
    painter.galley(at(left + width, height), layer, color);
}

/// A clip that was let go over a lane, and when. It is played by the actor that it was dragged from.
fn dropped(ui: &Ui, viewer: &Viewer, index: usize, lane: Rect) -> Option<(ClipDrag, f64)> {
    let response = ui.interact(lane, ui.id().with(("lane", index)), Sense::hover());
    let hovering = response.dnd_hover_payload::<ClipDrag>();
    let pointer = ui.ctx().pointer_interact_pos().filter(|p| lane.contains(*p))?;
    let secs = viewer.snapped(viewer.span.secs_at(pointer.x - lane.left(), lane.width()));
    let of = |clip: &ClipDrag| match &viewer.timeline.rows[index].what {
        Some(Selected::Actor(name)) => *name == clip.actor,
        _ => false,
    };
    if hovering.is_some_and(|clip| of(&clip)) {
        let x = lane.left() + viewer.span.x_of(secs, lane.width());
        ui.painter_at(lane).vline(x, lane.y_range(), Stroke::new(2.0, ui.visuals().strong_text_color()));
    }
    let clip = response.dnd_release_payload::<ClipDrag>().filter(|clip| of(clip))?;
    Some(((*clip).clone(), secs))
}

/// The handles of a bar, and their times.
fn handles(bar: &Bar) -> Vec<(CueTime, Time)> {
    match bar.what {
        Selected::Cue { .. } => {
            let fade = (bar.start + bar.fade_in).min(bar.end);
            let mut all = vec![(CueTime::Start, bar.start), (CueTime::End, bar.until)];
            all.extend((bar.fade_in > Time::ZERO).then_some((CueTime::FadeIn, fade)));
            all
        }
        Selected::Effect(_) => vec![(CueTime::Start, bar.start), (CueTime::End, bar.until)],
        _ if bar.cut.is_some() => vec![(CueTime::Start, bar.start)],
        _ => Vec::new(),
    }
}

/// Draws where a bar goes that is dragged; once it is let go, returns its new start in seconds, on a whole frame.
fn carried(ui: &Ui, viewer: &Viewer, bar: &Bar, response: &egui::Response, lane: Rect) -> Option<f64> {
    if !response.dragged_by(egui::PointerButton::Primary) && !response.drag_stopped() {
        return None;
    }
    let secs = |x: f32| viewer.span.secs_at(x - lane.left(), lane.width());
    let x = |secs: f64| lane.left() + viewer.span.x_of(secs, lane.width());
    let id = response.id.with("grabbed");
    if response.drag_started() {
        let origin = ui.input(|i| i.pointer.press_origin())?;
        ui.data_mut(|d| d.insert_temp(id, secs(origin.x) - bar.start.as_secs()));
    }
    // Seconds from the start of the bar to where it was taken.
    let grabbed: f64 = ui.data(|d| d.get_temp(id))?;
    let start = viewer.snapped((secs(response.interact_pointer_pos()?.x) - grabbed).max(0.0));
    let ghost = [start, start + (bar.end - bar.start).as_secs()].map(x);
    let ghost =
        Rect::from_min_max(pos2(ghost[0], lane.top() + 1.5), pos2(ghost[1], lane.bottom() - STRIP - 1.0));
    ui.painter_at(lane).rect_stroke(
        ghost,
        CornerRadius::same(3),
        Stroke::new(2.0, ui.visuals().strong_text_color()),
        StrokeKind::Inside,
    );
    (response.drag_stopped() && start != bar.start.as_secs()).then_some(start)
}

/// Draws a handle; once it is let go, returns the new value in seconds, on a whole frame.
fn handle(
    ui: &Ui,
    viewer: &Viewer,
    bar: &Bar,
    part: CueTime,
    at: Time,
    id: (usize, usize),
    lane: Rect,
) -> Option<f64> {
    let x = lane.left() + viewer.span.x_of(at.as_secs(), lane.width());
    // The fade's handle is above, the ends' are as high as the bar.
    let bottom = if part == CueTime::FadeIn { lane.top() + 8.0 } else { lane.bottom() };
    // The start's lies within the bar where another one's end is beside it.
    let right = if part == CueTime::Start { x + 5.0 } else { x + 4.0 };
    let place = Rect::from_min_max(pos2(x - 4.0, lane.top()), pos2(right, bottom)).intersect(lane);
    if place.width() <= 0.0 {
        return None;
    }
    let (row, number) = id;
    let response = ui.interact(place, ui.id().with(("handle", row, number, part as u8)), Sense::drag());
    let name = match part {
        CueTime::Start => "start of",
        CueTime::End => "end of",
        CueTime::FadeIn => "fade of",
    };
    let label = format!("{name} {} in row {row}", bar.label);
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Slider, true, label.clone()));
    let response = response.on_hover_cursor(egui::CursorIcon::ResizeHorizontal);
    let pointer =
        response.interact_pointer_pos().filter(|_| response.dragged() || response.drag_stopped())?;
    let secs = viewer.span.secs_at(pointer.x - lane.left(), lane.width());
    let secs = viewer.snapped(secs);
    let shown = lane.left() + viewer.span.x_of(secs, lane.width());
    ui.painter_at(lane).vline(shown, lane.y_range(), Stroke::new(2.0, ui.visuals().strong_text_color()));
    let value = if part == CueTime::FadeIn { (secs - bar.start.as_secs()).max(0.0) } else { secs };
    response.drag_stopped().then_some(value)
}

fn hover(viewer: &Viewer, bar: &Bar) -> String {
    let mut text =
        format!("{}\n{} to {}", bar.label, viewer.shown_time(bar.start), viewer.shown_time(bar.end));
    if bar.fade_in > Time::ZERO {
        text += &format!("\nfades in over {} s", bar.fade_in.as_secs());
    }
    if bar.place.line > 0 {
        text += &format!("\n{}", marks::report(&bar.place));
    }
    text
}

fn draw(painter: &Painter, bar: &Bar, place: Rect, x: &dyn Fn(Time) -> f32, selected: bool, wrong: bool) {
    let [r, g, b] = COLORS[bar.kind % COLORS.len()];
    let color = if wrong { Color32::from_rgb(0xc0, 0x30, 0x28) } else { Color32::from_rgb(r, g, b) };
    painter.rect_filled(place, CornerRadius::same(3), color);
    if let Some(holds) = bar.holds_from {
        // The clip is over: its last pose is held.
        let held = Rect::from_min_max(pos2(x(holds), place.top()), place.max).intersect(place);
        painter.rect_filled(held, CornerRadius::same(3), Color32::from_black_alpha(90));
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
    let text = painter.with_clip_rect(place.shrink2(vec2(4.0, 0.0)).intersect(painter.clip_rect()));
    let left = pos2(place.left() + 5.0, place.center().y);
    text.text(left, Align2::LEFT_CENTER, &bar.label, FontId::proportional(11.5), Color32::WHITE);
    if selected {
        painter.rect_stroke(
            place,
            CornerRadius::same(3),
            Stroke::new(2.0, Color32::WHITE),
            StrokeKind::Inside,
        );
    }
}

fn wheel(ui: &Ui, viewer: &mut Viewer, area: Rect, ruler: Rect) {
    let Some(pointer) = ui.ctx().pointer_hover_pos().filter(|p| area.contains(*p) && p.x >= ruler.left())
    else {
        return;
    };
    let (scroll, zoom) = ui.input(|i| (i.smooth_scroll_delta, f64::from(i.zoom_delta())));
    let length = viewer.playhead.length().as_secs();
    let (x, width) = (pointer.x - ruler.left(), ruler.width());
    if zoom != 1.0 {
        viewer.span.zoom(zoom, x, width, length);
    }
    if scroll.x != 0.0 {
        viewer.span.pan(scroll.x, width, length);
    }
}

/// Markers and the playhead, over all rows.
fn over_all(ui: &Ui, viewer: &Viewer, area: Rect, ruler: Rect) {
    let lanes = Rect::from_min_max(ruler.min, area.max);
    let painter = ui.painter_at(lanes);
    let x = |time: Time| ruler.left() + viewer.span.x_of(time.as_secs(), ruler.width());
    // The range after the end of the scene is darkened.
    let after = Rect::from_min_max(pos2(x(viewer.timeline.length), lanes.top()), lanes.max);
    painter.rect_filled(after.intersect(lanes), 0.0, Color32::from_black_alpha(110));
    let head = x(viewer.playhead.time());
    painter.vline(head, lanes.y_range(), Stroke::new(1.5, Color32::from_rgb(0xff, 0x6a, 0x3d)));
    let tip =
        vec![pos2(head - 5.0, lanes.top()), pos2(head + 5.0, lanes.top()), pos2(head, lanes.top() + 8.0)];
    painter.add(egui::Shape::convex_polygon(tip, Color32::from_rgb(0xff, 0x6a, 0x3d), Stroke::NONE));
}

/// How many errors and warnings there are, until they are mended; a click goes to the first.
fn wrong(ui: &Ui, viewer: &mut Viewer, place: Rect) {
    let Some(first) = viewer.problems.first() else { return };
    let visuals = ui.visuals();
    let color = if viewer.faulty { visuals.error_fg_color } else { visuals.warn_fg_color };
    let text = match (viewer.faulty, viewer.problems.len()) {
        (true, 1) => "1 error".to_string(),
        (true, n) => format!("{n} errors"),
        (false, 1) => "1 warning".to_string(),
        (false, n) => format!("{n} warnings"),
    };
    let text = if first.line > 0 { format!("{text}: line {}", first.line) } else { text };
    let response = ui.interact(place, ui.id().with("wrong"), Sense::click());
    response.widget_info(|| {
        egui::WidgetInfo::labeled(egui::WidgetType::Button, true, format!("problems: {text}"))
    });
    ui.painter_at(place).text(
        place.left_center() + vec2(6.0, 0.0),
        Align2::LEFT_CENTER,
        &text,
        FontId::proportional(11.5),
        color,
    );
    let line = first.line;
    if response.on_hover_text(first.message.clone()).clicked() && line > 0 {
        viewer.go_to = Some(line);
    }
}
