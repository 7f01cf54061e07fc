//! Uniform structs as the shaders read them (shaders/frame.wgsl, post.wgsl); `tests/shaders.rs` compares every field's offset.

use crate::plan::{PlanSky, PostPass, ShadowView, View};
use crate::scene_resources::material::{
    BASE_SLOTS, LAYER_SLOTS, MaterialResource, MaterialTexture, TEXTURE_SLOTS, TOON_SLOT, TOON_SLOTS,
};
use crate::sky::{MAX_LEVELS, SkyMaps};
use choreo_asset::{AlphaMode, Shading, TextureSlot, Toon};
use glam::{Mat4, Vec2, Vec3, Vec4};

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct FrameUniform {
    pub clip_from_relative: Mat4,
    pub eye: Vec4,
    pub camera: Vec4,
    pub ambient_up: Vec4,
    pub ambient_down: Vec4,
    pub background_top: Vec4,
    pub background_bottom: Vec4,
    /// Pixels.
    pub size: Vec2,
    pub light_count: u32,
    pub pad: u32,
}

/// How a place is found again from its pixel and depth; deferred.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct RebuiltUniform {
    pub relative_from_clip: Mat4,
}

impl RebuiltUniform {
    pub fn new(view: &View) -> RebuiltUniform {
        // In f64: of a far plane that is near, or a part of a large picture, little would be left.
        RebuiltUniform { relative_from_clip: view.clip_from_relative.as_dmat4().inverse().as_mat4() }
    }
}

/// A sky as sky.wgsl reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct SkyUniform {
    pub harmonics: [Vec4; 9],
    /// xy: first texel inside the border; z: texels a side.
    pub levels: [Vec4; MAX_LEVELS],
    /// Cosine and sine of the turn, strength, last level.
    pub turn: Vec4,
    /// xy: 1 / texels of the atlas; z: 1 where it is seen behind everything.
    pub texel: Vec4,
    /// See [`crate::plan::view::rays`].
    pub right: Vec4,
    pub down: Vec4,
    pub ahead: Vec4,
}

impl SkyUniform {
    /// Uniforms of a sky without maps: what is visible behind everything.
    pub fn new(sky: &PlanSky, view: &View, maps: Option<&SkyMaps>) -> SkyUniform {
        let [right, down, ahead] = crate::plan::view::rays(view).map(|v| v.extend(0.0));
        let [c, s] = sky.turn;
        let mut out =
            SkyUniform { turn: Vec4::new(c, s, sky.strength, 0.0), right, down, ahead, ..Self::default() };
        let Some(maps) = maps else { return out };
        out.harmonics = maps.harmonics.map(|c| c.extend(0.0));
        for (out, level) in out.levels.iter_mut().zip(&maps.levels) {
            *out = Vec4::new(level.at[0] as f32, level.at[1] as f32, level.size as f32, 0.0);
        }
        out.turn.w = maps.levels.len().saturating_sub(1) as f32;
        let seen = f32::from(u8::from(sky.background));
        out.texel = Vec4::new(1.0 / maps.size[0] as f32, 1.0 / maps.size[1] as f32, seen, 0.0);
        out
    }
}

/// u = dot(x.xy, uv) + x.z, v = dot(y.xy, uv) + y.z; x.w = uv set.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct UvTransform {
    pub x: Vec4,
    pub y: Vec4,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct MaterialUniform {
    pub base_color: Vec4,
    pub emissive: Vec3,
    pub alpha_cutoff: f32,
    pub specular_color: Vec3,
    pub specular: f32,
    pub metallic: f32,
    pub roughness: f32,
    pub normal_scale: f32,
    pub occlusion_strength: f32,
    pub shininess: f32,
    pub rim_lighting_mix: f32,
    /// Metres, or a share of the picture's height.
    pub outline_width: f32,
    /// 1: of the picture's height.
    pub outline_on_screen: f32,
    /// Toon: shading shift, toony, GI equalization, scale of the shift texture.
    pub toon: Vec4,
    /// Toon: rim colour and Fresnel power. Blinn–Phong: share that is mirrored, and roughness of the mirror.
    pub rim: Vec4,
    /// Toon: matcap colour and rim lift.
    pub matcap: Vec4,
    /// Outline's colour, and how much the surface's light counts.
    pub outline: Vec4,
    /// Toon: how far a masked motion has come. And how deep heights go, in textures.
    pub uv_moved: Vec4,
    /// Center of triplanar textures, 1 / their width; their sharpness is `uv_moved.x`.
    pub triplanar: Vec4,
    pub uv: [UvTransform; BASE_SLOTS + TOON_SLOTS],
}

/// Only of materials that have layers.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct LayersUniform {
    pub sheen_color: Vec3,
    pub sheen_roughness: f32,
    pub extinction: Vec3,
    pub thickness: f32,
    pub clearcoat: f32,
    pub clearcoat_roughness: f32,
    pub clearcoat_normal_scale: f32,
    pub transmission: f32,
    pub diffuse_transmission_color: Vec3,
    pub diffuse_transmission: f32,
    /// Cosine and sine of the rotation.
    pub anisotropy_direction: Vec2,
    pub anisotropy: f32,
    pub iridescence: f32,
    /// Nanometres of the film: where its texture is 0, and where it is 1.
    pub iridescence_thickness: Vec2,
    pub iridescence_ior: f32,
    pub pad: f32,
    /// Indices of refraction of red, green and blue.
    pub iors: Vec3,
    pub pad_iors: f32,
    pub uv: [UvTransform; LAYER_SLOTS],
}

impl LayersUniform {
    /// Binding after those of the textures.
    pub const BINDING: u32 = 1 + 2 * TEXTURE_SLOTS as u32;

    /// `None` where the material has no layers.
    pub fn new(resources: &MaterialResource) -> Option<LayersUniform> {
        let l = resources.material.layers.as_deref()?;
        let refs = resources.textures;
        let mut uv = [UvTransform { x: Vec4::X, y: Vec4::Y }; LAYER_SLOTS];
        for (out, slot) in uv.iter_mut().zip(&refs[BASE_SLOTS..TOON_SLOT]) {
            if let Some(t) = slot {
                *out = uv_transform(t);
            }
        }
        Some(LayersUniform {
            sheen_color: l.sheen_color,
            sheen_roughness: l.sheen_roughness,
            extinction: l.extinction(),
            thickness: l.thickness,
            clearcoat: l.clearcoat,
            clearcoat_roughness: l.clearcoat_roughness,
            clearcoat_normal_scale: l.clearcoat_normal_scale,
            transmission: l.transmission,
            diffuse_transmission_color: l.diffuse_transmission_color,
            diffuse_transmission: l.diffuse_transmission,
            anisotropy_direction: Vec2::new(
                libm::cosf(l.anisotropy_rotation),
                libm::sinf(l.anisotropy_rotation),
            ),
            anisotropy: l.anisotropy,
            iridescence: l.iridescence,
            iridescence_thickness: resources.film_thickness(),
            iridescence_ior: l.iridescence_ior,
            pad: 0.0,
            iors: l.iors(),
            pad_iors: 0.0,
            uv,
        })
    }
}

/// One shadow map as it is looked up.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct ShadowUniform {
    /// xy: texels of the image; z: depth; all times w.
    pub texel_from_relative: Mat4,
    /// Range in which the filter's texels all lie in the map: from (xy) and to (zw), texels.
    pub inside: Vec4,
    /// x: metres of a texel where w is 1; zw: 1 / texels of the image.
    pub texel: Vec4,
}

/// The filter reaches two texels to each side.
const SHADOW_MARGIN: f32 = 2.0;

impl ShadowUniform {
    pub fn new(view: &ShadowView, image: [u32; 2]) -> ShadowUniform {
        let [x, y, w, h] = [view.at[0], view.at[1], view.size[0], view.size[1]].map(|v| v as f32);
        let texel_from_clip = Mat4::from_cols(
            Vec4::new(w * 0.5, 0.0, 0.0, 0.0),
            Vec4::new(0.0, h * 0.5, 0.0, 0.0),
            Vec4::Z,
            Vec4::new(x + w * 0.5, y + h * 0.5, 0.0, 1.0),
        );
        let m = SHADOW_MARGIN;
        ShadowUniform {
            texel_from_relative: texel_from_clip * view.clip_from_relative,
            inside: Vec4::new(x + m, y + m, x + w - m, y + h - m),
            texel: Vec4::new(view.texel, 0.0, 1.0 / image[0] as f32, 1.0 / image[1] as f32),
        }
    }
}

fn uv_transform(t: &MaterialTexture) -> UvTransform {
    let a = t.uv_transform;
    UvTransform {
        x: Vec4::new(a.matrix2.x_axis.x, a.matrix2.y_axis.x, a.translation.x, t.uv_set as f32),
        y: Vec4::new(a.matrix2.x_axis.y, a.matrix2.y_axis.y, a.translation.y, 0.0),
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PostUniform {
    pub parameters: [Vec4; 2],
    /// Pixels of what it makes.
    pub size: Vec2,
    /// Number of earlier runs of an effect that runs more than once.
    pub number: u32,
    /// How many times smaller than the whole what it reads or what it makes is, whichever is smaller.
    pub shrink: u32,
    /// Pixels of what the pass before made, and of the whole.
    pub input: Vec2,
    pub whole: Vec2,
}

impl PostUniform {
    /// `before`: how many times smaller the picture is that it reads.
    pub fn new(pass: &PostPass, before: u32, whole: [u32; 2]) -> PostUniform {
        let p = &pass.parameters;
        let vec2 = |size: [u32; 2]| Vec2::new(size[0] as f32, size[1] as f32);
        PostUniform {
            parameters: [Vec4::new(p[0], p[1], p[2], p[3]), Vec4::new(p[4], p[5], p[6], p[7])],
            size: vec2(pass.size(whole)),
            number: pass.number,
            shrink: pass.shrink.max(before),
            input: vec2(whole.map(|s| s.div_ceil(before.max(1)))),
            whole: vec2(whole),
        }
    }
}

impl MaterialUniform {
    pub fn new(resources: &MaterialResource) -> MaterialUniform {
        let m = &resources.material;
        // A feature may be on where the material has no such texture (`PlanOptions::force_all`): identity then.
        let identity = UvTransform { x: Vec4::X, y: Vec4::Y };
        let mut uv = [identity; BASE_SLOTS + TOON_SLOTS];
        let refs = resources.textures;
        for (out, slot) in uv.iter_mut().zip(refs[..BASE_SLOTS].iter().chain(&refs[TOON_SLOT..])) {
            if let Some(t) = slot {
                *out = uv_transform(t);
            }
        }
        let default = Toon::default();
        let toon = m.toon.as_deref().unwrap_or(&default);
        let is_toon = m.shading == Shading::Toon;
        let phong = matches!(m.shading, Shading::BlinnPhong | Shading::Phong);
        // A factor of a texture that is not there counts nothing.
        let matcap = if is_toon && resources.texture(TextureSlot::MetallicRoughness).is_some() {
            toon.matcap
        } else {
            Vec3::ZERO
        };
        let shift_scale =
            if resources.texture(TextureSlot::Specular).is_some() { toon.shading_shift_scale } else { 0.0 };
        MaterialUniform {
            base_color: m.base_color,
            emissive: m.emissive,
            alpha_cutoff: match m.alpha_mode {
                AlphaMode::Mask(cutoff) => cutoff,
                _ => 0.0,
            },
            specular_color: if is_toon { toon.shade_color } else { m.specular_color },
            specular: m.specular,
            metallic: m.metallic,
            roughness: m.roughness,
            normal_scale: if resources.texture(TextureSlot::Normal).is_some() { m.normal_scale } else { 0.0 },
            occlusion_strength: m.occlusion_strength,
            shininess: m.shininess,
            rim_lighting_mix: toon.rim_lighting_mix,
            toon: Vec4::new(toon.shading_shift, toon.shading_toony, toon.gi_equalization, shift_scale),
            rim: match m.mirrors() {
                Some(r) => r.color.extend(m.mirror_roughness()),
                None if phong => Vec3::ZERO.extend(m.mirror_roughness()),
                None => toon.rim_color.extend(toon.rim_fresnel_power),
            },
            matcap: matcap.extend(toon.rim_lift),
            outline_width: toon.outline.as_ref().map_or(0.0, |o| o.width),
            outline_on_screen: toon.outline.as_ref().map_or(0.0, |o| f32::from(u8::from(o.on_screen))),
            outline: toon.outline.as_ref().map_or(Vec4::ZERO, |o| o.color.extend(o.lighting_mix)),
            uv_moved: match m.triplanar {
                Some(t) => Vec4::new(t.sharpness, 0.0, 0.0, m.relief),
                None => toon.uv_moved.extend(m.relief),
            },
            triplanar: m.triplanar.map_or(Vec4::ZERO, |t| t.middle.extend(1.0 / t.size)),
            uv,
        }
    }
}
