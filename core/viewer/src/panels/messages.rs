//! Panel of problems with their positions, and of the lines that the script printed. A click goes to the line.

use crate::app::Viewer;
use choreo_script::Severity;
use choreo_session::Problem;
use egui::{RichText, Sense, Ui};

/// Largest number of displayed messages, since the window draws all of them in each frame.
const MAX_MESSAGES: usize = 100;

pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer) {
    let visuals = ui.visuals().clone();
    if viewer.problems.is_empty() && viewer.renderer_problems.is_empty() && viewer.without_vulkan.is_none() {
        ui.label("no messages");
    }
    if let Some(text) = &viewer.without_vulkan {
        ui.label(RichText::new(text).color(visuals.warn_fg_color).monospace());
    }
    for text in &viewer.renderer_problems {
        ui.label(RichText::new(text).color(visuals.error_fg_color).monospace());
    }
    let mut go_to = None;
    let mut open = None;
    let shown = problems_to_show(&viewer.problems);
    let left_out = viewer.problems.len() - shown.len();
    for problem in shown {
        let color = match problem.severity {
            Severity::Error => visuals.error_fg_color,
            Severity::Warning => visuals.warn_fg_color,
            Severity::Note => visuals.text_color(),
        };
        // The same text as on the command line, with the source line and a caret.
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
    if left_out > 0 {
        ui.weak(format!("and {left_out} more, all of which choreo check prints"));
    }
    viewer.script_scroll_line = go_to.or(viewer.script_scroll_line);
    if let Some(line) = open {
        super::script::open_in_editor(viewer, line);
    }
    let printed = viewer.scene.as_ref().map(|s| s.printed.as_slice()).unwrap_or_default();
    for line in printed {
        ui.label(RichText::new(line).monospace());
    }
}

/// The most severe problems, in their order.
fn problems_to_show(problems: &[Problem]) -> Vec<&Problem> {
    let mut worst: Vec<usize> = (0..problems.len()).collect();
    worst.sort_by_key(|index| problems[*index].severity);
    worst.truncate(MAX_MESSAGES);
    worst.sort_unstable();
    worst.into_iter().map(|index| &problems[index]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_most_severe_problems_are_shown_when_there_are_too_many() {
        let mut problems = vec![Problem::warning("gap"); 4 * MAX_MESSAGES];
        problems.push(Problem::error("late"));
        let shown = problems_to_show(&problems);
        assert_eq!(shown.len(), MAX_MESSAGES);
        assert_eq!(shown.last().map(|problem| problem.message.as_str()), Some("late"));
        assert_eq!(super::problems_to_show(&problems[..3]).len(), 3);
    }
}
