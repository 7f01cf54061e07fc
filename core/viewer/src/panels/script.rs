//! The script's text, read-only; lines of what is on at the playhead, of the selection and of problems are marked.

use crate::app::Viewer;
use crate::selection::Selected;
use egui::{Color32, FontId, RichText, ScrollArea, TextStyle, Ui};
use std::collections::BTreeSet;

pub fn show(ui: &mut Ui, viewer: &mut Viewer) {
    let Some(scene) = viewer.scene.clone() else {
        ui.label("no version of the script is good yet");
        return;
    };
    let places = &scene.places;
    let Some(text) = places.sources.get(&places.main) else {
        ui.label("there is no script");
        return;
    };
    if viewer.faulty {
        ui.label(RichText::new("the last good version").small().weak());
    }
    let here = |file: &str, line: usize| (file == places.main).then_some(line);
    let time = viewer.playhead.time();
    let on: BTreeSet<usize> =
        viewer.timeline.on_at(time).filter_map(|bar| here(&bar.place.file, bar.place.line)).collect();
    let wrong: BTreeSet<usize> = viewer.problems.iter().filter_map(|p| here(&p.file, p.line)).collect();
    let selected = viewer.selection.as_ref().and_then(|s| line_of(viewer, s));
    let font = FontId::monospace(TextStyle::Monospace.resolve(ui.style()).size);
    let height = ui.text_style_height(&TextStyle::Monospace);
    let lines: Vec<&str> = text.lines().collect();
    let visuals = ui.visuals().clone();
    ScrollArea::both().auto_shrink([false, false]).show_rows(ui, height, lines.len(), |ui, rows| {
        for row in rows {
            let line = row + 1;
            let back = if selected == Some(line) {
                visuals.selection.bg_fill
            } else if wrong.contains(&line) {
                visuals.error_fg_color.gamma_multiply(0.35)
            } else if on.contains(&line) {
                visuals.selection.bg_fill.gamma_multiply(0.4)
            } else {
                Color32::TRANSPARENT
            };
            let text =
                RichText::new(format!("{line:4} {}", lines[row])).font(font.clone()).background_color(back);
            ui.add(egui::Label::new(text).extend());
        }
    });
}

/// Where the script made it.
pub fn line_of(viewer: &Viewer, what: &Selected) -> Option<usize> {
    let scene = viewer.scene.as_ref()?;
    let (stage, places) = (&scene.stage, &scene.places);
    let actor = |name: &str| crate::selection::actor(stage, name);
    let place = match what {
        Selected::Actor(name) => places.actors.get(actor(name)?)?,
        Selected::Cue { actor: name, layer, cue } => places.cues.get(actor(name)?)?.get(*layer)?.get(*cue)?,
        Selected::Camera(name) => places.cameras.get(stage.cameras.iter().position(|c| c.name == *name)?)?,
        Selected::Light(index) => places.lights.get(*index)?,
        Selected::Effect(index) => places.effects.get(*index)?,
    };
    (place.file == places.main && place.line > 0).then_some(place.line)
}
