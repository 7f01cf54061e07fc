//! CPU reference of scene.wgsl: the fragment shader, a 2×2 quad at a time, linear colour out.

use super::brdf::*;
use super::coverage::covered;
use super::lanes::{F4, V3, Weights};
use super::layers::*;
use super::lighting::Lit;
use super::refraction::SceneColorCopy;
use super::shadow::ShadowMaps;
use super::sky::Around;
use super::texture::Texture;
use super::thin_film::{film_f0, film_reflectance};
use super::toon::{ToonSurface, matcap_uv};
use super::triplanar::Planes;
use super::vertex::Vertex;
use crate::plan::{Features, Glass, Plan, PlanLight};
use crate::scene_resources::material::MaterialResource;
use crate::scene_resources::material::{BASE_SLOTS, TEXTURE_SLOTS};
use crate::sky::SkyMaps;
use choreo_asset::{AlphaMode, Primitive, Toon};
use choreo_plugin::Effect;
use glam::{Vec3, Vec4};
use std::sync::Arc;

/// A material with its textures at hand.
pub struct ShadeMaterial {
    pub factors: MaterialResource,
    /// Textures in the order of `MaterialResource::textures`.
    pub textures: [Option<Arc<Texture>>; TEXTURE_SLOTS],
}

/// Everything a quad needs beside its weights.
pub struct Fragment<'a> {
    pub plan: &'a Plan,
    /// Shadow maps, if some light casts.
    pub shadows: Option<&'a ShadowMaps>,
    /// The picture behind glass that bends light.
    pub behind: Option<Arc<SceneColorCopy>>,
    /// Sky maps, if a sky shines.
    pub sky: Option<&'a SkyMaps>,
    /// Effects on the surface, in order.
    pub surface: Vec<(Arc<dyn Effect>, [f32; 8])>,
    /// Effects that say what comes of light.
    pub lighting: Vec<(Arc<dyn Effect>, [f32; 8])>,
    pub features: Features,
    pub blend: bool,
    /// The alpha test keeps samples, not whole pixels.
    pub coverage: bool,
    pub glass: Glass,
    pub double_sided: bool,
    pub tint: Vec4,
    pub primitive: &'a Primitive,
    pub material: &'a ShadeMaterial,
}

/// Every sample of a pixel.
pub const ALL_SAMPLES: u8 = 0b1111;

/// Linear RGBA of four pixels, and which samples of them the alpha test keeps, a bit each.
pub struct Shaded {
    pub rgba: [F4; 4],
    pub kept: [u8; 4],
}

impl Shaded {
    #[inline(always)]
    pub fn pixel(&self, i: usize) -> Vec4 {
        Vec4::new(self.rgba[0].0[i], self.rgba[1].0[i], self.rgba[2].0[i], self.rgba[3].0[i])
    }
}

/// What the layers add to a surface; by default nothing.
struct Over {
    /// What comes through from behind, of the picture and of the hemisphere light.
    through: V3,
    behind: V3,
    below_sheen: F4,
    sheen: V3,
    coat_weight: F4,
    coat: V3,
    /// Colour of the light from behind that comes out in front.
    from_behind: V3,
    /// What the sky's reflection is seen by: F0 and direction, where the layers change them.
    sky_f0: Option<V3>,
    mirror: Option<V3>,
}

impl Default for Over {
    fn default() -> Over {
        let none = V3::splat(Vec3::ZERO);
        Over {
            through: none,
            behind: none,
            below_sheen: F4::ONE,
            sheen: none,
            coat_weight: F4::ZERO,
            coat: none,
            from_behind: none,
            sky_f0: None,
            mirror: None,
        }
    }
}

pub struct Quad<'a> {
    pub weights: &'a Weights,
    pub uvs: [[F4; 2]; 2],
    /// How much of a motion of the textures each pixel makes, where a mask says so.
    pub uv_mask: Option<F4>,
    /// How far heights shift the textures.
    pub relief: Option<[F4; 2]>,
    /// Planes of triplanar textures.
    pub planes: Option<Planes>,
}

impl Fragment<'_> {
    pub fn shade(&self, vertices: &[Vertex], ids: [u32; 3], front: bool, weights: &Weights) -> Shaded {
        let mut shaded = self.surface(vertices, ids, front, weights);
        if self.features.has(Features::SHELL) || self.features.has(Features::EDGES) {
            let toon = self.material.factors.material.toon.as_ref();
            if let Some(outline) = toon.and_then(|t| t.outline.as_ref()) {
                for (out, color) in shaded.rgba.iter_mut().zip(outline.color.to_array()) {
                    *out = F4::ONE.mix(*out, F4::splat(outline.lighting_mix)) * color;
                }
            }
        }
        shaded
    }

    fn surface(&self, vertices: &[Vertex], ids: [u32; 3], front: bool, weights: &Weights) -> Shaded {
        let f = self.features;
        let m = &self.material.factors.material;
        let refs = self.material.factors.textures;
        let mut quad = self.quad(ids, weights);
        if f.has(Features::RELIEF) {
            quad.relief = self.relief(vertices, ids, &quad);
        }
        let quad = quad;
        let texture = |slot: usize, bit: Features| {
            if !f.has(bit) {
                return None;
            }
            self.sample(&quad, refs[slot].as_ref(), self.material.textures[slot].as_deref())
        };

        let base = m.base_color * self.tint;
        let mut rgba = [base.x, base.y, base.z, base.w].map(F4::splat);
        if f.has(Features::VERTEX_COLOR) && !self.primitive.colors.is_empty() {
            let [a, b, c] = ids.map(|i| self.primitive.colors[i as usize].to_array());
            for (i, out) in rgba.iter_mut().enumerate() {
                *out *= quad.weights.scalar(a[i], b[i], c[i]);
            }
        }
        if let Some(texel) = texture(0, Features::BASE_COLOR_TEXTURE) {
            for (out, t) in rgba.iter_mut().zip(texel) {
                *out *= t;
            }
        }
        let mut kept = [ALL_SAMPLES; 4];
        if f.has(Features::ALPHA_MASK)
            && let AlphaMode::Mask(cutoff) = m.alpha_mode
        {
            kept = match self.coverage {
                true => covered(rgba[3].0, cutoff),
                false => rgba[3].0.map(|a| if a >= cutoff { ALL_SAMPLES } else { 0 }),
            };
            if kept == [0; 4] {
                return Shaded { rgba, kept };
            }
        }
        let alpha = if self.blend { rgba[3] } else { F4::ONE };
        if !f.is_lit() {
            return Shaded { rgba: [rgba[0], rgba[1], rgba[2], alpha], kept };
        }

        let base = V3 { x: rgba[0], y: rgba[1], z: rgba[2] };
        let map = texture(2, Features::NORMAL_TEXTURE).map(|t| (t, m.normal_scale));
        let bent = self.triplanar_normal(vertices, ids, front, &quad);
        let n = bent.unwrap_or_else(|| self.normal(vertices, ids, front, &quad, map));
        let [a, b, c] = ids.map(|i| vertices[i as usize].relative);
        let relative = weights.vec3([a, b, c]);
        let own_n = match f.has(Features::SHADOW) {
            true => self.normal(vertices, ids, front, &quad, None),
            false => n,
        };
        let eye = self.plan.view.eye;
        let v = (V3::splat(eye.truncate()) - relative * F4::splat(eye.w)).unit();
        if f.has(Features::TOON) {
            let color = self.toon(&quad, base, relative, [own_n, n], v) + self.emission(&quad);
            return Shaded { rgba: [color.x, color.y, color.z, alpha], kept };
        }
        let mut specular_color = V3::splat(m.specular_color);
        if let Some([r, g, b, _]) = texture(6, Features::SPECULAR_COLOR_TEXTURE) {
            specular_color = specular_color * V3 { x: r, y: g, z: b };
        }
        let mut occlusion = F4::ONE;
        if let Some([r, ..]) = texture(3, Features::OCCLUSION_TEXTURE) {
            occlusion = F4::ONE + (r - F4::ONE) * m.occlusion_strength;
        }

        let around = self.around();
        let dark = around.is_dark();
        let mut color;
        let mut over = Over::default();
        if f.has(Features::METALLIC_ROUGHNESS) {
            let (mut metallic, mut roughness) = (F4::splat(m.metallic), F4::splat(m.roughness));
            if let Some([_, g, b, _]) = texture(1, Features::METALLIC_ROUGHNESS_TEXTURE) {
                roughness *= g;
                metallic *= b;
            }
            let mut specular = F4::splat(m.specular);
            if let Some([.., a]) = texture(5, Features::SPECULAR_TEXTURE) {
                specular *= a;
            }
            let mut s = surface_of(base, metallic, roughness, specular, specular_color);
            let nv = n.dot(v).clamp(0.001, 1.0);
            if let Some(l) = m.layers.as_deref().filter(|_| f.has(Features::LAYERS)) {
                let none = V3::splat(Vec3::ZERO);
                let sky = |way: V3| if dark { none } else { around.diffuse(way) };
                let mirror = |way: V3, rough: F4| if dark { none } else { around.mirrored(way, rough) };
                let layer = |slot: usize, bit: Features| texture(BASE_SLOTS + slot, bit);
                if f.has(Features::ANISOTROPY) {
                    let texel = layer(9, Features::ANISOTROPY_TEXTURE);
                    let (brushed, mirror) =
                        self.brushed(vertices, ids, &quad, l, (texel, s.roughness), (n, v));
                    s.brushed = Some(brushed);
                    over.mirror = Some(mirror);
                }
                if f.has(Features::IRIDESCENCE) {
                    let mut share = F4::splat(l.iridescence);
                    if let Some([r, ..]) = layer(7, Features::IRIDESCENCE_TEXTURE) {
                        share *= r;
                    }
                    let [thin, thick] = self.material.factors.film_thickness().to_array().map(F4::splat);
                    let thickness = match layer(8, Features::IRIDESCENCE_THICKNESS_TEXTURE) {
                        Some([_, g, ..]) => thin.mix(thick, g),
                        None => thick,
                    };
                    let film = film_reflectance(l.iridescence_ior, thickness, nv, s.f0);
                    over.sky_f0 = Some(s.f0.mix(film_f0(film, nv), share));
                    s.film = Some((film, share));
                }
                let depth = (f.has(Features::VOLUME) || f.has(Features::REFRACTION)).then(|| {
                    let [a, b, c] = ids.map(|i| vertices[i as usize].scale);
                    let mut depth = weights.scalar(a, b, c) * l.thickness;
                    if let Some([_, g, ..]) = layer(6, Features::THICKNESS_TEXTURE) {
                        depth *= g;
                    }
                    depth
                });
                let absorbed =
                    depth.filter(|_| f.has(Features::VOLUME)).map(|d| let_through(l.extinction(), d));
                if f.has(Features::TRANSMISSION) {
                    let mut transmission = (F4::ONE - metallic) * l.transmission;
                    if let Some([r, ..]) = layer(5, Features::TRANSMISSION_TEXTURE) {
                        transmission *= r;
                    }
                    let reflected = ambient_specular(s.f0, s.f90, s.roughness, nv);
                    let mut through = base * transmission * (V3::splat(Vec3::ONE) - reflected);
                    if let Some(absorbed) = absorbed {
                        through = through * absorbed;
                    }
                    if let Some(depth) = depth.filter(|_| f.has(Features::REFRACTION)) {
                        over.behind = through * self.refracted(relative, [n, v], l, depth, roughness);
                    } else {
                        let blurred = roughness * roughness;
                        over.behind = through * mirror(-v, s.roughness) * blurred;
                        over.through = through * (F4::ONE - blurred);
                    }
                    s.diffuse = s.diffuse * (F4::ONE - transmission);
                }
                if f.has(Features::DIFFUSE_TRANSMISSION) {
                    let mut share = F4::splat(l.diffuse_transmission);
                    if let Some([.., a]) = layer(10, Features::DIFFUSE_TRANSMISSION_TEXTURE) {
                        share *= a;
                    }
                    let mut color = V3::splat(l.diffuse_transmission_color);
                    if let Some([r, g, b, _]) = layer(11, Features::DIFFUSE_TRANSMISSION_COLOR_TEXTURE) {
                        color = color * V3 { x: r, y: g, z: b };
                    }
                    if let Some(absorbed) = absorbed {
                        color = color * absorbed;
                    }
                    let grazing = F4::ONE - nv;
                    let f90 = V3 { x: s.f90, y: s.f90, z: s.f90 };
                    let reflected = s.f0 + (f90 - s.f0) * (grazing * grazing * grazing * grazing * grazing);
                    let rest = (F4::ONE - metallic) * (F4::ONE - reflected.max_component());
                    over.from_behind = color * (share * rest);
                    s.diffuse = s.diffuse * (F4::ONE - share);
                }
                if f.has(Features::SHEEN) {
                    let mut sheen_color = V3::splat(l.sheen_color);
                    if let Some([r, g, b, _]) = layer(3, Features::SHEEN_COLOR_TEXTURE) {
                        sheen_color = sheen_color * V3 { x: r, y: g, z: b };
                    }
                    let mut roughness = F4::splat(l.sheen_roughness);
                    if let Some([.., a]) = layer(4, Features::SHEEN_ROUGHNESS_TEXTURE) {
                        roughness *= a;
                    }
                    let roughness = roughness.max(F4::splat(0.07));
                    let share = sheen_albedo(roughness, nv);
                    let mut sheen = sky(n) * (share * occlusion);
                    self.lights(relative, [own_n, n], &mut sheen, |l, nl| {
                        let nl = nl.max(F4::splat(0.001));
                        V3::splat(Vec3::ONE) * sheen_lobe(roughness, n, v, l, nv, nl)
                    });
                    over.below_sheen = F4::ONE - sheen_color.max_component() * share;
                    over.sheen = sheen_color * sheen;
                }
                if f.has(Features::CLEARCOAT) {
                    let map = layer(2, Features::CLEARCOAT_NORMAL_TEXTURE);
                    let map = map.map(|t| (t, l.clearcoat_normal_scale));
                    let n = self.normal(vertices, ids, front, &quad, map);
                    let mut weight = F4::splat(l.clearcoat);
                    if let Some([r, ..]) = layer(0, Features::CLEARCOAT_TEXTURE) {
                        weight *= r;
                    }
                    let mut roughness = F4::splat(l.clearcoat_roughness);
                    if let Some([_, g, ..]) = layer(1, Features::CLEARCOAT_ROUGHNESS_TEXTURE) {
                        roughness *= g;
                    }
                    let roughness = roughness.max(F4::splat(0.045));
                    let nv = n.dot(v).clamp(0.001, 1.0);
                    over.coat_weight = weight * coat_fresnel(nv);
                    over.coat = mirror(n * (n.dot(v) * 2.0) - v, roughness) * occlusion;
                    self.lights(relative, [own_n, n], &mut over.coat, |l, nl| {
                        V3::splat(Vec3::ONE) * coat_lobe(roughness, n, v, l, nv, nl)
                    });
                }
            }
            color = V3::splat(Vec3::ZERO);
            if !dark {
                let mirrored = over.mirror.unwrap_or_else(|| n * (n.dot(v) * 2.0) - v);
                let f0 = over.sky_f0.unwrap_or(s.f0);
                let specular = ambient_specular(f0, s.f90, s.roughness, nv);
                let reflected = around.mirrored(mirrored, s.roughness) * specular;
                let behind = over.from_behind * around.diffuse(-n);
                color = (s.diffuse * around.diffuse(n) + reflected + behind) * occlusion;
            }
            let on = Lit { relative, own_n, n, v, base };
            self.all_lights(&on, &mut color, |l, nl| reflect_light(&s, n, v, l, nv, nl));
            if f.has(Features::DIFFUSE_TRANSMISSION) {
                self.lights(relative, [-own_n, -n], &mut color, |_, _| over.from_behind);
            }
        } else {
            // What is mirrored takes the base colour's place.
            let reflection = self.reflection(&quad, [n, v]);
            let base = reflection.map_or(base, |[share, _]| base * (V3::splat(Vec3::ONE) - share));
            color = base * around.diffuse(n) * occlusion;
            if let Some([share, seen]) = reflection {
                color = color + share * seen * occlusion;
            }
            self.all_lights(&Lit { relative, own_n, n, v, base }, &mut color, |l, _| {
                reflect_light_phong(base, [specular_color, n, v, l], m.shininess, !f.has(Features::PHONG))
            });
        }
        let layered = f.has(Features::LAYERS);
        if layered {
            color = (color + over.behind) * over.below_sheen + over.sheen;
        }
        if f.has(Features::EMISSIVE) {
            color = color + self.emission(&quad);
        }
        if layered {
            color = color.mix(over.coat, over.coat_weight);
        }
        let color = match self.glass {
            Glass::No | Glass::Refract => color,
            Glass::Light => color * alpha,
            Glass::Filter => {
                let through = over.through * (over.below_sheen * (F4::ONE - over.coat_weight));
                V3::splat(Vec3::ONE).mix(through, alpha)
            }
        };
        Shaded { rgba: [color.x, color.y, color.z, alpha], kept }
    }

    /// Zero where the draw has none.
    fn emission(&self, quad: &Quad) -> V3 {
        if !self.features.has(Features::EMISSIVE) {
            return V3::splat(Vec3::ZERO);
        }
        let emissive = V3::splat(self.material.factors.material.emissive);
        match self.slot(quad, 4, Features::EMISSIVE_TEXTURE) {
            Some([r, g, b, _]) => emissive * V3 { x: r, y: g, z: b },
            None => emissive,
        }
    }

    /// Toon shading; for the slots see [`Features::TOON`].
    fn toon(&self, quad: &Quad, base: V3, relative: V3, [own_n, n]: [V3; 2], v: V3) -> V3 {
        let material = &self.material.factors.material;
        let default = Toon::default();
        let toon = material.toon.as_deref().unwrap_or(&default);
        let rgb = |[r, g, b, _]: [F4; 4]| V3 { x: r, y: g, z: b };
        let one = V3 { x: F4::ONE, y: F4::ONE, z: F4::ONE };
        let shade = V3::splat(toon.shade_color * self.tint.truncate());
        let shift = self.slot(quad, 5, Features::SPECULAR_TEXTURE);
        let refs = self.material.factors.textures;
        let matcap = match (refs[1].as_ref(), self.material.textures[1].as_deref()) {
            (Some(r), Some(texture)) if self.features.has(Features::METALLIC_ROUGHNESS_TEXTURE) => {
                V3::splat(toon.matcap) * rgb(texture.sample(&r.sampler, matcap_uv(n, v)))
            }
            _ => V3::splat(Vec3::ZERO),
        };
        let surface = ToonSurface {
            toon,
            base,
            shade: shade * self.slot(quad, 6, Features::SPECULAR_COLOR_TEXTURE).map_or(one, rgb),
            shift: F4::splat(toon.shading_shift)
                + shift.map_or(F4::ZERO, |[r, ..]| r * toon.shading_shift_scale),
            matcap,
            rim_mask: self.slot(quad, 3, Features::OCCLUSION_TEXTURE).map_or(one, rgb),
        };
        let around = self.around();
        surface.lit(self.plan, &around, relative, [n, v], |light, l| self.share(light, relative, own_n, l))
    }

    pub fn around(&self) -> Around<'_> {
        Around::new(self.plan, self.sky.filter(|_| self.features.has(Features::SKY)))
    }

    pub fn slot(&self, quad: &Quad, slot: usize, bit: Features) -> Option<[F4; 4]> {
        let refs = self.material.factors.textures;
        if !self.features.has(bit) {
            return None;
        }
        self.sample(quad, refs[slot].as_ref(), self.material.textures[slot].as_deref())
    }

    /// How much of a light arrives past what stands in its way.
    pub fn share(&self, light: &PlanLight, relative: V3, own_n: V3, l: V3) -> F4 {
        let shadows = self.shadows.filter(|_| self.features.has(Features::SHADOW));
        shadows.map_or(F4::ONE, |s| s.share(light, relative, own_n, l))
    }

    #[inline(always)]
    pub fn lights(&self, relative: V3, [own_n, n]: [V3; 2], color: &mut V3, reflect: impl Fn(V3, F4) -> V3) {
        for light in self.reaching(relative) {
            let (l, strength) = incoming(light, relative);
            let nl = n.dot(l).clamp(0.0, 1.0);
            if !(nl * strength).any_positive() {
                continue;
            }
            let strength = strength * self.share(light, relative, own_n, l);
            let lit = reflect(l, nl) * V3::splat(light.color.truncate()) * (nl * strength);
            // Where the light is behind the surface the division by NL in V means nothing.
            let seen = |c: F4| F4(std::array::from_fn(|i| if nl.0[i] > 0.0 { c.0[i] } else { 0.0 }));
            *color = *color + V3 { x: seen(lit.x), y: seen(lit.y), z: seen(lit.z) };
        }
    }

    /// Interpolated normal, or the normal map's as MikkTSpace has it: x·T + y·(N × T · sign) + z·N of the interpolated
    /// vectors, made neither orthogonal nor unit before; the result is normalised. Turned on back faces.
    fn normal(
        &self,
        vertices: &[Vertex],
        ids: [u32; 3],
        front: bool,
        quad: &Quad,
        map: Option<([F4; 4], f32)>,
    ) -> V3 {
        let interpolated = quad.weights.vec3(ids.map(|i| vertices[i as usize].normal));
        let mut n = match map {
            Some(([x, y, z, _], scale)) => {
                let t = ids.map(|i| vertices[i as usize].tangent);
                let tangent = quad.weights.vec3(t.map(|t| t.truncate()));
                let sign = quad.weights.scalar(t[0].w, t[1].w, t[2].w);
                let bitangent = interpolated.cross(tangent) * sign;
                let (x, y) = ((x * 2.0 - F4::ONE) * scale, (y * 2.0 - F4::ONE) * scale);
                (tangent * x + bitangent * y + interpolated * (z * 2.0 - F4::ONE)).unit()
            }
            None => interpolated.unit(),
        };
        if self.double_sided && !front {
            n = -n;
        }
        n
    }
}
