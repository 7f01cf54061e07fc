//! Lights of a stage, and their shadows.

use crate::stage::actor::Attachment;
use crate::stage::channel::Channel;
use crate::stage::described::{FieldType, FieldValue, described};
use choreo_asset::{Light, LightKind};
use glam::{DVec3, Vec3};

described! {
    /// A light of the stage. By default it is at the origin and shines downwards, without a shadow.
    #[derive(Clone, Debug, PartialEq)]
    pub struct StageLight(
        /// Name in scripts.
        name: String => str,
        /// Kind, color and intensity.
        light: Light,
    ) {
        /// Position in the world, metres.
        position: DVec3 = DVec3::ZERO;
        /// Unit vector along which the light shines (directional and spot).
        direction: Vec3 = Vec3::NEG_Y;
        /// Settings of the shadow; `None`: the light shines through everything.
        shadow: Option<Shadow> = None;
        /// Coefficients (constant, linear, square) of the attenuation 1 / (constant + linear · d + square · d²), in place of 1 / d²; point
        /// and spot lights.
        attenuation: Option<[f32; 3]> = None;
        /// Actor or joint with which the light moves: position and direction are then in its space.
        parent: Option<Attachment> = None;
        /// Keyed properties.
        channels: Vec<Channel> = Vec::new();
    }
    fields {
        position: position, FieldType::Point, keys "position" Translation;
        /// in which it shines
        direction: direction, FieldType::Direction, keys "direction" Rotation, lacks all_around_reason;
        color: light.color, FieldType::Color, keys "color" Color;
        kelvin: [get |_: &StageLight| FieldValue::Unset, set |of: &mut StageLight, v| {
            crate::stage::described::FieldStorage::store(&mut of.light.color, v)
        }], FieldType::Kelvin, keys "kelvin" Color;
        /// lux for a sun, candela for the others
        intensity: light.intensity, FieldType::Number(0.0, 1e9, ""), keys "intensity" Intensity;
        range: light.range, FieldType::Number(1e-3, 1e9, "metres"), keys "range" Range, lacks shines_however_far;
        /// half angle of the cone
        outer: [get |of: &StageLight| half_angle(of, 1), set |of: &mut StageLight, v| set_cone(of, 1, v)], FieldType::Degrees(0.1, 90.0), keys "cone" Cone, lacks no_cone_reason;
        /// half angle of the cone at full intensity
        inner: [get |of: &StageLight| half_angle(of, 0), set |of: &mut StageLight, v| set_cone(of, 0, v)], FieldType::Degrees(0.0, 90.0), lacks no_cone_reason;
    }
}

described! {
    /// Settings of a light's shadow map.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Shadow {
        /// Largest side of the shadow map, texels.
        size: u32 = 2048;
        /// Width of the penumbra in metres, at any distance. `None`: a sun's penumbra follows from the size of its disc ([`SUN_ANGLE`]);
        /// other lights have [`Shadow::LAMP_SOFTNESS`].
        softness: Option<f32> = None;
    }
    fields {
        /// size of the shadow map
        size: size, FieldType::Number(64.0, 4096.0, "texels");
        /// width of the soft edge; by default 0.01, for a sun that of its disc of 0.53°: wider farther from the caster
        softness: softness, FieldType::Number(0.0, 100.0, "metres");
    }
}

/// Apparent diameter of the sun, radians (0.53°).
pub const SUN_ANGLE: f32 = 0.53 * std::f32::consts::PI / 180.0;

impl Shadow {
    /// Default penumbra width of point and spot lights, metres.
    pub const LAMP_SOFTNESS: f32 = 0.01;
    /// Allowed sizes of a shadow map.
    pub const SIZES: std::ops::RangeInclusive<u32> = 64..=4096;
}

fn shines_however_far(of: &StageLight) -> Option<&'static str> {
    of.light.kind.is_directional().then_some("a sun has no range")
}

fn all_around_reason(of: &StageLight) -> Option<&'static str> {
    (!of.light.kind.has_direction()).then_some("a point light shines in all directions")
}

fn no_cone_reason(of: &StageLight) -> Option<&'static str> {
    of.light.kind.cone().is_none().then_some("only a spot light has a cone")
}

fn set_cone(of: &mut StageLight, index: usize, angle: FieldValue) {
    if let (Some(cone), FieldValue::Number(radians)) = (of.light.kind.cone_mut(), angle) {
        *cone[index] = radians as f32;
    }
}

fn half_angle(of: &StageLight, index: usize) -> FieldValue {
    of.light.kind.cone().map_or(FieldValue::Unset, |cone| FieldValue::Number(cone[index].into()))
}

impl StageLight {
    /// A white directional light. `direction`: along which it shines, any length; `intensity`: lux.
    pub fn sun(name: &str, direction: Vec3, intensity: f32) -> StageLight {
        let light = Light { kind: LightKind::Directional, color: Vec3::ONE, intensity, range: None };
        StageLight { direction: direction.normalize_or(Vec3::NEG_Y), ..StageLight::new(name, light) }
    }

    /// A white point light. `position`: metres; `intensity`: candela.
    pub fn point(name: &str, position: DVec3, intensity: f32) -> StageLight {
        let light = Light { kind: LightKind::Point, color: Vec3::ONE, intensity, range: None };
        StageLight { position, ..StageLight::new(name, light) }
    }
}
