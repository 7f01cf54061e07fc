//! MToon materials: `VRMC_materials_mtoon` 1.0, and `materialProperties` of VRM 0.x converted to it.

use crate::json::At;
use choreo_asset::{Material, Outline, Shading, TextureRef, Toon, UvMotion};
use choreo_importer_kit::color::linear_from_srgb;
use choreo_importer_kit::{Problem, Result, text};
use glam::{Vec2, Vec3};
use import_gltf::MaterialTextures;
use import_gltf::profile::Document;
use serde_json::json;
use std::cell::Cell;
use std::sync::Arc;

/// Counts materials with a drawing order of their own, which the renderers ignore.
#[derive(Default)]
pub(crate) struct DrawOrders(Cell<usize>);

impl DrawOrders {
    pub(crate) fn warn(&self, document: &Document<'_>) {
        if self.0.get() > 0 {
            let materials = text::count(self.0.get(), "material");
            let has = if self.0.get() == 1 { "has" } else { "have" };
            let what = "a drawing order for transparent parts, which are sorted back to front instead";
            document.warn("materials", format!("{materials} {has} {what}"));
        }
    }
}

/// Reads `VRMC_materials_mtoon` 1.0. Base color, normals, emission and alpha are plain glTF and read already.
pub(crate) fn read(
    at: &At<'_>,
    textures: &mut dyn MaterialTextures,
    material: &mut Material,
    orders: &DrawOrders,
) -> Result<()> {
    let d = Toon::default();
    let number = |key: &str, default: f32| at.number_or(key, default);
    let color = |key: &str, default: Vec3| -> Result<Vec3> { Ok(at.vec3_or(key, default)?.max(Vec3::ZERO)) };
    let mut texture = |slot: &'static str| -> Result<Option<TextureRef>> {
        at.get(slot).map_or(Ok(None), |info| textures.texture(slot, info.raw()))
    };
    let width_texture = texture("outlineWidthMultiplyTexture")?;
    let mode = at.text("outlineWidthMode").unwrap_or("none");
    let outline = Outline {
        width: number("outlineWidthFactor", 0.0)?,
        on_screen: mode == "screenCoordinates",
        width_texture,
        color: color("outlineColorFactor", Vec3::ZERO)?,
        lighting_mix: number("outlineLightingMixFactor", 1.0)?,
    };
    let toon = Toon {
        shade_color: color("shadeColorFactor", d.shade_color)?,
        shade_texture: texture("shadeMultiplyTexture")?,
        shading_shift: number("shadingShiftFactor", d.shading_shift)?,
        shading_shift_texture: texture("shadingShiftTexture")?,
        shading_shift_scale: at.part("shadingShiftTexture").number_or("scale", d.shading_shift_scale)?,
        shading_toony: number("shadingToonyFactor", d.shading_toony)?,
        gi_equalization: number("giEqualizationFactor", d.gi_equalization)?,
        matcap: color("matcapFactor", d.matcap)?,
        matcap_texture: texture("matcapTexture")?,
        rim_color: color("parametricRimColorFactor", d.rim_color)?,
        rim_fresnel_power: number("parametricRimFresnelPowerFactor", d.rim_fresnel_power)?,
        rim_lift: number("parametricRimLiftFactor", d.rim_lift)?,
        rim_texture: texture("rimMultiplyTexture")?,
        rim_lighting_mix: number("rimLightingMixFactor", d.rim_lighting_mix)?,
        outline: (mode != "none" && outline.width > 0.0).then_some(outline),
        uv_motion: None,
        uv_mask: texture("uvAnimationMaskTexture")?,
        uv_moved: Vec3::ZERO,
    };
    let motion = UvMotion {
        scroll: Vec2::new(
            number("uvAnimationScrollXSpeedFactor", 0.0)?,
            number("uvAnimationScrollYSpeedFactor", 0.0)?,
        ),
        rotation: number("uvAnimationRotationSpeedFactor", 0.0)?,
    };
    let toon = Toon { uv_motion: moving(motion), ..toon };
    let order =
        at.flag("transparentWithZWrite")? == Some(true) || number("renderQueueOffsetNumber", 0.0)? != 0.0;
    orders.0.set(orders.0.get() + usize::from(order));
    finish(at, toon, material)
}

/// Reads MToon of VRM 0.x. Colors are sRGB. Shift and toony have other meanings there, and are converted as UniVRM and three-vrm
/// migrate them to 1.0.
pub(crate) fn read_v0(
    at: &At<'_>,
    textures: &mut dyn MaterialTextures,
    material: &mut Material,
) -> Result<()> {
    let d = Toon::default();
    let (floats, vectors) = (at.part("floatProperties"), at.part("vectorProperties"));
    let images = at.part("textureProperties");
    let number = |key: &str, default: f32| floats.number_or(key, default);
    let color = |key: &str, default: Vec3| -> Result<Vec3> {
        let Some(rgb) = vectors.first::<3>(key)? else { return Ok(default) };
        Ok(Vec3::from(rgb.map(|c| linear_from_srgb(c.max(0.0)))))
    };
    // The main texture's tiling applies to all textures except the matcap. v points up.
    let tiling = vectors.first::<4>("_MainTex")?.unwrap_or([0.0, 0.0, 1.0, 1.0]);
    let transform = json!({ "KHR_texture_transform": {
        "offset": [tiling[0], 1.0 - tiling[1] - tiling[3]], "scale": [tiling[2], tiling[3]],
    } });
    let mut texture = |slot: &'static str| -> Result<Option<TextureRef>> {
        let Some(index) = images.index(slot)? else { return Ok(None) };
        let plain = tiling == [0.0, 0.0, 1.0, 1.0] || slot == "_SphereAdd";
        let info = if plain {
            json!({ "index": index })
        } else {
            json!({ "index": index, "extensions": transform })
        };
        textures.texture(slot, &info)
    };
    let (shift, toony) = (number("_ShadeShift", 0.0)?, number("_ShadeToony", 0.9)?);
    let toony = toony + (1.0 - toony) * (0.5 + 0.5 * shift);
    let mode = number("_OutlineWidthMode", 0.0)?;
    let outline = Outline {
        // Centimetres to metres.
        width: number("_OutlineWidth", 0.0)? * 0.01,
        on_screen: mode == 2.0,
        width_texture: texture("_OutlineWidthTexture")?,
        color: color("_OutlineColor", Vec3::ZERO)?,
        lighting_mix: if number("_OutlineColorMode", 0.0)? == 1.0 {
            number("_OutlineLightingMix", 1.0)?
        } else {
            0.0
        },
    };
    let toon = Toon {
        shade_color: color("_ShadeColor", Vec3::ZERO)?,
        shade_texture: texture("_ShadeTexture")?,
        shading_shift: -shift - (1.0 - toony),
        shading_toony: toony,
        gi_equalization: 1.0 - number("_IndirectLightIntensity", 1.0 - d.gi_equalization)?,
        matcap_texture: texture("_SphereAdd")?,
        rim_color: color("_RimColor", Vec3::ZERO)?,
        rim_fresnel_power: number("_RimFresnelPower", 1.0)?,
        rim_lift: number("_RimLift", 0.0)?,
        rim_texture: texture("_RimTexture")?,
        rim_lighting_mix: number("_RimLightingMix", 0.0)?,
        outline: (mode > 0.0 && outline.width > 0.0).then_some(outline),
        uv_mask: texture("_UvAnimMaskTexture")?,
        ..d
    };
    // v points up, and the rotation is in turns a second.
    let motion = UvMotion {
        scroll: Vec2::new(number("_UvAnimScrollX", 0.0)?, -number("_UvAnimScrollY", 0.0)?),
        rotation: number("_UvAnimRotation", 0.0)? * std::f32::consts::TAU,
    };
    let toon = Toon { uv_motion: moving(motion), ..toon };
    finish(at, toon, material)
}

/// The motion; `None` where nothing moves.
fn moving(motion: UvMotion) -> Option<UvMotion> {
    (motion.scroll != Vec2::ZERO || motion.rotation != 0.0).then_some(motion)
}

fn finish(at: &At<'_>, toon: Toon, material: &mut Material) -> Result<()> {
    let toon = Toon {
        uv_mask: toon.uv_mask.filter(|_| toon.uv_motion.is_some()),
        shading_shift: toon.shading_shift.clamp(-2.0, 2.0),
        shading_toony: toon.shading_toony.clamp(0.0, 1.0),
        gi_equalization: toon.gi_equalization.clamp(0.0, 1.0),
        rim_lighting_mix: toon.rim_lighting_mix.clamp(0.0, 1.0),
        ..toon
    };
    if !toon.is_finite() {
        return Err(Problem::new(at.place(), "has a factor that is not finite"));
    }
    material.shading = Shading::Toon;
    material.toon = Some(Arc::new(toon));
    Ok(())
}
