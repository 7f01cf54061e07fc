//! Layers of a metallic-roughness surface (coat, sheen, film, glass): how they change the surface below and the light that they
//! add. CPU reference of the parts of scene.wgsl that read the layers' uniform; the formulas are in layers.rs.

use super::brdf::{Surface, ambient_specular};
use super::layers::{coat_fresnel, coat_lobe, let_through, sheen_albedo, sheen_lobe};
use super::lighting::SurfacePoint;
use super::shade::{Fragment, Quad, rgb};
use super::sky::EnvironmentLight;
use super::thin_film::{film_f0, film_reflectance};
use crate::lanes::{F4, V3};
use crate::plan::Features;
use choreo_asset::MaterialLayers;
use glam::Vec3;

/// Contributions of a material's layers to a surface; by default none.
pub struct LayerContributions {
    /// Transmitted share of the scene behind.
    pub through: V3,
    /// Environment light transmitted by rough thin glass.
    pub blurred: V3,
    /// Transmitted part of the scene color copy, of refracting glass.
    pub refracted: V3,
    pub below_sheen: F4,
    pub sheen: V3,
    pub coat_weight: F4,
    pub coat: V3,
    /// Factor on light that falls on the back and is scattered out in front (diffuse transmission).
    pub from_behind: V3,
    /// F0 and direction of the sky's reflection, where layers change them.
    pub sky_f0: Option<V3>,
    pub mirror: Option<V3>,
}

impl Default for LayerContributions {
    fn default() -> LayerContributions {
        let none = V3::splat(Vec3::ZERO);
        LayerContributions {
            through: none,
            blurred: none,
            refracted: none,
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

/// Four points of a surface with layers.
pub(crate) struct LayeredPoint<'a> {
    pub fragment: &'a Fragment<'a>,
    pub quad: &'a Quad<'a>,
    pub point: &'a SurfacePoint,
    pub layers: &'a MaterialLayers,
    /// Environment light; `None` if there is none.
    pub environment: Option<&'a EnvironmentLight<'a>>,
    pub metallic: F4,
    pub roughness: F4,
    pub occlusion: F4,
    pub nv: F4,
}

impl LayeredPoint<'_> {
    /// Contributions of the layers. Also changes `s`, the surface below.
    pub fn contributions(&self, s: &mut Surface) -> LayerContributions {
        let f = self.fragment.features;
        let mut over = LayerContributions::default();
        if f.has(Features::ANISOTROPY) {
            let (anisotropy, mirror) =
                self.fragment.anisotropy(self.quad, self.layers, s.roughness, (self.point.n, self.point.v));
            s.anisotropy = Some(anisotropy);
            over.mirror = Some(mirror);
        }
        if f.has(Features::IRIDESCENCE) {
            self.iridescence(s, &mut over);
        }
        let depth = f.has_any(Features::VOLUME.with(Features::REFRACTION)).then(|| self.depth());
        let absorbed =
            depth.filter(|_| f.has(Features::VOLUME)).map(|d| let_through(self.layers.extinction(), d));
        if f.has(Features::TRANSMISSION) {
            self.transmission(s, &mut over, depth, absorbed);
        }
        if f.has(Features::DIFFUSE_TRANSMISSION) {
            self.diffuse_transmission(s, &mut over, absorbed);
        }
        if f.has(Features::SHEEN) {
            self.sheen(&mut over);
        }
        if f.has(Features::CLEARCOAT) {
            self.clearcoat(&mut over);
        }
        over
    }

    fn texel(&self, feature: Features) -> Option<[F4; 4]> {
        self.fragment.texel(self.quad, feature)
    }

    /// Environment light reflected along `way`; zero without environment light.
    fn mirrored(&self, way: V3, roughness: F4) -> V3 {
        self.environment.map_or(V3::splat(Vec3::ZERO), |environment| environment.mirrored(way, roughness))
    }

    fn iridescence(&self, s: &mut Surface, over: &mut LayerContributions) {
        let mut share = F4::splat(self.layers.iridescence);
        if let Some([r, ..]) = self.texel(Features::IRIDESCENCE_TEXTURE) {
            share *= r;
        }
        let [thin, thick] = self.fragment.material.factors.film_thickness().to_array().map(F4::splat);
        let thickness = match self.texel(Features::IRIDESCENCE_THICKNESS_TEXTURE) {
            Some([_, g, ..]) => thin.mix(thick, g),
            None => thick,
        };
        let film = film_reflectance(self.layers.iridescence_ior, thickness, self.nv, s.f0);
        over.sky_f0 = Some(s.f0.mix(film_f0(film, self.nv), share));
        s.film = Some((film, share));
    }

    /// Path length of light through the volume, in metres.
    fn depth(&self) -> F4 {
        let depth = self.quad.scalar(|v| v.scale) * self.layers.thickness;
        self.texel(Features::THICKNESS_TEXTURE).map_or(depth, |[_, g, ..]| depth * g)
    }

    fn transmission(
        &self,
        s: &mut Surface,
        over: &mut LayerContributions,
        depth: Option<F4>,
        absorbed: Option<V3>,
    ) {
        let &SurfacePoint { relative, n, v, base, .. } = self.point;
        let mut transmission = (F4::ONE - self.metallic) * self.layers.transmission;
        if let Some([r, ..]) = self.texel(Features::TRANSMISSION_TEXTURE) {
            transmission *= r;
        }
        let reflected = ambient_specular(s.f0, s.f90, s.roughness, self.nv);
        let mut through = base * transmission * (V3::splat(Vec3::ONE) - reflected);
        if let Some(absorbed) = absorbed {
            through = through * absorbed;
        }
        if let Some(depth) = depth.filter(|_| self.fragment.features.has(Features::REFRACTION)) {
            let seen = self.fragment.refracted(relative, [n, v], self.layers, depth, self.roughness);
            over.refracted = through * seen;
        } else {
            let blurred = self.roughness * self.roughness;
            over.blurred = through * self.mirrored(-v, s.roughness) * blurred;
            over.through = through * (F4::ONE - blurred);
        }
        s.diffuse = s.diffuse * (F4::ONE - transmission);
    }

    fn diffuse_transmission(&self, s: &mut Surface, over: &mut LayerContributions, absorbed: Option<V3>) {
        let mut share = F4::splat(self.layers.diffuse_transmission);
        if let Some([.., a]) = self.texel(Features::DIFFUSE_TRANSMISSION_TEXTURE) {
            share *= a;
        }
        let mut color = V3::splat(self.layers.diffuse_transmission_color);
        if let Some(texel) = self.texel(Features::DIFFUSE_TRANSMISSION_COLOR_TEXTURE) {
            color = color * rgb(texel);
        }
        if let Some(absorbed) = absorbed {
            color = color * absorbed;
        }
        let grazing = F4::ONE - self.nv;
        let f90 = V3 { x: s.f90, y: s.f90, z: s.f90 };
        let reflected = s.f0 + (f90 - s.f0) * (grazing * grazing * grazing * grazing * grazing);
        let rest = (F4::ONE - self.metallic) * (F4::ONE - reflected.max_component());
        over.from_behind = color * (share * rest);
        s.diffuse = s.diffuse * (F4::ONE - share);
    }

    fn sheen(&self, over: &mut LayerContributions) {
        let &SurfacePoint { own_n, n, v, .. } = self.point;
        let mut color = V3::splat(self.layers.sheen_color);
        if let Some(texel) = self.texel(Features::SHEEN_COLOR_TEXTURE) {
            color = color * rgb(texel);
        }
        let mut roughness = F4::splat(self.layers.sheen_roughness);
        if let Some([.., a]) = self.texel(Features::SHEEN_ROUGHNESS_TEXTURE) {
            roughness *= a;
        }
        let roughness = roughness.max(F4::splat(0.07));
        let share = sheen_albedo(roughness, self.nv);
        let sky = self.environment.map_or(V3::splat(Vec3::ZERO), |environment| environment.diffuse(n));
        let mut sheen = sky * (share * self.occlusion);
        self.fragment.lights(self.point, [own_n, n], &mut sheen, |l, nl| {
            let nl = nl.max(F4::splat(0.001));
            V3::splat(Vec3::ONE) * sheen_lobe(roughness, n, v, l, self.nv, nl)
        });
        over.below_sheen = F4::ONE - color.max_component() * share;
        over.sheen = color * sheen;
    }

    fn clearcoat(&self, over: &mut LayerContributions) {
        let &SurfacePoint { own_n, v, .. } = self.point;
        let map = self.texel(Features::CLEARCOAT_NORMAL_TEXTURE);
        let n = self.fragment.normal(self.quad, map.map(|t| (t, self.layers.clearcoat_normal_scale)));
        let mut weight = F4::splat(self.layers.clearcoat);
        if let Some([r, ..]) = self.texel(Features::CLEARCOAT_TEXTURE) {
            weight *= r;
        }
        let mut roughness = F4::splat(self.layers.clearcoat_roughness);
        if let Some([_, g, ..]) = self.texel(Features::CLEARCOAT_ROUGHNESS_TEXTURE) {
            roughness *= g;
        }
        let roughness = roughness.max(F4::splat(0.045));
        let nv = n.dot(v).clamp(0.001, 1.0);
        over.coat_weight = weight * coat_fresnel(nv);
        over.coat = self.mirrored(n * (n.dot(v) * 2.0) - v, roughness) * self.occlusion;
        self.fragment.lights(self.point, [own_n, n], &mut over.coat, |l, nl| {
            V3::splat(Vec3::ONE) * coat_lobe(roughness, n, v, l, nv, nl)
        });
    }
}
