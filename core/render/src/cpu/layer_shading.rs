//! Layers of a metallic-roughness surface (coat, sheen, film, glass): how they change the surface below and the light that they
//! add. CPU reference of the parts of scene.wgsl that read the layers' uniform; the formulas are in layers.rs.

use super::brdf::{Surface, ambient_specular};
use super::layers::{coat_fresnel, coat_lobe, sheen_albedo, sheen_lobe, volume_transmittance};
use super::lighting::SurfacePoint;
use super::shade::{Fragment, Quad, rgb};
use super::sky::EnvironmentLight;
use super::thin_film::{film_f0, film_reflectance};
use crate::lanes::{F4, V3};
use crate::plan::Features;
use choreo_asset::MaterialLayers;
use glam::Vec3;

/// Contributions of a material's layers to a surface; by default none.
pub(super) struct LayerContributions {
    /// Transmitted share of the scene behind.
    pub transmitted: V3,
    /// Environment light transmitted by rough thin glass.
    pub blurred_environment: V3,
    /// Transmitted part of the scene color copy, of refracting glass.
    pub refracted: V3,
    pub sheen_attenuation: F4,
    pub sheen: V3,
    pub coat_weight: F4,
    pub coat: V3,
    /// Factor on light that falls on the back and is scattered out in front (diffuse transmission).
    pub back_light: V3,
    /// F0 and direction of the sky's reflection, where layers change them.
    pub sky_f0: Option<V3>,
    pub sky_direction: Option<V3>,
}

impl Default for LayerContributions {
    fn default() -> LayerContributions {
        let none = V3::splat(Vec3::ZERO);
        LayerContributions {
            transmitted: none,
            blurred_environment: none,
            refracted: none,
            sheen_attenuation: F4::ONE,
            sheen: none,
            coat_weight: F4::ZERO,
            coat: none,
            back_light: none,
            sky_f0: None,
            sky_direction: None,
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
    pub(super) fn contributions(&self, s: &mut Surface) -> LayerContributions {
        let f = self.fragment.features;
        let mut contributions = LayerContributions::default();
        if f.has(Features::ANISOTROPY) {
            let (anisotropy, sky_direction) =
                self.fragment.anisotropy(self.quad, self.layers, s.roughness, (self.point.n, self.point.v));
            s.anisotropy = Some(anisotropy);
            contributions.sky_direction = Some(sky_direction);
        }
        if f.has(Features::IRIDESCENCE) {
            self.iridescence(s, &mut contributions);
        }
        let depth = f.has_any(Features::VOLUME.with(Features::REFRACTION)).then(|| self.path_length());
        let transmittance = depth
            .filter(|_| f.has(Features::VOLUME))
            .map(|d| volume_transmittance(self.layers.extinction(), d));
        if f.has(Features::TRANSMISSION) {
            self.transmission(s, &mut contributions, depth, transmittance);
        }
        if f.has(Features::DIFFUSE_TRANSMISSION) {
            self.diffuse_transmission(s, &mut contributions, transmittance);
        }
        if f.has(Features::SHEEN) {
            self.sheen(&mut contributions);
        }
        if f.has(Features::CLEARCOAT) {
            self.clearcoat(&mut contributions);
        }
        contributions
    }

    fn sample_feature_texture(&self, feature: Features) -> Option<[F4; 4]> {
        self.fragment.sample_feature_texture(self.quad, feature)
    }

    /// Environment light reflected along `direction`; zero without environment light.
    fn environment_reflection(&self, direction: V3, roughness: F4) -> V3 {
        self.environment
            .map_or(V3::splat(Vec3::ZERO), |environment| environment.reflected(direction, roughness))
    }

    fn iridescence(&self, s: &mut Surface, contributions: &mut LayerContributions) {
        let mut share = F4::splat(self.layers.iridescence);
        if let Some([r, ..]) = self.sample_feature_texture(Features::IRIDESCENCE_TEXTURE) {
            share *= r;
        }
        let [thin, thick] = self.fragment.material.factors.film_thickness().to_array().map(F4::splat);
        let thickness = match self.sample_feature_texture(Features::IRIDESCENCE_THICKNESS_TEXTURE) {
            Some([_, g, ..]) => thin.mix(thick, g),
            None => thick,
        };
        let film = film_reflectance(self.layers.iridescence_ior, thickness, self.nv, s.f0);
        contributions.sky_f0 = Some(s.f0.mix(film_f0(film, self.nv), share));
        s.film = Some((film, share));
    }

    /// Path length of light through the volume, in metres.
    fn path_length(&self) -> F4 {
        let depth = self.quad.interpolate_scalar(|v| v.scale) * self.layers.thickness;
        self.sample_feature_texture(Features::THICKNESS_TEXTURE).map_or(depth, |[_, g, ..]| depth * g)
    }

    fn transmission(
        &self,
        s: &mut Surface,
        contributions: &mut LayerContributions,
        depth: Option<F4>,
        transmittance: Option<V3>,
    ) {
        let &SurfacePoint { relative, n, v, base, .. } = self.point;
        let mut transmission = (F4::ONE - self.metallic) * self.layers.transmission;
        if let Some([r, ..]) = self.sample_feature_texture(Features::TRANSMISSION_TEXTURE) {
            transmission *= r;
        }
        let reflected = ambient_specular(s.f0, s.f90, s.roughness, self.nv);
        let mut through = base * transmission * (V3::splat(Vec3::ONE) - reflected);
        if let Some(transmittance) = transmittance {
            through = through * transmittance;
        }
        if let Some(depth) = depth.filter(|_| self.fragment.features.has(Features::REFRACTION)) {
            let refracted =
                self.fragment.refracted_color(relative, [n, v], self.layers, depth, self.roughness);
            contributions.refracted = through * refracted;
        } else {
            let blurred = self.roughness * self.roughness;
            contributions.blurred_environment =
                through * self.environment_reflection(-v, s.roughness) * blurred;
            contributions.transmitted = through * (F4::ONE - blurred);
        }
        s.diffuse = s.diffuse * (F4::ONE - transmission);
    }

    fn diffuse_transmission(
        &self,
        s: &mut Surface,
        contributions: &mut LayerContributions,
        transmittance: Option<V3>,
    ) {
        let mut share = F4::splat(self.layers.diffuse_transmission);
        if let Some([.., a]) = self.sample_feature_texture(Features::DIFFUSE_TRANSMISSION_TEXTURE) {
            share *= a;
        }
        let mut color = V3::splat(self.layers.diffuse_transmission_color);
        if let Some(texel) = self.sample_feature_texture(Features::DIFFUSE_TRANSMISSION_COLOR_TEXTURE) {
            color = color * rgb(texel);
        }
        if let Some(transmittance) = transmittance {
            color = color * transmittance;
        }
        let grazing = F4::ONE - self.nv;
        let f90 = V3 { x: s.f90, y: s.f90, z: s.f90 };
        let reflected = s.f0 + (f90 - s.f0) * (grazing * grazing * grazing * grazing * grazing);
        let rest = (F4::ONE - self.metallic) * (F4::ONE - reflected.max_component());
        contributions.back_light = color * (share * rest);
        s.diffuse = s.diffuse * (F4::ONE - share);
    }

    fn sheen(&self, contributions: &mut LayerContributions) {
        let &SurfacePoint { geometric_n, n, v, .. } = self.point;
        let mut color = V3::splat(self.layers.sheen_color);
        if let Some(texel) = self.sample_feature_texture(Features::SHEEN_COLOR_TEXTURE) {
            color = color * rgb(texel);
        }
        let mut roughness = F4::splat(self.layers.sheen_roughness);
        if let Some([.., a]) = self.sample_feature_texture(Features::SHEEN_ROUGHNESS_TEXTURE) {
            roughness *= a;
        }
        let roughness = roughness.max(F4::splat(0.07));
        let share = sheen_albedo(roughness, self.nv);
        let sky = self.environment.map_or(V3::splat(Vec3::ZERO), |environment| environment.diffuse(n));
        let mut sheen = sky * (share * self.occlusion);
        self.fragment.add_lights(self.point, [geometric_n, n], &mut sheen, |l, nl| {
            let nl = nl.max(F4::splat(0.001));
            V3::splat(Vec3::ONE) * sheen_lobe(roughness, n, v, l, self.nv, nl)
        });
        contributions.sheen_attenuation = F4::ONE - color.max_component() * share;
        contributions.sheen = color * sheen;
    }

    fn clearcoat(&self, contributions: &mut LayerContributions) {
        let &SurfacePoint { geometric_n, v, .. } = self.point;
        let map = self.sample_feature_texture(Features::CLEARCOAT_NORMAL_TEXTURE);
        let n = self.fragment.normal(self.quad, map.map(|t| (t, self.layers.clearcoat_normal_scale)));
        let mut weight = F4::splat(self.layers.clearcoat);
        if let Some([r, ..]) = self.sample_feature_texture(Features::CLEARCOAT_TEXTURE) {
            weight *= r;
        }
        let mut roughness = F4::splat(self.layers.clearcoat_roughness);
        if let Some([_, g, ..]) = self.sample_feature_texture(Features::CLEARCOAT_ROUGHNESS_TEXTURE) {
            roughness *= g;
        }
        let roughness = roughness.max(F4::splat(0.045));
        let nv = n.dot(v).clamp(0.001, 1.0);
        contributions.coat_weight = weight * coat_fresnel(nv);
        contributions.coat =
            self.environment_reflection(n * (n.dot(v) * 2.0) - v, roughness) * self.occlusion;
        self.fragment.add_lights(self.point, [geometric_n, n], &mut contributions.coat, |l, nl| {
            V3::splat(Vec3::ONE) * coat_lobe(roughness, n, v, l, nv, nl)
        });
    }
}
