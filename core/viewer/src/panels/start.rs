//! Start page: recent files, templates, and the lessons as images.

use super::Panels;
use super::hint::Hint;
use super::thumbnail_textures::{ThumbnailTextures, thumbnail_height};
use crate::app::Viewer;
use crate::library::file_dialog::Purpose;
use crate::library::templates::TEMPLATES;
use crate::library::thumbnails::{Subject, ThumbnailState};
use egui::{RichText, ScrollArea, Sense, Ui, vec2};
use std::path::{Path, PathBuf};

/// Width of an image, points.
const TILE_WIDTH: f32 = 200.0;

pub(super) fn show(panels: &mut Panels, ui: &mut Ui, viewer: &mut Viewer) {
    // Files dropped on this page are opened.
    if let Some(file) = viewer.dropped_files.drain(..).next() {
        viewer.documents.file_to_open = Some(file);
    }
    let fill = egui::Frame::new().fill(ui.visuals().panel_fill).inner_margin(20.0);
    egui::CentralPanel::default().frame(fill).show(ui, |ui| {
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            ui.label(RichText::new("choreo").heading().strong());
            ui.add_space(8.0);
            if ui.button("Open…").hint("a script or a model").clicked() {
                viewer.documents.open_dialog(Purpose::Open, None);
            }
            show_section_title(ui, "New");
            ui.horizontal_wrapped(|ui| {
                for template in TEMPLATES {
                    let button = egui::Button::new(template.name).min_size(vec2(TILE_WIDTH, 44.0));
                    if ui.add(button).hint(template.about).clicked() {
                        viewer.documents.open_dialog(Purpose::New(template), None);
                    }
                }
            });
            let recent: Vec<(PathBuf, String)> = viewer
                .documents
                .recent
                .iter()
                .filter(|file| file.is_file())
                .map(|file| (file.clone(), file_name(file)))
                .collect();
            if !recent.is_empty() {
                show_section_title(ui, "Recent");
                if let Some(clicked) = show_tiles(ui, viewer, &mut panels.thumbnails, &recent) {
                    viewer.documents.file_to_open = Some(recent[clicked].0.clone());
                }
            }
            let lessons: Vec<(PathBuf, String)> = viewer
                .documents
                .lessons
                .iter()
                .map(|lesson| (lesson.file.clone(), lesson.title.clone()))
                .collect();
            if !lessons.is_empty() {
                show_section_title(ui, "Lessons");
                // A lesson is opened as a copy, so that an edit does not change the lesson itself.
                if let Some(clicked) = show_tiles(ui, viewer, &mut panels.thumbnails, &lessons) {
                    viewer.documents.open_dialog(Purpose::Lesson(clicked), None);
                }
            }
        });
    });
}

fn show_section_title(ui: &mut Ui, title: &str) {
    ui.add_space(16.0);
    ui.label(RichText::new(title).strong());
    ui.add_space(4.0);
}

fn file_name(file: &Path) -> String {
    file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Draws files as images with names. Returns the index of the one that was clicked.
fn show_tiles(
    ui: &mut Ui,
    viewer: &mut Viewer,
    thumbnails: &mut ThumbnailTextures,
    files: &[(PathBuf, String)],
) -> Option<usize> {
    let mut clicked = None;
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing = vec2(12.0, 12.0);
        for (number, (file, title)) in files.iter().enumerate() {
            let size = vec2(TILE_WIDTH, thumbnail_height(TILE_WIDTH) + 22.0);
            let (place, response) = ui.allocate_exact_size(size, Sense::click());
            response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, true, title.clone()));
            // Images outside the visible area are not drawn.
            if !ui.is_rect_visible(place) {
                continue;
            }
            let image = egui::Rect::from_min_size(place.min, vec2(TILE_WIDTH, thumbnail_height(TILE_WIDTH)));
            let made = thumbnails.show(ui, viewer, &Subject::file(file.clone()), None, image);
            let color = match response.hovered() || response.has_focus() {
                true => ui.visuals().strong_text_color(),
                false => ui.visuals().text_color(),
            };
            if response.hovered() || response.has_focus() {
                let stroke = egui::Stroke::new(2.0, ui.visuals().selection.bg_fill);
                ui.painter().rect_stroke(image, 3.0, stroke, egui::StrokeKind::Outside);
            }
            let name = super::truncated_text(ui.painter(), title, 13.0, color, TILE_WIDTH);
            ui.painter().galley(egui::pos2(place.left(), image.bottom() + 4.0), name, color);
            let mut hint = file.display().to_string();
            if let ThumbnailState::Failed(why) = made {
                hint = format!("{hint}\n{why}");
            }
            if response.hint(hint).clicked() {
                clicked = Some(number);
            }
        }
    });
    clicked
}
