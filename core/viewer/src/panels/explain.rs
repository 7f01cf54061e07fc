//! Panel that lists the parts of the displayed frame, those left out, and the work done so far.

use crate::app::Viewer;
use egui::{Grid, Ui};

pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer) {
    let Some(shown) = viewer.shown() else {
        ui.label("no frame was drawn yet");
        return;
    };
    let millis = |d: std::time::Duration| format!("{:.2} ms", d.as_secs_f64() * 1e3);
    let rows = [
        ("device", format!("{} ({})", shown.device.name, shown.device.driver)),
        ("poses", millis(shown.evaluated_in)),
        ("plan", millis(shown.planned_in)),
        ("drawing", millis(shown.drawn_in)),
        ("draws", shown.draw_count.to_string()),
        ("last build of the scene", millis(viewer.build_duration)),
        ("builds, imports so far", format!("{}, {}", viewer.work.builds, viewer.work.imports)),
        (
            "meshes, textures, materials, pipelines made so far",
            format!(
                "{}, {}, {}, {}",
                viewer.created_counts.meshes,
                viewer.created_counts.textures,
                viewer.created_counts.materials,
                viewer.created_counts.pipelines
            ),
        ),
    ];
    Grid::new("explain").num_columns(2).striped(true).show(ui, |ui| {
        for (name, value) in rows {
            ui.label(name);
            ui.monospace(value);
            ui.end_row();
        }
    });
    ui.add_space(6.0);
    ui.label("left out of this frame:");
    for (what, why) in &shown.left_out {
        ui.label(format!("{what}: {why}"));
    }
}
