//! Where a camera stands and looks, or how it moves with a target: fields of the inspector.

use super::fields::{self, Stated};
use super::rig::CallChange;
use super::values;
use crate::app::Viewer;
use crate::editing::FieldChange;
use crate::state::selection::Selected;
use choreo_session::edit::{Anew, format_number};
use choreo_stage::{Camera, Property, Rig, Target};
use egui::{Grid, Ui};
use glam::DVec3;

/// Options of `.orbit(target, …)`: name, unit, default, least and greatest.
const ORBIT: [(&str, &str, f64, f64, f64); 4] = [
    ("distance", "m", 4.0, 1e-3, 1e6),
    ("elevation", "°", 15.0, -89.0, 89.0),
    ("azimuth", "° at 0 s", 0.0, -1e5, 1e5),
    ("speed", "° a second", 20.0, -1e5, 1e5),
];
/// Options of `.frame(…)`.
const FRAME: [(&str, &str, f64, f64, f64); 2] =
    [("azimuth", "°", 25.0, -1e5, 1e5), ("elevation", "°", 10.0, -89.0, 89.0)];

/// The change that the user makes: of the camera itself, or of a call that moves it.
pub enum CameraChange {
    Field(FieldChange),
    Call(CallChange),
}

/// `key_button`: draws the button that sets a key of a property of this name.
pub fn show(
    ui: &mut Ui,
    viewer: &Viewer,
    stated: &Stated,
    camera: &Camera,
    mut key_button: impl FnMut(&mut Ui, &'static str),
) -> Option<CameraChange> {
    let mut wanted = None;
    Grid::new("camera").num_columns(2).show(ui, |ui| {
        wanted = match &camera.rig {
            Rig::Fixed { position, look_at, .. } => {
                let moved = stands(ui, viewer, stated, camera, (*position, look_at), &mut key_button);
                moved.map(CameraChange::Field)
            }
            Rig::Orbit { .. } => options(ui, viewer, camera, "orbit", &ORBIT),
            Rig::Frame { .. } => options(ui, viewer, camera, "frame", &FRAME),
            Rig::Follow { offset, .. } => follows(ui, viewer, camera, *offset),
            Rig::File { .. } => None,
        };
    });
    wanted
}

/// Place and target of a camera that no rig moves; at the playhead where they are keyed.
fn stands(
    ui: &mut Ui,
    viewer: &Viewer,
    stated: &Stated,
    camera: &Camera,
    (position, look_at): (DVec3, &Option<Target>),
    key_button: &mut impl FnMut(&mut Ui, &'static str),
) -> Option<FieldChange> {
    let keys = |property| camera.channels.iter().find(|channel| channel.property == property);
    let mut wanted = None;
    let mut row = |ui: &mut Ui,
                   name: &'static str,
                   about: &str,
                   now: DVec3,
                   key: Option<&'static str>,
                   is_keyed: bool| {
        wanted = fields::label(ui, stated, name, about).or(wanted.take());
        ui.horizontal(|ui| {
            for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
                let label = format!("camera {name} {letter}");
                let Some(to) = values::number(ui, &label, now[axis], 0.01, -1e9..=1e9) else { continue };
                let mut all = now;
                all[axis] = to;
                wanted = Some(match key.filter(|_| is_keyed) {
                    Some(key) => FieldChange::KeyedPoint(key, all),
                    None => {
                        let text = all.to_array().map(format_number).join(", ");
                        let written = stated.get(name);
                        let is_list = written.map_or(name == "look_at", |written| written.starts_with('['));
                        let text = if is_list { format!("[{text}]") } else { text };
                        FieldChange::Value(name, text, Anew::Method)
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
        row(ui, "look_at", "a point of the world, metres", *point, None, false);
    }
    wanted
}

/// The numbers among the options of the call that moves a camera.
fn options(
    ui: &mut Ui,
    viewer: &Viewer,
    camera: &Camera,
    call: &'static str,
    all: &[(&'static str, &'static str, f64, f64, f64)],
) -> Option<CameraChange> {
    let what = Selected::Camera(camera.name.clone());
    let call = viewer.stated_calls(&what, &[call]).pop()?;
    let (fps, mut wanted) = (viewer.playhead.fps().as_fps(), None);
    for (name, unit, usual, low, high) in all {
        wanted = fields::label(ui, &call.written, name, "").or(wanted);
        let written = call.written.get(*name);
        let now = written.map_or(Some(*usual), |text| crate::editing::expression::value(text, fps));
        ui.horizontal(|ui| {
            match now {
                Some(now) => {
                    let set = values::number(ui, &format!("camera {name}"), now, 0.05, *low..=*high);
                    let change = |to| FieldChange::Value(name, format_number(to), Anew::Option);
                    wanted = set.map(change).or(wanted.take());
                }
                // It is computed.
                None => drop(ui.monospace(written.map_or("", String::as_str))),
            }
            ui.weak(*unit);
        });
        ui.end_row();
    }
    wanted.map(|change| CameraChange::Call(CallChange(call, change)))
}

/// The offset of a camera that follows a target.
fn follows(ui: &mut Ui, viewer: &Viewer, camera: &Camera, offset: DVec3) -> Option<CameraChange> {
    let what = Selected::Camera(camera.name.clone());
    let call = viewer.stated_calls(&what, &["follow"]).pop()?;
    let mut wanted = None;
    ui.label("offset");
    ui.horizontal(|ui| {
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            let label = format!("camera offset {letter}");
            if let Some(to) = values::number(ui, &label, offset[axis], 0.01, -1e9..=1e9) {
                let mut all = offset;
                all[axis] = to;
                wanted =
                    Some(FieldChange::Second(format!("[{}]", all.to_array().map(format_number).join(", "))));
            }
        }
        ui.weak("m");
    });
    ui.end_row();
    wanted.map(|change| CameraChange::Call(CallChange(call, change)))
}
