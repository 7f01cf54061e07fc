//! Everything about the selection at the playhead.

use crate::app::Viewer;
use crate::selection::{Selected, actor};
use choreo_live::Scene;
use choreo_stage::{Light, LightKind, Stage};
use egui::{Grid, RichText, Ui};
use glam::DVec3;

pub fn show(ui: &mut Ui, viewer: &mut Viewer) {
    let (Some(scene), Some(selection)) = (viewer.scene.clone(), viewer.selection.clone()) else {
        ui.label("select an actor, a bar, a camera or a light");
        return;
    };
    let line = super::script::line_of(viewer, &selection);
    let rows = rows(viewer, &scene, &selection);
    let title = match &selection {
        Selected::Actor(name) | Selected::Camera(name) => name.clone(),
        Selected::Cue { actor, .. } => format!("{actor}: {}", rows.first().map_or("", |r| r.1.as_str())),
        Selected::Light(index) => format!("light {}", index + 1),
        Selected::Effect(index) => {
            scene.stage.effects.get(*index).map_or_else(String::new, |e| e.plugin.clone())
        }
    };
    ui.label(RichText::new(title).heading());
    if let Some(line) = line {
        ui.label(RichText::new(format!("{}:{line}", scene.places.main)).weak().monospace());
    }
    Grid::new("inspector").num_columns(2).striped(true).show(ui, |ui| {
        for (name, value) in rows {
            ui.label(name);
            ui.monospace(value);
            ui.end_row();
        }
    });
}

fn point(p: DVec3) -> String {
    format!("{:.3} {:.3} {:.3}", p.x, p.y, p.z)
}

fn rows(viewer: &Viewer, scene: &Scene, selection: &Selected) -> Vec<(String, String)> {
    let stage = &scene.stage;
    let mut rows = Vec::new();
    let mut row = |name: &str, value: String| rows.push((name.to_string(), value));
    match selection {
        Selected::Actor(name) => of_actor(viewer, stage, name, &mut row),
        Selected::Cue { actor: name, layer, cue } => {
            let found = actor(stage, name).and_then(|a| stage.actors[a].layers.get(*layer)?.cues.get(*cue));
            if let Some(cue) = found {
                let now = viewer.playhead.time();
                row("clip", cue.clip.name.clone());
                row("from", viewer.shown_time(cue.start));
                if let Some(end) = cue.end {
                    row("until", viewer.shown_time(end));
                }
                row("fade in", format!("{} s", cue.fade_in.as_secs()));
                row("fade out", format!("{} s", cue.fade_out.as_secs()));
                row("speed", cue.speed.to_string());
                row("repeat", format!("{:?}", cue.repeat));
                row("trim", format!("{} to {} s", cue.trim.0.as_secs(), cue.trim.1.as_secs()));
                row("weight", cue.weight.to_string());
                let played = cue.played(now.max(cue.start));
                let played = choreo_motion::Time(i64::try_from(played).unwrap_or(i64::MAX));
                row("played so far", format!("{:.3} s", played.as_secs()));
            }
        }
        Selected::Camera(name) => {
            if let Some(camera) = stage.cameras.iter().find(|c| c.name == *name) {
                row("rig", rig_name(&camera.rig).into());
                row("projection", format!("{:?}", camera.projection));
                row("keys", camera.channels.len().to_string());
            }
            if let Some(shown) = &viewer.shown
                && shown
                    .snapshot
                    .camera
                    .camera
                    .and_then(|c| stage.cameras.get(c))
                    .is_some_and(|c| c.name == *name)
            {
                row("stands at", point(shown.snapshot.camera.world_from_view.translation));
            }
        }
        Selected::Light(index) => {
            if let Some(light) = stage.lights.get(*index) {
                row("kind", light_kind(&light.light).into());
                let c = light.light.color;
                row("color (linear)", format!("{:.3} {:.3} {:.3}", c.x, c.y, c.z));
                row("intensity", light.light.intensity.to_string());
            }
        }
        Selected::Effect(index) => {
            if let Some(used) = stage.effects.get(*index) {
                row("from", viewer.shown_time(used.start));
                if let Some(end) = used.end {
                    row("until", viewer.shown_time(end));
                }
                if let Some(plugin) = scene.registry.effect(&used.plugin) {
                    let now = viewer
                        .shown
                        .as_ref()
                        .and_then(|s| s.snapshot.effects.iter().find(|e| e.effect == *index));
                    let given = now.map_or(&used.parameters, |state| &state.parameters);
                    let values = choreo_render::effect_parameters(plugin.as_ref(), given);
                    for (option, value) in plugin.manifest().options.iter().zip(values) {
                        row(&option.name, value.to_string());
                    }
                }
            }
        }
    }
    rows
}

fn of_actor(viewer: &Viewer, stage: &Stage, name: &str, row: &mut impl FnMut(&str, String)) {
    let Some(index) = actor(stage, name) else { return };
    let found = &stage.actors[index];
    let asset = &found.asset;
    row("asset", asset.name.clone());
    row("joints", asset.skeleton.len().to_string());
    row("meshes, materials", format!("{}, {}", asset.meshes.len(), asset.materials.len()));
    if let Some(state) = viewer.shown.as_ref().and_then(|s| s.snapshot.actors.get(index)) {
        row("visible", state.visible.to_string());
        row("stands at", point(state.world_from_model.translation));
        let (scale, rotation, _) = state.world_from_model.to_scale_rotation_translation();
        row("rotation", format!("{:.3} {:.3} {:.3} {:.3}", rotation.x, rotation.y, rotation.z, rotation.w));
        row("scale", point(scale));
    }
    if let Some(parent) = found.parent {
        row("attached to", stage.actors[parent.actor].name.clone());
    }
    let now = viewer.playhead.time();
    for (number, layer) in found.layers.iter().enumerate() {
        let on = layer.cues.iter().rev().find(|c| c.start <= now && c.end.is_none_or(|end| now < end));
        let layer_name = if number == 0 { "base layer".to_string() } else { format!("layer {number}") };
        row(&layer_name, on.map_or("—".into(), |cue| cue.clip.name.clone()));
    }
    if !asset.clips.is_empty() {
        let names: Vec<&str> = asset.clips.iter().map(|c| c.name.as_str()).take(30).collect();
        row("clips", names.join("\n"));
    }
}

pub fn light_kind(light: &Light) -> &'static str {
    match light.kind {
        LightKind::Directional => "sun",
        LightKind::Point => "point light",
        LightKind::Spot { .. } => "spot light",
    }
}

fn rig_name(rig: &choreo_stage::Rig) -> &'static str {
    use choreo_stage::Rig::*;
    match rig {
        Fixed { .. } => "fixed",
        Follow { .. } => "follows",
        Orbit { .. } => "orbits",
        Frame { .. } => "frames all",
        File { .. } => "of a file",
    }
}
