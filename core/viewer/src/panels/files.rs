//! Menu File, the file dialog, and the question about a missing script.

use super::dialog;
use super::hint::Hint;
use crate::app::Viewer;
use crate::library::file_dialog::{FileDialog, Purpose};
use crate::library::folder::{Entry, FileKind};
use crate::library::templates::TEMPLATES;
use egui::{Key, RichText, ScrollArea, TextEdit, Ui};

/// Entries of the menu.
pub(super) fn show_file_menu(ui: &mut Ui, viewer: &mut Viewer) {
    let shown = viewer.path.clone();
    ui.menu_button("New", |ui| {
        for template in TEMPLATES {
            if ui.button(template.name).hint(template.about).clicked() {
                viewer.documents.open_dialog(Purpose::New(template), shown.as_deref());
            }
        }
    });
    if ui.button("Open…").clicked() {
        viewer.documents.open_dialog(Purpose::Open, shown.as_deref());
    }
    let recent = viewer.documents.recent.clone();
    ui.add_enabled_ui(!recent.is_empty(), |ui| {
        ui.menu_button("Recent", |ui| {
            for file in recent {
                if ui.button(file.display().to_string()).clicked() {
                    viewer.documents.file_to_open = Some(file);
                }
            }
        });
    });
    // Edits are saved at once, so there is never anything to save.
    ui.add_enabled(false, egui::Button::new("Saved"))
        .on_disabled_hover_text("each change is written at once");
    if ui.add_enabled(shown.is_some(), egui::Button::new("Save as…")).clicked() {
        viewer.documents.open_dialog(Purpose::SaveAs, shown.as_deref());
    }
    ui.separator();
    let start = &mut viewer.documents.shows_start_page;
    let word = if *start { "Back to the file" } else { "Start page" };
    if ui.add_enabled(!*start || viewer.scene.is_some(), egui::Button::new(word)).clicked() {
        *start = !*start;
    }
    if ui.button("Quit").hint("ends the program; each change is saved").clicked() {
        viewer.should_close = true;
    }
}

/// The open file dialog, and the question about a missing script.
pub(crate) fn show_dialogs(ui: &mut Ui, viewer: &mut Viewer) {
    show_missing_file(ui, viewer);
    let Some(mut dialog) = viewer.documents.dialog.take() else { return };
    match show_file_list(ui, &mut dialog) {
        Answer::Pending => viewer.documents.dialog = Some(dialog),
        Answer::Cancel => {}
        Answer::Accept => match dialog.accept() {
            None => viewer.documents.dialog = Some(dialog),
            Some(file) => {
                if let Err(error) = viewer.take_file(dialog.purpose, &file) {
                    dialog.problem = Some(error.to_string());
                    viewer.documents.dialog = Some(dialog);
                }
            }
        },
    }
}

enum Answer {
    Pending,
    Cancel,
    Accept,
}

fn show_file_list(ui: &Ui, dialog: &mut FileDialog) -> Answer {
    let mut answer = Answer::Pending;
    let (title, button) = match dialog.purpose {
        Purpose::Open => ("Open".to_string(), "Open"),
        Purpose::New(template) => (format!("New: {}", template.name), "Create"),
        Purpose::Lesson(_) => ("Open a copy of the lesson".to_string(), "Create"),
        Purpose::SaveAs => ("Save as".to_string(), "Save"),
    };
    let is_dismissed = dialog::show(ui, &title, |ui| {
        ui.set_width(560.0);
        ui.horizontal(|ui| {
            let above = dialog.folder.parent().map(std::path::Path::to_path_buf);
            if ui.add_enabled(above.is_some(), egui::Button::new("Up")).hint("the folder above").clicked() {
                above.iter().for_each(|above| dialog.change_folder(above));
            }
            ui.add(
                egui::Label::new(RichText::new(dialog.folder.display().to_string()).monospace()).truncate(),
            );
        });
        ui.separator();
        let mut chosen: Option<(Entry, bool)> = None;
        ScrollArea::vertical().max_height(320.0).auto_shrink([false, false]).show(ui, |ui| {
            for entry in &dialog.entries {
                let name = match entry.kind {
                    FileKind::Folder => format!("{}/", entry.name),
                    _ => entry.name.clone(),
                };
                let response = ui.selectable_label(dialog.name == entry.name, name);
                if response.double_clicked() {
                    chosen = Some((entry.clone(), true));
                } else if response.clicked() {
                    chosen = Some((entry.clone(), false));
                }
            }
            if dialog.entries.is_empty() {
                ui.weak("no scripts or models here");
            }
        });
        if let Some((entry, twice)) = chosen {
            dialog.choose(&entry);
            if twice && entry.kind != FileKind::Folder && dialog.purpose == Purpose::Open {
                answer = Answer::Accept;
            }
        }
        ui.separator();
        ui.horizontal(|ui| {
            let label = ui.label("name");
            let field =
                ui.add(TextEdit::singleline(&mut dialog.name).desired_width(420.0)).labelled_by(label.id);
            if std::mem::take(&mut dialog.was_just_opened) {
                field.request_focus();
            }
            if field.lost_focus() && ui.input(|i| i.key_pressed(Key::Enter)) {
                answer = Answer::Accept;
            }
        });
        if let Some(problem) = &dialog.problem {
            ui.label(RichText::new(problem).color(ui.visuals().warn_fg_color));
        }
        ui.horizontal(|ui| {
            if ui.button(button).clicked() {
                answer = Answer::Accept;
            }
            if ui.button("Cancel").clicked() {
                answer = Answer::Cancel;
            }
        });
    });
    if is_dismissed { Answer::Cancel } else { answer }
}

/// Offers to create a missing script.
fn show_missing_file(ui: &Ui, viewer: &mut Viewer) {
    let Some(path) = viewer.documents.missing_script.clone() else { return };
    if path.exists() {
        // The file was created meanwhile.
        viewer.documents.missing_script = None;
        return;
    }
    let mut template_to_create = None;
    let is_dismissed = dialog::show(ui, "There is no such file", |ui| {
        ui.label(RichText::new(path.display().to_string()).monospace());
        ui.label("Create it from:");
        ui.horizontal(|ui| {
            for template in TEMPLATES {
                if ui.button(template.name).hint(template.about).clicked() {
                    template_to_create = Some(template);
                }
            }
        });
        ui.separator();
        ui.horizontal(|ui| {
            if ui.button("Open another…").clicked() {
                viewer.documents.missing_script = None;
                viewer.documents.open_dialog(Purpose::Open, Some(&path));
            }
            if ui.button("Do not create it").clicked() {
                viewer.documents.missing_script = None;
            }
        });
    });
    if is_dismissed {
        viewer.documents.missing_script = None;
    }
    if let Some(template) = template_to_create {
        viewer.edit(|v| v.take_file(Purpose::New(template), &path));
    }
}
