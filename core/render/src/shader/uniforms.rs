//! Uniform structs as the shaders read them (shaders/frame.wgsl, post.wgsl); `tests/shaders/layouts.rs` compares every field's offset.

use crate::plan::shadow_maps::MAX_PENUMBRA;
use crate::plan::{PlanSky, PostPass, ShadowView, View};
use crate::scene_resources::material::{
    BASE_SLOTS, LAYER_SLOTS, MaterialResource, MaterialTexture, TEXTURE_SLOTS, TOON_SLOT, TOON_SLOTS,
};
use crate::sky::{MAX_LEVELS, SkyMaps};
use choreo_asset::{AlphaMode, TextureSlot, Toon};
use choreo_plugin::{EffectFrame, ImagePass};
use glam::{Mat4, Vec2, Vec3, Vec4};

macro_rules! uniforms {
    ($($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident: $type:ty),* $(,)? })*) => { $(
        $(#[$doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
        pub struct $name { $($(#[$field_doc])* pub $field: $type),* }

        impl $name {
            /// Names and byte offsets of the fields, which equal the WGSL struct's.
            pub const FIELDS: &[(&str, usize)] =
                &[$((stringify!($field), std::mem::offset_of!($name, $field))),*];
        }
    )* };
}

uniforms! {
    FrameUniform {
        clip_from_relative: Mat4,
        eye: Vec4,
        camera: Vec4,
        ambient_up: Vec4,
        ambient_down: Vec4,
        background_top: Vec4,
        background_bottom: Vec4,
        /// Pixels.
        size: Vec2,
        light_count: u32,
        exposure: f32,
        clip_before: Mat4,
        camera_before: Vec4,
    }

    /// Transform from clip space back to camera-relative space, for deferred.wgsl.
    RebuiltUniform {
        relative_from_clip: Mat4,
    }

    /// A sky as sky.wgsl reads it.
    SkyUniform {
        harmonics: [Vec4; 9],
        /// xy: first texel inside the border; z: side in texels.
        levels: [Vec4; MAX_LEVELS],
        /// Cosine and sine of the rotation, strength, index of the last level.
        turn: Vec4,
        /// xy: 1 / size of the atlas in texels; z: 1 if the sky is the background.
        texel: Vec4,
        /// See `crate::view::ray_basis`.
        right: Vec4,
        down: Vec4,
        ahead: Vec4,
    }

    /// u = dot(x.xy, uv) + x.z, v = dot(y.xy, uv) + y.z; x.w = uv set.
    UvTransform {
        x: Vec4,
        y: Vec4,
    }

    /// Parameters of the metallic-roughness model.
    MetallicRoughnessUniform {
        specular_color: Vec3,
        specular: f32,
        metallic: f32,
        roughness: f32,
        pad: Vec2,
    }

    /// Parameters of Blinn–Phong and Phong.
    PhongUniform {
        specular_color: Vec3,
        shininess: f32,
        /// Reflectivity, linear RGB.
        reflection: Vec3,
        reflection_roughness: f32,
    }

    /// Parameters of toon shading (MToon).
    ToonUniform {
        shade_color: Vec3,
        shading_shift: f32,
        rim_color: Vec3,
        rim_fresnel_power: f32,
        matcap: Vec3,
        rim_lift: f32,
        shading_toony: f32,
        gi_equalization: f32,
        shading_shift_scale: f32,
        rim_lighting_mix: f32,
    }

    OutlineUniform {
        color: Vec3,
        /// Share of the surface's lighting in the outline's color.
        lighting_mix: f32,
        /// Width in metres, or as a share of the image's height if `on_screen` is 1.
        width: f32,
        on_screen: f32,
        pad: Vec2,
    }

    MaterialUniform {
        base_color: Vec4,
        emissive: Vec3,
        alpha_cutoff: f32,
        normal_scale: f32,
        occlusion_strength: f32,
        /// Depth of the height map, as a fraction of the width of the texture.
        parallax_depth: f32,
        triplanar_sharpness: f32,
        triplanar_middle: Vec3,
        /// 1 / width of the textures.
        triplanar_scale: f32,
        /// Current state of the masked UV animation: offset in widths of the texture, rotation in radians.
        uv_motion: Vec3,
        pad: f32,
        metallic_roughness: MetallicRoughnessUniform,
        phong: PhongUniform,
        toon: ToonUniform,
        outline: OutlineUniform,
        uv: [UvTransform; BASE_SLOTS + TOON_SLOTS],
    }

    /// Parameters of material layers; only materials with layers have them.
    LayersUniform {
        sheen_color: Vec3,
        sheen_roughness: f32,
        extinction: Vec3,
        thickness: f32,
        clearcoat: f32,
        clearcoat_roughness: f32,
        clearcoat_normal_scale: f32,
        transmission: f32,
        diffuse_transmission_color: Vec3,
        diffuse_transmission: f32,
        /// Cosine and sine of the rotation.
        anisotropy_direction: Vec2,
        anisotropy: f32,
        iridescence: f32,
        /// Thickness of the film in nanometers where its texture is 0, and where it is 1.
        iridescence_thickness: Vec2,
        iridescence_ior: f32,
        pad: f32,
        /// Indices of refraction of red, green and blue.
        iors: Vec3,
        pad_iors: f32,
        uv: [UvTransform; LAYER_SLOTS],
    }

    /// Lookup parameters of one shadow map.
    ShadowUniform {
        /// xy: texels of the shared image; z: depth; all multiplied by w.
        texel_from_relative: Mat4,
        /// Rectangle in which all texels of the filter lie inside the map: from (xy) and to (zw), texels.
        inside: Vec4,
        /// x: size of a texel in metres where w is 1; y: `ShadowView::penumbra`; zw: 1 / size of the image in texels.
        texel: Vec4,
    }

    PostUniform {
        /// Size of the image that the pass writes, in pixels.
        size: Vec2,
        /// Index of the pass among those of its effect.
        number: u32,
        /// Factor by which the smaller one of the input and the output is smaller than the whole image.
        shrink: u32,
        /// Size in pixels of the image that the pass before wrote; `whole`: size of the whole image.
        input: Vec2,
        whole: Vec2,
        /// Factors by which the textures of passes that it reads are smaller than the whole image.
        textures: [Vec4; ImagePass::MOST_READ / 4],
        /// [`EffectFrame::rows`].
        scene: [Vec4; EffectFrame::ROWS],
        /// The first eight parameters. The others follow the struct; see [`PostUniform::rest`].
        parameters: [Vec4; 2],
    }
}

impl RebuiltUniform {
    pub fn new(view: &View) -> RebuiltUniform {
        // Inverted in f64, because f32 would lose most digits for a far plane that is near, or a part of a large image.
        RebuiltUniform { relative_from_clip: view.clip_from_relative.as_dmat4().inverse().as_mat4() }
    }
}

impl SkyUniform {
    /// Uniforms of a sky. `maps`: `None` if only its background is drawn.
    pub fn new(sky: &PlanSky, view: &View, maps: Option<&SkyMaps>) -> SkyUniform {
        let [right, down, ahead] = crate::view::ray_basis(view).map(|v| v.extend(0.0));
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

impl LayersUniform {
    /// Binding of the layers' uniform, after those of the textures.
    pub(crate) const BINDING: u32 = 1 + 2 * TEXTURE_SLOTS as u32;

    /// The layers of a material; `None` if it has none.
    pub fn new(resource: &MaterialResource) -> Option<LayersUniform> {
        let l = resource.material.layers.as_deref()?;
        let refs = resource.textures;
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
            iridescence_thickness: resource.film_thickness(),
            iridescence_ior: l.iridescence_ior,
            pad: 0.0,
            iors: l.iors(),
            pad_iors: 0.0,
            uv,
        })
    }
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
        let m = SHADOW_MARGIN + if view.penumbra > 0.0 { 0.5 * MAX_PENUMBRA } else { 0.0 };
        ShadowUniform {
            texel_from_relative: texel_from_clip * view.clip_from_relative,
            inside: Vec4::new(x + m, y + m, x + w - m, y + h - m),
            texel: Vec4::new(view.texel, view.penumbra, 1.0 / image[0] as f32, 1.0 / image[1] as f32),
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

impl PostUniform {
    /// Size of the uniform data of a pass in bytes.
    pub fn bytes(pass: &PostPass) -> usize {
        size_of::<PostUniform>() + size_of_val(Self::rest(pass))
    }

    /// The parameters after the first eight.
    pub fn rest(pass: &PostPass) -> &[f32] {
        pass.parameters.get(8..).unwrap_or_default()
    }

    /// Uniform data of a pass. `before`: factor by which its input is smaller than the whole image.
    pub fn new(
        pass: &PostPass,
        before: u32,
        whole: [u32; 2],
        scales: [f32; ImagePass::MOST_READ],
        frame: &EffectFrame,
    ) -> PostUniform {
        let p = |i: usize| pass.parameters.get(i).copied().unwrap_or(0.0);
        let first = |i: usize| Vec4::new(p(i), p(i + 1), p(i + 2), p(i + 3));
        let vec2 = |size: [u32; 2]| Vec2::new(size[0] as f32, size[1] as f32);
        PostUniform {
            size: vec2(pass.size(whole)),
            number: pass.number,
            shrink: pass.shrink.max(before),
            input: vec2(whole.map(|s| s.div_ceil(before.max(1)))),
            whole: vec2(whole),
            textures: [0, 4].map(|i| Vec4::from_slice(&scales[i..])),
            scene: frame.rows(),
            parameters: [first(0), first(4)],
        }
    }
}

impl MaterialUniform {
    pub fn new(resource: &MaterialResource) -> MaterialUniform {
        let m = &resource.material;
        // A feature may be on for a material without that texture (`PlanOptions::force_all`); its transform is then the identity.
        let identity = UvTransform { x: Vec4::X, y: Vec4::Y };
        let mut uv = [identity; BASE_SLOTS + TOON_SLOTS];
        let refs = resource.textures;
        for (out, slot) in uv.iter_mut().zip(refs[..BASE_SLOTS].iter().chain(&refs[TOON_SLOT..])) {
            if let Some(t) = slot {
                *out = uv_transform(t);
            }
        }
        let triplanar = m.triplanar.as_ref();
        MaterialUniform {
            base_color: m.base_color,
            emissive: m.emissive,
            alpha_cutoff: match m.alpha_mode {
                AlphaMode::Mask(cutoff) => cutoff,
                _ => 0.0,
            },
            normal_scale: if resource.texture(TextureSlot::Normal).is_some() { m.normal_scale } else { 0.0 },
            occlusion_strength: m.occlusion_strength,
            parallax_depth: m.relief,
            triplanar_sharpness: triplanar.map_or(0.0, |t| t.sharpness),
            triplanar_middle: triplanar.map_or(Vec3::ZERO, |t| t.middle),
            triplanar_scale: triplanar.map_or(0.0, |t| 1.0 / t.size),
            uv_motion: m.toon.as_ref().map_or(Vec3::ZERO, |t| t.uv_moved),
            pad: 0.0,
            metallic_roughness: MetallicRoughnessUniform {
                specular_color: m.specular_color,
                specular: m.specular,
                metallic: m.metallic,
                roughness: m.roughness,
                pad: Vec2::ZERO,
            },
            phong: PhongUniform {
                specular_color: m.specular_color,
                shininess: m.shininess,
                reflection: m.environment_reflection().map_or(Vec3::ZERO, |r| r.color),
                reflection_roughness: m.mirror_roughness(),
            },
            toon: ToonUniform::new(resource),
            outline: m.toon.as_ref().and_then(|t| t.outline.as_ref()).map_or_else(Default::default, |o| {
                OutlineUniform {
                    color: o.color,
                    lighting_mix: o.lighting_mix,
                    width: o.width,
                    on_screen: f32::from(u8::from(o.on_screen)),
                    pad: Vec2::ZERO,
                }
            }),
            uv,
        }
    }
}

impl ToonUniform {
    fn new(resource: &MaterialResource) -> ToonUniform {
        let default = Toon::default();
        let t = resource.material.toon.as_deref().unwrap_or(&default);
        ToonUniform {
            shade_color: t.shade_color,
            shading_shift: t.shading_shift,
            rim_color: t.rim_color,
            rim_fresnel_power: t.rim_fresnel_power,
            // The factor of a missing matcap texture is zero.
            matcap: if resource.texture(TextureSlot::MetallicRoughness).is_some() {
                t.matcap
            } else {
                Vec3::ZERO
            },
            rim_lift: t.rim_lift,
            shading_toony: t.shading_toony,
            gi_equalization: t.gi_equalization,
            shading_shift_scale: if resource.texture(TextureSlot::Specular).is_some() {
                t.shading_shift_scale
            } else {
                0.0
            },
            rim_lighting_mix: t.rim_lighting_mix,
        }
    }
}
