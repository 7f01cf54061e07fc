//! Tree of the stage: actors and other objects, with toggles to hide, solo or lock them in this window, independent of the script.

use super::bar_menu;
use super::headers;
use super::hint::Hint;
use super::icons;
use crate::app::Viewer;
use crate::state::events;
use crate::state::selection::Selected;
use choreo_stage::Stage;
use egui::{RichText, Ui};
use std::collections::BTreeSet;

/// Largest number of joints that a search shows.
const MAX_JOINTS: usize = 40;

pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer) {
    let Some(scene) = viewer.scene.clone() else {
        ui.label("empty");
        return;
    };
    let id = ui.id().with("search");
    let mut search: String = ui.data_mut(|d| d.get_temp(id)).unwrap_or_default();
    ui.horizontal(|ui| {
        super::add_menu::show_menu(ui, viewer);
        let field = egui::TextEdit::singleline(&mut search).hint_text("search").desired_width(f32::INFINITY);
        let field =
            super::values::set_widget_name(ui.add(field), egui::WidgetType::TextEdit, "search the stage");
        if field.changed() {
            ui.data_mut(|d| d.insert_temp(id, search.clone()));
        }
    });
    let search_text = search.to_lowercase();
    let matches = |name: &str| search_text.is_empty() || name.to_lowercase().contains(&search_text);
    let stage = &scene.stage;
    if ["stage", "ambient", "background", "exposure"].into_iter().any(matches) {
        let response = show_entry(ui, viewer.selection.is_none(), RichText::new("Stage"));
        let hint = "length, size, background, ambient light, sky, exposure: in the inspector";
        if response.hint(hint).clicked() {
            viewer.selection = None;
        }
    }
    show_actors(ui, viewer, stage, &search_text);
    show_section_title(ui, "cameras", stage.cameras.len());
    let on = viewer.shown().and_then(|s| s.snapshot.camera.camera);
    for (index, camera) in stage.cameras.iter().enumerate().filter(|(_, c)| matches(&c.name)) {
        let text = RichText::new(&camera.name);
        let text = if on == Some(index) { text.strong() } else { text };
        show_selectable(ui, viewer, text, Selected::Camera(camera.name.clone()));
    }
    show_section_title(ui, "lights", stage.lights.len());
    for index in 0..stage.lights.len() {
        let name = viewer.light_name(index);
        if matches(&name) {
            show_selectable(ui, viewer, RichText::new(name), Selected::Light(index));
        }
    }
    if stage.sky.is_some() && matches("sky") {
        show_selectable(ui, viewer, RichText::new("sky"), Selected::Sky);
    }
    show_section_title(ui, "effects", stage.effects.len());
    for (index, effect) in stage.effects.iter().enumerate().filter(|(_, e)| matches(&e.plugin)) {
        show_selectable(ui, viewer, RichText::new(&effect.plugin), Selected::Effect(index));
    }
    show_section_title(ui, "titles", stage.layers_2d.len());
    for (index, layer) in stage.layers_2d.iter().enumerate() {
        let name = events::title_label(layer);
        if matches(&name) {
            show_selectable(ui, viewer, RichText::new(name), Selected::Title(index));
        }
    }
}

/// Rows of the actors whose name, or the name of one of whose joints, contains the search text (in lower case).
fn show_actors(ui: &mut Ui, viewer: &mut Viewer, stage: &Stage, search_text: &str) {
    show_section_title(ui, "actors", stage.actors.len());
    for (index, actor) in stage.actors.iter().enumerate() {
        // A search also finds joints.
        let names = actor.asset.skeleton.names();
        let found = |n: &&String| !search_text.is_empty() && n.to_lowercase().contains(search_text);
        let joints: Vec<&String> = names.iter().filter(found).take(MAX_JOINTS).collect();
        if !actor.name.to_lowercase().contains(search_text) && joints.is_empty() {
            continue;
        }
        if is_skipped(ui, joints.len()) {
            continue;
        }
        let visible = viewer.shown().and_then(|s| s.snapshot.actors.get(index)).is_none_or(|a| a.visible);
        let mut text = RichText::new(&actor.name);
        if !visible {
            text = text.weak();
        }
        ui.horizontal(|ui| {
            let toggles = &mut viewer.toggles;
            let eye = [icons::EYE, icons::EYE_SLASH];
            show_toggle(ui, &mut toggles.hidden, &actor.name, eye, ["hide", "hide in the viewport (H)"]);
            let star = [icons::STAR; 2];
            show_toggle(
                ui,
                &mut toggles.solo,
                &actor.name,
                star,
                ["solo", "only solo actors are shown here"],
            );
            let lock = [icons::LOCK_SIMPLE_OPEN, icons::LOCK_SIMPLE];
            let about = ["lock", "cannot be picked or moved with the mouse"];
            show_toggle(ui, &mut toggles.locked, &actor.name, lock, about);
            show_selectable(ui, viewer, text, Selected::Actor(actor.name.clone()));
        });
        for joint in joints {
            ui.label(RichText::new(format!("    {joint}")).weak());
        }
    }
}

/// Whether a row with its joints lies outside the visible part of the list; then only its space is allocated.
fn is_skipped(ui: &mut Ui, joints: usize) -> bool {
    let (text, between) = (ui.text_style_height(&egui::TextStyle::Body), ui.spacing().item_spacing.y);
    let height = ui.spacing().interact_size.y + joints as f32 * (text + between);
    let size = egui::vec2(ui.available_width(), height);
    let is_skipped = !ui.is_rect_visible(egui::Rect::from_min_size(ui.cursor().min, size));
    if is_skipped {
        ui.allocate_space(size);
    }
    is_skipped
}

/// Draws a small toggle button before a name. `icons`: icons for off and on.
fn show_toggle(
    ui: &mut Ui,
    set: &mut BTreeSet<String>,
    name: &str,
    [off, on_icon]: [&str; 2],
    [word, about]: [&str; 2],
) {
    let on = set.contains(name);
    let icon = if on { on_icon } else { off };
    let hint = format!("{word}: {about}");
    if icons::small_toggle_button(ui, icon, on, &format!("{word} {name}"), &hint).clicked() {
        match on {
            true => drop(set.remove(name)),
            false => drop(set.insert(name.to_string())),
        }
    }
}

fn show_section_title(ui: &mut Ui, name: &str, count: usize) {
    if count > 0 {
        ui.add_space(6.0);
        ui.label(RichText::new(format!("{name} ({count})")).size(11.0).weak());
    }
}

fn show_selectable(ui: &mut Ui, viewer: &mut Viewer, text: RichText, what: Selected) {
    let response = show_entry(ui, viewer.selection.as_ref() == Some(&what), text);
    let command = headers::show_menu(&response, viewer, &what);
    if response.clicked() || command.is_some() {
        viewer.select_all(vec![what]);
    }
    if let Some(command) = command {
        bar_menu::run(ui, viewer, command);
    }
}

fn show_entry(ui: &mut Ui, selected: bool, text: RichText) -> egui::Response {
    let name = text.text().to_string();
    // A truncated name is shown completely in a tooltip.
    let response = ui.add(egui::Button::selectable(selected, text).truncate());
    let is_cut = response.intrinsic_size().is_some_and(|whole| whole.x > response.rect.width() + 0.5);
    if is_cut { response.hint(name) } else { response }
}
