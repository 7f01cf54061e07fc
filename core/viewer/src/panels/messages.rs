//! What is wrong, with places, and what the script printed.

use crate::app::Viewer;
use choreo_script::Severity;
use egui::{RichText, Ui};

pub fn show(ui: &mut Ui, viewer: &mut Viewer) {
    let visuals = ui.visuals().clone();
    if viewer.problems.is_empty() && viewer.trouble.is_empty() {
        ui.label("nothing to say");
    }
    for text in &viewer.trouble {
        ui.label(RichText::new(text).color(visuals.error_fg_color).monospace());
    }
    for problem in &viewer.problems {
        let color = match problem.severity {
            Severity::Error => visuals.error_fg_color,
            Severity::Warning => visuals.warn_fg_color,
            Severity::Note => visuals.text_color(),
        };
        // As the command line says it, with the line and a caret.
        ui.label(RichText::new(problem.to_string()).color(color).monospace());
        ui.separator();
    }
    let printed = viewer.scene.as_ref().map(|s| s.printed.as_slice()).unwrap_or_default();
    for line in printed {
        ui.label(RichText::new(line).monospace());
    }
}
