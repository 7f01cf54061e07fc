//! Lights at a time: those of the stage and of files, or a default sun if there are no lights and no sky.

pub(crate) mod sky;

use crate::properties;
use crate::snapshot::{ActorState, LightState};
use crate::stage::Stage;
use crate::stage::actor::{Actor, Attachment};
use crate::stage::channel::Property;
use crate::stage::channel::{keyed_value, vec3};
use crate::stage::edits::{FrameEdits, LightEdit, edits_for_index};
use crate::stage::light::{Shadow, StageLight};
use crate::stage::parenting::ParentScale;
use crate::transforms::parents::world_from_parent;
use crate::transforms::world_from_attachment;
use choreo_asset::{Light, LightKind};
use choreo_motion::{PropertyTarget, Time};
use glam::{DQuat, DVec3, Vec3};

/// Default illuminance of suns, lux. A white surface that faces a sun of π lux has a luminance of 1. With the default ambient light of 0.45
/// from above, a white surface that faces this sun has 1.15, which the view transform shows as 243 of 255; #808080 on level ground shows as
/// 118.
pub const DEFAULT_SUN_LUX: f32 = 2.2;

/// The sun of a stage without lights: from over the left shoulder of a camera in front.
pub fn default_sun() -> LightState {
    let color = Vec3::new(1.0, 0.95, 0.88);
    LightState {
        light: Light { kind: LightKind::Directional, color, intensity: DEFAULT_SUN_LUX, range: None },
        position: DVec3::ZERO,
        direction: Vec3::new(0.48, -0.72, -0.504).normalize(),
        shadow: None,
        attenuation: None,
    }
}

impl Stage {
    /// Replaces the ambient light by the brightest one of the actors' files, component by component, if any file has ambient light.
    pub fn use_ambient_light_of_files(&mut self) {
        let shining = self.actors.iter().filter(|actor| actor.file_lights);
        let brightest = shining.fold(Vec3::ZERO, |most, actor| most.max(actor.asset.ambient));
        if brightest != Vec3::ZERO {
            (self.settings.ambient_up, self.settings.ambient_down) = (brightest, brightest);
        }
    }
}

/// Fills `out` with the lights that shine at a time.
pub(crate) fn evaluate_lights(
    stage: &Stage,
    edits: &FrameEdits,
    time: Time,
    actors: &[ActorState],
    out: &mut Vec<LightState>,
) {
    out.clear();
    for (index, light) in stage.lights.iter().enumerate() {
        out.extend(stage_light(stage, light, index, edits, time, actors));
    }
    let mut files_have_lights = false;
    for (index, (actor, state)) in stage.actors.iter().zip(actors).enumerate() {
        if !actor.file_lights {
            continue;
        }
        // A file with lights counts even while they do not shine: a default sun that appears when an actor leaves would surprise.
        files_have_lights |= !actor.asset.lights.is_empty();
        if !state.visible {
            continue;
        }
        for (number, light) in actor.asset.lights.iter().enumerate() {
            let shining = animated_light(actor, number as u32, light.light, time);
            if !shines(&shining) {
                continue;
            }
            let at = Attachment { actor: index, joint: Some(light.joint) };
            let world_from_light = world_from_attachment(stage, actors, &at);
            let direction = -world_from_light.matrix3.z_axis;
            out.extend(finite_light_state(shining, (None, None), world_from_light.translation, direction));
        }
    }
    if stage.lights.is_empty() && stage.sky.is_none() && !files_have_lights {
        out.push(default_sun());
    }
}

/// A file's light as animated by the actor's clips. Splines overshoot, so negative values are clamped.
fn animated_light(actor: &Actor, light_number: u32, light: Light, time: Time) -> Light {
    let color = properties::property_at(
        actor,
        PropertyTarget::LightColor(light_number),
        light.color.to_array(),
        time,
    );
    let intensity =
        properties::property_at(actor, PropertyTarget::LightIntensity(light_number), [light.intensity], time);
    let number =
        |target: PropertyTarget, rest: f32| properties::property_at(actor, target, [rest], time).map(|[v]| v);
    let range = number(PropertyTarget::LightRange(light_number), light.range.unwrap_or(0.0));
    let mut kind = light.kind;
    if let Some([inner, outer]) = kind.cone_mut() {
        // KHR_lights_punctual: 0 ≤ inner < outer ≤ π/2; splines overshoot.
        let most = std::f32::consts::FRAC_PI_2;
        let at = |target, rest| number(target, rest).unwrap_or(rest).clamp(0.0, most);
        *outer = at(PropertyTarget::SpotOuter(light_number), *outer).max(1e-3);
        *inner = at(PropertyTarget::SpotInner(light_number), *inner).min(*outer - 1e-3).max(0.0);
    }
    Light {
        kind,
        range: range.map_or(light.range, |r| (r > 0.0).then_some(r)),
        color: color.map_or(light.color, |c| Vec3::from_array(c).max(Vec3::ZERO)),
        intensity: intensity.map_or(light.intensity, |[i]| i.max(0.0)),
    }
}

/// A light with its keys, edits and parent applied; `None` if it does not shine.
pub(crate) fn stage_light(
    stage: &Stage,
    light: &StageLight,
    index: usize,
    edits: &FrameEdits,
    time: Time,
    actors: &[ActorState],
) -> Option<LightState> {
    let key = |property| keyed_value(&light.channels, property, time);
    let mut shining = light.light;
    let mut position = key(Property::Translation).map_or(light.position, vec3);
    // The rotation turns −Z, as in glTF.
    let direction =
        key(Property::Rotation).map_or(light.direction.as_dvec3(), |q| DQuat::from_array(q) * DVec3::NEG_Z);
    shining.intensity = key(Property::Intensity).map_or(shining.intensity, |v| v[0] as f32);
    shining.color = key(Property::Color).map_or(shining.color, |v| vec3(v).as_vec3());
    shining.range = key(Property::Range).map_or(shining.range, |v| Some((v[0] as f32).max(1e-3)));
    if let (Some([inner, outer]), Some(v)) = (shining.kind.cone_mut(), key(Property::Cone)) {
        // The inner angle keeps its ratio to the outer angle.
        let wide = (v[0] as f32).clamp(1e-3, std::f32::consts::FRAC_PI_2);
        (*inner, *outer) = (wide * (*inner / *outer), wide);
    }
    if key(Property::Visible).is_some_and(|v| v[0] < 0.5) {
        return None;
    }
    for edit in edits_for_index(&edits.lights, index) {
        match *edit {
            LightEdit::Intensity(intensity) => shining.intensity = intensity,
            LightEdit::Color(color) => shining.color = color,
            LightEdit::MoveTo(to) => position = to,
        }
    }
    if !shines(&shining) {
        return None;
    }
    match &light.parent {
        Some(parent) => {
            let world_from_parent = world_from_parent(stage, actors, parent, ParentScale::Keep);
            let direction = world_from_parent.matrix3 * direction;
            finite_light_state(
                shining,
                (light.shadow, light.attenuation),
                world_from_parent.transform_point3(position),
                direction,
            )
        }
        None => finite_light_state(shining, (light.shadow, light.attenuation), position, direction),
    }
}

fn shines(light: &Light) -> bool {
    light.intensity > 0.0 && light.color.max_element() > 0.0
}

/// State of a light; `None` if its position is not finite. A light without a valid direction points down.
fn finite_light_state(
    light: Light,
    (shadow, attenuation): (Option<Shadow>, Option<[f32; 3]>),
    position: DVec3,
    direction: DVec3,
) -> Option<LightState> {
    let direction = direction.as_vec3().normalize_or(Vec3::NEG_Y);
    position.is_finite().then_some(LightState { light, position, direction, shadow, attenuation })
}
