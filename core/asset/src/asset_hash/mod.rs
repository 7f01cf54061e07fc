//! Content hashes of assets and of what they hold.

mod character;

use crate::asset::Asset;
use crate::camera::Projection;
use crate::hash::{ContentHash, Writer, hash_of};
use crate::image_sequence::ImageSequence;
use crate::light::Light;
use crate::material::{AlphaMode, FrameStrip, LineStyle, Material, Shading, Triplanar};
use crate::material_layers::MaterialLayers;
use crate::mesh::{Mesh, Primitive, Topology};
use crate::reflection::Reflection;
use crate::texture::{Image, Sampler, TextureRef, Wrap};
use crate::toon::{Outline, Toon, UvMotion};
use choreo_motion::{Clip, Interpolation, MaterialProperty, Path, PropertyTarget, Skeleton};
use std::sync::Arc;

impl Primitive {
    /// Hash of everything drawn except the material index: equal geometry is shared whatever its material.
    pub fn content_hash(&self) -> ContentHash {
        hash_of(|w| self.write(w))
    }

    fn write(&self, w: &mut Writer) {
        let Primitive {
            topology,
            indices,
            positions,
            normals,
            tangents,
            uvs,
            colors,
            influences,
            joint_indices,
            joint_weights,
            morphs,
            material: _,
        } = self;
        w.tag(match topology {
            Topology::Triangles => 0,
            Topology::Lines => 1,
            Topology::Points => 2,
        });
        w.numbers(indices, 4);
        w.vec3s(positions);
        w.vec3s(normals);
        w.vec4s(tangents);
        w.vec2s(&uvs[0]);
        w.vec2s(&uvs[1]);
        w.vec4s(colors);
        w.count(*influences);
        w.numbers(joint_indices, 2);
        w.f32s(joint_weights);
        w.list(morphs, |w, morph| {
            w.vec3s(&morph.positions);
            w.vec3s(&morph.normals);
            w.vec3s(&morph.tangents);
        });
    }
}

impl Mesh {
    /// Its primitives with their material indices; names are left out.
    pub fn content_hash(&self) -> ContentHash {
        hash_of(|w| self.write(w))
    }

    fn write(&self, w: &mut Writer) {
        w.list(&self.primitives, |w, primitive| {
            primitive.write(w);
            w.option(&primitive.material, |w, m| w.u32(*m));
        });
        w.count(self.morph_targets);
    }
}

impl Image {
    /// Size and pixels; the name is left out.
    pub fn content_hash(&self) -> ContentHash {
        hash_of(|w| {
            w.u32(self.width);
            w.u32(self.height);
            w.bytes(&self.rgba);
        })
    }
}

impl Material {
    /// Hash of everything except the name. Textures count by the content of their images where `images` has them, so that equal
    /// materials of two files are equal.
    pub fn content_hash(&self, images: &[Arc<Image>]) -> ContentHash {
        let of = |index: u32| images.get(index as usize).map(|image| image.content_hash());
        hash_of(|w| self.write_content(w, &of))
    }

    /// Writes everything that decides how the material looks. `image_hash` gives the content of an image by its index.
    pub fn write_content(&self, w: &mut Writer, image_hash: &dyn Fn(u32) -> Option<ContentHash>) {
        // One list of more than 80 lines: a new field does not compile until it is hashed or left out here.
        let Material {
            name: _,
            shading,
            base_color,
            base_color_texture,
            metallic,
            roughness,
            metallic_roughness_texture,
            normal_texture,
            normal_scale,
            relief,
            occlusion_texture,
            occlusion_strength,
            emissive,
            emissive_texture,
            specular,
            specular_texture,
            specular_color,
            specular_color_texture,
            shininess,
            reflection,
            toon,
            alpha_mode,
            double_sided,
            uv_motion,
            strip,
            sequence,
            line_style,
            triplanar,
            layers,
        } = self;
        w.tag(match shading {
            Shading::MetallicRoughness => 0,
            Shading::BlinnPhong => 1,
            Shading::Phong => 4,
            Shading::Unlit => 2,
            Shading::Toon => 3,
        });
        w.vec4(*base_color);
        for factor in [metallic, roughness, normal_scale, occlusion_strength, specular, shininess] {
            w.f32(*factor);
        }
        w.vec3(*emissive);
        w.vec3(*specular_color);
        match alpha_mode {
            AlphaMode::Opaque => w.tag(0),
            AlphaMode::Mask(cutoff) => {
                w.tag(1);
                w.f32(*cutoff);
            }
            AlphaMode::Blend => w.tag(2),
        }
        w.flag(*double_sided);
        w.f32(*relief);
        w.option(uv_motion, |w, motion| {
            [motion.scroll.x, motion.scroll.y, motion.rotation].iter().for_each(|v| w.f32(*v));
        });
        w.option(sequence, |w, sequence| image_sequence(w, sequence));
        w.option(triplanar, |w, Triplanar { middle, size, sharpness }| {
            w.vec3(*middle);
            w.f32(*size);
            w.f32(*sharpness);
        });
        w.option(line_style, |w, LineStyle { width, metres, round }| {
            w.f32(*width);
            w.flag(*metres);
            w.flag(*round);
        });
        w.option(strip, frame_strip);
        for texture in [
            base_color_texture,
            metallic_roughness_texture,
            normal_texture,
            occlusion_texture,
            emissive_texture,
            specular_texture,
            specular_color_texture,
        ] {
            self::texture(w, texture, image_hash);
        }
        w.option(reflection, |w, reflection| {
            let Reflection { color, texture, environment } = &**reflection;
            w.vec3(*color);
            self::texture(w, texture, image_hash);
            self::texture(w, environment, image_hash);
        });
        w.option(&toon.as_deref(), |w, toon| toon_parameters(w, toon, image_hash));
        w.option(&layers.as_deref(), |w, layers| layer_parameters(w, layers, image_hash));
    }
}

/// The layers over and under the base of a material.
fn layer_parameters(
    w: &mut Writer,
    layers: &MaterialLayers,
    image_hash: &dyn Fn(u32) -> Option<ContentHash>,
) {
    let MaterialLayers {
        clearcoat,
        clearcoat_roughness,
        clearcoat_normal_scale,
        sheen_color,
        sheen_roughness,
        transmission,
        thickness,
        ior,
        dispersion,
        attenuation_distance,
        attenuation_color,
        iridescence,
        iridescence_ior,
        iridescence_thickness: [thin, thick],
        anisotropy,
        anisotropy_rotation,
        diffuse_transmission,
        diffuse_transmission_color,
        ..
    } = layers;
    for factor in [
        clearcoat,
        clearcoat_roughness,
        clearcoat_normal_scale,
        sheen_roughness,
        transmission,
        thickness,
        ior,
        dispersion,
        attenuation_distance,
        iridescence,
        iridescence_ior,
        thin,
        thick,
        anisotropy,
        anisotropy_rotation,
        diffuse_transmission,
    ] {
        w.f32(*factor);
    }
    w.vec3(*sheen_color);
    w.vec3(*attenuation_color);
    w.vec3(*diffuse_transmission_color);
    layers.textures().iter().for_each(|t| texture(w, t, image_hash));
}

fn image_sequence(w: &mut Writer, sequence: &ImageSequence) {
    w.list(&sequence.streams, |w, stream| {
        w.tag(stream.slot as u8);
        w.list(&stream.hashes, |w, hash| w.bytes(hash));
    });
    w.f32(sequence.fps);
    w.flag(sequence.once);
}

fn frame_strip(w: &mut Writer, strip: &FrameStrip) {
    [strip.columns, strip.rows, strip.count].iter().for_each(|v| w.f64(f64::from(*v)));
    w.f32(strip.fps);
    w.flag(strip.once);
}

/// A texture counts by the content of its image where that is known.
fn texture(w: &mut Writer, texture: &Option<TextureRef>, image_hash: &dyn Fn(u32) -> Option<ContentHash>) {
    w.option(texture, |w, t| {
        match image_hash(t.image) {
            Some(hash) => w.bytes(&hash),
            None => w.u32(t.image),
        }
        let Sampler { wrap_u, wrap_v, mag_linear, min_linear, mip_linear } = t.sampler;
        for wrap in [wrap_u, wrap_v] {
            w.tag(match wrap {
                Wrap::Repeat => 0,
                Wrap::MirroredRepeat => 1,
                Wrap::ClampToEdge => 2,
            });
        }
        w.flag(mag_linear);
        w.flag(min_linear);
        w.option(&mip_linear, |w, linear| w.flag(*linear));
        w.tag(t.uv_set);
        w.affine2(&t.uv_transform);
    });
}

fn toon_parameters(w: &mut Writer, toon: &Toon, image_hash: &dyn Fn(u32) -> Option<ContentHash>) {
    let Toon {
        shade_color,
        shade_texture: _,
        shading_shift,
        shading_shift_texture: _,
        shading_shift_scale,
        shading_toony,
        gi_equalization,
        matcap,
        matcap_texture: _,
        rim_color,
        rim_fresnel_power,
        rim_lift,
        rim_texture: _,
        rim_lighting_mix,
        outline,
        uv_motion,
        uv_mask: _,
        uv_moved,
    } = toon;
    w.option(uv_motion, |w, UvMotion { scroll, rotation }| {
        w.f32s(&[scroll.x, scroll.y, *rotation]);
    });
    for color in [shade_color, matcap, rim_color, uv_moved] {
        w.vec3(*color);
    }
    for number in [
        shading_shift,
        shading_shift_scale,
        shading_toony,
        gi_equalization,
        rim_fresnel_power,
        rim_lift,
        rim_lighting_mix,
    ] {
        w.f32(*number);
    }
    for used in toon.textures() {
        texture(w, used, image_hash);
    }
    w.option(outline, |w, Outline { width, on_screen, width_texture: _, color, lighting_mix }| {
        w.f32(*width);
        w.flag(*on_screen);
        w.vec3(*color);
        w.f32(*lighting_mix);
    });
}

/// Name, tree, rest pose and the bones of a human body.
pub(crate) fn skeleton_hash(skeleton: &Skeleton) -> ContentHash {
    hash_of(|w| {
        w.list(skeleton.names(), |w, name| w.text(name));
        w.list(skeleton.parents(), |w, parent| w.option(parent, |w, p| w.u32(*p)));
        w.list(skeleton.rest(), |w, rest| {
            w.vec3(rest.translation);
            w.quat(rest.rotation);
            w.vec3(rest.scale);
        });
        w.option(&skeleton.humanoid(), |w, humanoid| character::humanoid(w, humanoid));
    })
}

/// Name, duration and authored curves.
pub fn clip_hash(clip: &Clip) -> ContentHash {
    hash_of(|w| {
        w.text(&clip.name);
        w.time(clip.duration);
        w.list(clip.curves(), |w, curve| {
            w.u32(curve.joint);
            match curve.path {
                Path::Translation => w.tag(0),
                Path::Rotation => w.tag(1),
                Path::Scale => w.tag(2),
                Path::Weights(n) => {
                    w.tag(3);
                    w.u32(n);
                }
            }
            w.interpolation(curve.interpolation);
            w.list(&curve.times, |w, t| w.time(*t));
            w.f32s(&curve.values);
        });
        w.list(clip.expressions(), |w, curve| {
            w.text(&curve.name);
            w.interpolation(curve.interpolation);
            w.list(&curve.times, |w, t| w.time(*t));
            w.f32s(&curve.values);
        });
        let properties: Vec<_> = clip.properties().collect();
        w.list(&properties, |w, (target, curve)| {
            let (kind, index) = match target {
                PropertyTarget::CameraYfov(i) => (0, *i),
                PropertyTarget::CameraHeight(i) => (1, *i),
                PropertyTarget::LightColor(i) => (2, *i),
                PropertyTarget::LightIntensity(i) => (3, *i),
                PropertyTarget::BaseColor(i) => (4, *i),
                PropertyTarget::LightRange(i) => (5, *i),
                PropertyTarget::SpotInner(i) => (6, *i),
                PropertyTarget::SpotOuter(i) => (7, *i),
                PropertyTarget::Material(i, _) => (8, *i),
            };
            w.tag(kind);
            w.u32(index);
            if let PropertyTarget::Material(_, property) = target {
                let (kind, slot) = match *property {
                    MaterialProperty::Emissive => (0, 0),
                    MaterialProperty::EmissiveStrength => (1, 0),
                    MaterialProperty::Metallic => (2, 0),
                    MaterialProperty::Roughness => (3, 0),
                    MaterialProperty::AlphaCutoff => (4, 0),
                    MaterialProperty::NormalScale => (5, 0),
                    MaterialProperty::OcclusionStrength => (6, 0),
                    MaterialProperty::UvOffset(slot) => (7, slot),
                    MaterialProperty::UvRotation(slot) => (8, slot),
                    MaterialProperty::UvScale(slot) => (9, slot),
                };
                w.tag(kind);
                w.tag(slot);
            }
            w.interpolation(curve.interpolation);
            w.list(&curve.times, |w, t| w.time(*t));
            w.f32s(&curve.values);
        });
    })
}

pub(crate) fn asset_hash(asset: &Asset) -> ContentHash {
    let images: Vec<ContentHash> = asset.images.iter().map(|image| image.content_hash()).collect();
    hash_of(|w| {
        let Asset {
            name,
            skeleton,
            meshes,
            skins,
            instances,
            placements,
            materials,
            images: _,
            cameras,
            lights,
            ambient,
            clips,
            expressions,
            springs,
            eyes,
            front,
            origin: _,
            warnings: _,
            derived: _,
        } = asset;
        w.text(name);
        w.bytes(&skeleton_hash(skeleton));
        w.list(meshes, |w, mesh| {
            mesh.write(w);
            w.text(&mesh.name);
            w.list(&mesh.morph_names, |w, name| w.text(name));
        });
        w.list(skins, |w, skin| {
            w.numbers(&skin.joints, 4);
            w.list(&skin.inverse_bind, |w, m| w.mat4(m));
        });
        w.list(instances, |w, instance| {
            w.u32(instance.joint);
            w.u32(instance.mesh);
            w.option(&instance.skin, |w, skin| w.u32(*skin));
            w.f32s(&instance.weights);
            w.list(&instance.copies, |w, copy| w.f32s(&copy.to_cols_array()));
        });
        w.list(placements, |w, place| w.f32s(&place.to_cols_array()));
        w.list(materials, |w, material| {
            material.write_content(w, &|index| images.get(index as usize).copied());
            w.text(&material.name);
        });
        w.list(&images, |w, hash| w.bytes(hash));
        w.list(cameras, |w, camera| {
            w.text(&camera.name);
            w.u32(camera.joint);
            w.projection(&camera.projection);
        });
        w.list(lights, |w, light| {
            w.text(&light.name);
            w.u32(light.joint);
            w.light(&light.light);
        });
        w.list(clips, |w, clip| w.bytes(&clip_hash(clip)));
        w.list(expressions, character::expression);
        character::springs(w, springs);
        w.option(eyes, character::eyes);
        // An asset without a given front writes nothing here, so that its hash stays as it was before this field existed.
        front.iter().for_each(|front| w.text(front.name()));
        if *ambient != glam::Vec3::ZERO {
            w.text("ambient");
            w.vec3(*ambient);
        }
    })
}

/// Types that both assets and stages contain.
impl Writer {
    /// Writes how values between keys are found.
    pub fn interpolation(&mut self, interpolation: Interpolation) {
        self.tag(match interpolation {
            Interpolation::Step => 0,
            Interpolation::Linear => 1,
            Interpolation::CubicSpline => 2,
        });
    }

    /// Writes a camera's projection.
    pub fn projection(&mut self, projection: &Projection) {
        match projection {
            Projection::Perspective { yfov, near, far } => {
                self.tag(0);
                self.f32(*yfov);
                self.f32(*near);
                self.option(far, |w, far| w.f32(*far));
            }
            Projection::Orthographic { height, near, far } => {
                self.tag(1);
                self.f32(*height);
                self.f32(*near);
                self.f32(*far);
            }
        }
    }

    /// Writes a light.
    pub fn light(&mut self, light: &Light) {
        let (number, parameters) = light.kind.numbered();
        self.tag(number);
        parameters.into_iter().for_each(|v| self.f32(v));
        self.vec3(light.color);
        self.f32(light.intensity);
        self.option(&light.range, |w, range| w.f32(*range));
    }
}
