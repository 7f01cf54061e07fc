//! Asset browser: shows the built-in character, and the models and clips in the script's folder as images. A model is dragged onto the image, a
//! clip onto a row; a double click adds one to the scene. The chosen clip is previewed on the selected character.

use super::hint::Hint;
use super::icons;
use super::inspector::ClipDrag;
use super::thumbnail_textures::{ThumbnailTextures, thumbnail_height};
use crate::app::Viewer;
use crate::editing::ClipSource;
use crate::library::folder::{Entry, FileKind, list_folder};
use crate::library::thumbnails::{ClipEntry, Subject, ThumbnailState};
use crate::state::dropped_models::DroppedModels;
use crate::state::selection::{Selected, actor};
use choreo_asset::Asset;
use choreo_session::model::is_built_in;
use egui::{Align2, FontId, Rect, RichText, ScrollArea, Sense, Ui, vec2};
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Width of an image, points.
const TILE_WIDTH: f32 = 112.0;
const MAX_CLIPS: usize = 200;

/// Payload of a model dragged onto a viewport.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ModelDrag(pub PathBuf);

/// State of the browser.
#[derive(Default)]
pub(super) struct Browser {
    /// Displayed folder, in the folder of the script.
    folder: PathBuf,
    /// Folder of the script when `entries` were read.
    root: PathBuf,
    entries: Vec<Entry>,
    problem: Option<String>,
    search: String,
    chosen_file: Option<PathBuf>,
    chosen_clip: Option<String>,
    /// Version of the scene when `entries` were read.
    scene_number: Option<u64>,
}

impl Browser {
    /// Reads the folder again if it differs from the one read before, or if the scene has changed.
    fn refresh(&mut self, root: &Path, scene_number: Option<u64>, models: &[String]) {
        let is_same =
            self.root == root && self.scene_number == scene_number && !self.folder.as_os_str().is_empty();
        if is_same {
            return;
        }
        if self.root != root {
            (self.folder, self.chosen_file, self.chosen_clip) = (root.to_path_buf(), None, None);
        }
        (self.root, self.scene_number) = (root.to_path_buf(), scene_number);
        self.read_folder(models);
    }

    fn read_folder(&mut self, models: &[String]) {
        match list_folder(&self.folder, models) {
            Ok(entries) => (self.entries, self.problem) = (entries, None),
            Err(error) => (self.entries, self.problem) = (Vec::new(), Some(error.to_string())),
        }
    }

    fn open_folder(&mut self, folder: PathBuf, models: &[String]) {
        self.folder = folder;
        self.read_folder(models);
    }
}

pub(super) fn show(
    ui: &mut Ui,
    viewer: &mut Viewer,
    browser: &mut Browser,
    thumbnails: &mut ThumbnailTextures,
) {
    let root = viewer.path.as_ref().and_then(|path| path.canonicalize().ok());
    let Some(root) = root.as_deref().and_then(Path::parent) else {
        ui.label("no script is open; this panel lists the models in the script's folder");
        return;
    };
    let models = viewer.documents.model_extensions.clone();
    browser.refresh(root, viewer.scene.as_ref().map(|scene| scene.number), &models);
    show_path_row(ui, viewer, browser, root, &models);
    if let Some(problem) = &browser.problem {
        ui.label(RichText::new(problem).color(ui.visuals().error_fg_color));
    }
    let preview_height =
        if browser.chosen_file.is_some() { 190.0_f32.min(ui.available_height() / 2.0) } else { 0.0 };
    let height = (ui.available_height() - preview_height).max(60.0);
    ScrollArea::vertical().id_salt("files").max_height(height).auto_shrink([false, false]).show(ui, |ui| {
        show_tiles(ui, viewer, browser, thumbnails, &models);
    });
    if let Some(file) = browser.chosen_file.clone() {
        ui.separator();
        show_chosen_file(ui, viewer, browser, thumbnails, &file);
    }
}

fn show_path_row(ui: &mut Ui, viewer: &mut Viewer, browser: &mut Browser, root: &Path, models: &[String]) {
    ui.horizontal(|ui| {
        let inside = browser.folder.strip_prefix(root).unwrap_or(Path::new("")).to_path_buf();
        let is_subfolder = !inside.as_os_str().is_empty();
        let up = ui.add_enabled_ui(is_subfolder, |ui| {
            icons::small_button(ui, icons::ARROW_UP, "Up", "to the folder above")
        });
        if up.inner.clicked()
            && let Some(above) = browser.folder.parent().map(Path::to_path_buf)
        {
            browser.open_folder(above, models);
        }
        let hint = "reads the folder and its images again";
        if icons::small_button(ui, icons::ARROWS_CLOCKWISE, "Refresh", hint).clicked() {
            viewer.documents.thumbnails.forget();
            browser.read_folder(models);
        }
        let name = root.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let shown = if is_subfolder { format!("{name}/{}", inside.display()) } else { name };
        ui.add(egui::Label::new(RichText::new(shown).monospace().small()).truncate());
    });
    let search = egui::TextEdit::singleline(&mut browser.search).hint_text("search files");
    let search = ui.add(search.desired_width(f32::INFINITY));
    super::values::set_widget_name(search, egui::WidgetType::TextEdit, "search files");
}

fn show_tiles(
    ui: &mut Ui,
    viewer: &mut Viewer,
    browser: &mut Browser,
    thumbnails: &mut ThumbnailTextures,
    models: &[String],
) {
    let search_text = browser.search.to_lowercase();
    let matches =
        |entry: &&Entry| entry.kind != FileKind::Script && entry.name.to_lowercase().contains(&search_text);
    // Built-in assets are listed in the folder of the script.
    let built_in = viewer.documents.built_in.iter().filter(|_| browser.folder == browser.root);
    let entries: Vec<Entry> = built_in.chain(&browser.entries).filter(matches).cloned().collect();
    if entries.iter().all(|entry| is_built_in(&entry.path)) {
        ui.weak("no files here; drop files on the image to copy them into assets/");
    }
    ui.horizontal_wrapped(|ui| {
        for entry in entries {
            let size = vec2(TILE_WIDTH, thumbnail_height(TILE_WIDTH) + 18.0);
            let (place, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
            let is_chosen = browser.chosen_file.as_ref() == Some(&entry.path);
            let label = entry.name.clone();
            response.widget_info(|| {
                egui::WidgetInfo::selected(egui::WidgetType::Button, true, is_chosen, label.clone())
            });
            if ui.is_rect_visible(place) {
                show_tile(ui, viewer, thumbnails, &entry, place, is_chosen || response.hovered());
            }
            if entry.kind == FileKind::Folder {
                if response.clicked() {
                    browser.open_folder(entry.path, models);
                }
                continue;
            }
            response.dnd_set_drag_payload(ModelDrag(entry.path.clone()));
            if response.double_clicked() {
                add_model(viewer, &entry.path);
            } else if response.clicked() {
                (browser.chosen_file, browser.chosen_clip) = (Some(entry.path.clone()), None);
            }
            response
                .hint(format!("{}\ndrag it onto the image, or click twice, to put it on stage", entry.name));
        }
    });
}

fn show_tile(
    ui: &Ui,
    viewer: &mut Viewer,
    thumbnails: &mut ThumbnailTextures,
    entry: &Entry,
    place: Rect,
    is_highlighted: bool,
) {
    let image = Rect::from_min_size(place.min, vec2(TILE_WIDTH, thumbnail_height(TILE_WIDTH)));
    let color = if is_highlighted { ui.visuals().strong_text_color() } else { ui.visuals().text_color() };
    match entry.kind {
        FileKind::Folder => {
            ui.painter().rect_filled(image, 3.0, ui.visuals().faint_bg_color);
            let (font, color) = (FontId::proportional(36.0), ui.visuals().weak_text_color());
            ui.painter().text(image.center(), Align2::CENTER_CENTER, icons::FOLDER, font, color);
        }
        _ => drop(thumbnails.show(ui, viewer, &Subject::file(entry.path.clone()), None, image)),
    }
    if is_highlighted {
        let stroke = egui::Stroke::new(1.5, ui.visuals().selection.bg_fill);
        ui.painter().rect_stroke(image, 3.0, stroke, egui::StrokeKind::Outside);
    }
    let name = super::truncated_text(ui.painter(), &entry.name, 11.5, color, TILE_WIDTH);
    ui.painter().galley(egui::pos2(place.left(), image.bottom() + 2.0), name, color);
}

/// Adds a model at the free position nearest to the center of the view.
fn add_model(viewer: &mut Viewer, file: &Path) {
    let at = viewer.point_of_interest().unwrap_or(DVec3::ZERO);
    let at = DVec3::new(at.x, 0.0, at.z);
    viewer.dropped_models = Some(DroppedModels { files: vec![file.to_path_buf()], at, beside: true });
}

/// The chosen file: its clips, and a preview of one of them.
fn show_chosen_file(
    ui: &mut Ui,
    viewer: &mut Viewer,
    browser: &mut Browser,
    thumbnails: &mut ThumbnailTextures,
    file: &Path,
) {
    let made = viewer.documents.thumbnails.get(&Subject::file(file.to_path_buf()), None, || {
        let context = ui.ctx().clone();
        Box::new(move || context.request_repaint())
    });
    let thumbnail = match made {
        ThumbnailState::Ready(thumbnail) => thumbnail,
        ThumbnailState::Waiting => return drop(ui.weak("reading…")),
        ThumbnailState::Failed(why) => {
            return drop(ui.label(RichText::new(why).color(ui.visuals().error_fg_color)));
        }
    };
    let target = target_character(viewer);
    ui.horizontal_top(|ui| {
        let width = (ui.available_width() * 0.5).clamp(100.0, 224.0);
        // Text below the image is not wider than it, so that the clips do not move.
        ui.vertical(|ui| {
            ui.set_width(width);
            show_preview(ui, viewer, browser, thumbnails, file, width);
        });
        // A scroll area inherits the surrounding layout; without a column the clips would be side by side.
        ui.vertical(|ui| {
            ScrollArea::vertical().id_salt("clips").auto_shrink([false, false]).show(ui, |ui| {
                show_clips(
                    ui,
                    viewer,
                    browser,
                    file,
                    &thumbnail.clips,
                    target.as_ref().map(|(name, _)| name.as_str()),
                );
            });
        });
    });
}

fn show_preview(
    ui: &mut Ui,
    viewer: &mut Viewer,
    browser: &Browser,
    thumbnails: &mut ThumbnailTextures,
    file: &Path,
    width: f32,
) {
    let (place, response) = ui.allocate_exact_size(vec2(width, thumbnail_height(width)), Sense::hover());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Image, true, "preview"));
    let number = viewer.scene.as_ref().map_or(0, |scene| scene.number);
    let (subject, asset, title) = match (&browser.chosen_clip, target_character(viewer)) {
        (Some(clip), Some((name, asset))) => {
            let title = format!("{clip} on {name}");
            let (file, clip) = (file.to_path_buf(), Some(clip.clone()));
            (Subject { file, clip, character: Some((name, number)) }, Some(asset), title)
        }
        (clip, _) => {
            let subject = Subject { file: file.to_path_buf(), clip: clip.clone(), character: None };
            (subject, None, clip.clone().unwrap_or_default())
        }
    };
    let made = thumbnails.show(ui, viewer, &subject, asset.as_ref(), place);
    ui.add(egui::Label::new(RichText::new(title).small()).truncate());
    match made {
        ThumbnailState::Failed(why) => {
            drop(ui.label(RichText::new(why).small().color(ui.visuals().error_fg_color)))
        }
        ThumbnailState::Ready(thumbnail) => {
            if let Some(note) = &thumbnail.note {
                ui.label(RichText::new(note).small().weak());
            }
        }
        ThumbnailState::Waiting => {}
    }
}

/// Clips of a file: a click previews one, a double click or `+` adds it after the last clip, a drag moves it to a row.
fn show_clips(
    ui: &mut Ui,
    viewer: &mut Viewer,
    browser: &mut Browser,
    file: &Path,
    all: &[ClipEntry],
    target: Option<&str>,
) {
    if all.is_empty() {
        ui.weak("no clips");
    }
    for clip in all.iter().take(MAX_CLIPS) {
        ui.horizontal(|ui| {
            let hint = match target {
                Some(name) => format!("{name} plays it after its last clip"),
                None => "select a character first".to_string(),
            };
            let label = format!("play {} of the file", clip.name);
            let add = ui
                .add_enabled_ui(target.is_some(), |ui| icons::small_button(ui, icons::PLUS, &label, &hint))
                .inner;
            let is_chosen = browser.chosen_clip.as_ref() == Some(&clip.name);
            let text = format!("{}  {:.2} s", clip.name, clip.secs);
            let button = egui::Button::selectable(is_chosen, text).sense(Sense::click_and_drag()).truncate();
            let response = ui.add(button);
            response.dnd_set_drag_payload(ClipDrag {
                source: ClipSource::File(file.to_path_buf()),
                clip: clip.name.clone(),
            });
            if response.clicked() {
                browser.chosen_clip = Some(clip.name.clone());
            }
            if let Some(name) = target.filter(|_| add.clicked() || response.double_clicked()) {
                let source = ClipSource::File(file.to_path_buf());
                viewer.edit(|v| v.add_clip_to_layer(name, &source, &clip.name, None, 0));
            }
        });
    }
}

/// The selected actor with joints, else the first one: its name and asset.
fn target_character(viewer: &Viewer) -> Option<(String, Arc<Asset>)> {
    let stage = &viewer.scene.as_ref()?.stage;
    let selected = viewer.selection.as_ref().and_then(Selected::actor);
    let selected = selected.and_then(|name| stage.actors.get(actor(stage, name)?));
    let moves = |actor: &&choreo_stage::Actor| actor.asset.skeleton.len() > 1;
    let found = selected.or_else(|| stage.actors.iter().find(moves))?;
    Some((found.name.clone(), found.asset.clone()))
}
