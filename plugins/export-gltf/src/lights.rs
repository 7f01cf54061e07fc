//! Lights (KHR_lights_punctual): the stage's lights as nodes of their own, the lights of imported files at their joints.

use crate::document::{Index, Node};
use crate::{actors, actors::Parts};
use choreo_exporter_kit::bake::Baked;
use choreo_exporter_kit::bake::signals::{LightPart, Quantity, rotation_towards};
use choreo_plugin::asset::{Light, LightKind};
use choreo_plugin::glam::{Quat, Vec3};
use choreo_plugin::motion::Transform;
use choreo_plugin::stage::{LightState, Stage, default_sun};
use serde_json::{Map, Value, json};

#[derive(Default)]
pub(crate) struct Lights {
    pub list: Vec<Value>,
}

/// A light of the stage, with its node and index in the document.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightNode {
    pub light: usize,
    pub kind: LightKind,
    pub node: Index,
    pub index: Index,
}

impl Lights {
    pub(crate) fn add(&mut self, name: &str, light: &Light) -> Index {
        let mut out = Map::new();
        out.insert("name".into(), name.into());
        // All light types of KHR_lights_punctual. Another kind would have to be written as one of these, and reported as a loss.
        let of_type = match light.kind {
            LightKind::Directional => "directional",
            LightKind::Point => "point",
            LightKind::Spot { .. } => "spot",
        };
        out.insert("type".into(), of_type.into());
        if light.color != Vec3::ONE {
            out.insert("color".into(), json!(light.color.to_array()));
        }
        if light.intensity != 1.0 {
            out.insert("intensity".into(), light.intensity.into());
        }
        if let (Some(range), false) = (light.range, light.kind.is_directional()) {
            out.insert("range".into(), range.into());
        }
        if let Some([inner, outer]) = light.kind.cone() {
            out.insert("spot".into(), json!({ "innerConeAngle": inner, "outerConeAngle": outer }));
        }
        self.list.push(out.into());
        self.list.len() as Index - 1
    }
}

/// Adds the lights of the stage, or the default sun of a stage without lights.
pub(crate) fn of_stage(parts: &mut Parts<'_>, stage: &Stage, baked: &Baked<'_>) -> Vec<LightNode> {
    let in_files = stage.actors.iter().any(|a| a.file_lights && !a.asset.lights.is_empty());
    if stage.lights.is_empty() && stage.sky.is_none() && !in_files {
        let sun = default_sun();
        add(parts, "sun", &sun.light, Some(rotation_towards(sun.direction)), Vec3::ZERO);
    }
    let mut out = Vec::new();
    for (light, of) in stage.lights.iter().enumerate() {
        if of.shadow.is_some() {
            parts.losses.insert("how shadows are drawn");
        }
        if of.attenuation.is_some() {
            parts.losses.insert("attenuation other than 1 / d²");
        }
        let state: Option<LightState> = baked.lights.get(light).copied().flatten();
        let series = |part| baked.series_of(Quantity::Light { light, part });
        let dark = Light { intensity: 0.0, ..of.light };
        let mut now = state.map_or(dark, |state| state.light);
        let (mut position, mut rotation) = match &state {
            Some(state) => (state.position.as_vec3(), rotation_towards(state.direction)),
            None => (of.position.as_vec3(), rotation_towards(of.direction)),
        };
        if let Some(first) = series(LightPart::Position) {
            position = Vec3::from_slice(first.first());
        }
        if let Some(first) = series(LightPart::Rotation) {
            rotation = Quat::from_slice(first.first());
        }
        if let (LightKind::Spot { inner, outer }, Some(cone)) = (&mut now.kind, series(LightPart::Outer)) {
            // The state at the start may be of a moment when the spot is off, so the angle comes from the first key.
            *outer = cone.first()[0].max(1e-3);
            *inner = inner.min(*outer * 0.999);
        }
        let turned = now.kind.has_direction().then_some(rotation);
        let position = if now.kind.is_directional() { Vec3::ZERO } else { position };
        let (node, index) = add(parts, &of.name, &now, turned, position);
        out.push(LightNode { light, kind: now.kind, node, index });
    }
    out
}

fn add(
    parts: &mut Parts<'_>,
    name: &str,
    light: &Light,
    rotation: Option<Quat>,
    translation: Vec3,
) -> (Index, Index) {
    let index = parts.lights.add(name, light);
    let extensions = json!({ "KHR_lights_punctual": { "light": index } });
    let at = Transform { translation, rotation: rotation.unwrap_or(Quat::IDENTITY), scale: Vec3::ONE };
    let node = Node {
        name: name.into(),
        extensions: Some(Box::new(extensions)),
        ..actors::node_with_transform(&at)
    };
    let node = parts.push(node);
    parts.at_root(node);
    (node, index)
}
