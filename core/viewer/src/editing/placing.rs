//! Edits that move, rotate and scale actors, and that set numbers of lights and effects. If a property has keys, the key at the playhead is edited;
//! an attached actor is moved in the space of its parent; an actor that faces a target is not rotated.

use crate::app::{Dragging, Viewer};
use crate::editing::EditError;
use crate::editing::fields::is_as_shown;
use crate::geometry::gizmo::Change;
use crate::state::history::ExpectedPlacement;
use crate::state::keyed::ValueText;
use crate::state::orbit::Orbit;
use crate::state::selection::{Selected, actor};
use choreo_asset::Projection;
use choreo_motion::Time;
use choreo_script::Place;
use choreo_session::PlacementOverride;
use choreo_session::edit::{
    Edit, EditRefused, EditTime, KeyValue, NewValueSyntax, ScriptObject, TypedNumber, format_as_meant,
    format_number, numbered_name,
};
use choreo_stage::{Actor, Camera, Placement, Property, Rig, Stage, StageLight};
use glam::{DAffine3, DQuat, DVec3};

/// Transform of an actor in the space of its parent at a time, including keys but not callbacks, root motion or paths.
pub fn placement_at(actor: &Actor, time: Time) -> Placement {
    let mut placement = actor.transform;
    for channel in &actor.channels {
        let Some([x, y, z, w]) = channel.at(time) else { continue };
        match channel.property {
            Property::Translation => placement.translation = DVec3::new(x, y, z),
            Property::Rotation => placement.rotation = DQuat::from_xyzw(x, y, z, w),
            Property::Scale => placement.scale = DVec3::new(x, y, z),
            _ => {}
        }
    }
    placement
}

/// A light at a time, including keys.
pub(crate) fn light_at(light: &StageLight, time: Time) -> StageLight {
    let mut now = light.clone();
    for channel in &light.channels {
        let Some([x, y, z, w]) = channel.at(time) else { continue };
        match channel.property {
            Property::Intensity => now.light.intensity = x as f32,
            Property::Color => now.light.color = DVec3::new(x, y, z).as_vec3(),
            Property::Translation => now.position = DVec3::new(x, y, z),
            // Unrotated lights shine along −Z, as in glTF.
            Property::Rotation => now.direction = (DQuat::from_xyzw(x, y, z, w) * DVec3::NEG_Z).as_vec3(),
            _ => {}
        }
    }
    now
}

/// Converts a change from world space to the space of a parent.
fn to_parent_space(change: Change, world_from_parent: &DAffine3) -> Change {
    match change {
        Change::Move(by) => Change::Move(world_from_parent.matrix3.inverse() * by),
        Change::Turn(by) => {
            let (_, turned, _) = world_from_parent.to_scale_rotation_translation();
            Change::Turn(turned.inverse() * by * turned)
        }
        // Scale is along the actor's own axes.
        Change::Scale(_) => change,
    }
}

/// The transform after a change, and the changed property.
fn apply_change(old: Placement, change: Change) -> (Placement, Property) {
    match change {
        Change::Move(by) => (Placement { translation: old.translation + by, ..old }, Property::Translation),
        Change::Turn(by) => (Placement { rotation: by * old.rotation, ..old }, Property::Rotation),
        Change::Scale(by) => (Placement { scale: old.scale * by, ..old }, Property::Scale),
    }
}

/// A camera, its position in the script, and the number of cameras that the same line creates.
pub(super) struct ScriptCamera {
    pub camera: Camera,
    pub place: Place,
    pub siblings: usize,
}

impl Viewer {
    /// Moves, rotates or scales an actor as dragged: along world axes, or along its own axes for scale.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn change_actor(&mut self, name: &str, change: Change) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let index = actor(&scene.stage, name).ok_or(EditError::ObjectGone)?;
        let in_parent = self.change_in_parent_space(&scene.stage.actors[index], index, change)?;
        let (done, name) = (self.place_actor(name, in_parent, None), name.to_string());
        self.retry_after_unroll(done, move |viewer| viewer.change_actor(&name, change))
    }

    /// Converts a change of an actor from world space to the space of its parent.
    fn change_in_parent_space(
        &self,
        found: &Actor,
        index: usize,
        change: Change,
    ) -> Result<Change, EditError> {
        let time = self.playhead.time();
        if let Some(parent) = found.parent_at(time).filter(|p| p.placement.is_some()) {
            let start = format_number(parent.start.as_secs());
            let why = format!("the calls after its .attach from {start} s place the actor now; change those");
            return Err(EditError::refused(why));
        }
        let parent = match found.parents.is_empty() {
            true => Some(DAffine3::IDENTITY),
            false => self.shown().and_then(|s| Some(s.snapshot.actors.get(index)?.world_from_parent)),
        };
        let parent = parent.filter(|parent| parent.matrix3.determinant().abs() > 1e-12);
        let parent = parent.ok_or_else(|| {
            EditError::refused("the parent of the actor is not shown; show the parent first")
        })?;
        Ok(to_parent_space(change, &parent))
    }

    /// Placement of the dragged actor. `None` if the script would not change.
    pub(crate) fn dragged_placement(&self, stage: &Stage) -> Option<PlacementOverride> {
        let Dragging { actor: name, drag, change } = self.dragging.as_ref()?;
        if *change == Change::none(drag.tool) {
            return None;
        }
        let index = actor(stage, name)?;
        let found = &stage.actors[index];
        let change = self.change_in_parent_space(found, index, *change).ok()?;
        let (to, property) = apply_change(placement_at(found, self.playhead.time()), change);
        Some(PlacementOverride::Actor { actor: index, property, to })
    }

    /// Like [`Viewer::change_actor`], but along the axes of the actor's parent. `typed`: the number that the user typed, if any.
    pub(crate) fn place_actor(
        &mut self,
        name: &str,
        change: Change,
        typed: Option<&TypedNumber>,
    ) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let index = actor(&scene.stage, name).ok_or(EditError::ObjectGone)?;
        let found = &scene.stage.actors[index];
        let place = scene.places.actors.get(index).cloned().unwrap_or_default();
        let siblings = scene.places.actors.iter().filter(|p| **p == place).count();
        let time = self.playhead.time();
        let old = placement_at(found, time);
        let (to, property) = apply_change(old, change);
        let (at, rotation) = (to.translation, to.rotation);
        let faces = found.face.is_some() && property == Property::Rotation;
        if !faces && found.channels.iter().any(|channel| channel.property == property) {
            let property = match change {
                Change::Move(_) => "position",
                Change::Turn(_) => "rotation",
                Change::Scale(_) => "scale",
            };
            let keyed = self.keyed_property(&Selected::Actor(name.to_string()), property)?;
            let value = match change {
                Change::Move(_) => keyed.text(time, &at.to_array()),
                Change::Turn(_) => ValueText::Rotation(rotation),
                Change::Scale(_) => ValueText::Scale(to.scale),
            };
            let step = self.text_step(&keyed, time, value)?;
            self.apply_steps(vec![match typed {
                Some(typed) => step.keeping_number(typed),
                None => step,
            }])?;
        } else {
            self.edit_call(&place, siblings, |text| {
                let object = ScriptObject::at(text, place.line, place.column)?;
                let made = match change {
                    Change::Move(by) => object.move_by(by, at),
                    Change::Turn(by) => match object.line_of_call("face") {
                        Some(line) => Err(face_rotation_refusal(line)),
                        None if faces => Err(face_rotation_refusal(place.line)),
                        None => Ok(object.turn_by(by)),
                    },
                    Change::Scale(_) => {
                        let even = (to.scale - to.scale.x).abs().max_element() < 1e-9;
                        let all = to.scale.to_array();
                        object.set("scale", &all[..if even { 1 } else { 3 }])
                    }
                };
                match typed {
                    Some(typed) => typed.keep(text, made),
                    None => made,
                }
            })?;
        }
        self.history.expected_placement =
            Some(ExpectedPlacement { actor: name.to_string(), time, at, rotation, line: place.line });
        Ok(())
    }

    /// The camera with this name.
    pub(super) fn script_camera(&self, name: &str) -> Result<ScriptCamera, EditError> {
        let scene = self.scene.as_ref().ok_or(EditError::NothingShown)?;
        let index = scene.stage.cameras.iter().position(|c| c.name == name).ok_or(EditError::ObjectGone)?;
        let place = scene.places.cameras.get(index).cloned().unwrap_or_default();
        let siblings = scene.places.cameras.iter().filter(|p| **p == place).count();
        Ok(ScriptCamera { camera: scene.stage.cameras[index].clone(), place, siblings })
    }

    /// The camera with this name. Fails if a rig moves it.
    pub(super) fn fixed_camera(&self, name: &str) -> Result<ScriptCamera, EditError> {
        let found = self.script_camera(name)?;
        match found.camera.rig {
            Rig::Fixed { .. } => Ok(found),
            _ => Err(EditError::refused_at(
                &found.place,
                "the camera moves by itself (orbit, follow, …); change that there",
            )),
        }
    }

    /// Writes the free camera into a camera of the script, as one edit: position (`.at`), target (`.look_at`) and lens, or the key at the playhead
    /// if one of them has keys.
    ///
    /// # Errors
    /// Fails as [`Viewer::change_actor`] does.
    pub fn set_camera(&mut self, name: &str, from: &Orbit) -> Result<(), EditError> {
        let ScriptCamera { camera, place, siblings } = self.fixed_camera(name)?;
        let keyed = camera.channels.iter().any(|c| c.property == Property::Translation);
        if camera.channels.iter().any(|c| c.property == Property::Rotation) {
            return Err(EditError::refused_at(
                &place,
                "the rotation of the camera has keys; change them there",
            ));
        }
        let time = self.playhead.time();
        let when = self.edit_time(time.as_secs());
        let (at, center) = (from.camera().world_from_view.translation, from.center);
        let projection = from.camera().projection;
        self.edit_call(&place, siblings, |text| {
            let object = ScriptObject::at(text, place.line, place.column)?;
            let target_edit = object.set_point("look_at", center)?;
            let text_with_target = target_edit.apply(text);
            // The start of the call does not move, since only text after it has changed.
            let object = ScriptObject::at(&text_with_target, place.line, place.column)?;
            let position_edit = match keyed {
                true => object.set_key("position", when, KeyValue::Point(at)),
                false => object.set("at", &at.to_array()),
            };
            let position_edit =
                position_edit.map_err(|refused| refused.before(text, std::slice::from_ref(&target_edit)))?;
            let text_with_position = position_edit.apply(&text_with_target);
            let object = ScriptObject::at(&text_with_position, place.line, place.column)?;
            let view_edit = projection_edit(&object, &camera, time, when, projection)
                .map_err(|refused| refused.before(text, &[target_edit, position_edit]))?;
            Ok(Edit::between(
                text,
                &view_edit.map_or_else(|| text_with_position.clone(), |edit| edit.apply(&text_with_position)),
            ))
        })
    }

    /// Adds a camera at the position of the free one, at the end of the script. If there are other cameras, it is active from the playhead on.
    ///
    /// # Errors
    /// Fails as [`Viewer::change_actor`] does.
    pub(crate) fn add_camera(&mut self, from: &Orbit) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let taken = |name: &str| scene.stage.cameras.iter().any(|c| c.name == name);
        let name = numbered_name("view", taken);
        let point = |p: DVec3| p.to_array().map(format_number).join(", ");
        let (at, center) = (point(from.camera().world_from_view.translation), point(from.center));
        let known = self.displayed_text().unwrap_or_default();
        let time = self.edit_time(self.playhead.time().as_secs()).written(&known);
        let cut = if scene.stage.cameras.is_empty() { String::new() } else { format!(".cut({time})") };
        let projection = match from.camera().projection {
            Projection::Perspective { yfov, .. } if is_default_yfov(yfov) => String::new(),
            Projection::Perspective { yfov, .. } => {
                format!(".fov({})", format_number(f64::from(yfov).to_degrees()))
            }
            Projection::Orthographic { height, .. } => format!(".ortho({})", format_number(height.into())),
        };
        self.add_line(&format!("camera(\"{name}\").at({at}).look_at([{center}]){projection}{cut};\n"))?;
        self.selection = Some(Selected::Camera(name));
        Ok(())
    }

    /// Sets the vertical field of view of a camera, degrees: `.fov`, or its key at the playhead. `written`: its source text.
    ///
    /// # Errors
    /// Fails as [`Viewer::change_actor`] does.
    pub fn set_field_of_view(&mut self, name: &str, degrees: f64, written: &str) -> Result<(), EditError> {
        let ScriptCamera { camera, place, siblings } = self.script_camera(name)?;
        let keyed = |property| camera.channels.iter().any(|c| c.property == property);
        let (in_angles, in_millimetres) = (keyed(Property::FieldOfView), keyed(Property::FocalLength));
        let is_meant = |read: f64| is_as_shown(Camera::yfov(read).to_degrees(), degrees);
        let length = format_as_meant(Camera::focal_length(degrees.to_radians()), is_meant);
        let when = self.edit_time(self.playhead.time().as_secs());
        self.edit_call(&place, siblings, |text| {
            let object = ScriptObject::at(text, place.line, place.column)?;
            if in_millimetres {
                return object.set_key("focal_length", when, KeyValue::Text(&length));
            }
            let states = |name| object.line_of_call(name).is_some();
            match in_angles {
                true => object.set_key("fov", when, KeyValue::Text(written)),
                // A `fov` before `focal_length` would have no effect.
                false if states("focal_length") && !states("fov") => {
                    object.set_value("focal_length", &length, NewValueSyntax::Method)
                }
                false if written == format_number(degrees) => object.set("fov", &[degrees]),
                false => object.set_value("fov", written, NewValueSyntax::Method),
            }
        })
    }

    /// Sets a parameter of an effect, or an option of a light or the sky; for keyed values, the key at the playhead. `value`: source text.
    pub fn set_value(&mut self, what: &Selected, name: &str, value: &str) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let sky_places = scene.places.sky.clone().into_iter().collect();
        let (places, index) = match what {
            Selected::Sky => (&sky_places, 0),
            Selected::Effect(index) => (&scene.places.effects, *index),
            Selected::Light(index) => (&scene.places.lights, *index),
            _ => {
                return Err(EditError::refused(
                    "only values of lights, effects and the sky can be set in this way",
                ));
            }
        };
        if matches!(what, Selected::Effect(_))
            && let Some(done) = self.set_keyed_parameter(what, name, value)
        {
            return done;
        }
        let place = places.get(index).cloned().unwrap_or_default();
        let siblings = places.iter().filter(|p| **p == place).count();
        let light = matches!(what, Selected::Light(_)).then(|| scene.stage.lights.get(index)).flatten();
        let property = match name {
            "intensity" => Some(Property::Intensity),
            "color" => Some(Property::Color),
            "position" => Some(Property::Translation),
            "direction" => Some(Property::Rotation),
            _ => None,
        };
        let of_sky = (*what == Selected::Sky).then(|| self.keyed_property(what, name)).transpose()?;
        if let Some(keyed) = of_sky.filter(|keyed| keyed.has_keys()) {
            let value = ValueText::Text(value.to_string());
            let step = self.text_step(&keyed, self.playhead.time(), value)?;
            return self.apply_steps(vec![step]);
        }
        let keyed = light.is_some_and(|l| l.channels.iter().any(|c| Some(c.property) == property));
        let when = self.edit_time(self.playhead.time().as_secs());
        self.edit_call(&place, siblings, |text| {
            let object = ScriptObject::at(text, place.line, place.column)?;
            match light {
                Some(_) if keyed => object.set_key(name, when, KeyValue::Text(value)),
                None if matches!(what, Selected::Effect(_)) => object.set_parameter(name, value),
                _ => object.set_option(name, value),
            }
        })
    }

    /// Tells the user if another line of the script overrides the edited placement.
    pub(crate) fn check_expected_placement(&mut self) {
        let Some(expected) = self.history.expected_placement.take() else { return };
        let scene = self.scene.as_ref();
        let Some((scene, index)) = scene.and_then(|s| Some((s, actor(&s.stage, &expected.actor)?))) else {
            return;
        };
        let now = placement_at(&scene.stage.actors[index], expected.time);
        // Edits write 3 decimal places.
        let is_as_expected = (now.translation - expected.at).length() < 0.01
            && now.rotation.dot(expected.rotation).abs() > 0.9999;
        self.message = (!is_as_expected).then(|| {
            let line = expected.line;
            format!(
                "line {line}: the change was written, but another line places \"{}\" again; Ctrl Z undoes it",
                expected.actor
            )
        });
    }
}

/// Whether a vertical field of view, in radians, is the default of cameras.
fn is_default_yfov(yfov: f32) -> bool {
    matches!(Projection::default(), Projection::Perspective { yfov: default_yfov, .. } if (default_yfov - yfov).abs() < 1e-5)
}

/// The edit that gives a camera the lens of a view: its field of view, or its height in parallel projection. `None` if it has that lens already.
fn projection_edit(
    object: &ScriptObject,
    camera: &Camera,
    time: Time,
    when: EditTime,
    projection: Projection,
) -> Result<Option<Edit>, EditRefused> {
    let key = |property| camera.channels.iter().find(|c| c.property == property);
    let keyed = key(Property::FieldOfView).or_else(|| key(Property::FocalLength));
    let ((name, value), is_same) = match (projection, camera.projection) {
        (Projection::Perspective { yfov, .. }, own) => {
            let (yfov, in_millimetres) = (f64::from(yfov), object.line_of_call("focal_length").is_some());
            let degrees = format_number(yfov.to_degrees());
            let length = format_number(Camera::focal_length(yfov));
            if let Some((channel, [now, ..])) = keyed.and_then(|channel| Some((channel, channel.at(time)?))) {
                let (name, now, value) = match channel.property {
                    Property::FocalLength => ("focal_length", Camera::yfov(now), length),
                    _ => ("fov", now, degrees),
                };
                let is_same = (now - yfov).abs() < 1e-4;
                return (!is_same).then(|| object.set_key(name, when, KeyValue::Text(&value))).transpose();
            }
            let is_same = matches!(own, Projection::Perspective { yfov: own, .. } if (f64::from(own) - yfov).abs() < 1e-4);
            (if in_millimetres { ("focal_length", length) } else { ("fov", degrees) }, is_same)
        }
        (Projection::Orthographic { .. }, _) if keyed.is_some() => {
            let in_millimetres = keyed.is_some_and(|channel| channel.property == Property::FocalLength);
            let name = if in_millimetres { "focal_length" } else { "fov" };
            let line = object.line_of_call("key").unwrap_or(object.place().0);
            let why =
                format!("the \"{name}\" of the camera has keys, which an orthographic camera cannot have");
            return Err(EditRefused::at(line, &why));
        }
        (Projection::Orthographic { height, .. }, own) => {
            let is_same = matches!(own, Projection::Orthographic { height: own, .. } if (height / own - 1.0).abs() < 1e-4);
            (("ortho", format_number(height.into())), is_same)
        }
    };
    let projection_methods = ["fov", "focal_length", "ortho"];
    (!is_same).then(|| object.set_one_of(&projection_methods, name, &value)).transpose()
}

fn face_rotation_refusal(line: usize) -> EditRefused {
    EditRefused::at(line, ".face(…) turns the actor; change or remove that call")
}
