//! Inspector: everything about the selection at the playhead. Values stated by the script can be edited.

use super::camera_fields::{self, CameraChange};
use super::hint::Hint;
use super::rig::CallChange;
use super::{fields, headers, icons, rig, values};
use crate::app::Viewer;
use crate::editing::placing::{light_at, placement_at};
use crate::editing::{ClipSource, EditError, FieldChange, expression};
use crate::geometry::gizmo::Change;
use crate::state::keyed::{self, KeyRef, KeyedProperty};
use crate::state::selection::{Selected, actor};
use choreo_asset::{Asset, LightKind, Projection};
use choreo_motion::Time;
use choreo_plugin::{OptionKind, OptionSpec};
use choreo_script::Place;
use choreo_session::edit::{TypedNumber, euler_degrees_near};
use choreo_session::{FrameInfo, Scene};
use choreo_stage::{
    ActiveClip, ActorState, Camera, Described, EffectUse, FieldType, FieldValue, Rig, Sky, Stage, StageLight,
};
use egui::{Grid, Response, RichText, Ui};
use glam::{DQuat, DVec3, Vec3};
use std::ops::RangeInclusive;
use std::sync::Arc;

/// Payload of a clip dragged onto the sequencer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ClipDrag {
    pub source: ClipSource,
    pub clip: String,
}

/// An edit by the user, made after all fields have been drawn.
enum InspectorEdit {
    /// A change of an actor's transform, and the number that was typed.
    Transform(Change, TypedNumber),
    Value(&'static str, String),
    Parameter(String, String),
    /// Removes a parameter of an effect from the script, since it has its default value.
    RemoveParameter(String),
    AddClip(String, f64),
    /// Field of view in degrees, and its source text.
    FieldOfView(f64, String),
    /// Sets a key of a property at the playhead; `true`: deletes the existing one.
    ToggleKey(String, bool),
    Field(FieldChange),
    Call(CallChange),
    Rename(String),
}

/// Properties of the selection that have keys or can have keys.
type KeyableProperties<'k> = &'k [KeyedProperty];

const MAX_CLIPS: usize = 200;
const MAX_JOINTS: usize = 400;

pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer) {
    let (Some(scene), Some(selection)) = (viewer.scene.clone(), viewer.selection.clone()) else {
        ui.label("select an actor, a bar, a camera or a light");
        return;
    };
    let line = super::script::line_of(viewer, &selection);
    let known = match &selection {
        what @ Selected::Cue { .. } => Some(Arc::new(keyed::cue_properties(&scene, what))),
        what => viewer.known_properties(what).map(|(all, _)| all),
    };
    let known = known.unwrap_or_default();
    let keyable: KeyableProperties = &known;
    let rows = rows_without_field(viewer, &scene, &selection, keyable);
    let title = match &selection {
        Selected::Actor(name) | Selected::Camera(name) => name.clone(),
        Selected::Cue { actor, .. } => format!("{actor}: {}", rows.first().map_or("", |r| r.1.as_str())),
        Selected::Light(index) => viewer.light_name(*index),
        Selected::Effect(index) => viewer.effect_name(*index),
        Selected::Title(index) => format!("title {}", index + 1),
        Selected::Sky => "sky".to_string(),
    };
    ui.label(RichText::new(title).heading());
    if let Some(line) = line {
        let place = Place { file: scene.places.main.clone(), line, ..Place::default() };
        let text = RichText::new(super::marks::file_and_line(&place)).weak().monospace();
        let label = ui.add(egui::Label::new(text).sense(egui::Sense::click()));
        if label.hint("click to go to this line").clicked() {
            viewer.script_scroll_line = Some(line);
        }
    }
    let written = viewer.written_values(&selection);
    let mut edit = None;
    let name = viewer.name_of(&selection).filter(|_| !matches!(selection, Selected::Title(_)));
    let name = name.and_then(|name| {
        ui.horizontal(|ui| {
            ui.label("name");
            fields::source_field(ui, "name", &name, "")
        })
        .inner
    });
    match &selection {
        Selected::Actor(name) => edit = transform_fields(ui, viewer, &scene.stage, (name, &written), keyable),
        Selected::Light(index) => edit = light_fields(ui, viewer, (&scene.stage, *index), keyable, &written),
        Selected::Effect(index) => edit = show_parameters(ui, viewer, &scene, (*index, &written), keyable),
        Selected::Camera(name) => {
            edit = field_of_view_fields(ui, viewer, &scene, (name, &written), keyable);
            edit = camera_placement_fields(ui, viewer, &scene.stage, (name, &written), keyable).or(edit);
        }
        Selected::Sky => edit = sky_fields(ui, viewer, &scene.stage, keyable),
        Selected::Cue { .. } | Selected::Title(_) => {}
    }
    let field = fields::show(ui, viewer, &scene.stage, &selection, &written);
    edit = field.map(InspectorEdit::Field).or(name.map(InspectorEdit::Rename)).or(edit);
    edit = keys_menu(ui, viewer, keyable).or(edit);
    Grid::new("inspector").num_columns(2).striped(true).show(ui, |ui| {
        for (name, value) in rows {
            ui.label(name);
            ui.monospace(value);
            ui.end_row();
        }
    });
    if let Selected::Actor(name) = &selection
        && let Some(index) = actor(&scene.stage, name)
    {
        let asset = &scene.stage.actors[index].asset;
        edit = show_clips(ui, viewer, name, asset).or(edit);
        edit = rig::show(ui, viewer, &scene.stage.actors[index], index).map(InspectorEdit::Call).or(edit);
        show_materials(ui, asset);
        if let Some(state) = viewer.shown().and_then(|s| s.snapshot.actors.get(index)) {
            show_joints(ui, asset, state);
        }
    }
    if let Some(edit) = edit {
        apply_edit(viewer, selection, edit, &known);
    }
}

fn apply_edit(viewer: &mut Viewer, selection: Selected, edit: InspectorEdit, known: &[KeyedProperty]) {
    viewer.note = None;
    let locked = selection.actor().filter(|name| viewer.toggles.locked.contains(*name));
    // The lock protects the row, but not its name.
    if let Some(name) = locked.filter(|_| !matches!(edit, InspectorEdit::Rename(_))) {
        return viewer.report(Err(EditError::refused(headers::locked_row_message(name))));
    }
    let change = match edit {
        InspectorEdit::Field(change) => viewer.change_field(&selection, &change),
        InspectorEdit::Rename(name) => viewer.rename(&selection, &name),
        InspectorEdit::Call(CallChange(call, change)) => viewer.change_call(&call, &change),
        InspectorEdit::FieldOfView(degrees, written) => match &selection {
            Selected::Camera(name) => viewer.set_field_of_view(name, degrees, &written),
            _ => Ok(()),
        },
        InspectorEdit::ToggleKey(name, true) => {
            let at = viewer.playhead.time();
            let property = known.iter().find(|p| p.name == name);
            let key_time = property.and_then(|p| Some(p.keys[p.key_at(at, viewer.playhead.fps())?]));
            key_time
                .map_or(Ok(()), |at| viewer.delete_keys(&[KeyRef { what: selection, property: name, at }]))
        }
        InspectorEdit::ToggleKey(name, false) => viewer.set_keys(&selection, &[&name]),
        InspectorEdit::Transform(change, typed) => {
            selection.actor().map_or(Ok(()), |name| viewer.place_actor(name, change, Some(&typed)))
        }
        InspectorEdit::Value(name, value) => viewer.set_value(&selection, name, &value),
        InspectorEdit::Parameter(name, value) => viewer.set_value(&selection, &name, &value),
        InspectorEdit::RemoveParameter(name) => viewer.remove_parameter(&selection, &name),
        InspectorEdit::AddClip(clip, secs) => {
            selection.actor().map_or(Ok(()), |name| viewer.add_clip(name, name, &clip, secs))
        }
    };
    viewer.report(change);
}

/// The diamond next to a value. It is filled if there is a key at the playhead, which a click deletes; otherwise a click sets one.
fn key_button(ui: &mut Ui, viewer: &Viewer, keyable: KeyableProperties, name: &str) -> Option<InspectorEdit> {
    let property = keyable.iter().find(|property| property.name == name)?;
    let here = property.key_at(viewer.playhead.time(), viewer.playhead.fps()).is_some();
    let color = match (here, property.has_keys()) {
        (true, _) => super::marks::SELECTED_COLOR,
        (_, true) => ui.visuals().strong_text_color(),
        _ => ui.visuals().weak_text_color(),
    };
    let (place, response) = ui.allocate_exact_size(egui::vec2(14.0, 14.0), egui::Sense::click());
    let half = if response.hovered() { 6.0 } else { 5.0 };
    let around = [(0.0, -half), (half, 0.0), (0.0, half), (-half, 0.0)];
    let around = around.map(|(x, y)| place.center() + egui::vec2(x, y)).to_vec();
    let fill = if here { color } else { egui::Color32::TRANSPARENT };
    ui.painter().add(egui::Shape::convex_polygon(around, fill, egui::Stroke::new(1.2, color)));
    let label = format!("key of {name}");
    response
        .widget_info(|| egui::WidgetInfo::selected(egui::WidgetType::Checkbox, true, here, label.clone()));
    let hint = match here {
        true => format!("delete the key of {} here", property.title()),
        false => {
            format!("set a key of {} at the playhead (K: of all properties with keys)", property.title())
        }
    };
    response.hint(hint).clicked().then(|| InspectorEdit::ToggleKey(name.to_string(), here))
}

/// Menu of keys for all properties that can have them, including those without a field.
fn keys_menu(ui: &mut Ui, viewer: &Viewer, keyable: KeyableProperties) -> Option<InspectorEdit> {
    if keyable.is_empty() {
        return None;
    }
    let mut edit = None;
    ui.menu_button("keys", |ui| {
        for property in keyable {
            ui.horizontal(|ui| {
                edit = key_button(ui, viewer, keyable, &property.name).or(edit.take());
                ui.label(property.title());
                let now = property.at(viewer.playhead.time());
                let now: Vec<String> =
                    now.iter().map(|n| format!("{:.3}", super::rounded(*n, 1e3))).collect();
                ui.weak(format!("{} {}", now.join(" "), property.unit));
            });
        }
    });
    edit
}

/// A number field with a default.
fn number_with_default(
    name: &str,
    value: f64,
    speed: f64,
    range: RangeInclusive<f64>,
    default: f64,
) -> values::NumberField<'_> {
    values::NumberField { name, value, speed, range, default: Some(default), is_time: false }
}

/// Fields of the transform relative to the parent, as stated by the script; at the playhead if it has keys.
fn transform_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    stage: &Stage,
    (name, written): (&str, &fields::StatedValues),
    keyable: KeyableProperties,
) -> Option<InspectorEdit> {
    let placed = placement_at(stage.actors.get(actor(stage, name)?)?, viewer.playhead.time());
    let mut edit = None;
    Grid::new("transform").num_columns(5).show(ui, |ui| {
        edit = name_with_menu(ui, written, ["placed at", ""], &["at", "move_by"]);
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            let value = placed.translation[axis];
            if let Some(to) = number_with_default(letter, value, 0.01, -1e9..=1e9, 0.0).show(ui) {
                let mut by = DVec3::ZERO;
                by[axis] = to - placed.translation[axis];
                edit = Some(InspectorEdit::Transform(Change::Move(by), values::typed_number(ui, to)));
            }
        }
        edit = key_button(ui, viewer, keyable, "position").or(edit.take());
        ui.end_row();
        edit = name_with_menu(ui, written, ["turned", ""], &["turn", "rotate"]).or(edit.take());
        let z = placed.rotation * DVec3::Z;
        let degrees = libm::atan2(z.x, z.z).to_degrees();
        if let Some(to) = number_with_default("degrees", degrees, 0.5, -360.0..=360.0, 0.0).show(ui) {
            let (sin, cos) = libm::sincos((to - degrees).to_radians() / 2.0);
            let turn = Change::Turn(DQuat::from_xyzw(0.0, sin, 0.0, cos));
            edit = Some(InspectorEdit::Transform(turn, values::typed_number(ui, to)));
        }
        edit = key_button(ui, viewer, keyable, "rotation").or(edit.take());
        ui.end_row();
        let about =
            "along its own axes; a negative number mirrors it. Shift while a number is entered: all three\n";
        edit = name_with_menu(ui, written, ["scaled", about], &["scale"]).or(edit.take());
        for (axis, name) in ["scale x", "scale y", "scale z"].into_iter().enumerate() {
            if let Some(to) = number_with_default(name, placed.scale[axis], 0.01, -1e3..=1e3, 1.0).show(ui) {
                // An object with a scale of 0 would vanish.
                let to = if to.abs() < 1e-3 { 1e-3_f64.copysign(to) } else { to };
                let by = to / placed.scale[axis];
                let all = super::gesture::modifiers(ui).shift;
                let mut scale = if all { DVec3::splat(by) } else { DVec3::ONE };
                scale[axis] = by;
                edit = Some(InspectorEdit::Transform(Change::Scale(scale), values::typed_number(ui, to)));
            }
        }
        edit = key_button(ui, viewer, keyable, "scale").or(edit.take());
        ui.end_row();
    });
    edit
}

/// Projection of a camera at the playhead if it is active, else its initial one.
fn projection(viewer: &Viewer, stage: &Stage, name: &str) -> Option<Projection> {
    let index = stage.cameras.iter().position(|c| c.name == name)?;
    let shown = viewer.shown().map(|shown| shown.snapshot.camera).filter(|c| c.camera == Some(index));
    Some(shown.map_or(stage.cameras[index].projection, |camera| camera.projection))
}

/// Vertical field of view by the script's keys, else by its calls, degrees. `None` if a file defines it.
fn stated_field_of_view(camera: &Camera, time: Time, keyable: KeyableProperties) -> Option<f64> {
    let keyed = |name: &str| {
        let property = keyable.iter().find(|property| property.name == name && property.has_keys())?;
        property.at(time).first().copied()
    };
    match (&camera.rig, camera.projection) {
        (Rig::File { .. }, _) | (_, Projection::Orthographic { .. }) => None,
        (_, Projection::Perspective { yfov, .. }) => {
            let keyed = keyed("fov").or_else(|| Some(Camera::yfov(keyed("focal_length")?).to_degrees()));
            keyed.or_else(|| Some(f64::from(yfov).to_degrees()))
        }
    }
}

/// Text for the field of view at the playhead, if a callback sets it.
fn field_of_view_by_callback(
    viewer: &Viewer,
    scene: &Scene,
    name: &str,
    degrees: f64,
    keyable: KeyableProperties,
) -> Option<String> {
    let frame = frame_of_callbacks(viewer, scene)?;
    let index = frame.snapshot.camera.camera?;
    let camera = scene.stage.cameras.get(index).filter(|camera| camera.name == name)?;
    let stated = stated_field_of_view(camera, frame.time, keyable)?;
    ((stated - degrees).abs() > 1e-3).then(|| format!("{degrees:.3} ({})", callback_origin(scene)))
}

fn field_of_view_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    scene: &Scene,
    (name, written): (&str, &fields::StatedValues),
    keyable: KeyableProperties,
) -> Option<InspectorEdit> {
    let Projection::Perspective { yfov, .. } = projection(viewer, &scene.stage, name)? else { return None };
    let mut edit = None;
    ui.horizontal(|ui| {
        let about = "degrees, from the top to the bottom of the image\n";
        edit = name_with_menu(ui, written, ["field of view", about], &["fov", "focal_length"]);
        let degrees = f64::from(yfov).to_degrees();
        let Projection::Perspective { yfov: default_value, .. } = Projection::default() else { return };
        let default_value = f64::from(default_value).to_degrees();
        if let Some(text) = field_of_view_by_callback(viewer, scene, name, degrees, keyable) {
            ui.monospace(text);
            return;
        }
        let number = number_with_default("field of view", degrees, 0.25, 1.0..=170.0, default_value);
        let set = number.show(ui).map(|to| InspectorEdit::FieldOfView(to, values::source_text(ui, to)));
        edit = set.or(edit.take());
        for name in ["fov", "focal_length"] {
            edit = key_button(ui, viewer, keyable, name).or(edit.take());
        }
    });
    edit
}

/// Fields of a camera: position and target, or its motion with a target.
fn camera_placement_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    stage: &Stage,
    (name, written): (&str, &fields::StatedValues),
    keyable: KeyableProperties,
) -> Option<InspectorEdit> {
    let camera = stage.cameras.iter().find(|camera| camera.name == name)?;
    let mut key = None;
    let change = camera_fields::show(ui, viewer, written, camera, |ui, name| {
        key = key_button(ui, viewer, keyable, name).or(key.take());
    });
    let change = change.map(|change| match change {
        CameraChange::Field(change) => InspectorEdit::Field(change),
        CameraChange::Call(change) => InspectorEdit::Call(change),
    });
    change.or(key)
}

fn srgb(linear: Vec3) -> [u8; 3] {
    linear.to_array().map(|v| egui::ecolor::gamma_u8_from_linear_f32(v.clamp(0.0, 1.0)))
}

/// Fields of a light at the playhead.
fn light_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    (stage, index): (&Stage, usize),
    keyable: KeyableProperties,
    written: &fields::StatedValues,
) -> Option<InspectorEdit> {
    let light = light_at(stage.lights.get(index)?, viewer.playhead.time());
    let mut edit = None;
    Grid::new("light").num_columns(4).show(ui, |ui| {
        for field in StageLight::FIELDS.iter().filter(|field| (field.missing_reason)(&light).is_none()) {
            let name = format!("light {}", field.name);
            let set = match ((field.get)(&light), field.field_type) {
                (FieldValue::Number(n), FieldType::Number(low, high, _)) => {
                    edit = light_name_with_menu(ui, written, field.name).or(edit.take());
                    values::number_source_field(ui, &name, n, 0.05, low..=high, written.get(field.name))
                }
                (FieldValue::Number(n), FieldType::Degrees(low, high)) => {
                    edit = light_name_with_menu(ui, written, field.name).or(edit.take());
                    let range = cone_range(&light, field.name, written).unwrap_or(low..=high);
                    values::number_source_field(
                        ui,
                        &name,
                        n.to_degrees(),
                        0.25,
                        range,
                        written.get(field.name),
                    )
                }
                (_, FieldType::Color) => {
                    edit = light_name_with_menu(ui, written, field.name).or(edit.take());
                    let set = values::color_field(ui, &name, srgb(light.light.color));
                    set.map(|[r, g, b]| format!("\"#{r:02x}{g:02x}{b:02x}\""))
                }
                _ => continue,
            };
            edit = set.map(|value| InspectorEdit::Value(field.name, value)).or(edit.take());
            if let Some((name, _)) = field.keyed {
                edit = key_button(ui, viewer, keyable, name).or(edit.take());
            }
            ui.end_row();
        }
        let (label, name, vector, speed) = match light.light.kind.is_directional() {
            true => ("shines along", "direction", light.direction.as_dvec3(), 0.01),
            false => ("stands at", "position", light.position, 0.01),
        };
        // A direction as stated by the script, which need not be a unit vector.
        let text = written.get(name).map(String::as_str);
        let stated = text.and_then(fields::parse_point);
        let is_keyed = keyable.iter().any(|property| property.name == name && property.has_keys());
        let vector = stated.filter(|_| !is_keyed).unwrap_or(vector);
        let resets: &[&'static str] =
            if name == "position" { &["position", "at"] } else { &["direction", "look_at"] };
        edit = name_with_menu(ui, written, [label, ""], resets).or(edit.take());
        let set = vector_field(ui, ["light x", "light y", "light z"], vector, speed, text);
        edit = set.map(|text| InspectorEdit::Value(name, text)).or(edit.take());
        edit = key_button(ui, viewer, keyable, name).or(edit.take());
        ui.end_row();
        edit =
            target_and_temperature_fields(ui, &light, written, has_direction_keys(keyable)).or(edit.take());
    });
    edit
}

/// Range of a spot's cone angle, degrees: the inner angle is smaller than the outer one.
fn cone_range(light: &StageLight, name: &str, written: &fields::StatedValues) -> Option<RangeInclusive<f64>> {
    const MIN_CONE_DIFFERENCE: f64 = 0.01;
    let LightKind::Spot { inner, outer } = light.light.kind else { return None };
    let [inner, outer] = [inner, outer].map(|angle| f64::from(angle).to_degrees());
    match name {
        "inner" => Some(0.0..=(outer - MIN_CONE_DIFFERENCE).max(0.0)),
        // An inner angle that is not stated follows the outer one.
        "outer" if written.contains_key("inner") => Some((inner + MIN_CONE_DIFFERENCE).min(90.0)..=90.0),
        _ => None,
    }
}

/// Whether keys rotate a light.
fn has_direction_keys(keyable: KeyableProperties) -> bool {
    keyable.iter().any(|property| property.name == "direction" && property.has_keys())
}

/// Fields of a spot's target or direction, and of the color temperature.
fn target_and_temperature_fields(
    ui: &mut Ui,
    light: &StageLight,
    written: &fields::StatedValues,
    keyed: bool,
) -> Option<InspectorEdit> {
    let mut edit = None;
    if matches!(light.light.kind, LightKind::Spot { .. }) && !keyed {
        let at = written.get("look_at").and_then(|text| fields::parse_point(text));
        let (name, vector) = match at {
            Some(at) => ("look_at", at),
            None => ("direction", light.direction.as_dvec3()),
        };
        let label = if at.is_some() { "shines on" } else { "shines along" };
        ui.label(label);
        let text = written.get(name).map(String::as_str);
        let set = vector_field(ui, ["aim x", "aim y", "aim z"], vector, 0.01, text);
        edit = set.map(|text| InspectorEdit::Value(name, text));
        ui.end_row();
    }
    edit = light_name_with_menu(ui, written, "kelvin").or(edit);
    let now = written.get("kelvin").and_then(|text| expression::evaluate(text, 1.0));
    // Range of temperatures that scripts have colors for, kelvin.
    let range = choreo_script::KELVIN_RANGE.0..=choreo_script::KELVIN_RANGE.1;
    let set = match now {
        _ if written.contains_key("color") => {
            ui.weak("a color is set instead");
            None
        }
        Some(now) => values::number_field(ui, "light kelvin", now, 10.0, range),
        None => values::derived_number_field(ui, "light kelvin", None, range, false),
    };
    edit = set.map(|to| InspectorEdit::Value("kelvin", values::source_text(ui, to))).or(edit);
    ui.end_row();
    edit
}

/// Three number fields in one cell, which return the source text of a point or a direction. `stated`: the present source text.
fn vector_field(
    ui: &mut Ui,
    names: [&str; 3],
    now: DVec3,
    speed: f64,
    stated: Option<&str>,
) -> Option<String> {
    let mut edit = None;
    ui.horizontal(|ui| {
        for (axis, name) in names.into_iter().enumerate() {
            if let Some(to) = values::number_field(ui, name, now[axis], speed, -1e6..=1e6) {
                edit = Some(format!("[{}]", values::number_list_text(ui, stated, &now.to_array(), axis, to)));
            }
        }
    });
    edit
}

/// Fields of the sky at the playhead.
fn sky_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    stage: &Stage,
    keyable: KeyableProperties,
) -> Option<InspectorEdit> {
    let (sky, mut edit) = (stage.sky.as_ref()?, None);
    Grid::new("sky").num_columns(3).show(ui, |ui| {
        for field in Sky::FIELDS.iter() {
            let Some((key, _)) = field.keyed else { continue };
            let keyed = keyable.iter().find(|keyed| keyed.name == key && keyed.has_keys());
            let now = keyed.map(|keyed| keyed.at(viewer.playhead.time())[0]);
            let (stated, [low, high], speed) = match ((field.get)(sky), field.field_type) {
                (FieldValue::Number(n), FieldType::Degrees(low, high)) => (n.to_degrees(), [low, high], 0.25),
                (FieldValue::Number(n), FieldType::Number(low, high, _)) => (n, [low, high], 0.01),
                _ => continue,
            };
            ui.label(field.name);
            let name = format!("sky {}", field.name);
            let set = values::number_field(ui, &name, now.unwrap_or(stated), speed, low..=high);
            edit =
                set.map(|to| InspectorEdit::Value(field.name, values::source_text(ui, to))).or(edit.take());
            edit = key_button(ui, viewer, keyable, key).or(edit.take());
            ui.end_row();
        }
    });
    edit
}

/// Name of a light's field with a context menu that resets it; strong if the script states the value.
fn light_name_with_menu(
    ui: &mut Ui,
    written: &fields::StatedValues,
    name: &'static str,
) -> Option<InspectorEdit> {
    let names: &[&'static str] = if name == "color" { &["color", "kelvin"] } else { &[name] };
    name_with_menu(ui, written, [name, ""], names)
}

/// A name with a context menu that resets the values `names`; strong if the script states one of them. `about`: text before the hint.
fn name_with_menu(
    ui: &mut Ui,
    written: &fields::StatedValues,
    [label, about]: [&str; 2],
    names: &[&'static str],
) -> Option<InspectorEdit> {
    let is_stated = names.iter().any(|name| written.contains_key(*name));
    let response = ui.add(egui::Label::new(fields::name_text(label, is_stated)).sense(egui::Sense::click()));
    let hint = if is_stated { "stated by the script; right click: reset to default" } else { "by default" };
    fields::reset_menu(&response.hint(format!("{about}{hint}")), names).map(InspectorEdit::Field)
}

/// Fields of an effect's parameters, as described by its manifest.
fn show_parameters(
    ui: &mut Ui,
    viewer: &Viewer,
    scene: &Scene,
    (index, written): (usize, &fields::StatedValues),
    keyable: KeyableProperties,
) -> Option<InspectorEdit> {
    let used = scene.stage.effects.get(index)?;
    let plugin = scene.registry.effect(&used.plugin)?;
    let shown = frame_of_callbacks(viewer, scene);
    let time = shown.map_or(viewer.playhead.time(), |shown| shown.time);
    let given = choreo_render::effect_parameters(plugin, &used.parameters_at(time));
    let state = shown.and_then(|shown| shown.snapshot.effects.iter().find(|e| e.effect == index));
    let now = state.map(|state| choreo_render::effect_parameters(plugin, &state.parameters));
    let now = now.unwrap_or_else(|| given.clone());
    let defaults = choreo_render::effect_parameters(plugin, &[]);
    let mut edit = None;
    Grid::new("parameters").num_columns(3).show(ui, |ui| {
        let mut first = 0;
        for option in &plugin.manifest().options {
            let numbers = first..first + option.number_count();
            first = numbers.end;
            let (value, now, default_value) =
                (&given[numbers.clone()], &now[numbers.clone()], &defaults[numbers]);
            let is_stated = written.keys().any(|name| name.starts_with(&option.name));
            let label = ui.label(fields::name_text(&option.name, is_stated));
            let label = label.interact(egui::Sense::click()).hint(&option.about);
            let set = match now == value {
                true => parameter_field(ui, used, option, &label, (value, default_value)),
                // A literal in the script would not change a value that a callback sets.
                false => {
                    let now: Vec<String> = now.iter().map(|n| format!("{n:.3}")).collect();
                    ui.monospace(format!("{} ({})", now.join(" "), callback_origin(scene)));
                    None
                }
            };
            let is_number = matches!(option.kind, OptionKind::Number { .. } | OptionKind::Integer { .. });
            let is_keyed = keyable.iter().any(|property| property.name == option.name && property.has_keys());
            let is_default =
                |to: &str| is_number && !is_keyed && to.parse::<f32>().is_ok_and(|to| to == default_value[0]);
            let change = |(name, to): (String, String)| match is_default(&to) {
                true => InspectorEdit::RemoveParameter(name),
                false => InspectorEdit::Parameter(name, to),
            };
            edit = set.map(change).or(edit.take());
            edit = key_button(ui, viewer, keyable, &option.name).or(edit.take());
            ui.end_row();
        }
    });
    edit
}

/// The displayed frame, if it belongs to this version and callbacks may have set values in it.
fn frame_of_callbacks<'v>(viewer: &'v Viewer, scene: &Scene) -> Option<&'v FrameInfo> {
    viewer.shown().filter(|shown| shown.number == scene.number && !scene.places.callbacks.is_empty())
}

/// Origin of a value that a callback sets: lines of the first calls of `on_frame`, any of which may set it.
fn callback_origin(scene: &Scene) -> String {
    /// Largest number of lines listed.
    const MAX_LINES: usize = 3;
    let mut all: Vec<&Place> = Vec::new();
    for place in &scene.places.callbacks {
        // A loop may register several callbacks in one line.
        if !all.iter().any(|known| (&known.file, known.line) == (&place.file, place.line)) {
            all.push(place);
        }
    }
    let is_here = all.iter().all(|place| place.file == scene.places.main);
    let named = |place: &&Place| match is_here {
        true => place.line.to_string(),
        false => super::marks::file_and_line(place),
    };
    let names: Vec<String> = all.iter().take(MAX_LINES).map(named).collect();
    let listed = match (all.len().saturating_sub(MAX_LINES), names.as_slice()) {
        (0, [before @ .., last]) if !before.is_empty() => format!("{} and {last}", before.join(", ")),
        (0, _) => names.join(", "),
        (1, _) => format!("{} and 1 other", names.join(", ")),
        (others, _) => format!("{} and {others} others", names.join(", ")),
    };
    let unit = match (is_here, all.len()) {
        (false, _) => "",
        (true, 1) => "line ",
        (true, _) => "lines ",
    };
    format!("by on_frame, {unit}{listed}")
}

/// Field of one parameter. `value`, `default_value`: its present components and the default ones. Returns the name and the source text.
fn parameter_field(
    ui: &mut Ui,
    used: &EffectUse,
    option: &OptionSpec,
    label: &Response,
    (value, default_value): (&[f32], &[f32]),
) -> Option<(String, String)> {
    let mut edit = None;
    let [min, max] = option.bounds().unwrap_or_default();
    match &option.kind {
        OptionKind::Number { .. } | OptionKind::Integer { .. } => {
            let (value, default_value) = (f64::from(value[0]), f64::from(default_value[0]));
            let reset = values::reset_menu(label, default_value).filter(|to| *to != value);
            let set =
                number_with_default(&option.name, value, 0.01, min..=max, default_value).show_slider(ui);
            let is_whole = matches!(option.kind, OptionKind::Integer { .. });
            let to = reset.or(set).map(|to| if is_whole { to.round() } else { to });
            edit = to.map(|to| (option.name.clone(), values::source_text(ui, to)));
        }
        OptionKind::Color { .. }
            if value.len() == 3 && value.iter().all(|part| (0.0..=1.0).contains(part)) =>
        {
            let set = values::color_field(ui, &option.name, srgb(Vec3::from_slice(value)));
            edit = set.map(|[r, g, b]| (option.name.clone(), format!("\"#{r:02x}{g:02x}{b:02x}\"")));
        }
        OptionKind::Color { .. } | OptionKind::Vector { .. } => {
            ui.horizontal(|ui| {
                for (number, (name, value)) in option.number_names().zip(value).enumerate() {
                    let (value, speed) = (f64::from(*value), ((max - min) * 0.002).min(0.01));
                    let default_value = f64::from(default_value[number]);
                    if let Some(to) =
                        number_with_default(&name, value, speed, min..=max, default_value).show(ui)
                    {
                        edit = Some((name, values::source_text(ui, to)));
                    }
                }
            });
        }
        OptionKind::Curve { .. } => {
            let ends = [value[0], value[value.len() - 1]];
            ui.monospace(format!("{:.3} to {:.3}", ends[0], ends[1]));
        }
        OptionKind::Bool { .. } => {
            let mut on = value[0] != 0.0;
            let checkbox = ui.checkbox(&mut on, "");
            let (enabled, name) = (checkbox.enabled(), &option.name);
            checkbox
                .widget_info(|| egui::WidgetInfo::selected(egui::WidgetType::Checkbox, enabled, on, name));
            if checkbox.changed() {
                edit = Some((option.name.clone(), on.to_string()));
            }
        }
        OptionKind::Text { one_of, .. } => {
            let shown = one_of.get(value[0] as usize).cloned().unwrap_or_default();
            let combo = egui::ComboBox::from_id_salt(&option.name).selected_text(&shown).show_ui(ui, |ui| {
                for choice in one_of {
                    if ui.selectable_label(*choice == shown, choice).clicked() && *choice != shown {
                        edit = Some((option.name.clone(), format!("\"{choice}\"")));
                    }
                }
            });
            values::set_widget_name(combo.response, egui::WidgetType::ComboBox, &option.name);
        }
        OptionKind::Texture { default, .. } => {
            let chosen = used.images.iter().find(|chosen| chosen.parameter == option.name);
            ui.monospace(chosen.map_or(default.as_str(), |chosen| chosen.image.name.as_str()));
        }
        _ => drop(ui.monospace(format!("{value:.3?}"))),
    }
    edit
}

/// List of clips that can be dragged onto a row of the sequencer, or added at the playhead.
fn show_clips(ui: &mut Ui, viewer: &Viewer, name: &str, asset: &Asset) -> Option<InspectorEdit> {
    if asset.clips.is_empty() {
        return None;
    }
    let mut edit = None;
    let title = format!("clips ({})", asset.clips.len());
    egui::CollapsingHeader::new(title).default_open(true).show(ui, |ui| {
        for clip in asset.clips.iter().take(MAX_CLIPS) {
            ui.horizontal(|ui| {
                let (label, hint) = (format!("play {}", clip.name), "from the playhead on");
                if icons::small_button(ui, icons::PLUS, &label, hint).clicked() {
                    edit = Some(InspectorEdit::AddClip(clip.name.clone(), viewer.playhead.time().as_secs()));
                }
                let id = ui.id().with(("clip", &clip.name));
                let payload =
                    ClipDrag { source: ClipSource::Actor(name.to_string()), clip: clip.name.clone() };
                ui.dnd_drag_source(id, payload, |ui| {
                    ui.label(format!("{}  {:.2} s", clip.name, clip.duration.as_secs()));
                });
            });
        }
    });
    edit
}

fn show_materials(ui: &mut Ui, asset: &Asset) {
    egui::CollapsingHeader::new(format!("materials ({})", asset.materials.len())).show(ui, |ui| {
        Grid::new("materials").num_columns(4).striped(true).show(ui, |ui| {
            for material in asset.materials.iter().take(MAX_CLIPS) {
                let [r, g, b] = srgb(material.base_color.truncate());
                let (rect, _) = ui.allocate_exact_size(egui::vec2(14.0, 14.0), egui::Sense::hover());
                ui.painter().rect_filled(rect, 2.0, egui::Color32::from_rgb(r, g, b));
                ui.label(&material.name);
                ui.monospace(format!("metallic {:.2}", material.metallic));
                ui.monospace(format!("roughness {:.2}", material.roughness));
                ui.end_row();
            }
        });
    });
}

/// List of joints: rotation angle from the rest pose in degrees, and position in model space.
fn show_joints(ui: &mut Ui, asset: &Asset, state: &ActorState) {
    let count = asset.skeleton.len();
    if state.model_from_joint.len() < count {
        return;
    }
    egui::CollapsingHeader::new(format!("joints ({count})")).show(ui, |ui| {
        Grid::new("joints").num_columns(3).striped(true).show(ui, |ui| {
            ui.weak("joint");
            ui.weak("angle from rest");
            ui.weak("position (model)");
            ui.end_row();
            for (joint, name) in asset.skeleton.names().iter().enumerate().take(MAX_JOINTS) {
                let model_from_joint = state.model_from_joint[joint];
                let local = match asset.skeleton.parents()[joint] {
                    Some(parent) => state.model_from_joint[parent as usize].inverse() * model_from_joint,
                    None => model_from_joint,
                };
                let (_, rotation, _) = local.to_scale_rotation_translation();
                let rest = asset.skeleton.rest()[joint].rotation;
                let half = rotation.normalize().dot(rest.normalize()).abs().min(1.0);
                ui.label(name);
                ui.monospace(format!("{:6.1}°", 2.0 * libm::acosf(half).to_degrees()));
                ui.monospace(point_text(model_from_joint.translation.as_dvec3()));
                ui.end_row();
            }
        });
    });
}

fn point_text(p: DVec3) -> String {
    let [x, y, z] = p.to_array().map(|v| super::rounded(v, 1e3));
    format!("{x:.3} {y:.3} {z:.3}")
}

/// Text of angles about x, y and z.
fn angles_text(angles: DVec3) -> String {
    let [x, y, z] = angles.to_array().map(|v| super::rounded(v, 10.0));
    format!("{x:.1}° {y:.1}° {z:.1}°")
}

/// Values that have no field.
fn rows_without_field(
    viewer: &Viewer,
    scene: &Scene,
    selection: &Selected,
    keyable: KeyableProperties,
) -> Vec<(String, String)> {
    let stage = &scene.stage;
    let mut rows = Vec::new();
    let mut row = |name: &str, value: String| rows.push((name.to_string(), value));
    match selection {
        Selected::Actor(name) => add_actor_rows(viewer, stage, name, &mut row),
        Selected::Cue { actor: name, layer, cue } => {
            add_cue_rows(viewer, stage, name, *layer, *cue, &mut row)
        }
        Selected::Camera(name) => {
            if let Some(camera) = stage.cameras.iter().find(|c| c.name == *name) {
                row("rig", rig_name(&camera.rig).into());
                let height = Camera::field("height").and_then(|field| field.shown_with_unit(camera));
                height.into_iter().for_each(|height| row("height", height));
                if let Some(rotation) = keyable.iter().find(|property| property.name == "rotation") {
                    let angles = match rotation.at(viewer.playhead.time())[..] {
                        [x, y, z] => DVec3::new(x, y, z),
                        [y, ..] => DVec3::new(0.0, y, 0.0),
                        [] => DVec3::ZERO,
                    };
                    row("turned x, y, z", angles_text(angles));
                }
                if camera.far().is_none() {
                    row("far", "any distance".into());
                }
            }
            if let Some(shown) = viewer.shown()
                && shown
                    .snapshot
                    .camera
                    .camera
                    .and_then(|c| stage.cameras.get(c))
                    .is_some_and(|c| c.name == *name)
            {
                row("stands at", point_text(shown.snapshot.camera.world_from_view.translation));
            }
        }
        Selected::Light(index) => {
            if let Some(light) = stage.lights.get(*index) {
                row("kind", light.light.kind.title().into());
            }
        }
        Selected::Title(_) | Selected::Sky => {}
        Selected::Effect(index) => {
            if let Some(used) = stage.effects.get(*index) {
                row("from", viewer.time_text(used.start));
                if let Some(end) = used.end {
                    row("until", viewer.time_text(end));
                }
            }
        }
    }
    rows
}

fn add_cue_rows(
    viewer: &Viewer,
    stage: &Stage,
    name: &str,
    layer: usize,
    cue: usize,
    row: &mut impl FnMut(&str, String),
) {
    let Some(found) = actor(stage, name).map(|a| &stage.actors[a]) else { return };
    let Some(played) = found.layers.get(layer).and_then(|l| l.cues.get(cue)) else { return };
    row("clip", played.clip.name.clone());
    let active = found.active_clips(viewer.playhead.time());
    match layer_shares(&active, layer).find(|(clip, _)| clip.cue == cue) {
        Some((active, share)) => {
            row("now", format!("{:.0} % at {:.3} s of the clip", share * 100.0, active.clip_time.as_secs()))
        }
        None => row("now", "not active".into()),
    }
}

/// Effective weight of each cue in a layer's pose, the last cue first: each leaves the rest to the ones below.
fn layer_shares(active: &[ActiveClip], layer: usize) -> impl Iterator<Item = (&ActiveClip, f32)> {
    let of_layer = active.iter().filter(move |clip| clip.layer == layer).rev();
    of_layer.scan(1.0, |rest, clip| {
        let share = if clip.additive { clip.weight } else { *rest * clip.weight };
        *rest -= if clip.additive { 0.0 } else { share };
        Some((clip, share))
    })
}

fn add_actor_rows(viewer: &Viewer, stage: &Stage, name: &str, row: &mut impl FnMut(&str, String)) {
    let Some(index) = actor(stage, name) else { return };
    let found = &stage.actors[index];
    let asset = &found.asset;
    row("asset", asset.name.clone());
    row("meshes, joints", format!("{}, {}", asset.meshes.len(), asset.skeleton.len()));
    if let Some(state) = viewer.shown().and_then(|s| s.snapshot.actors.get(index)) {
        row("visible", state.visible.to_string());
        row("stands at", point_text(state.world_from_model.translation));
        let (scale, rotation, _) = state.world_from_model.to_scale_rotation_translation();
        row("turned x, y, z", angles_text(euler_degrees_near(rotation, DVec3::ZERO)));
        row("scale", point_text(scale));
    }
    if let Some(to) = found.parent_at(viewer.playhead.time()).and_then(|parent| parent.to) {
        let carrier = &stage.actors[to.actor];
        let joint = to.joint.and_then(|joint| carrier.asset.skeleton.names().get(joint as usize));
        let joint = joint.map(|joint| format!(", {joint}")).unwrap_or_default();
        row("attached to", format!("{}{joint}", carrier.name));
    }
    let active = found.active_clips(viewer.playhead.time());
    for (number, layer) in found.layers.iter().enumerate() {
        let layer_name = if number == 0 { "base layer".to_string() } else { format!("layer {number}") };
        let lines: Vec<String> = layer_shares(&active, number)
            .filter_map(|(clip, share)| {
                Some(format!("{:3.0} % {}", share * 100.0, layer.cues.get(clip.cue)?.clip.name))
            })
            .collect();
        row(&layer_name, if lines.is_empty() { "—".into() } else { lines.join("\n") });
    }
}

fn rig_name(rig: &Rig) -> &'static str {
    match rig {
        Rig::Fixed { .. } => "fixed",
        Rig::Follow { .. } => "follows",
        Rig::Orbit { .. } => "orbits",
        Rig::Frame { .. } => "frames all",
        Rig::File { .. } => "from a file",
    }
}
