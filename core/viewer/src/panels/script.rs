//! Read-only text of the script. Lines that are active at the playhead, selected, or have problems are marked.

use super::hint::Hint;
use crate::app::Viewer;
use crate::editing::{EditError, read_script};
use crate::state::selection::Selected;
use choreo_script::Severity;
use egui::{Color32, CursorIcon, FontId, RichText, ScrollArea, Sense, TextStyle, Ui, Visuals};
use std::collections::BTreeSet;
use std::sync::Arc;

pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer) {
    let places = viewer.scene.as_ref().map(|s| s.places.clone());
    let shown = places.as_ref().and_then(|p| p.sources.get(&p.main).cloned());
    // The messages of a faulty version refer to its own text.
    let newest = viewer.is_faulty.then(|| viewer.path.as_ref().and_then(|p| read_script(p).ok())).flatten();
    let Some(text) = newest.map(Arc::<str>::from).or(shown) else {
        ui.label("there is no script");
        return;
    };
    viewer.script_has_input = ui.rect_contains_pointer(ui.max_rect());
    ui.horizontal(|ui| {
        ui.label(RichText::new("read only").small().weak())
            .hint("click a line to select the object that it makes");
        let line = viewer.selection.as_ref().and_then(|s| line_of(viewer, s)).unwrap_or(1);
        let hint = "opens this line in $VISUAL; Ctrl click on a line does the same";
        if viewer.path.is_some() && ui.small_button("open in editor").hint(hint).clicked() {
            open_in_editor(viewer, line);
        }
        if viewer.is_faulty {
            ui.label(RichText::new("as it is on disk; the last good version is shown").small().weak());
        }
    });
    let marked = MarkedLines::new(viewer, places.as_ref().map(|p| p.main.as_str()));
    let font = FontId::monospace(TextStyle::Monospace.resolve(ui.style()).size);
    let height = ui.text_style_height(&TextStyle::Monospace);
    let lines: Vec<&str> = text.lines().collect();
    let visuals = ui.visuals().clone();
    let mut area = ScrollArea::both().auto_shrink([false, false]);
    let row_height = height + ui.spacing().item_spacing.y;
    if let Some(line) = viewer.script_scroll_line.take() {
        let middle = ui.available_height() / 2.0;
        area = area.vertical_scroll_offset(((line.max(1) - 1) as f32 * row_height - middle).max(0.0));
    }
    let (mut clicked, mut has_focus) = (None, false);
    area.show_rows(ui, height, lines.len(), |ui, rows| {
        for row in rows {
            let line = row + 1;
            let background_color = marked.background(line, &visuals);
            let text = RichText::new(format!("{line:4} {}", lines[row]))
                .font(font.clone())
                .background_color(background_color);
            let label = ui.add(egui::Label::new(text).extend().sense(Sense::click()));
            // The pointer is not a text cursor, which would suggest that text can be typed.
            let label = label.on_hover_cursor(CursorIcon::PointingHand);
            has_focus |= label.has_focus();
            if label.clicked() {
                // Only a click with Ctrl opens the editor; a double click selects text, as elsewhere.
                clicked = Some((line, super::gesture::modifiers(ui).command));
            }
            label.context_menu(|ui| {
                if ui.button(format!("Open line {line} in the editor")).clicked() {
                    clicked = Some((line, true));
                    ui.close();
                }
            });
        }
    });
    viewer.script_has_input |= has_focus;
    match clicked {
        Some((line, true)) => open_in_editor(viewer, line),
        Some((line, false)) => select_line(viewer, line),
        None => {}
    }
}

/// Lines of the main file with a colored background.
struct MarkedLines {
    /// The line of the selection.
    selected: Option<usize>,
    errors: BTreeSet<usize>,
    warnings: BTreeSet<usize>,
    /// Lines of the cues that are active at the playhead.
    active: BTreeSet<usize>,
}

impl MarkedLines {
    /// `main`: name of the main file; `None` if no version was loaded.
    fn new(viewer: &Viewer, main: Option<&str>) -> MarkedLines {
        let line_in_main_file = |file: &str, line: usize| main.is_none_or(|m| m == file).then_some(line);
        let lines_with = |severity| {
            let problems = viewer.problems.iter().filter(move |p| p.severity == severity);
            problems.filter_map(|p| line_in_main_file(&p.file, p.line)).collect()
        };
        let (errors, warnings) = (lines_with(Severity::Error), lines_with(Severity::Warning));
        // The timeline shows the last good version, whose lines may differ from the faulty text.
        if viewer.is_faulty {
            return MarkedLines { selected: None, errors, warnings, active: BTreeSet::new() };
        }
        let bars = viewer.timeline.bars_at(viewer.playhead.time());
        MarkedLines {
            selected: viewer.selection.as_ref().and_then(|s| line_of(viewer, s)),
            errors,
            warnings,
            active: bars.filter_map(|bar| line_in_main_file(&bar.place.file, bar.place.line)).collect(),
        }
    }

    fn background(&self, line: usize, visuals: &Visuals) -> Color32 {
        if self.selected == Some(line) {
            visuals.selection.bg_fill
        } else if self.errors.contains(&line) {
            visuals.error_fg_color.gamma_multiply(0.35)
        } else if self.warnings.contains(&line) {
            visuals.warn_fg_color.gamma_multiply(0.35)
        } else if self.active.contains(&line) {
            visuals.selection.bg_fill.gamma_multiply(0.4)
        } else {
            Color32::TRANSPARENT
        }
    }
}

/// Refuses an edit of the selection by a key while the panel has the pointer or the keyboard. Returns whether it does.
pub(super) fn refuses_keys(viewer: &mut Viewer) -> bool {
    const READ_ONLY_MESSAGE: &str = "the script is read only here: open it in the editor to type; \
        with the pointer elsewhere, the key acts on the selection";
    if viewer.script_has_input {
        viewer.edit(|_| Err(EditError::refused(READ_ONLY_MESSAGE)));
    }
    viewer.script_has_input
}

pub(crate) fn open_in_editor(viewer: &mut Viewer, line: usize) {
    if let Some(path) = &viewer.path {
        let opened = viewer.editor.open(path, line);
        viewer.report(opened.map_err(Into::into));
    }
}

/// Selects the object that a line of the script creates.
fn select_line(viewer: &mut Viewer, line: usize) {
    let Some(scene) = viewer.scene.clone().filter(|_| !viewer.is_faulty) else { return };
    let bars = viewer.timeline.rows.iter().flat_map(|r| &r.bars).map(|b| b.what.clone());
    let actors = scene.stage.actors.iter().map(|a| Selected::Actor(a.name.clone()));
    let lights = (0..scene.stage.lights.len()).map(Selected::Light);
    let made = bars.chain(actors).chain(lights).find(|what| line_of(viewer, what) == Some(line));
    if made.is_some() {
        viewer.selection = made;
    }
}

/// Line of the script that creates an object.
pub(super) fn line_of(viewer: &Viewer, what: &Selected) -> Option<usize> {
    let scene = viewer.scene.as_ref()?;
    let (stage, places) = (&scene.stage, &scene.places);
    let actor = |name: &str| crate::state::selection::actor(stage, name);
    let place = match what {
        Selected::Actor(name) => places.actors.get(actor(name)?)?,
        Selected::Cue { actor: name, layer, cue } => places.cues.get(actor(name)?)?.get(*layer)?.get(*cue)?,
        Selected::Camera(name) => places.cameras.get(stage.cameras.iter().position(|c| c.name == *name)?)?,
        Selected::Light(index) => places.lights.get(*index)?,
        Selected::Effect(index) => places.effects.get(*index)?,
        Selected::Title(index) => places.layers_2d.get(*index)?,
        Selected::Sky => places.sky.as_ref()?,
    };
    (place.file == places.main && place.line > 0).then_some(place.line)
}
