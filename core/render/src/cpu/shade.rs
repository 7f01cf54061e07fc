//! The fragment shader, a 2×2 quad at a time, linear color out. CPU reference of scene.wgsl.

use super::brdf::{ambient_specular, reflect_light, reflect_light_phong, surface_of};
use super::coverage::covered_samples;
use super::layer_shading::{LayerContributions, LayeredPoint};
use super::lighting::SurfacePoint;
use super::refraction::SceneColorCopy;
use super::shadow::ShadowMaps;
use super::sky::EnvironmentLight;
use super::texture::Texture;
use super::toon::{ToonSurface, matcap_uv};
use super::triplanar::TriplanarCoordinates;
use super::vertex::Vertex;
use super::view_transform::apply_view_transform;
use crate::effect_faults::Fault;
use crate::lanes::{F4, Mask, NO_LANES, V3, Weights};
use crate::plan::shader_features::texture_slot;
use crate::plan::{Features, Glass, Plan, PlanLight};
use crate::scene_resources::material::MaterialResource;
use crate::scene_resources::material::TEXTURE_SLOTS;
use crate::sky::SkyMaps;
use choreo_asset::{AlphaMode, Primitive, Toon};
use choreo_plugin::Effect;
use glam::{Vec3, Vec4};
use std::sync::Arc;

/// A material with its textures loaded.
pub(crate) struct ShadeMaterial {
    pub factors: MaterialResource,
    /// Textures in the order of `MaterialResource::textures`.
    pub textures: [Option<Arc<Texture>>; TEXTURE_SLOTS],
}

/// Inputs of the shading of a triangle's quads, except the barycentric weights.
pub(super) struct Fragment<'a> {
    pub plan: &'a Plan,
    /// Set if a light casts shadows.
    pub shadows: Option<&'a ShadowMaps>,
    /// The scene color copy that refracting glass shows.
    pub scene_color: Option<Arc<SceneColorCopy>>,
    /// Maps of the sky, if it lights the scene.
    pub sky: Option<&'a SkyMaps>,
    /// Effects on the surface, in order.
    pub surface: Vec<(Effect, Vec<f32>)>,
    /// Lighting effects of the surface.
    pub lighting: Vec<(Effect, Vec<f32>)>,
    pub features: Features,
    pub blend: bool,
    /// Whether the alpha test keeps samples instead of whole pixels (alpha to coverage).
    pub coverage: bool,
    pub glass: Glass,
    pub double_sided: bool,
    pub tint: Vec4,
    pub primitive: &'a Primitive,
    pub material: &'a ShadeMaterial,
}

/// Every sample of a pixel.
pub(crate) const ALL_SAMPLES: u8 = 0b1111;

/// Linear RGBA of four pixels, and the samples that the alpha test keeps, one bit each.
pub(crate) struct Shaded {
    pub rgba: [F4; 4],
    pub kept_samples: [u8; 4],
    /// Fault of an effect at each pixel, with the effect's index in `Fragment::surface` followed by `Fragment::lighting`.
    pub faults: [Option<(u8, Fault)>; 4],
}

impl Shaded {
    #[inline(always)]
    pub(super) fn pixel(&self, i: usize) -> Vec4 {
        Vec4::new(self.rgba[0].0[i], self.rgba[1].0[i], self.rgba[2].0[i], self.rgba[3].0[i])
    }
}

/// Four pixels of a triangle.
#[derive(Clone, Copy)]
pub(super) struct Quad<'a> {
    pub vertices: [&'a Vertex; 3],
    /// Indices of the vertices.
    pub ids: [u32; 3],
    /// Whether the front face is visible.
    pub front: bool,
    pub weights: &'a Weights,
    pub uvs: [[F4; 2]; 2],
    /// Factor on the material's UV animation at each pixel, from its mask texture; `None` without one.
    pub uv_mask: Option<F4>,
    /// Shift of the texture coordinates by parallax mapping.
    pub parallax: Option<[F4; 2]>,
    /// The inputs of triplanar mapping.
    pub triplanar: Option<TriplanarCoordinates>,
}

impl Quad<'_> {
    #[inline(always)]
    pub(super) fn interpolate_vec3(&self, attribute: impl Fn(&Vertex) -> Vec3) -> V3 {
        self.weights.interpolate_vec3(self.vertices.map(attribute))
    }

    #[inline(always)]
    pub(super) fn interpolate_scalar(&self, attribute: impl Fn(&Vertex) -> f32) -> F4 {
        let [a, b, c] = self.vertices.map(attribute);
        self.weights.interpolate_scalar(a, b, c)
    }

    /// Interpolated tangent, bitangent and normal. As MikkTSpace requires, they are neither orthogonal nor normalized.
    pub(super) fn tangent_frame(&self) -> [V3; 3] {
        let normal = self.interpolate_vec3(|v| v.normal);
        let tangent = self.interpolate_vec3(|v| v.tangent.truncate());
        [tangent, normal.cross(tangent) * self.interpolate_scalar(|v| v.tangent.w), normal]
    }
}

pub(super) fn rgb([x, y, z, _]: [F4; 4]) -> V3 {
    V3 { x, y, z }
}

/// The color of a texel; white without a texture.
fn rgb_or_white(texel: Option<[F4; 4]>) -> V3 {
    texel.map_or(V3::splat(Vec3::ONE), rgb)
}

impl Fragment<'_> {
    pub(super) fn shade(&self, vertices: &[Vertex], ids: [u32; 3], front: bool, weights: &Weights) -> Shaded {
        let mut shaded = self.surface_color(&self.new_quad(vertices, ids, front, weights));
        if self.features.has_any(Features::OUTLINE.with(Features::WIREFRAME)) {
            let toon = self.material.factors.material.toon.as_ref();
            if let Some(outline) = toon.and_then(|t| t.outline.as_ref()) {
                for (out, color) in shaded.rgba.iter_mut().zip(outline.color.to_array()) {
                    *out = F4::ONE.mix(*out, F4::splat(outline.lighting_mix)) * color;
                }
            }
        }
        if !self.lighting.is_empty() {
            self.mark_light_faults(&mut shaded);
        }
        shaded
    }

    fn surface_color(&self, quad: &Quad) -> Shaded {
        let rgba = self.base_color(quad);
        let kept_samples = self.kept_samples(rgba[3]);
        let faults = [None; 4];
        if kept_samples == [0; 4] {
            return Shaded { rgba, kept_samples, faults };
        }
        let alpha = if self.blend { rgba[3] } else { F4::ONE };
        if !self.features.is_lit() {
            return Shaded { rgba: [rgba[0], rgba[1], rgba[2], alpha], kept_samples, faults };
        }
        let point = self.surface_point(quad, rgb(rgba));
        let color = match self.features.has(Features::TOON) {
            // The view transform does not apply to toon shading, which gives display colors.
            true => self.apply_exposure(self.toon_color(quad, &point) + self.emission(quad)),
            false => self.lit_color(quad, &point, alpha),
        };
        Shaded { rgba: [color.x, color.y, color.z, alpha], kept_samples, faults }
    }

    fn base_color(&self, quad: &Quad) -> [F4; 4] {
        let base = self.material.factors.material.base_color * self.tint;
        let mut rgba = base.to_array().map(F4::splat);
        if self.features.has(Features::VERTEX_COLOR) && !self.primitive.colors.is_empty() {
            let [a, b, c] = quad.ids.map(|i| self.primitive.colors[i as usize].to_array());
            for (i, out) in rgba.iter_mut().enumerate() {
                *out *= quad.weights.interpolate_scalar(a[i], b[i], c[i]);
            }
        }
        if let Some(texel) = self.sample_feature_texture(quad, Features::BASE_COLOR_TEXTURE) {
            for (out, t) in rgba.iter_mut().zip(texel) {
                *out *= t;
            }
        }
        rgba
    }

    /// The samples of each pixel that the alpha test keeps.
    fn kept_samples(&self, alpha: F4) -> [u8; 4] {
        match self.material.factors.material.alpha_mode {
            AlphaMode::Mask(cutoff) if self.features.has(Features::ALPHA_MASK) => match self.coverage {
                true => covered_samples(alpha.0, cutoff),
                false => alpha.0.map(|a| if a >= cutoff { ALL_SAMPLES } else { 0 }),
            },
            _ => [ALL_SAMPLES; 4],
        }
    }

    fn surface_point(&self, quad: &Quad, base: V3) -> SurfacePoint {
        let scale = self.material.factors.material.normal_scale;
        let n = self.triplanar_normal(quad).unwrap_or_else(|| {
            self.normal(quad, self.sample_feature_texture(quad, Features::NORMAL_TEXTURE).map(|t| (t, scale)))
        });
        let relative = quad.interpolate_vec3(|v| v.relative);
        let geometric_n = match self.features.has(Features::SHADOW) {
            true => self.normal(quad, None),
            false => n,
        };
        let eye = self.plan.view.eye;
        let v = (V3::splat(eye.truncate()) - relative * F4::splat(eye.w)).unit();
        SurfacePoint { relative, geometric_n, n, v, base, visible: quad.weights.visible }
    }

    /// Color by the metallic-roughness model or by Blinn–Phong, with layers, emission, exposure and view transform.
    fn lit_color(&self, quad: &Quad, point: &SurfacePoint, alpha: F4) -> V3 {
        let m = &self.material.factors.material;
        let tint = self.sample_feature_texture(quad, Features::SPECULAR_COLOR_TEXTURE);
        let specular_color = V3::splat(m.specular_color);
        let specular_color = tint.map_or(specular_color, |t| specular_color * rgb(t));
        let occlusion = self.sample_feature_texture(quad, Features::OCCLUSION_TEXTURE);
        let occlusion = occlusion.map_or(F4::ONE, |[r, ..]| F4::ONE + (r - F4::ONE) * m.occlusion_strength);
        let (mut color, contributions) = match self.features.has(Features::METALLIC_ROUGHNESS) {
            true => self.metallic_roughness(quad, point, specular_color, occlusion),
            false => {
                (self.blinn_phong(quad, point, specular_color, occlusion), LayerContributions::default())
            }
        };
        let layered = self.features.has(Features::LAYERS);
        if layered {
            color = (color + contributions.blurred_environment) * contributions.sheen_attenuation
                + contributions.sheen;
        }
        if self.features.has(Features::EMISSIVE) {
            color = color + self.emission(quad);
        }
        if layered {
            color = color.mix(contributions.coat, contributions.coat_weight);
        }
        color = apply_view_transform(self.features, self.apply_exposure(color));
        if self.features.has(Features::REFRACTION) {
            // The scene color copy holds display colors already.
            color = color
                + contributions.refracted
                    * (contributions.sheen_attenuation * (F4::ONE - contributions.coat_weight));
        }
        match self.glass {
            Glass::No | Glass::Refract => color,
            Glass::Light => color * alpha,
            Glass::Filter => {
                let through = contributions.transmitted
                    * (contributions.sheen_attenuation * (F4::ONE - contributions.coat_weight));
                V3::splat(Vec3::ONE).mix(through, alpha)
            }
        }
    }

    fn apply_exposure(&self, light: V3) -> V3 {
        match self.features.has(Features::EXPOSURE) {
            true => light * F4::splat(self.plan.exposure),
            false => light,
        }
    }

    fn metallic_roughness(
        &self,
        quad: &Quad,
        point: &SurfacePoint,
        specular_color: V3,
        occlusion: F4,
    ) -> (V3, LayerContributions) {
        let m = &self.material.factors.material;
        let &SurfacePoint { n, v, base, geometric_n, .. } = point;
        let (mut metallic, mut roughness) = (F4::splat(m.metallic), F4::splat(m.roughness));
        if let Some([_, g, b, _]) = self.sample_feature_texture(quad, Features::METALLIC_ROUGHNESS_TEXTURE) {
            roughness *= g;
            metallic *= b;
        }
        let mut specular = F4::splat(m.specular);
        if let Some([.., a]) = self.sample_feature_texture(quad, Features::SPECULAR_TEXTURE) {
            specular *= a;
        }
        let mut s = surface_of(base, metallic, roughness, specular, specular_color);
        let nv = n.dot(v).clamp(0.001, 1.0);
        let environment = self.environment_light();
        let is_dark = environment.is_dark();
        let layers = m.layers.as_deref().filter(|_| self.features.has(Features::LAYERS));
        let contributions = layers.map_or_else(LayerContributions::default, |layers| {
            let environment = (!is_dark).then_some(&environment);
            let layered = LayeredPoint {
                fragment: self,
                quad,
                point,
                layers,
                environment,
                metallic,
                roughness,
                occlusion,
                nv,
            };
            layered.contributions(&mut s)
        });
        let mut color = V3::splat(Vec3::ZERO);
        if !is_dark {
            let mirror_direction = contributions.sky_direction.unwrap_or_else(|| n * (n.dot(v) * 2.0) - v);
            let f0 = contributions.sky_f0.unwrap_or(s.f0);
            let specular = ambient_specular(f0, s.f90, s.roughness, nv);
            let reflected = environment.reflected(mirror_direction, s.roughness) * specular;
            let behind = contributions.back_light * environment.diffuse(-n);
            color = (s.diffuse * environment.diffuse(n) + reflected + behind) * occlusion;
        }
        self.add_lights_or_effects(point, &mut color, |l, nl| reflect_light(&s, n, v, l, nv, nl));
        if self.features.has(Features::DIFFUSE_TRANSMISSION) {
            self.add_lights(point, [-geometric_n, -n], &mut color, |_, _| contributions.back_light);
        }
        (color, contributions)
    }

    fn blinn_phong(&self, quad: &Quad, point: &SurfacePoint, specular_color: V3, occlusion: F4) -> V3 {
        let &SurfacePoint { n, v, .. } = point;
        // A reflection replaces its share of the base color.
        let reflection = self.reflection(quad, [n, v]);
        let base = reflection.map_or(point.base, |[share, _]| point.base * (V3::splat(Vec3::ONE) - share));
        let mut color = base * self.environment_light().diffuse(n) * occlusion;
        if let Some([share, reflected]) = reflection {
            color = color + share * reflected * occlusion;
        }
        let shininess = self.material.factors.material.shininess;
        let blinn = !self.features.has(Features::PHONG);
        self.add_lights_or_effects(&SurfacePoint { base, ..*point }, &mut color, |l, _| {
            reflect_light_phong(base, [specular_color, n, v, l], shininess, blinn)
        });
        color
    }

    /// Emitted light; zero without emission.
    fn emission(&self, quad: &Quad) -> V3 {
        if !self.features.has(Features::EMISSIVE) {
            return V3::splat(Vec3::ZERO);
        }
        let emissive = V3::splat(self.material.factors.material.emissive);
        self.sample_feature_texture(quad, Features::EMISSIVE_TEXTURE)
            .map_or(emissive, |texel| emissive * rgb(texel))
    }

    fn toon_color(&self, quad: &Quad, point: &SurfacePoint) -> V3 {
        let &SurfacePoint { relative, geometric_n, n, v, base, visible } = point;
        let material = &self.material.factors.material;
        let default = Toon::default();
        let toon = material.toon.as_deref().unwrap_or(&default);
        let shade = V3::splat(toon.shade_color * self.tint.truncate());
        let shift = self.sample_feature_texture(quad, Features::SHADING_SHIFT_TEXTURE);
        let slot = texture_slot(Features::MATCAP_TEXTURE);
        let references = self.material.factors.textures;
        let matcap = match (references[slot].as_ref(), self.material.textures[slot].as_deref()) {
            (Some(r), Some(texture)) if self.features.has(Features::MATCAP_TEXTURE) => {
                V3::splat(toon.matcap) * rgb(texture.sample(&r.sampler, matcap_uv(n, v)))
            }
            _ => V3::splat(Vec3::ZERO),
        };
        let surface = ToonSurface {
            toon,
            base,
            shade: shade * rgb_or_white(self.sample_feature_texture(quad, Features::SHADE_COLOR_TEXTURE)),
            shift: F4::splat(toon.shading_shift)
                + shift.map_or(F4::ZERO, |[r, ..]| r * toon.shading_shift_scale),
            matcap,
            rim_mask: rgb_or_white(self.sample_feature_texture(quad, Features::RIM_TEXTURE)),
        };
        let environment = self.environment_light();
        surface.toon_lit(self.plan, &environment, relative, [n, v], |light, l| {
            self.unshadowed_share(light, [relative, geometric_n, l], visible)
        })
    }

    pub(super) fn environment_light(&self) -> EnvironmentLight<'_> {
        EnvironmentLight::new(self.plan, self.sky.filter(|_| self.features.has(Features::SKY)))
    }

    /// The texture of a feature, sampled at four pixels; `None` if the draw does not read it.
    pub(super) fn sample_feature_texture(&self, quad: &Quad, feature: Features) -> Option<[F4; 4]> {
        if !self.features.has(feature) {
            return None;
        }
        let slot = texture_slot(feature);
        let references = self.material.factors.textures;
        self.sample_material_texture(quad, references[slot].as_ref(), self.material.textures[slot].as_deref())
    }

    /// Share of the light that is not shadowed, 0 to 1, in the lanes that `lanes` selects. `geometric_n`: normal without the normal
    /// map; `l`: direction to the light.
    pub(super) fn unshadowed_share(
        &self,
        light: &PlanLight,
        [relative, geometric_n, l]: [V3; 3],
        lanes: Mask,
    ) -> F4 {
        let shadows = self.shadows.filter(|_| self.features.has(Features::SHADOW));
        shadows.map_or(F4::ONE, |s| s.unshadowed_share(light, [relative, geometric_n, l], lanes))
    }

    #[inline(always)]
    pub(super) fn add_lights(
        &self,
        point: &SurfacePoint,
        [geometric_n, n]: [V3; 2],
        color: &mut V3,
        reflect: impl Fn(V3, F4) -> V3,
    ) {
        for light in self.lights_reaching(point.relative) {
            let (l, strength) = light.incoming(point.relative);
            let nl = n.dot(l).clamp(0.0, 1.0);
            let falling = (nl * strength).0.map(|falling| falling > 0.0);
            if falling == NO_LANES {
                continue;
            }
            let lanes = std::array::from_fn(|i| falling[i] & point.visible[i]);
            let strength = strength * self.unshadowed_share(light, [point.relative, geometric_n, l], lanes);
            let lit = reflect(l, nl) * V3::splat(light.color) * (nl * strength);
            // The division by NL in V is meaningless for light from behind the surface.
            let facing_light = |c: F4| F4(std::array::from_fn(|i| if nl.0[i] > 0.0 { c.0[i] } else { 0.0 }));
            *color = *color + V3 { x: facing_light(lit.x), y: facing_light(lit.y), z: facing_light(lit.z) };
        }
    }

    /// Interpolated normal, or the normal of the normal map by MikkTSpace: x·T + y·(N × T · sign) + z·N of the interpolated vectors, then
    /// normalized. Flipped on back faces.
    pub(super) fn normal(&self, quad: &Quad, map: Option<([F4; 4], f32)>) -> V3 {
        let n = match map {
            Some(([x, y, z, _], scale)) => {
                let [tangent, bitangent, normal] = quad.tangent_frame();
                let (x, y) = ((x * 2.0 - F4::ONE) * scale, (y * 2.0 - F4::ONE) * scale);
                (tangent * x + bitangent * y + normal * (z * 2.0 - F4::ONE)).unit()
            }
            None => quad.interpolate_vec3(|v| v.normal).unit(),
        };
        if self.double_sided && !quad.front { -n } else { n }
    }
}
