//! The switches of the scene's shaders: one for each feature of the table, and those of passes and pipeline keys.

use super::{DeferredPass, InputTargets, LightLoop, PeelPass, SceneVariant};
use crate::plan::shader_features::{ALPHA, FEATURES, Feature, TextureSlot, holds, names};
use crate::plan::{Features, Glass};

/// The origin of a switch other than a feature's.
#[derive(Clone, Copy)]
pub enum SwitchSource {
    /// The switch is on exactly where a condition on features and earlier switches holds.
    Condition(&'static str),
    Variant(fn(&SceneVariant) -> bool),
    /// Set when modules other than the scene's are compiled.
    OtherModules,
}

/// A switch that is not a feature: another property that a scene shader is compiled for.
#[derive(Clone, Copy)]
pub struct Switch {
    pub name: &'static str,
    pub source: SwitchSource,
    /// Conditions on other switches, as in [`Feature`].
    pub needs: &'static [&'static str],
    /// The only features that may be on together with this switch.
    pub only: Option<Features>,
}

const fn derived(name: &'static str, condition: &'static str) -> Switch {
    Switch { name, source: SwitchSource::Condition(condition), needs: &[], only: None }
}

const fn variant(
    name: &'static str,
    is_on: fn(&SceneVariant) -> bool,
    needs: &'static [&'static str],
) -> Switch {
    Switch { name, source: SwitchSource::Variant(is_on), needs, only: None }
}

const fn pass(
    name: &'static str,
    is_on: fn(&SceneVariant) -> bool,
    only: Features,
    needs: &'static [&'static str],
) -> Switch {
    Switch { name, source: SwitchSource::Variant(is_on), needs, only: Some(only) }
}

/// The features that a shader keeps while it draws a surface into the G-buffer.
const GEOMETRY_PASS_FEATURES: Features = Features::ALL
    .without(
        Features::LIGHTS.with(Features::ALL_LAYERS).with(Features::EFFECT_JOINTS).with(Features::OUTLINE),
    )
    .without(
        Features::WIREFRAME.with(Features::THICK_LINES).with(Features::BLINN_PHONG).with(Features::TOON),
    );
const LIGHTING_PASS_FEATURES: Features = Features::METALLIC_ROUGHNESS
    .with(Features::LIGHTS)
    .with(Features::EMISSIVE)
    .with(Features::EFFECT_NORMALS);
const SHADOW_PASS_FEATURES: Features =
    Features::SKINNING.with(ALPHA).with(Features::EFFECT_NORMALS).with(Features::PRE_SKINNED);
/// All switches other than features. A condition may only name switches above it.
pub const SWITCHES: &[Switch] = &[
    pass(
        "INPUT_PASS",
        |v| v.inputs != InputTargets::No,
        SHADOW_PASS_FEATURES,
        &[
            "!SHADOW_PASS",
            "!PEELED",
            "!SURFACE",
            "!LIGHTING",
            "!GEOMETRY",
            "!LIGHT_PASS",
            "!BLEND",
            "!COVERAGE",
            "!TINT",
            "ALPHA_MASK || !BASE_COLOR_TEXTURE",
            "ALPHA_MASK || !TRIPLANAR",
            "ALPHA_MASK || !VERTEX_COLOR",
            "ALPHA_MASK || !UV_MOTION_MASK",
        ],
    ),
    variant("MOTION", |v| v.inputs == InputTargets::Motion, &["INPUT_PASS", "!PRE_SKINNED"]),
    derived("LIT", "METALLIC_ROUGHNESS || BLINN_PHONG || TOON"),
    derived("NORMAL", "LIT || OUTLINE || EFFECT_NORMALS || TRIPLANAR"),
    derived("TANGENT", "NORMAL_TEXTURE || CLEARCOAT_NORMAL_TEXTURE || ANISOTROPY"),
    variant("SURFACE", |v| v.key.surface != 0, &["!SHADOW_PASS", "!GEOMETRY"]),
    variant("DISPLACED", |v| v.key.displaced != 0, &["!LIGHT_PASS"]),
    variant("LIGHTING", |v| v.key.lighting != 0, &["LIT", "!TOON", "!GEOMETRY", "!LIGHT_PASS"]),
    derived("EFFECTS", "SURFACE || DISPLACED || LIGHTING"),
    derived("POSITION_OUT", "LIT || SURFACE || INPUT_PASS"),
    derived("NORMAL_OUT", "LIT || EFFECT_NORMALS"),
    variant(
        "GLASS_FILTER",
        |v| v.key.glass == Glass::Filter,
        &["TRANSMISSION", "!REFRACTION", "!GLASS_LIGHT"],
    ),
    variant("GLASS_LIGHT", |v| v.key.glass == Glass::Light, &["TRANSMISSION", "!REFRACTION"]),
    derived("GLASS", "GLASS_FILTER || GLASS_LIGHT"),
    variant("BLEND", |v| v.key.blend, &["!SHADOW_PASS", "!GEOMETRY", "!LIGHT_PASS"]),
    variant(
        "COVERAGE",
        |v| v.key.coverage,
        &["ALPHA_MASK", "!BLEND", "!TRANSMISSION", "!SHADOW_PASS", "!GEOMETRY"],
    ),
    variant("DOUBLE_SIDED", |v| v.key.double_sided, &["!LIGHT_PASS"]),
    variant(
        "TINT",
        |v| v.tint && !v.shadow_pass && v.inputs == InputTargets::No && v.deferred != DeferredPass::Light,
        &["!SHADOW_PASS", "!LIGHT_PASS"],
    ),
    variant("JOINTS_UNIFORM", |v| v.joints_uniform, &["SKIN"]),
    pass(
        "SHADOW_PASS",
        |v| v.shadow_pass,
        SHADOW_PASS_FEATURES,
        &[
            "!PEELED",
            "ALPHA_MASK || !BASE_COLOR_TEXTURE",
            "ALPHA_MASK || !TRIPLANAR",
            "ALPHA_MASK || !VERTEX_COLOR",
            "ALPHA_MASK || !UV_MOTION_MASK",
        ],
    ),
    variant("PEELED", |v| v.key.peeled, &["BLEND || TRANSMISSION", "!REFRACTION"]),
    pass(
        "GEOMETRY",
        |v| v.deferred == DeferredPass::Geometry,
        GEOMETRY_PASS_FEATURES,
        &["METALLIC_ROUGHNESS", "!PEELED"],
    ),
    pass(
        "LIGHT_PASS",
        |v| v.deferred == DeferredPass::Light,
        LIGHTING_PASS_FEATURES,
        &["METALLIC_ROUGHNESS", "!GEOMETRY"],
    ),
    variant("PEEL_PASS", |v| v.peel != PeelPass::No, &["PEELED"]),
    variant("MULTISAMPLED", |v| v.peel == PeelPass::Several, &["PEEL_PASS"]),
    variant("ONE_LIGHT", |v| v.lights == LightLoop::One && v.key.features.is_lit(), &["LIT", "!GEOMETRY"]),
    variant(
        "LIGHT_CLUSTERS",
        |v| v.lights == LightLoop::Clusters && v.key.features.is_lit(),
        &["LIT", "!ONE_LIGHT", "!LIGHTING", "!GEOMETRY"],
    ),
    Switch { name: "TEXTURES", source: SwitchSource::OtherModules, needs: &["EFFECTS"], only: None },
    Switch { name: "DITHER", source: SwitchSource::OtherModules, needs: &[], only: None },
    Switch { name: "FAULT_RECORDS", source: SwitchSource::OtherModules, needs: &["EFFECTS"], only: None },
    Switch { name: "SKY_BACKGROUND", source: SwitchSource::OtherModules, needs: &[], only: None },
    Switch { name: "SURFACE_INPUT", source: SwitchSource::OtherModules, needs: &[], only: None },
    Switch { name: "MOTION_INPUT", source: SwitchSource::OtherModules, needs: &[], only: None },
    Switch { name: "PICTURE", source: SwitchSource::OtherModules, needs: &[], only: None },
];

/// Names of all switches, features first.
pub fn switch_names() -> impl Iterator<Item = &'static str> {
    FEATURES.iter().map(|f| f.name).chain(SWITCHES.iter().map(|s| s.name))
}

/// Names of the switches of a variant that are on, as modules write them.
pub fn switches(variant: &SceneVariant) -> Vec<&'static str> {
    let on = names_of_switches_on(variant);
    debug_assert_eq!(broken_rule(&on), None, "{on:?}");
    on
}

fn names_of_switches_on(variant: &SceneVariant) -> Vec<&'static str> {
    let mut on: Vec<&'static str> = names(variant.key.features).collect();
    for switch in SWITCHES {
        let is_on = match switch.source {
            SwitchSource::Condition(condition) => holds(condition, |name| on.contains(&name)),
            SwitchSource::Variant(is_on) => is_on(variant),
            SwitchSource::OtherModules => false,
        };
        if is_on {
            on.push(switch.name);
        }
    }
    on
}

/// A rule of the table that a set of switches breaks. If there is one, the planner and the table disagree.
pub fn broken_rule(on: &[&str]) -> Option<String> {
    let of_features = FEATURES.iter().map(|f| (f.name, f.needs, None));
    let of_switches = SWITCHES.iter().map(|s| (s.name, s.needs, s.only));
    for (name, needs, only) in of_features.chain(of_switches).filter(|(name, ..)| on.contains(name)) {
        if let Some(condition) = needs.iter().find(|c| !holds(c, |name| on.contains(&name))) {
            return Some(format!("{name} needs {condition}"));
        }
        let beside = FEATURES.iter().find(|f| only.is_some_and(|o| !o.has(f.bit)) && on.contains(&f.name));
        if let Some(feature) = beside {
            return Some(format!("{} is on with {name}", feature.name));
        }
    }
    None
}

/// The generated module with the declarations of the material textures.
pub(super) fn texture_bindings() -> String {
    let mut text = String::new();
    for (feature, TextureSlot { slot, .. }) in FEATURES.iter().filter_map(|f| Some((f, f.texture?))) {
        let name = texture_name(feature);
        for (binding, suffix, kind) in
            [(1 + 2 * slot, "texture", "texture_2d<f32>"), (2 + 2 * slot, "sampler", "sampler")]
        {
            text += &format!(
                "@if({}) @group(3) @binding({binding}) var {name}_{suffix}: {kind};\n",
                feature.name
            );
        }
    }
    text
}

/// `base_color` of `BASE_COLOR_TEXTURE`.
fn texture_name(feature: &Feature) -> String {
    feature.name.trim_end_matches("_TEXTURE").to_lowercase()
}
