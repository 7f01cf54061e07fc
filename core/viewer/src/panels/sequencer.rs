//! Sequencer: rows of bars over time for cues and active cameras, the playhead, and its controls.

use super::actions::hint_with_shortcut;
use super::hint::Hint;
use super::inspector::ClipDrag;
use super::marks::MarkAct;
use super::toolbar::Toolbar;
use super::{
    bar_menu, bars, gesture, headers, icons, key_menu, markers, marks, property_row, row_order, values,
};
use crate::app::Viewer;
use crate::editing::{ClipSource, EditError};
use crate::state::keyed::KeyRef;
use crate::state::playhead::SPEEDS;
use crate::state::selection::Selected;
use crate::state::span::Span;
use crate::state::tempo::Tempo;
use crate::state::timeline::{RowNumber, color_index};
use choreo_motion::Time;
use choreo_script::Severity;
use egui::{Color32, FontId, Rect, Response, Sense, Stroke, StrokeKind, Ui, pos2, vec2};

pub(super) const LABELS_WIDTH: f32 = 150.0;
const ROW_HEIGHT: f32 = 22.0;
/// Height of the foot contacts at the bottom of a row, points.
pub(crate) const FOOT_STRIP_HEIGHT: f32 = 3.0;
pub(super) const RULER_HEIGHT: f32 = 22.0;
/// Smallest distance of beats that are drawn, points.
const MIN_BEAT_DISTANCE: f32 = 6.0;

/// Colors that remain distinguishable with a red-green color vision deficiency (after Okabe and Ito, "Color Universal Design").
pub(super) const BAR_COLORS: [[u8; 3]; 8] = [
    [0x00, 0x72, 0xb2],
    [0x00, 0x86, 0x62],
    [0xa8, 0x5c, 0x00],
    [0x8c, 0x4f, 0x78],
    [0x2c, 0x7c, 0xa4],
    [0x7a, 0x72, 0x10],
    [0x9e, 0x3f, 0x1a],
    [0x5b, 0x64, 0x70],
];

/// Color of a bar by its number: eight hues, each bright or dark.
pub(super) fn bar_color(color_index: usize) -> Color32 {
    let [r, g, b] = BAR_COLORS[color_index % BAR_COLORS.len()];
    let is_dark = color_index / BAR_COLORS.len() % 2 == 1;
    let shade = |value: u8| if is_dark { (u16::from(value) * 7 / 10) as u8 } else { value };
    Color32::from_rgb(shade(r), shade(g), shade(b))
}

/// Color of a clip's bars, sRGB.
pub fn color_of_clip(name: &str) -> [u8; 3] {
    let [r, g, b, _] = bar_color(color_index(name)).to_array();
    [r, g, b]
}

pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer, now: f64) {
    show_transport(ui, viewer, now);
    let area = ui.available_rect_before_wrap();
    let ruler = Rect::from_min_max(
        pos2(area.left() + LABELS_WIDTH, area.top()),
        pos2(area.right(), area.top() + RULER_HEIGHT),
    );
    if ruler.width() < 20.0 {
        return;
    }
    show_ruler(ui, viewer, (ruler, viewer.visible_span), "time");
    ui.allocate_rect(Rect::from_min_max(area.min, pos2(area.right(), ruler.bottom())), Sense::hover());
    zoom_and_scroll_with_wheel(ui, viewer, area, ruler);
    let rows = viewer.shown_rows();
    let spacing = std::mem::replace(&mut ui.spacing_mut().item_spacing.y, 0.0);
    if let Some((camera, _)) = rows.split_first() {
        // The camera row does not scroll with the others.
        show_row(ui, viewer, camera.row, ruler);
    }
    let others = rows.get(1..).unwrap_or_default();
    let scrolling_lanes = Rect::from_min_max(pos2(ruler.left(), ruler.bottom() + ROW_HEIGHT), area.max);
    show_selection_box(ui, viewer, scrolling_lanes, others);
    egui::ScrollArea::vertical().auto_shrink([false, false]).show_rows(
        ui,
        ROW_HEIGHT,
        others.len(),
        |ui, shown| {
            for index in shown {
                match others[index] {
                    RowNumber { row: index, part: None } => show_row(ui, viewer, index, ruler),
                    part => property_row::show(ui, viewer, part, ruler),
                }
            }
        },
    );
    ui.spacing_mut().item_spacing.y = spacing;
    draw_beats_and_playhead(ui, viewer, area, (ruler, viewer.visible_span));
    markers::show(ui, viewer, area, ruler);
    show_problem_count(ui, viewer, Rect::from_min_max(area.min, pos2(ruler.left(), ruler.bottom())));
}

fn show_transport(ui: &mut Ui, viewer: &mut Viewer, now: f64) {
    ui.horizontal(|ui| {
        let mut bar = Toolbar::new("timeline");
        add_playhead_buttons(&mut bar, viewer, now);
        bar.add_separator();
        let playhead = &viewer.playhead;
        let (time, last) = (playhead.time().as_secs(), playhead.length().as_secs());
        bar.add_widget("time of the playhead", false, move |ui, viewer| {
            if let Some(to) = values::time_field(ui, "time of the playhead", time, 0.01, 0.0..=last) {
                let playhead = &mut viewer.playhead;
                playhead.seek(Time::from_secs(nearest_frame_secs(playhead.fps().as_fps(), to)));
            }
        });
        // The text has the same width in each frame, so that the entries after it do not move.
        let width = playhead.frames().to_string().len();
        let text = format!(
            "s   frame {:>width$} of {}   {} frames a second",
            playhead.frame(),
            playhead.frames(),
            playhead.fps().as_fps()
        );
        bar.add_text(&text, "", egui::TextStyle::Monospace);
        bar.add_separator();
        let units = if viewer.in_seconds { "seconds" } else { "frames" };
        let hint = hint_with_shortcut(viewer, "seconds", "times as seconds or as frames");
        bar.add_button(units, &hint, |viewer| {
            viewer.in_seconds = !viewer.in_seconds;
        });
        bar.reserve_width_for(["seconds", "frames"].into_iter());
        let hint = hint_with_shortcut(viewer, "previous_event", "go to the previous start, end or event");
        bar.add_icon(icons::ARROW_LINE_LEFT, "Previous event", &hint, |viewer| viewer.seek_to_next(true));
        let hint = hint_with_shortcut(viewer, "next_event", "go to the next start, end or event");
        bar.add_icon(icons::ARROW_LINE_RIGHT, "Next event", &hint, |viewer| viewer.seek_to_next(false));
        let hint = "show the whole scene";
        bar.add_icon(icons::ARROWS_OUT_LINE_HORIZONTAL, "Whole", hint, |viewer| {
            viewer.visible_span = Span::whole(viewer.playhead.length().as_secs());
        });
        add_speed_menu(&mut bar, viewer.playhead.speed());
        bar.show(ui, viewer, 0.0);
    });
}

/// Fields for the tempo of the music, whose beats dragged times snap to.
fn tempo_fields(ui: &mut Ui, viewer: &mut Viewer) {
    let mut tempo = viewer.tempo;
    let set = values::number_field(
        ui,
        "beats a minute",
        tempo.beats_per_minute,
        0.5,
        0.0..=Tempo::MAX_BEATS_PER_MINUTE,
    );
    tempo.beats_per_minute = set.unwrap_or(tempo.beats_per_minute);
    ui.weak("bpm").hint("beats a minute of the music; dragged times snap to beats. 0: none");
    // The field is also there without a tempo, so that the entries after it do not move.
    ui.add_enabled_ui(tempo.beats_per_minute > 0.0, |ui| {
        let set = values::time_field(
            ui,
            "first beat",
            tempo.first_beat_secs,
            0.01,
            0.0..=Tempo::MAX_FIRST_BEAT_SECS,
        );
        tempo.first_beat_secs = set.unwrap_or(tempo.first_beat_secs);
        ui.weak("s").hint("time of the first beat");
    });
    if tempo != viewer.tempo {
        viewer.tempo = tempo;
        if let Some(script) = &viewer.path {
            viewer.documents.keep_tempo(script, tempo);
        }
    }
}

/// Buttons that move the playhead and control playback.
fn add_playhead_buttons(bar: &mut Toolbar<'_, Viewer>, viewer: &Viewer, now: f64) {
    let playhead = &viewer.playhead;
    let keys = |id| hint_with_shortcut(viewer, id, "");
    bar.add_icon(icons::SKIP_BACK, "First frame", &keys("first_frame"), |viewer| {
        viewer.playhead.step(i64::MIN / 2);
    });
    let hint = keys("previous_frame");
    bar.add_icon(icons::CARET_LEFT, "One frame back", &hint, |viewer| viewer.playhead.step(-1));
    let (icon, name) = match playhead.is_playing() {
        true => (icons::PAUSE, "Pause"),
        false => (icons::PLAY, "Play"),
    };
    bar.add_icon(icon, name, &keys("play"), move |viewer| viewer.playhead.toggle_playback(now));
    bar.reserve_width_for([icons::PAUSE, icons::PLAY].into_iter());
    let hint = keys("next_frame");
    bar.add_icon(icons::CARET_RIGHT, "One frame forward", &hint, |viewer| viewer.playhead.step(1));
    bar.add_icon(icons::SKIP_FORWARD, "Last frame", &keys("last_frame"), |viewer| {
        viewer.playhead.step(i64::MAX / 2);
    });
    let hint = hint_with_shortcut(viewer, "loop", "play again and again, or once");
    bar.add_icon_toggle(icons::REPEAT, playhead.looping, "Loop", &hint, |viewer| {
        viewer.playhead.looping ^= true
    });
    let text = |from: Time, to: Time| format!("{:.2} to {:.2} s", from.as_secs(), to.as_secs());
    let length = playhead.length();
    let (from, to) = playhead.range().unwrap_or((Time::ZERO, length));
    let hint = match playhead.range() {
        Some(_) => "the range that is played; click to play everything",
        None => "everything is played; Shift drag on the ruler to play a range",
    };
    bar.add_button(&text(from, to), hint, |viewer| viewer.playhead.set_range(None));
    bar.set_enabled(playhead.range().is_some());
    // The button is as wide as its longest text, so that the entries after it do not move.
    let widest = text(length, length).replace(|c: char| c.is_ascii_digit(), "8");
    bar.reserve_width_for([widest.as_str()].into_iter());
    let hint = "dragged times snap to whole frames (N)";
    bar.add_icon_toggle(icons::MAGNET, viewer.snap, "Snap", hint, |viewer| viewer.snap ^= true);
    bar.add_widget("tempo", true, tempo_fields);
}

/// Menu of the playback speed.
fn add_speed_menu(bar: &mut Toolbar<Viewer>, now: f64) {
    let label = |speed: f64| format!("{speed}×");
    bar.add_menu(&label(now), "speed of playback; the script stays as it is", move |ui, viewer| {
        for speed in SPEEDS {
            if ui.selectable_label(speed == now, label(speed)).clicked() {
                viewer.playhead.set_speed(speed);
            }
        }
    });
    bar.reserve_width_for(SPEEDS.map(label).iter().map(String::as_str));
}

/// Time of the frame nearest to a time, seconds.
fn nearest_frame_secs(fps: f64, secs: f64) -> f64 {
    // A frame begins at the nearest tick, so a small offset makes sure that it has begun.
    (secs * fps).round() / fps + 1e-6
}

/// Draws the ruler; a press or a drag on it moves the playhead.
pub(super) fn show_ruler(ui: &mut Ui, viewer: &mut Viewer, (ruler, span): (Rect, Span), label: &str) {
    let response = ui.interact(ruler, ui.id().with("ruler"), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Slider, true, label));
    viewer.is_scrubbing |= response.dragged();
    if let Some(pointer) = response.interact_pointer_pos() {
        let time = |x: f32| {
            let secs = span.secs_at(x - ruler.left(), ruler.width());
            let secs = nearest_frame_secs(viewer.playhead.fps().as_fps(), secs);
            Time::from_secs(secs.clamp(0.0, viewer.playhead.length().as_secs()))
        };
        let from = ui.input(|i| i.pointer.press_origin()).map_or(pointer.x, |p| p.x);
        let (from, to) = (time(from), time(pointer.x));
        match gesture::modifiers(ui).shift {
            true if response.dragged() => viewer.playhead.set_range(Some((from, to))),
            true => {}
            false => viewer.playhead.seek(to),
        }
    }
    let painter = ui.painter_at(ruler);
    let visuals = ui.visuals();
    painter.rect_filled(ruler, 0.0, visuals.extreme_bg_color);
    if let Some((from, to)) = viewer.playhead.range() {
        let x = |time: Time| ruler.left() + span.x_of(time.as_secs(), ruler.width());
        let part = Rect::from_min_max(pos2(x(from), ruler.top()), pos2(x(to), ruler.bottom()));
        painter.rect_filled(part.intersect(ruler), 0.0, visuals.selection.bg_fill.gamma_multiply(0.6));
    }
    let font = FontId::proportional(10.5);
    let fps = viewer.playhead.fps().as_fps();
    // If times are displayed as frames, the lines are at whole frames.
    let unit = if viewer.in_seconds { 1.0 } else { 1.0 / fps };
    let in_units = Span { from: span.from / unit, to: span.to / unit };
    let step = in_units.ruler_interval(ruler.width(), 56.0);
    let step = if viewer.in_seconds { step } else { step.max(1.0) };
    let mut line = (in_units.from / step).ceil();
    while line * step <= in_units.to {
        let x = ruler.left() + in_units.x_of(line * step, ruler.width());
        painter.vline(x, ruler.bottom() - 5.0..=ruler.bottom(), Stroke::new(1.0, visuals.weak_text_color()));
        let digits = match viewer.in_seconds {
            true if step < 0.01 => 3,
            true if step < 0.1 => 2,
            true if step < 1.0 => 1,
            _ => 0,
        };
        let text = super::fixed_digits(line * step, digits);
        // The first and the last number stay completely visible.
        let galley = painter.layout_no_wrap(text, font.clone(), visuals.weak_text_color());
        let half = galley.size().x / 2.0;
        let middle = x.min(ruler.right() - half).max(ruler.left() + half);
        painter.galley(pos2(middle - half, ruler.top() + 2.0), galley, visuals.weak_text_color());
        line += 1.0;
    }
}

/// Allocates the next row: the rectangles of its label and of its lane.
pub(super) fn allocate_row(ui: &mut Ui, number: RowNumber, ruler: Rect) -> (Rect, Rect) {
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), ROW_HEIGHT), Sense::hover());
    let pass = ui.ctx().cumulative_pass_nr();
    ui.data_mut(|d| d.insert_temp(row_id(number), (pass, rect)));
    if number.row % 2 == 1 {
        ui.painter().rect_filled(rect, 0.0, ui.visuals().faint_bg_color);
    }
    let label = Rect::from_min_max(rect.min, pos2(ruler.left(), rect.bottom()));
    let lane = Rect::from_min_max(pos2(ruler.left(), rect.top()), pos2(ruler.right(), rect.bottom()));
    (label, lane)
}

fn show_row(ui: &mut Ui, viewer: &mut Viewer, index: usize, ruler: Rect) {
    let number = RowNumber::whole(index);
    let (label, lane) = allocate_row(ui, number, ruler);
    let visuals = ui.visuals().clone();
    let row = &viewer.timeline.rows[index];
    let selected_actor = row.what.is_some() && row.what == viewer.selection;
    let mut seek_time = None;
    if index > 0 && !row.bars.is_empty() {
        seek_time = marks::draw_foot_contacts(ui, viewer, row, lane);
    }
    let mut clicked = None;
    let response = ui.interact(label, ui.id().with(("row", index)), Sense::click_and_drag());
    response.widget_info(|| {
        egui::WidgetInfo::labeled(egui::WidgetType::Label, true, format!("row {}", row.label))
    });
    if response.clicked() {
        clicked = row.what.clone();
    }
    let color = match viewer.severity(&row.place) {
        Some(Severity::Error) => visuals.error_fg_color,
        Some(Severity::Warning) => visuals.warn_fg_color,
        _ if selected_actor => visuals.strong_text_color(),
        _ => visuals.text_color(),
    };
    let command = row.what.as_ref().and_then(|what| headers::show_menu(&response, viewer, what));
    let command = command.zip(row.what.clone());
    let toggled = headers::show_buttons(ui, viewer, index, label);
    draw_row_name(ui, &row.label, headers::name_rect(&viewer.timeline, index, label), color);
    let response = response.hint(&row.label);
    let reordered = row_order::drag_row(ui, viewer, index, &response);
    let lane_of = bars::Lane { rect: lane, row: index };
    let locked =
        row.what.as_ref().and_then(Selected::actor).is_some_and(|a| viewer.toggles.locked.contains(a));
    let act = bars::show(ui, viewer, &row.bars, &row.label, &lane_of, locked);
    let mark_act = marks::show_events(ui, viewer, row, number, lane);
    if let Some(MarkAct::Click(event, _)) = &mark_act {
        seek_time = Some(event.at);
        let is_other = |what: &Selected| viewer.selection.as_ref() != Some(what);
        clicked = event.what.clone().filter(|what| event.keys.is_empty() && is_other(what));
    }
    add_dropped_clip(ui, viewer, number, lane);
    if let Some(toggle) = toggled {
        headers::apply_toggle(viewer, toggle);
    }
    if let Some((to, side)) = reordered {
        viewer.edit(|v| v.move_row(index, to, side));
    }
    if let Some((command, what)) = command {
        run_command(ui, viewer, index, command, what);
    }
    if let Some(at) = seek_time {
        viewer.playhead.seek(at);
    }
    if let Some(act) = act {
        bars::run(ui, viewer, act);
    }
    if let Some(mark_act) = mark_act {
        run_mark(ui, viewer, mark_act);
    }
    if let Some(what) = clicked {
        viewer.select_all(vec![what]);
    }
}

/// Performs a command of a row's menu.
fn run_command(ui: &Ui, viewer: &mut Viewer, index: usize, command: bar_menu::Command, what: Selected) {
    viewer.selection = Some(what);
    match command.row_side() {
        Some(side) => viewer.edit(|v| v.shift_row(index, side)),
        None => bar_menu::run(ui, viewer, command),
    }
}

/// Menu of an empty place in a row, which applies to the object of the row.
fn show_free_place_menu(ui: &Ui, viewer: &mut Viewer, response: &Response, rows: &[RowNumber]) {
    let id = response.id.with("menu of row");
    if let Some(at) = response.interact_pointer_pos().filter(|_| response.secondary_clicked()) {
        let is_there = |number: &&RowNumber| {
            drawn_row_rect(ui, **number).is_some_and(|rect| rect.y_range().contains(at.y))
        };
        let row = rows.iter().find(is_there).map(|number| number.row);
        ui.data_mut(|d| d.insert_temp(id, row));
        viewer.selection = row.and_then(|row| viewer.timeline.rows[row].what.clone());
    }
    let row: Option<usize> = ui.data(|d| d.get_temp(id)).flatten();
    let what = row.and_then(|row| Some((row, viewer.timeline.rows.get(row)?.what.clone()?)));
    let Some((row, what)) = what else { return };
    if let Some(command) = headers::show_menu(response, viewer, &what) {
        run_command(ui, viewer, row, command, what);
    }
}

/// Performs an action on a mark.
pub(super) fn run_mark(ui: &Ui, viewer: &mut Viewer, act: MarkAct) {
    match act {
        MarkAct::Click(event, add) => match (event.key_refs(), add) {
            (keys, _) if keys.is_empty() => {}
            (keys, true) => viewer.select_more_keys(&keys),
            (keys, false) => viewer.select_keys(keys),
        },
        MarkAct::Move(event, by) => {
            let keys = event.key_refs();
            if keys.is_empty() {
                let why = "this key cannot be moved here; its line in the script sets the time";
                return viewer.edit(|_| Err(EditError::refused_at(&event.place, why)));
            }
            let locked =
                keys.iter().filter_map(|key| key.what.actor()).find(|a| viewer.toggles.locked.contains(*a));
            if let Some(why) = locked.map(headers::locked_row_message) {
                return viewer.edit(|_| Err(EditError::refused(why)));
            }
            // If only some keys of a diamond are selected, all of its keys are moved.
            let is_selected = keys.iter().all(|key| viewer.is_key_selected(key));
            match is_selected {
                true => viewer.edit(|v| v.move_selected(by)),
                false => viewer.edit(|v| v.drag_keys(&keys, by, None)),
            }
        }
        MarkAct::Key(act) => key_menu::run(ui, viewer, act),
    }
}

/// Box selection: a drag over empty places selects the bars and keys that it touches; with Shift, it adds them to the selection.
fn show_selection_box(ui: &Ui, viewer: &mut Viewer, lanes: Rect, rows: &[RowNumber]) {
    let response = ui.interact(lanes, ui.id().with("box"), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Other, true, "rows"));
    if response.clicked() {
        viewer.selection = None;
    }
    show_free_place_menu(ui, viewer, &response, rows);
    let (Some(to), true) = (response.interact_pointer_pos(), response.dragged() || response.drag_stopped())
    else {
        return;
    };
    let from = ui.input(|i| i.pointer.press_origin()).unwrap_or(to);
    let id = response.id.with("from");
    if response.drag_started() {
        ui.data_mut(|d| d.insert_temp(id, from));
    }
    let from = ui.data(|d| d.get_temp(id)).unwrap_or(from);
    let area = Rect::from_two_pos(from, to).intersect(lanes);
    let color = ui.visuals().selection.stroke.color;
    let painter = ui.ctx().layer_painter(egui::LayerId::new(egui::Order::Foreground, id));
    painter.rect_stroke(area, 0.0, Stroke::new(1.0, color), StrokeKind::Inside);
    if !response.drag_stopped() {
        return;
    }
    let secs = |x: f32| viewer.visible_span.secs_at(x - lanes.left(), lanes.width());
    let (first, last) = (secs(area.left()), secs(area.right()));
    let drawn: Vec<(RowNumber, Rect)> =
        rows.iter().filter_map(|number| Some((*number, drawn_row_rect(ui, *number)?))).collect();
    let touched = drawn.iter().filter(|(_, rect)| rect.intersects(area));
    let bars = touched.flat_map(|(number, _)| viewer.timeline.row(*number)).flat_map(|row| &row.bars);
    let inside = bars.filter(|bar| bar.end.as_secs() > first && bar.start.as_secs() < last);
    let mut all: Vec<Selected> = inside.map(|bar| bar.what.clone()).collect();
    let lane = |rect: Rect| Rect::from_x_y_ranges(lanes.x_range(), rect.y_range());
    let keys = drawn.iter().filter_map(|(number, rect)| Some((viewer.timeline.row(*number)?, *rect)));
    let mut keys: Vec<KeyRef> =
        keys.flat_map(|(row, rect)| marks::keys_within(viewer, row, lane(rect), area)).collect();
    if gesture::modifiers(ui).shift {
        all.extend(viewer.selected_bars());
        keys.extend(viewer.selected_keys().iter().cloned());
    }
    all.dedup();
    viewer.select_bars_and_keys(all, keys);
}

fn row_id(number: RowNumber) -> egui::Id {
    egui::Id::new("sequencer row").with(number)
}

/// Rectangle of a row, if it was drawn in this frame or in the last one.
fn drawn_row_rect(ui: &Ui, number: RowNumber) -> Option<Rect> {
    let (drawn, rect): (u64, Rect) = ui.data(|d| d.get_temp(row_id(number)))?;
    (drawn + 1 >= ui.ctx().cumulative_pass_nr()).then_some(rect)
}

/// Visible rows with their rectangles: those drawn in this frame or in the last one.
pub(super) fn visible_row_rects(ui: &Ui, viewer: &Viewer) -> Vec<(usize, Rect)> {
    let place = |index: usize| Some((index, drawn_row_rect(ui, RowNumber::whole(index))?));
    (0..viewer.timeline.rows.len()).filter_map(place).collect()
}

/// Rectangle of an object's row, if it is visible.
pub(super) fn object_row_rect(ui: &Ui, viewer: &Viewer, what: &Selected) -> Option<Rect> {
    let is_of_it = |(index, _): &(usize, Rect)| {
        let row = &viewer.timeline.rows[*index];
        row.what.as_ref() == Some(what) || row.bars.iter().any(|bar| bar.what == *what)
    };
    visible_row_rects(ui, viewer).into_iter().find(is_of_it).map(|(_, rect)| rect)
}

/// Draws the name of a row. The number of the layer stays visible for long names.
pub(super) fn draw_row_name(ui: &Ui, name: &str, place: Rect, color: Color32) {
    let painter = ui.painter_at(place);
    let (name, layer) = match name.rsplit_once(" +") {
        Some((name, layer)) if layer.bytes().all(|b| b.is_ascii_digit()) => (name, format!(" +{layer}")),
        _ => (name, String::new()),
    };
    let layer = painter.layout_no_wrap(layer, FontId::proportional(12.0), color);
    let left = place.left() + 6.0;
    let name =
        super::truncated_text(&painter, name, 12.0, color, place.right() - 4.0 - layer.size().x - left);
    let at = |x: f32, height: f32| pos2(x, place.center().y - height / 2.0);
    let (width, height) = (name.size().x, name.size().y);
    painter.galley(at(left, height), name, color);
    painter.galley(at(left + width, height), layer, color);
}

/// Adds a clip that was dropped on a lane to the actor of its row.
pub(super) fn add_dropped_clip(ui: &Ui, viewer: &mut Viewer, number: RowNumber, lane: Rect) {
    let Some((clip, target, secs)) = take_dropped_clip(ui, viewer, number, lane) else { return };
    let layer = viewer.timeline.rows.get(number.row).and_then(|row| row.layer).unwrap_or(0);
    viewer.edit(|v| v.add_clip_to_layer(&target, &clip.source, &clip.clip, Some(secs), layer));
}

/// A clip that was dropped on a lane: the clip, the actor of the row, and the time in seconds.
fn take_dropped_clip(
    ui: &Ui,
    viewer: &mut Viewer,
    number: RowNumber,
    lane: Rect,
) -> Option<(ClipDrag, String, f64)> {
    let response = ui.interact(lane, ui.id().with(("lane", number)), Sense::hover());
    let index = number.row;
    let hovering = response.dnd_hover_payload::<ClipDrag>();
    let pointer = ui.ctx().pointer_interact_pos().filter(|p| lane.contains(*p))?;
    let secs = bars::Lane { rect: lane, row: index }.snapped(viewer, pointer.x, None);
    let row = viewer.timeline.rows[index].what.clone();
    let target = row.as_ref().and_then(Selected::actor);
    if let (Some(clip), Some(target)) = (hovering, target) {
        let x = lane.left() + viewer.visible_span.x_of(secs, lane.width());
        ui.painter_at(lane).vline(x, lane.y_range(), Stroke::new(2.0, ui.visuals().strong_text_color()));
        if let Some((joints, moved)) = count_following_joints(ui, viewer, &clip, target) {
            bars::draw_text_at_pointer(
                ui,
                pointer,
                &format!("on {target}: {joints} of {moved} joints follow"),
            );
        }
    }
    let clip = response.dnd_release_payload::<ClipDrag>()?;
    match target {
        Some(target) => Some(((*clip).clone(), target.to_string(), secs)),
        None => {
            viewer.edit(|_| {
                Err(EditError::refused("only actors play clips: drop the clip on the row of an actor"))
            });
            None
        }
    }
}

/// Number of an actor's joints that follow a dragged clip, and number of joints that the clip moves; computed once per drag.
pub(super) fn count_following_joints(
    ui: &Ui,
    viewer: &Viewer,
    clip: &ClipDrag,
    target: &str,
) -> Option<(usize, usize)> {
    let ClipSource::Actor(of) = &clip.source else { return None };
    let number = viewer.scene.as_ref()?.number;
    let id = egui::Id::new("followed").with((number, of, &clip.clip, target));
    if let Some(known) = ui.data(|d| d.get_temp(id)) {
        return known;
    }
    let found = viewer.joints_that_follow(of, &clip.clip, target);
    ui.data_mut(|d| d.insert_temp(id, found));
    found
}

fn zoom_and_scroll_with_wheel(ui: &Ui, viewer: &mut Viewer, area: Rect, ruler: Rect) {
    let Some(pointer) = ui.ctx().pointer_hover_pos().filter(|p| area.contains(*p) && p.x >= ruler.left())
    else {
        return;
    };
    // The wheel over the names of rows scrolls them.
    let (scroll, zoom) = ui.input_mut(|i| {
        let scroll = std::mem::take(&mut i.smooth_scroll_delta);
        (scroll, f64::from(i.zoom_delta()) * libm::exp(f64::from(scroll.y) / 200.0))
    });
    let length = viewer.playhead.length().as_secs();
    let (x, width) = (pointer.x - ruler.left(), ruler.width());
    if zoom != 1.0 {
        viewer.visible_span.zoom(zoom, x, width, length);
    }
    if scroll.x != 0.0 {
        viewer.visible_span.pan(scroll.x, width, length);
    }
}

/// Draws the beats and the playhead over all rows.
pub(super) fn draw_beats_and_playhead(ui: &Ui, viewer: &Viewer, area: Rect, (ruler, span): (Rect, Span)) {
    let lanes = Rect::from_min_max(ruler.min, area.max);
    let painter = ui.painter_at(lanes);
    let x = |time: Time| ruler.left() + span.x_of(time.as_secs(), ruler.width());
    // The time after the end of the scene is darkened.
    let after = Rect::from_min_max(pos2(x(viewer.timeline.length), lanes.top()), lanes.max);
    painter.rect_filled(after.intersect(lanes), 0.0, Color32::from_black_alpha(110));
    let faint = Stroke::new(1.0, ui.visuals().weak_text_color().gamma_multiply(0.35));
    let min_beat_secs = span.secs_at(MIN_BEAT_DISTANCE, ruler.width()) - span.from;
    for beat in
        viewer.tempo.beats_between(span.from, span.to.min(viewer.timeline.length.as_secs()), min_beat_secs)
    {
        painter.vline(ruler.left() + span.x_of(beat, ruler.width()), lanes.y_range(), faint);
    }
    let head = x(viewer.playhead.time());
    painter.vline(head, lanes.y_range(), Stroke::new(1.5, Color32::from_rgb(0xff, 0x6a, 0x3d)));
    let tip =
        vec![pos2(head - 5.0, lanes.top()), pos2(head + 5.0, lanes.top()), pos2(head, lanes.top() + 8.0)];
    painter.add(egui::Shape::convex_polygon(tip, Color32::from_rgb(0xff, 0x6a, 0x3d), Stroke::NONE));
}

/// Number of errors or warnings, if there are any; a click goes to the first.
fn show_problem_count(ui: &Ui, viewer: &mut Viewer, place: Rect) {
    let of = |severity| viewer.problems.iter().filter(move |p| p.severity == severity);
    let highest_severity =
        [Severity::Error, Severity::Warning].into_iter().find(|severity| of(*severity).next().is_some());
    let Some((highest_severity, first)) =
        highest_severity.and_then(|severity| Some((severity, of(severity).next()?)))
    else {
        return;
    };
    let visuals = ui.visuals();
    let (color, word) = match highest_severity {
        Severity::Error => (visuals.error_fg_color, "error"),
        _ => (visuals.warn_fg_color, "warning"),
    };
    let text = match of(highest_severity).count() {
        1 => format!("1 {word}"),
        n => format!("{n} {word}s"),
    };
    let text = if first.line > 0 { format!("{text}: line {}", first.line) } else { text };
    let response = ui.interact(place, ui.id().with("wrong"), Sense::click());
    response.widget_info(|| {
        egui::WidgetInfo::labeled(egui::WidgetType::Button, true, format!("problems: {text}"))
    });
    let painter = ui.painter_at(place);
    let galley = super::truncated_text(&painter, &text, 11.5, color, place.width() - 12.0);
    painter.galley(place.left_center() + vec2(6.0, -galley.size().y / 2.0), galley, color);
    let line = first.line;
    if response.hint(format!("{text}\n{}", first.message)).clicked() && line > 0 {
        viewer.script_scroll_line = Some(line);
    }
}
