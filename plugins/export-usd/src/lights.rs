//! Lights (UsdLux): the stage's lights, the lights of imported files, ambient light and the sky.

use crate::frames::Frames;
use crate::joints;
use crate::layer::{ASSET, Attribute, BOOL, COLOR3F, FLOAT, Prim, Property, TOKEN, Value};
use crate::model::Common;
use crate::motion::{add_transform_ops, animate, series_samples};
use crate::names::Names;
use choreo_exporter_kit::bake::rig;
use choreo_exporter_kit::bake::signals::{LightPart, Quantity, rotation_towards};
use choreo_exporter_kit::{Baked, losses};
use choreo_plugin::ExportError;
use choreo_plugin::asset::{Asset, Light, LightKind};
use choreo_plugin::glam::{DAffine3, Quat, Vec3};
use choreo_plugin::motion::Transform;
use choreo_plugin::stage::{Stage, default_sun};
use std::collections::BTreeSet;

/// Radius of point and spot lights, which USD has as spheres, metres.
const LIGHT_RADIUS: f32 = 0.01;
/// Intensity of a normalized sphere light for one candela. The luminance is intensity ÷ 4πr², and a viewer sees a disk of πr².
const SPHERE_INTENSITY_PER_CANDELA: f32 = 4.0;

pub(crate) fn of_stage<'a>(
    stage: &Stage,
    baked: &Baked<'_>,
    (frames, names): (Frames, &mut Names),
    losses: &mut BTreeSet<&'static str>,
) -> Vec<Prim<'a>> {
    let mut out = Vec::new();
    let in_files = stage.actors.iter().any(|a| a.file_lights && !a.asset.lights.is_empty());
    if stage.lights.is_empty() && stage.sky.is_none() && !in_files {
        let sun = default_sun();
        let at = Transform { rotation: rotation_towards(sun.direction), ..Transform::IDENTITY };
        out.push(light(names.add_unique("sun"), &sun.light, &at).0);
    }
    for (number, stage_light) in stage.lights.iter().enumerate() {
        for (lost, what) in [
            (stage_light.shadow.is_some(), "how shadows are drawn"),
            (stage_light.attenuation.is_some(), "attenuation other than 1 / d²"),
            (stage_light.light.range.is_some(), "ranges of lights"),
        ] {
            if lost {
                losses.insert(what);
            }
        }
        out.push(of_light(stage, baked, number, (frames, names)));
    }
    let settings = &stage.settings;
    let mean_ambient = 0.5 * (settings.ambient_up + settings.ambient_down);
    if stage.sky.is_none() && mean_ambient != Vec3::ZERO {
        if settings.ambient_up != settings.ambient_down {
            losses.insert("the difference between ambient light from above and below");
        }
        let mut dome = Prim::new("DomeLight", names.add_unique("ambient"));
        dome.set_number(COLOR3F, "inputs:color", &(mean_ambient / mean_ambient.max_element()).to_array());
        dome.set_number(FLOAT, "inputs:intensity", &[mean_ambient.max_element()]);
        out.push(dome);
    }
    out
}

/// The sky as a dome light. The center of the image lies at +Z in USD, and at −Z here.
///
/// # Errors
/// The sky's image cannot be written as OpenEXR.
pub(crate) fn of_sky<'a>(
    stage: &Stage,
    baked: &Baked<'_>,
    (is_package, names): (bool, &mut Names),
    common: &mut Common,
) -> Result<Option<Prim<'a>>, ExportError> {
    let (Some(sky), Some(now)) = (&stage.sky, &baked.first.sky) else { return Ok(None) };
    losses::add(
        &[
            (!sky.channels.is_empty() || !stage.frame_callbacks.is_empty(), "changes of the sky"),
            (!sky.background, "a hidden sky (written as visible)"),
        ],
        &mut common.losses,
    );
    let mut dome = Prim::new("DomeLight", names.add_unique("sky"));
    let path = common.textures.sky(&now.panorama, is_package)?;
    dome.set(ASSET, "inputs:texture:file", Value::text(path));
    dome.set(TOKEN, "inputs:texture:format", Value::text("latlong"));
    dome.set_number(FLOAT, "inputs:intensity", &[now.strength]);
    let rotation = Quat::from_rotation_y(std::f32::consts::PI + now.turn as f32);
    add_transform_ops(&mut dome, &Transform { rotation, ..Transform::IDENTITY });
    Ok(Some(dome))
}

fn of_light<'a>(
    stage: &Stage,
    baked: &Baked<'_>,
    number: usize,
    (frames, names): (Frames, &mut Names),
) -> Prim<'a> {
    let stage_light = &stage.lights[number];
    let state = baked.lights.get(number).copied().flatten();
    let series = |part| baked.series_of(Quantity::Light { light: number, part });
    let now = state.map_or(Light { intensity: 0.0, ..stage_light.light }, |state| state.light);
    let (position, direction) = match &state {
        Some(state) => (state.position, state.direction),
        None => (stage_light.position, stage_light.direction),
    };
    let mut at = Transform { translation: position.as_vec3(), ..Transform::IDENTITY };
    if let Some(first) = series(LightPart::Position) {
        at.translation = Vec3::from_slice(first.first());
    }
    if now.kind.has_direction() {
        let turned = series(LightPart::Rotation).map(|first| Quat::from_slice(first.first()));
        at.rotation = turned.unwrap_or_else(|| rotation_towards(direction));
    }
    if now.kind.is_directional() {
        at.translation = Vec3::ZERO;
    }
    let (mut out, property_indices) = light(names.add_unique(&stage_light.name), &now, &at);
    let factor = if now.kind.is_directional() { 1.0 } else { SPHERE_INTENSITY_PER_CANDELA };
    for (part, property) in
        [(LightPart::Position, property_indices[0]), (LightPart::Rotation, property_indices[1])]
    {
        let has_it =
            if part == LightPart::Position { !now.kind.is_directional() } else { now.kind.has_direction() };
        if let Some(series) = series(part).filter(|series| !series.is_still() && has_it) {
            animate(&mut out, property, series_samples(series, frames, f64::from));
        }
    }
    for (part, name, factor) in [
        (LightPart::Color, "inputs:color", 1.0),
        (LightPart::Intensity, "inputs:intensity", factor),
        (LightPart::Outer, "inputs:shaping:cone:angle", 1f32.to_degrees()),
    ] {
        let moving = series(part).filter(|series| !series.is_still());
        if let Some(series) = moving.filter(|_| now.kind.cone().is_some() || part != LightPart::Outer)
            && let Some(property) = property_index(&out, name)
        {
            animate(&mut out, property, series_samples(series, frames, |v| f64::from(v) * f64::from(factor)));
        }
    }
    out
}

fn property_index(prim: &Prim<'_>, name: &str) -> Option<usize> {
    let is = |p: &Property<'_>| matches!(p, Property::Attribute(Attribute { name: own, .. }) if own == name);
    prim.properties.iter().position(is)
}

/// A light, and the indices of its translate, orient and scale properties.
fn light<'a>(name: String, light: &Light, at: &Transform) -> (Prim<'a>, [usize; 3]) {
    let of_type = match light.kind {
        LightKind::Directional => "DistantLight",
        LightKind::Point | LightKind::Spot { .. } => "SphereLight",
    };
    let mut out = Prim::new(of_type, name);
    out.set_number(COLOR3F, "inputs:color", &light.color.to_array());
    if light.kind.is_directional() {
        // A distant light: its intensity is the illuminance.
        out.set_number(FLOAT, "inputs:angle", &[0.0]);
        out.set_number(FLOAT, "inputs:intensity", &[light.intensity]);
        out.set_number(BOOL, "inputs:normalize", &[1.0]);
    } else {
        out.set_number(FLOAT, "inputs:intensity", &[light.intensity * SPHERE_INTENSITY_PER_CANDELA]);
        out.set_number(BOOL, "inputs:normalize", &[1.0]);
        out.set_number(FLOAT, "inputs:radius", &[LIGHT_RADIUS]);
        out.set_number(BOOL, "treatAsPoint", &[1.0]);
    }
    if let Some([inner, outer]) = light.kind.cone() {
        out.api.push("ShapingAPI");
        out.set_number(FLOAT, "inputs:shaping:cone:angle", &[outer.to_degrees()]);
        let softness = (1.0 - inner / outer.max(1e-6)).clamp(0.0, 1.0);
        out.set_number(FLOAT, "inputs:shaping:cone:softness", &[softness]);
    }
    let property_indices = add_transform_ops(&mut out, at);
    (out, property_indices)
}

/// Adds the lights of an actor's file, placed at their joints in the pose at the start.
pub(crate) fn of_file(prim: &mut Prim<'_>, asset: &Asset, still: &[Transform]) {
    let in_model = joints::in_model(asset, still);
    let mut names = Names::default();
    for file_light in &asset.lights {
        let Some(at) = in_model.get(file_light.joint as usize) else { continue };
        let at = rig::decompose(&DAffine3::from_mat4(*at), &Transform::IDENTITY);
        let name = names.add_unique(&format!("light {}", file_light.name));
        prim.children.push(light(name, &file_light.light, &at).0);
    }
}
