//! Panel of frame times by stage, and of the objects that the renderer holds.

use crate::app::Viewer;
use crate::state::performance::MAX_FRAMES;
use egui::{Color32, Grid, Rect, Sense, Ui, pos2, vec2};

/// Colors of the stages: poses, plan, drawing.
const STAGE_COLORS: [Color32; 3] = [
    Color32::from_rgb(0x00, 0x8a, 0x66),
    Color32::from_rgb(0xd0, 0x8a, 0x20),
    Color32::from_rgb(0x2f, 0x7f, 0xc8),
];

pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer) {
    ui.horizontal(|ui| {
        ui.label("at most");
        let caps = [None, Some(60), Some(30), Some(15), Some(5)];
        let name =
            |cap: Option<u32>| cap.map_or("as the scene has".to_string(), |c| format!("{c} frames a second"));
        let cap = egui::ComboBox::from_id_salt("cap").selected_text(name(viewer.performance.max_fps));
        let cap = cap.show_ui(ui, |ui| {
            for cap in caps {
                ui.selectable_value(&mut viewer.performance.max_fps, cap, name(cap));
            }
        });
        cap.response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::ComboBox, true, "at most"));
        if let Some([median, high]) = viewer.performance.median_and_p95() {
            ui.separator();
            ui.monospace(format!("median {median:.1} ms, 95 % below {high:.1} ms"));
        }
    });
    draw_frame_graph(ui, viewer);
    let Some(shown) = viewer.shown() else {
        ui.label("no frame was drawn yet");
        return;
    };
    let millis = |d: std::time::Duration| format!("{:.2} ms", d.as_secs_f64() * 1e3);
    let rows = [
        ("poses", millis(shown.evaluated_in)),
        ("plan", millis(shown.planned_in)),
        ("drawing", millis(shown.drawn_in)),
        ("draws, triangles", format!("{}, {}", shown.draw_count, shown.triangle_count)),
        ("pipelines", viewer.device_usage.pipelines.to_string()),
        (
            "memory objects, blocks",
            format!("{}, {}", viewer.device_usage.memory_objects, viewer.device_usage.memory_blocks),
        ),
        ("memory on the device", format!("{:.1} MB", viewer.device_usage.bytes as f64 / 1e6)),
        ("device", shown.device.name.clone()),
        ("window drawn by", viewer.window_device.clone()),
    ];
    Grid::new("performance").num_columns(2).striped(true).show(ui, |ui| {
        for (name, value) in rows {
            ui.label(name);
            ui.monospace(value);
            ui.end_row();
        }
    });
}

/// A column per frame, the newest on the right.
fn draw_frame_graph(ui: &mut Ui, viewer: &Viewer) {
    let (rect, response) =
        ui.allocate_exact_size(vec2(ui.available_width().min(720.0), 70.0), Sense::hover());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Image, true, "frame graph"));
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    let frames = &viewer.performance.frames;
    let budget = 1e3 / viewer.playhead.fps().as_fps() as f32;
    let highest = frames.iter().map(|f| f.iter().sum::<f32>()).fold(budget * 1.25, f32::max);
    let width = rect.width() / MAX_FRAMES as f32;
    for (index, frame) in frames.iter().rev().enumerate() {
        let right = rect.right() - index as f32 * width;
        let mut bottom = rect.bottom();
        for (part, color) in frame.iter().zip(STAGE_COLORS) {
            let top = bottom - part / highest * rect.height();
            painter.rect_filled(
                Rect::from_min_max(pos2(right - width, top), pos2(right, bottom)),
                0.0,
                color,
            );
            bottom = top;
        }
    }
    let line = rect.bottom() - budget / highest * rect.height();
    painter.hline(rect.x_range(), line, egui::Stroke::new(1.0, ui.visuals().warn_fg_color));
    let text = format!("{budget:.1} ms: the scene's own rate");
    let font = egui::FontId::proportional(10.5);
    painter.text(
        pos2(rect.left() + 4.0, line - 1.0),
        egui::Align2::LEFT_BOTTOM,
        text,
        font,
        ui.visuals().weak_text_color(),
    );
}
