//! Inspector fields of a camera: its position and target, or its motion around or after a target.

use super::fields::{self, StatedValues};
use super::hint::Hint;
use super::rig::CallChange;
use super::values;
use crate::app::Viewer;
use crate::editing::{FieldChange, StatedCall, expression};
use crate::state::selection::Selected;
use choreo_script::quoted;
use choreo_session::edit::NewValueSyntax;
use choreo_stage::{Camera, Property, Rig, RigOption, Target};
use egui::{Grid, Ui};
use glam::DVec3;

/// An edit by the user: of the camera itself, or of the call that moves it.
pub(super) enum CameraChange {
    Field(FieldChange),
    Call(CallChange),
}

/// Shows the fields. `key_button`: draws the button that sets a key of the property with this name.
pub(super) fn show(
    ui: &mut Ui,
    viewer: &Viewer,
    stated: &StatedValues,
    camera: &Camera,
    mut key_button: impl FnMut(&mut Ui, &'static str),
) -> Option<CameraChange> {
    let mut edit = None;
    Grid::new("camera").num_columns(2).show(ui, |ui| {
        edit = match &camera.rig {
            Rig::Fixed { position, look_at, .. } => {
                let moved =
                    fixed_camera_fields(ui, viewer, stated, camera, (*position, look_at), &mut key_button);
                moved.map(CameraChange::Field)
            }
            Rig::Orbit { target, .. } => motion_fields(ui, viewer, camera, "orbit", |ui, call| {
                let of = rig_option_fields(ui, viewer, call, &Rig::ORBIT);
                target_field(ui, viewer, call, target).or(of)
            }),
            Rig::Frame { .. } => motion_fields(ui, viewer, camera, "frame", |ui, call| {
                rig_option_fields(ui, viewer, call, &Rig::FRAME)
            }),
            Rig::Follow { target, offset } => motion_fields(ui, viewer, camera, "follow", |ui, call| {
                let stated = call.arguments[1].as_deref();
                let to = point_field(ui, ["offset", "camera offset"], *offset, stated);
                let to = to.map(|text| FieldChange::Argument(1, text));
                target_field(ui, viewer, call, target).or(to)
            }),
            Rig::File { .. } => None,
        };
    });
    edit
}

/// Position and target of a camera that no rig moves; at the playhead if they have keys.
fn fixed_camera_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    stated: &StatedValues,
    camera: &Camera,
    (position, look_at): (DVec3, &Option<Target>),
    key_button: &mut impl FnMut(&mut Ui, &'static str),
) -> Option<FieldChange> {
    let keys = |property| camera.channels.iter().find(|channel| channel.property == property);
    let mut edit = None;
    let mut row = |ui: &mut Ui,
                   name: &'static str,
                   about: &str,
                   now: DVec3,
                   key: Option<&'static str>,
                   is_keyed: bool| {
        edit = fields::name_label(ui, stated, name, about).or(edit.take());
        ui.horizontal(|ui| {
            for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
                let label = format!("camera {name} {letter}");
                let Some(to) = values::number_field(ui, &label, now[axis], 0.01, -1e9..=1e9) else {
                    continue;
                };
                let mut all = now;
                all[axis] = to;
                edit = Some(match key.filter(|_| is_keyed) {
                    Some(key) => FieldChange::KeyedPoint(key, all, values::typed_number(ui, to)),
                    None => {
                        let written = stated.get(name).map(String::as_str);
                        let text = values::number_list_text(ui, written, &now.to_array(), axis, to);
                        let is_list = written.map_or(name == "look_at", |written| written.starts_with('['));
                        let text = if is_list { format!("[{text}]") } else { text };
                        FieldChange::Value(name, text, NewValueSyntax::Method)
                    }
                });
            }
            key.into_iter().for_each(|key| key_button(ui, key));
        });
        ui.end_row();
    };
    let place = keys(Property::Translation);
    let now = place.and_then(|keys| keys.at(viewer.playhead.time()));
    let at = now.map_or(position, |[x, y, z, _]| DVec3::new(x, y, z));
    row(ui, "at", "metres", at, Some("position"), place.is_some());
    if let (Some(Target::Point(point)), None) = (look_at, keys(Property::Rotation)) {
        row(ui, "look_at", "a point in world space, metres", *point, None, false);
    }
    edit
}

/// Fields of the call that moves a camera.
fn motion_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    camera: &Camera,
    name: &str,
    show: impl FnOnce(&mut Ui, &StatedCall) -> Option<FieldChange>,
) -> Option<CameraChange> {
    let what = Selected::Camera(camera.name.clone());
    let call = viewer.stated_calls(&what, &[name]).pop()?;
    show(ui, &call).map(|change| CameraChange::Call(CallChange(call, change)))
}

/// Numbers among the options of a call.
fn rig_option_fields(
    ui: &mut Ui,
    viewer: &Viewer,
    call: &StatedCall,
    all: &[RigOption],
) -> Option<FieldChange> {
    let (fps, mut edit) = (viewer.playhead.fps().as_fps(), None);
    for RigOption { name, unit, default, range: [low, high] } in all {
        edit = fields::name_label(ui, &call.values, name, "").or(edit);
        let written = call.values.get(*name);
        let now = written.map_or(Some(*default), |text| expression::evaluate(text, fps));
        ui.horizontal(|ui| {
            match now {
                Some(now) => {
                    let name_shown = format!("camera {name}");
                    let set = values::number_source_field(ui, &name_shown, now, 0.05, *low..=*high, written);
                    let change = |to| FieldChange::Value(name, to, NewValueSyntax::Option);
                    edit = set.map(change).or(edit.take());
                }
                // The script computes the value, so its source text is displayed.
                None => drop(ui.monospace(written.map_or("", String::as_str))),
            }
            ui.weak(*unit);
        });
        ui.end_row();
    }
    edit
}

/// Target of a camera: a point in world space, a whole actor, or one of its joints.
fn target_field(ui: &mut Ui, viewer: &Viewer, call: &StatedCall, target: &Target) -> Option<FieldChange> {
    /// Label of the choice of a whole actor.
    const WHOLE_ACTOR_LABEL: &str = "whole actor";
    let (actor, joint) = match target {
        Target::Point(at) => {
            let to = point_field(ui, ["center", "camera center"], *at, call.arguments[0].as_deref());
            return to.map(|text| FieldChange::Argument(0, text));
        }
        Target::Actor(actor) => (*actor, None),
        Target::Joint { actor, joint } => (*actor, Some(*joint as usize)),
    };
    let scene = viewer.scene.as_ref()?;
    let skeleton = &scene.stage.actors.get(actor)?.asset.skeleton;
    let now = joint.map_or(WHOLE_ACTOR_LABEL, |joint| skeleton.short_name(joint));
    let first = call.arguments[0].as_deref()?;
    ui.label("target").hint("the whole actor, or one of its joints");
    let mut edit = None;
    ui.horizontal(|ui| {
        ui.monospace(&scene.stage.actors[actor].name);
        let joints = (0..skeleton.names().len()).map(|joint| skeleton.short_name(joint));
        let chosen = fields::combo_box(ui, "joint", now, std::iter::once(WHOLE_ACTOR_LABEL).chain(joints));
        let variable = first.split(".joint(").next().unwrap_or(first);
        edit = chosen.map(|name| match name == WHOLE_ACTOR_LABEL {
            true => FieldChange::Argument(0, variable.to_string()),
            false => FieldChange::Argument(0, format!("{variable}.joint({})", quoted(&name))),
        });
    });
    ui.end_row();
    edit
}

/// Three number fields in a row, which return the source text of a point. `stated`: the present source text.
fn point_field(ui: &mut Ui, [label, name]: [&str; 2], now: DVec3, stated: Option<&str>) -> Option<String> {
    let mut edit = None;
    ui.label(label);
    ui.horizontal(|ui| {
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            if let Some(to) =
                values::number_field(ui, &format!("{name} {letter}"), now[axis], 0.01, -1e9..=1e9)
            {
                edit = Some(format!("[{}]", values::number_list_text(ui, stated, &now.to_array(), axis, to)));
            }
        }
        ui.weak("m");
    });
    ui.end_row();
    edit
}
