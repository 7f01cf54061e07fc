//! Settings of the stage, which the inspector shows while nothing is selected.

use super::fields::{self, StatedValues};
use super::hint::Hint;
use super::values::{self, NumberField};
use crate::app::Viewer;
use crate::editing::{Ambient, FieldChange, expression};
use crate::state::selection::Selected;
use choreo_session::edit::{Addition, NewValueSyntax, format_number};
use choreo_stage::{Background, Settings, ViewTransform};
use egui::{Grid, RichText, Ui};
use glam::Vec3;

/// View transforms and their names in scripts.
const VIEW_TRANSFORMS: [(ViewTransform, &str); 3] =
    [(ViewTransform::Neutral, "neutral"), (ViewTransform::Agx, "agx"), (ViewTransform::None, "none")];

pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer) {
    let Some(scene) = viewer.scene.clone() else { return };
    if viewer.path.is_none() || !viewer.previewed_files.is_empty() {
        ui.label("select an actor, a bar, a camera or a light");
        return;
    }
    ui.label(RichText::new("stage").heading());
    let (stated, settings) = (viewer.written_stage_values(), &scene.stage.settings);
    let mut edit = None;
    Grid::new("stage").num_columns(2).show(ui, |ui| edit = setting_rows(ui, &stated, settings));
    show_light_fields(ui, viewer);
    ui.weak("select an actor, a bar, a camera or a light for more");
    if let Some(change) = edit {
        viewer.edit(|v| v.change_stage(&change));
    }
}

/// Fields of ambient light and of the sky.
fn show_light_fields(ui: &mut Ui, viewer: &mut Viewer) {
    let Some(now) = viewer.ambient() else { return };
    let mut edit = None;
    Grid::new("light of the stage").num_columns(2).show(ui, |ui| {
        let hint = match viewer.ambient_line() {
            Some(line) => format!("light from above, from below, and how strong it is; line {line}"),
            None => "light from above, from below, and how strong it is".to_string(),
        };
        ui.label("ambient").hint(hint);
        ui.horizontal(|ui| {
            let up = values::color_field(ui, "ambient above", now.up);
            let down = values::color_field(ui, "ambient below", now.down);
            let (name, value) = ("ambient strength", now.strength.value);
            let number =
                NumberField { name, value, speed: 0.01, range: 0.0..=1000.0, default: None, is_time: false };
            let strength = number.show_with_source(ui, Some(&now.strength.text));
            if up.is_some() || down.is_some() || strength.is_some() {
                edit = Some(Ambient {
                    up: up.unwrap_or(now.up),
                    down: down.unwrap_or(now.down),
                    strength: strength.map_or(now.strength, |to| values::typed_number(ui, to)),
                });
            }
        });
        ui.end_row();
        ui.label("sky").hint("an environment image, for light and reflections");
        let sky = viewer.scene.as_ref().is_some_and(|scene| scene.stage.sky.is_some());
        if sky && ui.button("select the sky").clicked() {
            viewer.selection = Some(Selected::Sky);
        } else if !sky && ui.button("add the studio").hint("a room with soft boxes").clicked() {
            viewer.edit(|v| v.add_object(&Addition::StudioSky));
        }
        ui.end_row();
    });
    if let Some(edit) = edit {
        viewer.edit(|v| v.set_ambient(edit));
    }
}

fn setting_rows(ui: &mut Ui, stated: &StatedValues, settings: &Settings) -> Option<FieldChange> {
    let mut edit = None;
    let mut row =
        |ui: &mut Ui, name: &'static str, about: &str, field: &mut dyn FnMut(&mut Ui) -> Option<String>| {
            edit = fields::name_label(ui, stated, name, about).or(edit.take());
            let set = ui.horizontal(field).inner;
            edit = set.map(|value| FieldChange::Value(name, value, NewValueSyntax::Option)).or(edit.take());
            ui.end_row();
        };
    row(ui, "length", "seconds", &mut |ui| {
        let (value, stated) = (settings.length.as_secs(), stated.get("length").map(String::as_str));
        let number = NumberField {
            name: "stage length",
            value,
            speed: 0.05,
            range: 0.001..=1e5,
            default: None,
            is_time: true,
        };
        let set = number.show_with_source(ui, stated)?;
        // A length typed as frames is written in seconds, since the same call states the frame rate, unless the script already counts frames.
        let in_frames = stated.is_some_and(expression::counts_frames);
        Some(values::source_text(ui, set))
            .filter(|text| in_frames || !expression::counts_frames(text))
            .or(Some(format_number(set)))
    });
    row(ui, "fps", "frames a second", &mut |ui| {
        values::number_source_field(
            ui,
            "stage fps",
            settings.fps.as_fps(),
            0.2,
            0.001..=1000.0,
            stated.get("fps"),
        )
    });
    row(ui, "size", "width and height in pixels", &mut |ui| {
        let mut size = settings.size;
        let mut changed = false;
        for (axis, name) in ["stage width", "stage height"].into_iter().enumerate() {
            if let Some(to) = values::number_field(ui, name, f64::from(size[axis]), 1.0, 1.0..=16384.0) {
                (size[axis], changed) = (to.round() as u32, true);
            }
        }
        changed.then(|| format!("[{}, {}]", size[0], size[1]))
    });
    row(ui, "background", "above and below", &mut |ui| background_fields(ui, &settings.background));
    row(ui, "exposure", "stops: 1 doubles the light", &mut |ui| {
        let now = f64::from(settings.exposure);
        values::number_source_field(ui, "stage exposure", now, 0.02, -20.0..=20.0, stated.get("exposure"))
    });
    row(ui, "view", "tone mapping: from light to the colors of a display", &mut |ui| {
        let mut set = None;
        let name = VIEW_TRANSFORMS
            .iter()
            .find(|(view, _)| *view == settings.view_transform)
            .map_or("", |(_, name)| name);
        let combo = egui::ComboBox::from_id_salt("view").selected_text(name).show_ui(ui, |ui| {
            for (view, name) in VIEW_TRANSFORMS {
                if ui.selectable_label(view == settings.view_transform, name).clicked() {
                    set = Some(format!("\"{name}\""));
                }
            }
        });
        values::set_widget_name(combo.response, egui::WidgetType::ComboBox, "stage view");
        set
    });
    edit
}

/// Fields for the background colors above and below; equal colors are written as one.
fn background_fields(ui: &mut Ui, background: &Background) -> Option<String> {
    let srgb =
        |linear: Vec3| linear.to_array().map(|v| egui::ecolor::gamma_u8_from_linear_f32(v.clamp(0.0, 1.0)));
    let [top, bottom] = match background {
        Background::Color(color) => [srgb(color.truncate()); 2],
        Background::Gradient { top, bottom } => [srgb(*top), srgb(*bottom)],
    };
    let set = [
        values::color_field(ui, "background above", top),
        values::color_field(ui, "background below", bottom),
    ];
    if set.iter().all(Option::is_none) {
        return None;
    }
    let hex = |[r, g, b]: [u8; 3]| format!("\"#{r:02x}{g:02x}{b:02x}\"");
    let [top, bottom] = [set[0].unwrap_or(top), set[1].unwrap_or(bottom)].map(hex);
    Some(if top == bottom { top } else { format!("#{{ top: {top}, bottom: {bottom} }}") })
}
