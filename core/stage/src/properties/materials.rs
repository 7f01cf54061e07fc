//! Animated materials: by clips (KHR_animation_pointer), by expressions (VRM's color and texture binds) and by themselves (MToon's UV
//! animation, frame strips). An actor without any of these costs one scan of its clips.

use crate::properties;
use crate::snapshot::ChangedMaterial;
use crate::stage::actor::Actor;
use choreo_asset::{Expression, Material, MaterialColor, TextureRef, Toon, UvMotion};
use choreo_motion::{MaterialProperty, PropertyTarget, Time};
use glam::{Affine2, Mat2, Vec2, Vec3, Vec4};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Fills `out` with the materials of an actor that are animated, at a time. `weights`: resolved weights of the asset's expressions.
pub(crate) fn find_changed_materials(
    actor: &Actor,
    weights: &[f32],
    time: Time,
    out: &mut Vec<ChangedMaterial>,
) {
    out.clear();
    let asset = &*actor.asset;
    let clips = actor.layers.iter().flat_map(|layer| &layer.cues).flat_map(|cue| cue.clip.properties());
    let driven: BTreeSet<(u32, MaterialProperty)> = clips
        .filter_map(|(target, _)| match target {
            PropertyTarget::Material(material, property) => Some((material, property)),
            _ => None,
        })
        .collect();
    let shown = || asset.expressions.iter().zip(weights).filter(|(_, w)| **w > 0.0);
    let moving = (0..).zip(&asset.materials).filter(|(_, m)| m.has_uv_animation()).map(|(i, _)| i);
    let mut all: BTreeSet<u32> = driven.iter().map(|(m, _)| *m).chain(moving).collect();
    all.extend(shown().flat_map(|(e, _)| e.changed_materials()));
    for index in all {
        let Some(material) = asset.materials.get(index as usize) else { continue };
        let mut now = material.clone();
        let range = (index, MaterialProperty::Emissive)..=(index, MaterialProperty::UvScale(u8::MAX));
        let properties: Vec<MaterialProperty> = driven.range(range).map(|(_, p)| *p).collect();
        apply_clips(actor, index, &properties, time, &mut now);
        for (expression, weight) in shown() {
            apply_expression(expression, *weight, index, material, &mut now);
        }
        if let Some(motion) = material.active_uv_motion() {
            apply_uv_motion(motion, time, &mut now);
        }
        if let Some(flipbook) = material.flipbook {
            let cell = flipbook.cell(time);
            for_each_texture(&mut now, |texture| texture.uv_transform = cell * texture.uv_transform);
        }
        out.push(ChangedMaterial { material: index, now });
    }
}

fn apply_clips(actor: &Actor, index: u32, properties: &[MaterialProperty], time: Time, now: &mut Material) {
    let mut strength = 1.0;
    for &property in properties {
        let target = PropertyTarget::Material(index, property);
        let number = |rest: f32| properties::property_at(actor, target, [rest], time).map_or(rest, |[v]| v);
        match property {
            MaterialProperty::Emissive => {
                let color = properties::property_at(actor, target, now.emissive.to_array(), time);
                now.emissive = color.map_or(now.emissive, |c| Vec3::from_array(c).max(Vec3::ZERO));
            }
            MaterialProperty::EmissiveStrength => strength = number(1.0).max(0.0),
            MaterialProperty::Metallic => now.metallic = number(now.metallic).clamp(0.0, 1.0),
            MaterialProperty::Roughness => now.roughness = number(now.roughness).clamp(0.0, 1.0),
            MaterialProperty::AlphaCutoff => {
                if let choreo_asset::AlphaMode::Mask(cutoff) = &mut now.alpha_mode {
                    *cutoff = number(*cutoff);
                }
            }
            MaterialProperty::NormalScale => now.normal_scale = number(now.normal_scale),
            MaterialProperty::OcclusionStrength => {
                now.occlusion_strength = number(now.occlusion_strength).clamp(0.0, 1.0);
            }
            MaterialProperty::UvOffset(slot) => change_texture_uv(now, slot, |uv| {
                let rest = uv.offset.to_array();
                uv.offset =
                    properties::property_at(actor, target, rest, time).map_or(uv.offset, Vec2::from_array);
            }),
            MaterialProperty::UvRotation(slot) => {
                change_texture_uv(now, slot, |uv| uv.rotation = number(uv.rotation))
            }
            MaterialProperty::UvScale(slot) => change_texture_uv(now, slot, |uv| {
                let rest = uv.scale.to_array();
                uv.scale =
                    properties::property_at(actor, target, rest, time).map_or(uv.scale, Vec2::from_array);
            }),
        }
    }
    now.emissive *= strength;
}

/// Applies the binds of an expression (VRM 1.0, "expressions.md"): adds the difference from the material at rest, times the weight.
fn apply_expression(expression: &Expression, weight: f32, index: u32, rest: &Material, now: &mut Material) {
    for bind in expression.colors.iter().filter(|b| b.material == index) {
        let to = bind.to.truncate();
        let change_toon = |now: &mut Material, change: &dyn Fn(&mut Toon, &Toon)| {
            if let (Some(toon), Some(rest)) = (&mut now.toon, &rest.toon) {
                change(Arc::make_mut(toon), rest);
            }
        };
        match bind.color {
            MaterialColor::Base => {
                now.base_color = (now.base_color + (bind.to - rest.base_color) * weight).max(Vec4::ZERO);
            }
            MaterialColor::Emission => {
                now.emissive = (now.emissive + (to - rest.emissive) * weight).max(Vec3::ZERO);
            }
            MaterialColor::Shade => {
                change_toon(now, &|t, rest| t.shade_color += (to - rest.shade_color) * weight)
            }
            MaterialColor::Matcap => change_toon(now, &|t, rest| t.matcap += (to - rest.matcap) * weight),
            MaterialColor::Rim => change_toon(now, &|t, rest| t.rim_color += (to - rest.rim_color) * weight),
        }
    }
    for bind in expression.uvs.iter().filter(|b| b.material == index) {
        for_each_texture(now, |texture| {
            let mut uv = UvTransform::of(&texture.uv_transform);
            // VRM assumes a texture at offset 0 and scale 1. For any other texture the offset is added and the scale is multiplied.
            uv.offset += bind.offset * weight;
            uv.scale *= Vec2::ONE + (bind.scale - Vec2::ONE) * weight;
            texture.uv_transform = uv.transform();
        });
    }
}

/// MToon's UV animation of all textures except the matcap: rotates about the center, then scrolls.
fn apply_uv_motion(motion: UvMotion, time: Time, now: &mut Material) {
    if let Some(toon) = now.toon.as_mut().filter(|t| t.uv_mask.is_some()) {
        // Each texel of a mask sets a share of the motion, a multiple of 1/255, so after 255 rounds all texels are where they began.
        let round =
            |speed: f32, whole: f64| libm::fmod(f64::from(speed) * time.as_secs(), 255.0 * whole) as f32;
        let turned = round(motion.rotation, std::f64::consts::TAU);
        let moved = Vec3::new(round(motion.scroll.x, 1.0), round(motion.scroll.y, 1.0), turned);
        Arc::make_mut(toon).uv_moved = moved;
        return;
    }
    let secs = time.as_secs();
    let part = |speed: f32, whole: f64| libm::fmod(f64::from(speed) * secs, whole) as f32;
    let angle = part(motion.rotation, std::f64::consts::TAU);
    let (sin, cos) = (libm::sinf(angle), libm::cosf(angle));
    let turn = Mat2::from_cols(Vec2::new(cos, sin), Vec2::new(-sin, cos));
    let middle = Vec2::splat(0.5);
    let moved = Vec2::new(part(motion.scroll.x, 1.0), part(motion.scroll.y, 1.0));
    let all = Affine2 { matrix2: turn, translation: middle - turn * middle + moved };
    for_each_texture(now, |texture| texture.uv_transform = all * texture.uv_transform);
}

/// Calls `change` for every texture that is sampled by texture coordinates.
fn for_each_texture(material: &mut Material, mut change: impl FnMut(&mut TextureRef)) {
    for slot in 0..7 {
        if let Some(texture) = texture_of_slot(material, slot) {
            change(texture);
        }
    }
    if let Some(toon) = &mut material.toon {
        let toon = Arc::make_mut(toon);
        let of_toon = [&mut toon.shade_texture, &mut toon.shading_shift_texture, &mut toon.rim_texture];
        of_toon.into_iter().flatten().for_each(change);
    }
}

fn texture_of_slot(m: &mut Material, slot: u8) -> Option<&mut TextureRef> {
    match slot {
        0 => m.base_color_texture.as_mut(),
        1 => m.metallic_roughness_texture.as_mut(),
        2 => m.normal_texture.as_mut(),
        3 => m.occlusion_texture.as_mut(),
        4 => m.emissive_texture.as_mut(),
        // Blinn–Phong materials have their reflection map in slot 5.
        5 => match &mut m.reflection {
            Some(reflection) => reflection.texture.as_mut(),
            None => m.specular_texture.as_mut(),
        },
        6 => m.specular_color_texture.as_mut(),
        _ => None,
    }
}

fn change_texture_uv(material: &mut Material, slot: u8, change: impl FnOnce(&mut UvTransform)) {
    if let Some(texture) = texture_of_slot(material, slot) {
        let mut uv = UvTransform::of(&texture.uv_transform);
        change(&mut uv);
        texture.uv_transform = uv.transform();
    }
}

/// Offset, rotation in radians and scale of KHR_texture_transform.
struct UvTransform {
    offset: Vec2,
    rotation: f32,
    scale: Vec2,
}

impl UvTransform {
    /// Decomposes a matrix made by [`uv_transform`]. If the scale is zero, the rotation is lost.
    fn of(a: &Affine2) -> UvTransform {
        let (x, y) = (a.matrix2.x_axis, a.matrix2.y_axis);
        let mirrored = a.matrix2.determinant() < 0.0;
        UvTransform {
            offset: a.translation,
            rotation: libm::atan2f(-x.y, x.x),
            scale: Vec2::new(x.length(), if mirrored { -y.length() } else { y.length() }),
        }
    }

    fn transform(&self) -> Affine2 {
        uv_transform(self.offset, self.rotation, self.scale)
    }
}

/// KHR_texture_transform: offset · rotation · scale. With v pointing down, "counter-clockwise" as seen takes +u towards −v.
pub fn uv_transform(offset: Vec2, rotation_rad: f32, scale: Vec2) -> Affine2 {
    let (sin, cos) = (libm::sinf(rotation_rad), libm::cosf(rotation_rad));
    let matrix = Mat2::from_cols(Vec2::new(cos, -sin) * scale.x, Vec2::new(sin, cos) * scale.y);
    Affine2 { matrix2: matrix, translation: offset }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_asset::{ColorBind, Shading, UvBind};

    #[test]
    fn uv_transform_survives_decomposition() {
        for (rotation, scale) in [(0.0, Vec2::ONE), (1.1, Vec2::new(2.0, 0.5)), (-2.0, Vec2::new(3.0, -1.0))]
        {
            let whole = uv_transform(Vec2::new(0.2, 0.7), rotation, scale);
            let again = UvTransform::of(&whole).transform();
            assert!(whole.abs_diff_eq(again, 1e-6), "{rotation} {scale}: {again:?}");
        }
    }

    #[test]
    fn frame_strip_cells_run_from_the_top_left_and_loop() {
        let strip = choreo_asset::FrameStrip { columns: 3, rows: 2, count: 5, fps: 10.0, once: false };
        let corner = |secs: f64| strip.cell(Time::from_secs(secs)).transform_point2(Vec2::ZERO);
        let end = |secs: f64| strip.cell(Time::from_secs(secs)).transform_point2(Vec2::ONE);
        let third = 1.0 / 3.0;
        for (secs, x, y) in
            [(0.0, 0.0, 0.0), (0.1, 1.0, 0.0), (0.29, 2.0, 0.0), (0.3, 0.0, 0.5), (0.5, 0.0, 0.0)]
        {
            assert!(corner(secs).abs_diff_eq(Vec2::new(x * third, y), 1e-6), "{secs}: {}", corner(secs));
            assert!((end(secs) - corner(secs)).abs_diff_eq(Vec2::new(third, 0.5), 1e-6), "{secs}");
        }
        // Before the beginning, and after a hundred hours.
        assert_eq!(corner(-0.05), corner(0.45));
        assert_eq!(corner(360_000.2), corner(0.2));
        let none = choreo_asset::FrameStrip { columns: 0, rows: 0, count: 0, fps: 1.0, once: true };
        assert_eq!(none.cell(Time::from_secs(3.0)), Affine2::IDENTITY);
    }

    #[test]
    fn expression_color_binds_add_the_difference_from_rest() {
        let rest = Material { base_color: Vec4::new(0.2, 0.4, 0.6, 1.0), ..Material::default() };
        let red = ColorBind { material: 0, color: MaterialColor::Base, to: Vec4::new(1.0, 0.0, 0.0, 1.0) };
        let face = Expression { colors: vec![red], ..Expression::default() };
        let mut now = rest.clone();
        apply_expression(&face, 0.5, 0, &rest, &mut now);
        assert!(now.base_color.abs_diff_eq(Vec4::new(0.6, 0.2, 0.3, 1.0), 1e-6), "{}", now.base_color);
        // Another material's bind changes nothing.
        let mut other = rest.clone();
        apply_expression(&face, 1.0, 1, &rest, &mut other);
        assert_eq!(other, rest);
    }

    #[test]
    fn uv_binds_and_uv_motion_transform_textures() {
        let texture =
            TextureRef { image: 0, sampler: Default::default(), uv_set: 0, uv_transform: Affine2::IDENTITY };
        let toon = Toon { shade_texture: Some(texture.clone()), ..Toon::default() };
        let rest = Material {
            base_color_texture: Some(texture),
            shading: Shading::Toon,
            toon: Some(Arc::new(toon)),
            ..Material::default()
        };
        let bind = UvBind { material: 0, offset: Vec2::new(0.5, 0.25), scale: Vec2::new(3.0, 1.0) };
        let face = Expression { uvs: vec![bind], ..Expression::default() };
        let mut now = rest.clone();
        apply_expression(&face, 0.5, 0, &rest, &mut now);
        let uv =
            |m: &Material, p: Vec2| m.base_color_texture.as_ref().unwrap().uv_transform.transform_point2(p);
        assert!(uv(&now, Vec2::ONE).abs_diff_eq(Vec2::new(2.25, 1.125), 1e-6));
        let mut now = rest.clone();
        let motion = UvMotion { scroll: Vec2::new(0.25, -0.5), rotation: std::f32::consts::FRAC_PI_2 };
        apply_uv_motion(motion, Time::from_secs(1.0), &mut now);
        // A quarter turn about the middle, then a quarter to the right and half up.
        assert!(
            uv(&now, Vec2::new(1.0, 0.5)).abs_diff_eq(Vec2::new(0.75, 0.5), 1e-6),
            "{}",
            uv(&now, Vec2::new(1.0, 0.5))
        );
        let shade = now.toon.unwrap().shade_texture.clone().unwrap().uv_transform;
        assert_eq!(shade, now.base_color_texture.unwrap().uv_transform);
    }
}
