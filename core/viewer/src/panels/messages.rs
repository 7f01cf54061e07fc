//! Problems with their places, and the lines that the script printed. A click goes to the line.

use crate::app::Viewer;
use choreo_script::Severity;
use egui::{RichText, Sense, Ui};

pub fn show(ui: &mut Ui, viewer: &mut Viewer) {
    let visuals = ui.visuals().clone();
    if viewer.problems.is_empty() && viewer.trouble.is_empty() && viewer.without_vulkan.is_none() {
        ui.label("nothing to say");
    }
    if let Some(text) = &viewer.without_vulkan {
        ui.label(RichText::new(text).color(visuals.warn_fg_color).monospace());
    }
    for text in &viewer.trouble {
        ui.label(RichText::new(text).color(visuals.error_fg_color).monospace());
    }
    let mut go_to = None;
    let mut open = None;
    for problem in &viewer.problems {
        let color = match problem.severity {
            Severity::Error => visuals.error_fg_color,
            Severity::Warning => visuals.warn_fg_color,
            Severity::Note => visuals.text_color(),
        };
        // The text is that of the command line, with the line and a caret.
        let text = RichText::new(problem.to_string()).color(color).monospace();
        let placed = problem.line > 0;
        let label =
            ui.add(egui::Label::new(text).sense(if placed { Sense::click() } else { Sense::hover() }));
        if placed {
            if label.on_hover_cursor(egui::CursorIcon::PointingHand).clicked() {
                go_to = Some(problem.line);
            }
            if ui.small_button("open in editor").clicked() {
                open = Some(problem.line);
            }
        }
        ui.separator();
    }
    viewer.go_to = go_to.or(viewer.go_to);
    if let Some(line) = open {
        super::script::open_in_editor(viewer, line);
    }
    let printed = viewer.scene.as_ref().map(|s| s.printed.as_slice()).unwrap_or_default();
    for line in printed {
        ui.label(RichText::new(line).monospace());
    }
}
