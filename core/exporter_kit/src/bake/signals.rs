//! Signals: numbers of a scene, apart from joints, that change with time: cameras, lights, materials, morph weights.

use crate::uv::UvParts;
use choreo_plugin::asset::{AlphaMode, Asset, Material, Projection, Shading, TextureRef};
use choreo_plugin::glam::{Quat, Vec3, Vec4};
use choreo_plugin::stage::{
    ActorState, Camera, CameraState, LightState, Property, Rig, Snapshot, Stage, Target,
};

/// The quantity that a signal holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quantity {
    /// A part of the active camera, or, if `dissolving`, of the outgoing camera of a dissolve.
    Camera {
        dissolving: bool,
        part: CameraPart,
    },
    /// A part of a light of the stage, by index.
    Light {
        light: usize,
        part: LightPart,
    },
    Material {
        actor: usize,
        material: u32,
        part: MaterialPart,
    },
    /// Morph weights of a mesh instance.
    Weights {
        actor: usize,
        instance: usize,
    },
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CameraPart {
    Position,
    Rotation,
    /// Vertical angle of view in radians (perspective), or height in metres (orthographic).
    Lens,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightPart {
    Position,
    Rotation,
    Color,
    Intensity,
    Range,
    Inner,
    Outer,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MaterialPart {
    BaseColor,
    Emissive,
    Metallic,
    Roughness,
    AlphaCutoff,
    NormalScale,
    OcclusionStrength,
    /// Transform of a texture slot.
    UvOffset(u8),
    UvRotation(u8),
    UvScale(u8),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    pub quantity: Quantity,
    /// Index of its first number in a row.
    pub offset: usize,
    pub width: usize,
    /// Largest error: radians for a rotation, else the difference of each number.
    pub tolerance: f32,
}

impl Signal {
    pub(crate) fn is_rotation(&self) -> bool {
        matches!(
            self.quantity,
            Quantity::Camera { part: CameraPart::Rotation, .. }
                | Quantity::Light { part: LightPart::Rotation, .. }
        )
    }

    /// Difference of two values, as a multiple of the allowed error.
    pub fn error(&self, a: &[f32], b: &[f32]) -> f32 {
        if self.is_rotation() {
            let (a, b) = (Quat::from_slice(a), Quat::from_slice(b));
            let chord = (a - b).length().min((a + b).length());
            return 2.0 * chord / self.tolerance;
        }
        a.iter().zip(b).map(|(a, b)| (a - b).abs() / self.tolerance).fold(0.0, f32::max)
    }

    pub fn is_near(&self, a: &[f32], b: &[f32]) -> bool {
        self.error(a, b) <= 1.0
    }

    /// Interpolates between two values: slerp for rotations, else linear.
    pub fn interpolate(&self, a: &[f32], b: &[f32], t: f32, out: &mut [f32]) {
        if self.is_rotation() {
            out.copy_from_slice(&Quat::from_slice(a).slerp(Quat::from_slice(b), t).to_array());
            return;
        }
        for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
            *out = a + (b - a) * t;
        }
    }
}

/// The signals of a stage; `tolerance` in metres.
pub fn of_stage(stage: &Stage, tolerance: f32, sampled_weights: impl Fn(usize) -> bool) -> Vec<Signal> {
    let mut out = Signals::default();
    let moves = stage.cameras.iter().any(|camera| !is_still(stage, camera));
    for dissolving in [false, true] {
        if !moves || dissolving && stage.cuts.iter().all(|cut| cut.dissolve.0 <= 0) {
            continue;
        }
        // A rotation of 1e-4 rad is a sixth of a pixel at 720 lines and 26°.
        for (part, width, allowed) in [
            (CameraPart::Position, 3, tolerance),
            (CameraPart::Rotation, 4, 1e-4),
            (CameraPart::Lens, 1, 1e-4),
        ] {
            out.add(Quantity::Camera { dissolving, part }, width, allowed);
        }
    }
    for (light, of) in stage.lights.iter().enumerate() {
        if of.channels.is_empty() && of.parent.is_none() && stage.frame_callbacks.is_empty() {
            continue;
        }
        let intensity = of.light.intensity.max(1.0) * 1e-3;
        for (part, width, allowed) in [
            (LightPart::Position, 3, tolerance),
            (LightPart::Rotation, 4, 1e-3),
            (LightPart::Color, 3, 2e-3),
            (LightPart::Intensity, 1, intensity),
            (LightPart::Range, 1, 1e-2),
            (LightPart::Inner, 1, 1e-3),
            (LightPart::Outer, 1, 1e-3),
        ] {
            out.add(Quantity::Light { light, part }, width, allowed);
        }
    }
    for (index, actor) in stage.actors.iter().enumerate() {
        let tinted =
            !stage.frame_callbacks.is_empty() || actor.channels.iter().any(|c| c.property == Property::Tint);
        let colors = actor.asset.animated_base_colors();
        let changing = actor.asset.changing_materials();
        for (number, material) in actor.asset.materials.iter().enumerate() {
            let is = |list: &[bool]| list.get(number).is_some_and(|is| *is);
            out.material(index, number as u32, material, [tinted || is(&colors), is(&changing)]);
        }
        if sampled_weights(index) {
            for (instance, of) in
                actor.asset.instances.iter().enumerate().filter(|(_, i)| !i.weights.is_empty())
            {
                let farthest = farthest_morph(&actor.asset, of.mesh as usize);
                let allowed = (0.5 * tolerance / farthest.max(1e-6)).min(0.01);
                out.add(Quantity::Weights { actor: index, instance }, of.weights.len(), allowed);
            }
        }
    }
    out.0
}

/// Whether a camera stands still, however long it is active.
pub fn is_still(stage: &Stage, camera: &Camera) -> bool {
    let still = match &camera.rig {
        Rig::Fixed { look_at, .. } => matches!(look_at, None | Some(Target::Point(_))),
        Rig::Frame { .. } => true,
        _ => false,
    };
    still
        && stage.frame_callbacks.is_empty()
        && camera.channels.is_empty()
        && camera.looks.is_empty()
        && camera.shakes.is_empty()
}

#[derive(Default)]
struct Signals(Vec<Signal>);

impl Signals {
    fn add(&mut self, quantity: Quantity, width: usize, tolerance: f32) {
        let offset = self.0.last().map_or(0, |last| last.offset + last.width);
        self.0.push(Signal { quantity, offset, width, tolerance });
    }

    fn material(&mut self, actor: usize, material: u32, of: &Material, [colored, changing]: [bool; 2]) {
        let mut add =
            |part, width, allowed| self.add(Quantity::Material { actor, material, part }, width, allowed);
        if colored || changing {
            add(MaterialPart::BaseColor, 4, 2e-3);
        }
        if !changing {
            return;
        }
        if !matches!(of.shading, Shading::Unlit | Shading::Toon) {
            add(MaterialPart::Emissive, 3, 2e-3);
        }
        if of.shading == Shading::MetallicRoughness {
            add(MaterialPart::Metallic, 1, 2e-3);
            add(MaterialPart::Roughness, 1, 2e-3);
        }
        if matches!(of.alpha_mode, AlphaMode::Mask(_)) {
            add(MaterialPart::AlphaCutoff, 1, 2e-3);
        }
        if of.normal_texture.is_some() {
            add(MaterialPart::NormalScale, 1, 2e-3);
        }
        if of.occlusion_texture.is_some() {
            add(MaterialPart::OcclusionStrength, 1, 2e-3);
        }
        for slot in (0..TEXTURE_SLOTS).filter(|slot| slot_of(of, *slot).is_some()) {
            add(MaterialPart::UvOffset(slot), 2, 2e-4);
            add(MaterialPart::UvRotation(slot), 1, 5e-4);
            add(MaterialPart::UvScale(slot), 2, 2e-4);
        }
    }
}

/// Metres that the farthest vertex moves at weight 1.
fn farthest_morph(asset: &Asset, mesh: usize) -> f32 {
    let morphs = asset.meshes.get(mesh).into_iter().flat_map(|m| &m.primitives).flat_map(|p| &p.morphs);
    let squares = morphs.flat_map(|m| &m.positions).map(|offset| offset.length_squared());
    squares.fold(0.0, f32::max).sqrt()
}

/// Texture slots of a material whose transforms can change: base color, metallic-roughness, normal, occlusion, emissive, specular,
/// specular color.
pub const TEXTURE_SLOTS: u8 = 7;

/// The texture of a slot.
pub fn slot_of(m: &Material, slot: u8) -> Option<&TextureRef> {
    let slots = [
        &m.base_color_texture,
        &m.metallic_roughness_texture,
        &m.normal_texture,
        &m.occlusion_texture,
        &m.emissive_texture,
        &m.specular_texture,
        &m.specular_color_texture,
    ];
    slots.get(slot as usize)?.as_ref()
}

/// The material of an actor in a snapshot, tint included.
pub fn material_now(asset: &Asset, state: &ActorState, material: u32) -> Material {
    let changed = state.materials.iter().find(|m| m.material == material).map(|m| m.now.clone());
    let of_asset = || asset.materials.get(material as usize).cloned().unwrap_or_default();
    let mut now = changed.unwrap_or_else(of_asset);
    if let Some(color) = state.base_colors.get(material as usize) {
        now.base_color = *color;
    }
    now.base_color = (now.base_color * state.tint).clamp(Vec4::ZERO, Vec4::ONE);
    now
}

/// Appends the values of all signals.
pub fn append(
    stage: &Stage,
    signals: &[Signal],
    snapshot: &Snapshot,
    lights: &[Option<LightState>],
    out: &mut Vec<f32>,
) {
    let mut known: Option<((usize, u32), Material)> = None;
    for signal in signals {
        match signal.quantity {
            Quantity::Camera { dissolving, part } => {
                let from = snapshot.dissolve.as_ref().filter(|_| dissolving).map(|d| &d.camera);
                camera(from.unwrap_or(&snapshot.camera), part, out);
            }
            Quantity::Light { light, part } => {
                let rest = &stage.lights[light];
                let dark = || LightState {
                    light: choreo_plugin::asset::Light { intensity: 0.0, ..rest.light },
                    position: rest.position,
                    direction: rest.direction,
                    shadow: None,
                    attenuation: None,
                };
                of_light(&lights.get(light).copied().flatten().unwrap_or_else(dark), part, out);
            }
            Quantity::Material { actor, material, part } => {
                if known.as_ref().is_none_or(|(key, _)| *key != (actor, material)) {
                    let asset = &stage.actors[actor].asset;
                    known = Some(((actor, material), material_now(asset, &snapshot.actors[actor], material)));
                }
                if let Some((_, now)) = &known {
                    of_material(now, part, out);
                }
            }
            Quantity::Weights { actor, instance } => {
                let weights = snapshot.actors[actor].morph_weights.get(instance);
                let from = out.len();
                out.extend(weights.into_iter().flatten());
                out.resize(from + signal.width, 0.0);
            }
        }
    }
}

pub fn camera(state: &CameraState, part: CameraPart, out: &mut Vec<f32>) {
    match part {
        CameraPart::Position => out.extend(state.world_from_view.translation.as_vec3().to_array()),
        CameraPart::Rotation => {
            let (_, rotation, _) = state.world_from_view.to_scale_rotation_translation();
            out.extend(rotation.as_quat().normalize().to_array());
        }
        CameraPart::Lens => out.push(match state.projection {
            Projection::Perspective { yfov, .. } => yfov,
            Projection::Orthographic { height, .. } => height,
        }),
    }
}

/// Rotation that turns −Z into a direction, with +Y up where possible.
pub fn rotation_towards(direction: Vec3) -> Quat {
    let back = -direction.normalize_or(Vec3::NEG_Y);
    let right = Vec3::Y.cross(back);
    let right = if right.length() < 1e-3 { Vec3::X } else { right.normalize() };
    let up = back.cross(right).normalize();
    Quat::from_mat3(&choreo_plugin::glam::Mat3::from_cols(up.cross(back), up, back)).normalize()
}

fn of_light(state: &LightState, part: LightPart, out: &mut Vec<f32>) {
    let cone = state.light.kind.cone().unwrap_or_default();
    match part {
        LightPart::Position => out.extend(state.position.as_vec3().to_array()),
        LightPart::Rotation => out.extend(rotation_towards(state.direction).to_array()),
        LightPart::Color => out.extend(state.light.color.to_array()),
        LightPart::Intensity => out.push(state.light.intensity),
        LightPart::Range => out.push(state.light.range.unwrap_or(0.0)),
        LightPart::Inner => out.push(cone[0]),
        LightPart::Outer => out.push(cone[1]),
    }
}

fn of_material(m: &Material, part: MaterialPart, out: &mut Vec<f32>) {
    let uv = |slot: u8| slot_of(m, slot).map(|t| UvParts::of(&t.uv_transform));
    let none = UvParts { offset: Default::default(), rotation: 0.0, scale: choreo_plugin::glam::Vec2::ONE };
    match part {
        MaterialPart::BaseColor => out.extend(m.base_color.to_array()),
        MaterialPart::Emissive => out.extend(m.emissive.max(Vec3::ZERO).to_array()),
        MaterialPart::Metallic => out.push(m.metallic.clamp(0.0, 1.0)),
        MaterialPart::Roughness => out.push(m.roughness.clamp(0.0, 1.0)),
        MaterialPart::AlphaCutoff => {
            out.push(if let AlphaMode::Mask(cutoff) = m.alpha_mode { cutoff } else { 0.5 })
        }
        MaterialPart::NormalScale => out.push(m.normal_scale),
        MaterialPart::OcclusionStrength => out.push(m.occlusion_strength.clamp(0.0, 1.0)),
        MaterialPart::UvOffset(slot) => out.extend(uv(slot).unwrap_or(none).offset.to_array()),
        MaterialPart::UvRotation(slot) => out.push(uv(slot).unwrap_or(none).rotation),
        MaterialPart::UvScale(slot) => out.extend(uv(slot).unwrap_or(none).scale.to_array()),
    }
}

/// Sets a part of a material.
pub fn set_material_part(m: &mut Material, part: MaterialPart, value: &[f32]) {
    match part {
        MaterialPart::BaseColor => m.base_color = Vec4::from_slice(value),
        MaterialPart::Emissive => m.emissive = Vec3::from_slice(value),
        MaterialPart::Metallic => m.metallic = value[0],
        MaterialPart::Roughness => m.roughness = value[0],
        MaterialPart::AlphaCutoff => m.alpha_mode = AlphaMode::Mask(value[0]),
        MaterialPart::NormalScale => m.normal_scale = value[0],
        MaterialPart::OcclusionStrength => m.occlusion_strength = value[0],
        MaterialPart::UvOffset(slot) => {
            set_uv(m, slot, |uv| uv.offset = choreo_plugin::glam::Vec2::from_slice(value))
        }
        MaterialPart::UvRotation(slot) => set_uv(m, slot, |uv| uv.rotation = value[0]),
        MaterialPart::UvScale(slot) => {
            set_uv(m, slot, |uv| uv.scale = choreo_plugin::glam::Vec2::from_slice(value))
        }
    }
}

fn set_uv(m: &mut Material, slot: u8, change: impl FnOnce(&mut UvParts)) {
    let slots = [
        &mut m.base_color_texture,
        &mut m.metallic_roughness_texture,
        &mut m.normal_texture,
        &mut m.occlusion_texture,
        &mut m.emissive_texture,
        &mut m.specular_texture,
        &mut m.specular_color_texture,
    ];
    if let Some(texture) = slots.into_iter().nth(slot.into()).and_then(Option::as_mut) {
        let mut parts = UvParts::of(&texture.uv_transform);
        change(&mut parts);
        texture.uv_transform = choreo_plugin::stage::uv_transform(parts.offset, parts.rotation, parts.scale);
    }
}
