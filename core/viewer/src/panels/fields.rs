//! Inspector fields for everything that the script can state about the selection, built from the stage's descriptions of its types. The context
//! menu of a name resets the value.

use super::hint::Hint;
use super::values::{self, NumberField};
use crate::app::Viewer;
use crate::editing::{FieldChange, expression};
use crate::state::selection::{Selected, actor};
use choreo_asset::{AlphaMode, Asset, Material};
use choreo_motion::Repeat;
use choreo_script::quoted;
use choreo_session::edit::{CueTime, NewValueSyntax};
use choreo_stage::{
    Camera, Cue, Described, Field, FieldType, FieldValue, Layer2d, Layer2dContent, Property, Shadow, Stage,
    StageLight,
};
use egui::{Grid, Response, RichText, Ui};
use glam::DVec3;
use std::collections::BTreeMap;

/// Largest time, and smallest length of a trimmed part, seconds.
const MAX_SECS: f64 = 1e6;
const MIN_TRIM_SECS: f64 = 0.01;
/// Parameters of a shape's metallic-roughness material: name, minimum, maximum and default.
const SURFACE_PARAMETERS: [(&str, f64, f64, f64); 2] =
    [("roughness", 0.0, 1.0, 0.9), ("metallic", 0.0, 1.0, 0.0)];

/// Source text of everything that the script states about an object, by name.
pub(super) type StatedValues = BTreeMap<String, String>;

/// The object whose fields are shown.
pub(super) struct Form<'f> {
    pub stated: &'f StatedValues,
    /// Prefix of the names of its fields, to distinguish them from fields with the same name.
    pub name_prefix: &'f str,
    pub is_cue: bool,
    /// End of the object if the script states none, seconds.
    pub end: Option<f64>,
}

impl Form<'_> {
    fn of<'f>(stated: &'f StatedValues, what: &Selected) -> Form<'f> {
        Form { stated, name_prefix: "", is_cue: matches!(what, Selected::Cue { .. }), end: None }
    }

    /// The same form with the end of the object's bar.
    fn with_end(self, viewer: &Viewer, what: &Selected) -> Self {
        let bar = viewer.bars().find(|bar| bar.what == *what);
        Form { end: bar.map(|bar| bar.draggable_end.as_secs()), ..self }
    }
}

/// Shows the fields of the selection, and returns the user's edit.
pub(super) fn show(
    ui: &mut Ui,
    viewer: &Viewer,
    stage: &Stage,
    what: &Selected,
    stated: &StatedValues,
) -> Option<FieldChange> {
    match what {
        Selected::Cue { actor: name, layer, cue } => {
            let found = &stage.actors[actor(stage, name)?];
            let played = found.layers.get(*layer)?.cues.get(*cue)?;
            clip_fields(ui, viewer, (stage, stated), what, played, *layer)
        }
        Selected::Camera(name) => {
            let camera = stage.cameras.iter().find(|camera| camera.name == *name)?;
            projection_fields(ui, viewer, stated, what, camera)
        }
        Selected::Title(index) => title_fields(ui, viewer, (what, stated), stage.layers_2d.get(*index)?),
        Selected::Actor(name) => appearance_fields(ui, viewer, stage, what, name, stated),
        Selected::Light(index) => shadow_fields(ui, viewer, stage.lights.get(*index)?, what, stated),
        Selected::Effect(_) | Selected::Sky => None,
    }
}

/// Context menu of a field's name with the entry "Reset to default". It also opens on the numbers next to the name.
pub(super) fn reset_menu(name: &Response, names: &[&'static str]) -> Option<FieldChange> {
    let mut edit = None;
    values::name_menu(name).show(|ui| {
        if ui.button("Reset to default").clicked() {
            edit = Some(FieldChange::Reset(names.to_vec()));
            ui.close();
        }
    });
    edit
}

/// Name of a field with its context menu; strong if the script states the value.
pub(super) fn name_label(
    ui: &mut Ui,
    stated: &StatedValues,
    name: &'static str,
    about: &str,
) -> Option<FieldChange> {
    let is_stated = stated.contains_key(name);
    let response = ui.add(egui::Label::new(name_text(name, is_stated)).sense(egui::Sense::click()));
    let hint = if is_stated { "stated by the script; right click: reset to default" } else { "by default" };
    let hint = if about.is_empty() { hint.to_string() } else { format!("{about}\n{hint}") };
    reset_menu(&response.hint(hint), &[name])
}

/// Name of a field: strong if the script states its value, else weak.
pub(super) fn name_text(name: &str, is_stated: bool) -> RichText {
    let text = RichText::new(name.replace('_', " "));
    if is_stated { text.strong() } else { text.weak() }
}

/// Syntax of a value that the script does not state yet.
fn new_value_syntax(form: &Form, name: &str) -> NewValueSyntax {
    match name {
        // No method has this name.
        "inertial" => NewValueSyntax::Option,
        _ if form.is_cue => NewValueSyntax::LikeOthers,
        "scale" | "near" | "far" | "from" | "until" => NewValueSyntax::Method,
        _ => NewValueSyntax::Option,
    }
}

/// A field of a described type, as a row of a grid with two columns.
pub(super) fn described_field<T: Described>(
    ui: &mut Ui,
    form: &Form,
    of: &T,
    field: &'static Field<T>,
) -> Option<FieldChange> {
    let name = field.name;
    let shown = format!("{}{name}", form.name_prefix);
    let mut edit = name_label(ui, form.stated, name, &field.about());
    let set = match ((field.get)(of), field.field_type) {
        (FieldValue::Number(n), FieldType::Number(low, high, unit)) => {
            let set = number_source_field(ui, &shown, n, low..=high, (unit, form.stated.get(name)));
            set.map(|to| FieldChange::Value(name, to, new_value_syntax(form, name)))
        }
        (FieldValue::Number(n), FieldType::Degrees(low, high)) => {
            let set =
                number_source_field(ui, &shown, n.to_degrees(), low..=high, ("°", form.stated.get(name)));
            set.map(|to| FieldChange::Value(name, to, new_value_syntax(form, name)))
        }
        (value, FieldType::Time | FieldType::Duration) => {
            let set = match value {
                FieldValue::Time(time) => number_field(ui, &shown, time.as_secs(), 0.0..=MAX_SECS, "s"),
                _ => {
                    let derived = form.end.filter(|_| name == "until");
                    let row = |ui: &mut Ui| {
                        let set = values::derived_number_field(
                            ui,
                            &format!("{shown} field"),
                            derived,
                            0.0..=MAX_SECS,
                            true,
                        );
                        ui.weak("s");
                        set
                    };
                    ui.horizontal(row).inner
                }
            };
            set.map(|to| values::typed_number(ui, to)).map(|to| match (name, form.is_cue) {
                ("from", _) => FieldChange::Time(CueTime::Start, to),
                ("until", _) => FieldChange::Time(CueTime::End, to),
                ("fade", true) => FieldChange::Time(CueTime::FadeIn, to),
                ("fade", false) => FieldChange::Value(name, to.text, NewValueSyntax::Method),
                _ => FieldChange::Value(name, to.text, new_value_syntax(form, name)),
            })
        }
        (value, FieldType::Flag) => flag_checkbox(ui, name, &shown, value == FieldValue::Flag(true)),
        (FieldValue::Pair(pair), FieldType::Pair) => {
            let mut set = None;
            ui.horizontal(|ui| {
                for (axis, letter) in ["x", "y"].into_iter().enumerate() {
                    let label = format!("{name} {letter}");
                    if let Some(to) = values::number_field(ui, &label, pair[axis], 0.01, -1e5..=1e5) {
                        let stated = form.stated.get(name).map(String::as_str);
                        let text = values::number_list_text(ui, stated, &pair.to_array(), axis, to);
                        // `.at(x, y)` and `at: [x, y]` have different syntax.
                        let is_method = stated.is_some_and(|stated| !stated.starts_with('['));
                        let text = if is_method { text } else { format!("[{text}]") };
                        set = Some(FieldChange::Value(name, text, NewValueSyntax::Option));
                    }
                }
            });
            set
        }
        _ => {
            ui.monospace(field.shown_with_unit(of).unwrap_or_else(|| "—".to_string()));
            None
        }
    };
    ui.end_row();
    edit = set.or(edit);
    edit
}

fn flag_checkbox(ui: &mut Ui, name: &'static str, shown: &str, on: bool) -> Option<FieldChange> {
    let mut now = on;
    let response = ui.checkbox(&mut now, "");
    response.widget_info(|| {
        egui::WidgetInfo::selected(egui::WidgetType::Checkbox, true, now, format!("{shown} field"))
    });
    response.changed().then(|| match now {
        // The default of `keep` is not always `false`.
        now if name == "keep" => FieldChange::Overwrite(name, now.to_string(), NewValueSyntax::Option),
        // A method without an argument switches the flag on.
        true => FieldChange::Overwrite(name, String::new(), NewValueSyntax::Method),
        false => FieldChange::Reset(vec![name]),
    })
}

/// A number field that returns source text, which is an expression if one was typed. `unit`, `stated`: unit, and present source text.
fn number_source_field(
    ui: &mut Ui,
    name: &str,
    value: f64,
    range: std::ops::RangeInclusive<f64>,
    (unit, stated): (&str, Option<&String>),
) -> Option<String> {
    let name = format!("{name} field");
    let row = |ui: &mut Ui| {
        let is_time = unit == "s";
        let number = NumberField { name: &name, value, speed: 0.01, range, default: None, is_time };
        let set = number.show_source(ui, stated.map(String::as_str));
        ui.weak(unit);
        set
    };
    ui.horizontal(row).inner
}

fn number_field(
    ui: &mut Ui,
    name: &str,
    value: f64,
    range: std::ops::RangeInclusive<f64>,
    unit: &str,
) -> Option<f64> {
    let mut set = None;
    // The label next to it has the plain name.
    let name = format!("{name} field");
    ui.horizontal(|ui| {
        let is_time = unit == "s";
        set = NumberField { name: &name, value, speed: 0.01, range, default: None, is_time }.show(ui);
        ui.weak(unit);
    });
    set
}

/// Combo box of names with the present one selected.
pub(super) fn combo_box<'n>(
    ui: &mut Ui,
    id: &str,
    now: &str,
    names: impl Iterator<Item = &'n str>,
) -> Option<String> {
    let mut chosen = None;
    let combo = egui::ComboBox::from_id_salt(id).selected_text(now).show_ui(ui, |ui| {
        for name in names {
            if ui.selectable_label(name == now, name).clicked() && name != now {
                chosen = Some(name.to_string());
            }
        }
    });
    let label = format!("{id}: {now}");
    combo.response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::ComboBox, true, label.clone()));
    chosen
}

/// Text field for source text, taken when the field is left.
pub(super) fn source_field(ui: &mut Ui, name: &'static str, now: &str, hint: &str) -> Option<String> {
    let id = ui.id().with(("source", name));
    let mut text: String = ui.data(|d| d.get_temp(id)).unwrap_or_else(|| now.to_string());
    let field = egui::TextEdit::singleline(&mut text).hint_text(hint).desired_width(150.0);
    let response = ui.add(field.font(egui::TextStyle::Monospace));
    let shown = format!("{name} field");
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::TextEdit, true, shown.clone()));
    super::inspected::record_focus(ui, &response);
    if response.has_focus() {
        ui.data_mut(|d| d.insert_temp(id, text));
        return None;
    }
    ui.data_mut(|d| d.remove::<String>(id));
    (response.lost_focus() && text.trim() != now).then(|| text.trim().to_string())
}

fn clip_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    (stage, stated): (&Stage, &StatedValues),
    what: &Selected,
    played: &Cue,
    layer: usize,
) -> Option<FieldChange> {
    let mut edit = None;
    Grid::new("clip").num_columns(2).show(ui, |ui| {
        ui.label("clip");
        let own = what.actor().and_then(|name| Some(&stage.actors[actor(stage, name)?].asset));
        let names = own.iter().flat_map(|asset| asset.clips.iter().map(|clip| clip.name.as_str()));
        edit = combo_box(ui, "clip", &played.clip.name, names).map(FieldChange::Clip);
        ui.end_row();
        let form = Form::of(stated, what).with_end(viewer, what);
        // Clips on upper layers fade in and have no inertial transition.
        let suits = |field: &&Field<Cue>| layer == 0 || field.name != "inertial";
        for field in Cue::FIELDS.iter().filter(|field| (field.missing_reason)(played).is_none()).filter(suits)
        {
            edit = match keyed_value_text(viewer, what, played, field.name) {
                Some(keys) => keyed_row(ui, stated, field.name, &keys),
                None => described_field(ui, &form, played, field),
            }
            .or(edit.take());
        }
        edit = trim_fields(ui, stated, played).or(edit.take());
        let is_stated = ["repeat", "once", "loop", "ping_pong"].iter().any(|name| stated.contains_key(*name));
        ui.label(name_text("repeat", is_stated));
        let current = match played.repeat {
            Repeat::Once => "once",
            Repeat::Loop => "loop",
            Repeat::PingPong => "ping_pong",
        };
        let names = ["once", "loop", "ping_pong"];
        let chosen = combo_box(ui, "repeat", current, names.into_iter());
        let chosen = names.into_iter().find(|name| chosen.as_deref() == Some(*name));
        edit = chosen.map(FieldChange::Repeat).or(edit.take());
        ui.end_row();
        edit = ease_field(ui, stated).or(edit.take());
        edit = match layer {
            _ if own.is_none() => edit.take(),
            0 => {
                ui.label(name_text("on", false))
                    .hint("joints on which it plays; it becomes a layer, with the clips that follow it");
                own.and_then(|asset| mask_field(ui, "", asset)).or(edit.take())
            }
            _ => own.and_then(|asset| layer_fields(ui, stated, asset)).or(edit.take()),
        };
    });
    edit
}

/// Description of the keys of a cue's value, if it has keys.
fn keyed_value_text(viewer: &Viewer, what: &Selected, played: &Cue, name: &str) -> Option<String> {
    // Keys of the clip's time replace its speed.
    let is_replaced_by = |keyed: &str| keyed == name || (name, keyed) == ("speed", "clip_time");
    let mut keyed = Cue::keyed_options().filter(|(_, property)| played.keys(*property).is_some());
    let method = keyed.find(|(keyed, _)| is_replaced_by(keyed)).map(|(keyed, _)| format!(".{keyed}"))?;
    let keys = viewer.keyed_properties(what).into_iter().find(|keyed| keyed.name == method)?.keys;
    let (first, last) = keys.first().zip(keys.last())?;
    Some(format!("{} keys, {:.2} to {:.2} s", keys.len(), first.as_secs(), last.as_secs()))
}

/// Row of a keyed value, without a field, since a number would replace the keys.
fn keyed_row(ui: &mut Ui, stated: &StatedValues, name: &'static str, keys: &str) -> Option<FieldChange> {
    let edit = name_label(ui, stated, name, "keyed in the script");
    ui.monospace(keys);
    ui.end_row();
    edit
}

fn trim_fields(ui: &mut Ui, stated: &StatedValues, played: &Cue) -> Option<FieldChange> {
    let mut edit = name_label(ui, stated, "trim", "the part of the clip that is played");
    let now = [played.trim.0.as_secs(), played.trim.1.as_secs()];
    let whole = played.clip.duration.as_secs();
    ui.horizontal(|ui| {
        for (end, name) in ["trim start", "trim end"].into_iter().enumerate() {
            // Some of the clip must remain.
            let range = if end == 0 {
                0.0..=(now[1] - MIN_TRIM_SECS).max(0.0)
            } else {
                (now[0] + MIN_TRIM_SECS).min(whole)..=whole
            };
            if let Some(to) = values::time_field(ui, name, now[end], 0.01, range) {
                let mut all = now;
                all[end] = to;
                edit = Some(FieldChange::Trim(all, values::typed_number(ui, to)));
            }
        }
        ui.weak(format!("of {whole:.2} s"));
    });
    ui.end_row();
    edit
}

fn ease_field(ui: &mut Ui, stated: &StatedValues) -> Option<FieldChange> {
    let mut edit = name_label(ui, stated, "ease", "easing of the fades");
    let written = stated.get("ease").cloned().unwrap_or_else(|| "\"linear\"".to_string());
    let names = choreo_script::easing_names();
    let chosen = combo_box(ui, "ease", written.trim_matches('"'), names.iter().map(String::as_str));
    edit = chosen
        .map(|name| FieldChange::Overwrite("ease", format!("\"{name}\""), NewValueSyntax::LikeOthers))
        .or(edit);
    ui.end_row();
    edit
}

/// Field for the mask of a layer: a text to type, or a branch of the skeleton to choose. A single string is displayed without quotes. `now`: source
/// text; empty: the clip has no mask, and setting one moves it and the clips that follow it to a layer of their own.
fn mask_field(ui: &mut Ui, now: &str, asset: &Asset) -> Option<FieldChange> {
    let string_content = now
        .strip_prefix('"')
        .and_then(|rest| rest.strip_suffix('"'))
        .filter(|string_content| !string_content.contains('"'));
    let is_text = now.is_empty() || string_content.is_some();
    let skeleton = &asset.skeleton;
    let branches = (0..skeleton.names().len()).map(|joint| format!("{}..", skeleton.short_name(joint)));
    let branches: Vec<String> = branches.collect();
    let set = ui.horizontal(|ui| {
        let typed = source_field(ui, "on", string_content.unwrap_or(now), "RightShoulder..");
        combo_box(ui, "joints", "", branches.iter().map(String::as_str)).or(typed)
    });
    ui.end_row();
    let set = set.inner.filter(|text| !text.is_empty())?;
    let is_written = set.starts_with(['"', '[', '#', '`']) || !(is_text || branches.contains(&set));
    let text = if is_written { set } else { quoted(&set) };
    Some(FieldChange::Overwrite("on", text, NewValueSyntax::Method))
}

/// Fields for mask, priority and weight of a layer, on the clip that states them.
fn layer_fields(ui: &mut Ui, stated: &StatedValues, asset: &Asset) -> Option<FieldChange> {
    let mut edit = None;
    if let Some(now) = stated.get("on") {
        edit = name_label(ui, stated, "on", "joints of the layer: Spine.., or [\"Head\", \"*Arm*\"]");
        edit = mask_field(ui, now, asset).or(edit);
    }
    for (name, hint) in [("priority", "0 to 1000"), ("layer_weight", "0 to 1")] {
        // Only the first clip of a layer states these.
        let Some(now) = stated.get(name) else { continue };
        if now.starts_with("[[") {
            edit = keyed_row(ui, stated, name, "by keys").or(edit);
            continue;
        }
        edit = name_label(ui, stated, name, hint).or(edit);
        let set = source_field(ui, name, now, hint);
        edit = set.map(|text| FieldChange::Overwrite(name, text, NewValueSyntax::Method)).or(edit);
        ui.end_row();
    }
    edit
}

fn projection_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    stated: &StatedValues,
    what: &Selected,
    camera: &Camera,
) -> Option<FieldChange> {
    let mut edit = None;
    let keyed_value = |property| {
        let keys = camera.channels.iter().find(|channel| channel.property == property)?;
        Some(keys.at(viewer.playhead.time())?[0])
    };
    Grid::new("lens").num_columns(2).show(ui, |ui| {
        if let Some(FieldValue::Number(fov)) = Camera::field("fov").map(|field| (field.get)(camera)) {
            let by_angle = || Camera::focal_length(keyed_value(Property::FieldOfView).unwrap_or(fov));
            let now = keyed_value(Property::FocalLength).unwrap_or_else(by_angle);
            let is_stated = ["fov", "focal_length"].iter().any(|name| stated.contains_key(*name));
            let name = name_text("focal length", is_stated);
            let label = ui.add(egui::Label::new(name).sense(egui::Sense::click()));
            let label = label.hint("on full-frame film, 24 mm high; right click: reset to default");
            edit = reset_menu(&label, &["fov", "focal_length"]);
            let set = number_field(ui, "focal length", now, 0.2..=13_000.0, "mm");
            edit = set.map(|to| FieldChange::FocalLength(to, values::source_text(ui, to))).or(edit.take());
            ui.end_row();
        }
        for name in ["near", "far"] {
            let Some(field) = Camera::field(name) else { continue };
            let mut row = described_field(ui, &Form::of(stated, what), camera, field);
            if let (Some(FieldChange::Value(_, value, _)), FieldValue::Number(_)) =
                (&row, (field.get)(camera))
            {
                row = Some(FieldChange::Value(field.name, value.clone(), NewValueSyntax::Method));
            }
            edit = row.or(edit.take());
        }
    });
    edit
}

/// Parses a list of numbers in brackets.
fn parse_numbers(text: &str) -> Option<Vec<f64>> {
    let inside = text.trim().strip_prefix('[')?.strip_suffix(']')?;
    inside.split(',').map(parse_number).collect()
}

/// Parses a number or a calculation of a script, such as `1.0 / 3.0`.
fn parse_number(text: &str) -> Option<f64> {
    let number = text.trim().parse().ok();
    number.or_else(|| expression::evaluate(&expression::to_script_syntax(text)?, 1.0))
}

/// Parses a point: three numbers in brackets.
pub(super) fn parse_point(text: &str) -> Option<DVec3> {
    <[f64; 3]>::try_from(parse_numbers(text)?).ok().map(DVec3::from_array)
}

/// Fields of a light's shadow.
fn shadow_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    light: &StageLight,
    what: &Selected,
    stated: &StatedValues,
) -> Option<FieldChange> {
    let mut edit = None;
    Grid::new("shadow").num_columns(2).show(ui, |ui| {
        let reset = name_label(ui, stated, "shadow", "lit objects cast shadows");
        let set = flag_checkbox(ui, "shadow", "shadow", light.shadow.is_some());
        edit = set.map(|change| match change {
            FieldChange::Overwrite(name, ..) => {
                FieldChange::Overwrite(name, "true".into(), NewValueSyntax::Option)
            }
            other => other,
        });
        edit = edit.take().or(reset);
        ui.end_row();
        let Some(shadow) = light.shadow else { return };
        let shadow = Shadow { softness: shadow.softness.or(Some(Shadow::LAMP_SOFTNESS)), ..shadow };
        let inner = viewer.values_in_option(what, "shadow");
        let form = Form { stated: &inner, name_prefix: "shadow ", is_cue: false, end: None };
        for field in Shadow::FIELDS {
            let set = match described_field(ui, &form, &shadow, field) {
                Some(FieldChange::Value(name, value, _)) if name == "size" => {
                    // The number of texels is whole.
                    Some(FieldChange::ValueInOption(
                        "shadow",
                        name,
                        value.split('.').next().map(str::to_string),
                    ))
                }
                Some(FieldChange::Value(name, value, _)) => {
                    Some(FieldChange::ValueInOption("shadow", name, Some(value)))
                }
                Some(FieldChange::Reset(_)) => Some(FieldChange::ValueInOption("shadow", field.name, None)),
                other => other,
            };
            edit = set.or(edit.take());
        }
    });
    edit
}

fn title_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    (what, stated): (&Selected, &StatedValues),
    layer: &Layer2d,
) -> Option<FieldChange> {
    let mut edit = None;
    if let Layer2dContent::Text { words, .. } = &layer.content {
        let id = ui.id().with("words");
        let mut now: String = ui.data(|d| d.get_temp(id)).unwrap_or_else(|| words.clone());
        let field = egui::TextEdit::multiline(&mut now).desired_rows(2).desired_width(f32::INFINITY);
        let response = ui.add(field);
        response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::TextEdit, true, "words"));
        super::inspected::record_focus(ui, &response);
        if response.has_focus() {
            ui.data_mut(|d| d.insert_temp(id, now));
        } else {
            ui.data_mut(|d| d.remove::<String>(id));
            edit = (response.lost_focus() && now != *words).then_some(FieldChange::TitleText(now));
        }
    }
    Grid::new("title").num_columns(2).show(ui, |ui| {
        let form = Form::of(stated, what).with_end(viewer, what);
        for field in Layer2d::FIELDS.iter().filter(|field| (field.missing_reason)(layer).is_none()) {
            edit = described_field(ui, &form, layer, field).or(edit.take());
        }
        if let Layer2dContent::Text { size, width, line_height, color, align, .. } = &layer.content {
            let numbers = [("size", *size, 0.001, 10.0), ("line_height", *line_height, 0.1, 10.0)];
            let width = width.map(|width| ("width", width, 0.01, 10.0));
            for (name, value, low, high) in numbers.into_iter().chain(width) {
                edit = name_label(ui, stated, name, "").or(edit.take());
                let set = number_field(ui, name, value, low..=high, "");
                let change =
                    |to| FieldChange::Value(name, values::source_text(ui, to), NewValueSyntax::Option);
                edit = set.map(change).or(edit.take());
                ui.end_row();
            }
            edit = name_label(ui, stated, "align", "").or(edit.take());
            let now = format!("{align:?}").to_lowercase();
            let set = combo_box(ui, "align", &now, ["left", "center", "right"].into_iter());
            let change = |name| FieldChange::Value("align", format!("\"{name}\""), NewValueSyntax::Option);
            edit = set.map(change).or(edit.take());
            ui.end_row();
            edit = color_row(ui, stated, "color", color.truncate()).or(edit.take());
        }
    });
    edit
}

fn color_row(
    ui: &mut Ui,
    stated: &StatedValues,
    name: &'static str,
    linear: glam::Vec3,
) -> Option<FieldChange> {
    let mut edit = name_label(ui, stated, name, "");
    let shown = linear.to_array().map(|v| egui::ecolor::gamma_u8_from_linear_f32(v.clamp(0.0, 1.0)));
    if let Some([r, g, b]) = values::color_field(ui, name, shown) {
        let syntax = if name == "tint" { NewValueSyntax::Method } else { NewValueSyntax::Option };
        edit = Some(FieldChange::Value(name, format!("\"#{r:02x}{g:02x}{b:02x}\""), syntax));
    }
    ui.end_row();
    edit
}

/// Fields for the tint of an actor, and for the options of its shape or built-in character.
fn appearance_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    stage: &Stage,
    what: &Selected,
    name: &str,
    stated: &StatedValues,
) -> Option<FieldChange> {
    let found = &stage.actors[actor(stage, name)?];
    let mut edit = None;
    Grid::new("surface").num_columns(2).show(ui, |ui| {
        edit = color_row(ui, stated, "tint", found.tint.truncate());
        let Some((asset_function, arguments, written)) = viewer.written_asset(what) else { return };
        let is_shape = asset_function == "shape";
        let colors: &[&'static str] = match &*asset_function {
            "shape" => &["color"],
            "load" if arguments.starts_with("\"choreo:") => &["color", "accent"],
            _ => return,
        };
        let materials = &found.asset.materials;
        for (index, name) in colors.iter().enumerate() {
            let now = materials.get(index).map_or(glam::Vec3::ONE, |material| material.base_color.truncate());
            edit = asset_color_row(ui, &written, name, now).or(edit.take());
        }
        if is_shape {
            edit = size_fields(ui, &written, &arguments, &found.asset).or(edit.take());
            let current = materials.first().cloned().unwrap_or_default();
            edit = material_fields(ui, viewer, &written, &current).or(edit.take());
        }
    });
    edit
}

/// Name of an asset's option with the context menu that resets it; strong if the script states it.
fn option_label(ui: &mut Ui, written: &StatedValues, name: &'static str) -> Option<FieldChange> {
    let text = name_text(name, written.contains_key(name));
    let response = ui.add(egui::Label::new(text).sense(egui::Sense::click()));
    reset_menu(
        &response.hint("belongs to the asset; if other actors share it, you choose which of them change"),
        &[name],
    )
    .map(|_| FieldChange::AssetOption(name, None))
}

/// Fields for the size of a shape along its axes, metres. `kind`: source text with quotes.
fn size_fields(ui: &mut Ui, written: &StatedValues, kind: &str, asset: &Asset) -> Option<FieldChange> {
    let axes: &[usize] = match kind {
        "\"plane\"" => &[0, 2],
        "\"quad\"" => &[0, 1],
        _ => &[0, 1, 2],
    };
    let stated =
        written.get("size").filter(|text| text.starts_with('[')).and_then(|text| parse_numbers(text));
    let bounds = asset.rest_bounds();
    let real = |axis: &usize| f64::from(bounds.max[*axis] - bounds.min[*axis]);
    let now = stated.filter(|stated| stated.len() == axes.len());
    let now = now.unwrap_or_else(|| axes.iter().map(real).collect());
    let mut edit = option_label(ui, written, "size");
    ui.horizontal(|ui| {
        for (index, axis) in axes.iter().enumerate() {
            let name = format!("size {}", ["x", "y", "z"][*axis]);
            let range = size_range(kind, *axis, &now);
            let Some(to) = values::number_field(ui, &name, now[index], 0.01, range) else { continue };
            let all = values::number_list_text(ui, written.get("size").map(String::as_str), &now, index, to);
            edit = Some(FieldChange::AssetOption("size", Some(format!("[{all}]"))));
        }
        ui.weak("m");
    });
    ui.end_row();
    edit
}

/// Range of a shape's size along an axis, given its other sizes, metres: a capsule is at least as high as it is wide, and a torus at most half as
/// high.
fn size_range(kind: &str, axis: usize, now: &[f64]) -> std::ops::RangeInclusive<f64> {
    let (least, most) = (1e-4, 1e6);
    match (kind, axis, now) {
        ("\"capsule\"", 1, [x, _, z]) => x.max(*z)..=most,
        ("\"capsule\"", _, [_, y, _]) => least..=*y,
        ("\"torus\"", 1, [x, _, z]) => least..=0.5 * x.min(*z),
        ("\"torus\"", _, [_, y, _]) => 2.0 * y..=most,
        _ => least..=most,
    }
}

/// Row with a color of an actor's asset.
fn asset_color_row(
    ui: &mut Ui,
    written: &StatedValues,
    name: &'static str,
    linear: glam::Vec3,
) -> Option<FieldChange> {
    let edit = option_label(ui, written, name);
    let shown = linear.to_array().map(|v| egui::ecolor::gamma_u8_from_linear_f32(v.clamp(0.0, 1.0)));
    let set = values::color_field(ui, &format!("asset {name}"), shown);
    ui.end_row();
    let text = |[r, g, b]: [u8; 3]| format!("\"#{r:02x}{g:02x}{b:02x}\"");
    set.map(|color| FieldChange::AssetOption(name, Some(text(color)))).or(edit)
}

/// Fields of a shape's material. Options that exclude each other or require another one are only offered where the script accepts them.
fn material_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    written: &StatedValues,
    current: &Material,
) -> Option<FieldChange> {
    let (fps, mut edit) = (viewer.playhead.fps().as_fps(), None);
    let row = |ui: &mut Ui, (name, low, high, default_value): (&'static str, f64, f64, f64)| {
        let label = option_label(ui, written, name);
        let value =
            written.get(name).and_then(|text| expression::evaluate(text, fps)).unwrap_or(default_value);
        let set = number_field(ui, name, value, low..=high, "");
        ui.end_row();
        let set = set.map(|to| FieldChange::AssetOption(name, Some(values::source_text(ui, to))));
        (set.or(label), value)
    };
    // Blinn–Phong materials have neither.
    for option in SURFACE_PARAMETERS.into_iter().filter(|_| !written.contains_key("shininess")) {
        edit = row(ui, option).0.or(edit);
    }
    let mut strength = 1.0;
    if written.contains_key("emissive") {
        let (change, value) = row(ui, ("emissive_strength", 0.0, 1e6, 1.0));
        (edit, strength) = (change.or(edit), value);
    }
    let emissive = current.emissive / (strength as f32).max(f32::MIN_POSITIVE);
    edit = asset_color_row(ui, written, "emissive", emissive).or(edit);
    edit = option_label(ui, written, "alpha").or(edit);
    let now = match current.alpha_mode {
        AlphaMode::Opaque => "opaque",
        AlphaMode::Mask(_) => "mask",
        AlphaMode::Blend => "blend",
    };
    let set = combo_box(ui, "alpha", now, ["opaque", "mask", "blend"].into_iter());
    ui.end_row();
    set.map(|mode| FieldChange::AssetOption("alpha", Some(quoted(&mode)))).or(edit)
}
