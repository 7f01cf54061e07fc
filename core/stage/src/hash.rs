//! Content hashes (BLAKE3): equal content, equal hash, on every machine. Floats count by their bits, lists by length and content.
//!
//! They answer two questions: did a script give the same stage again, and are two meshes, materials or images the same thing.

use crate::*;
use choreo_motion::{Clip, Interpolation, Path, Skeleton, Time};
use glam::{Affine2, DQuat, DVec3, Mat4, Quat, Vec2, Vec3, Vec4};
use std::collections::BTreeMap;
use std::sync::Arc;

pub type ContentHash = [u8; 32];

/// Feeds a hasher with a length or tag before everything whose extent is not fixed, so that no two contents share a byte stream.
#[derive(Default)]
struct Writer(blake3::Hasher);

impl Writer {
    fn bytes(&mut self, bytes: &[u8]) {
        self.count(bytes.len());
        self.0.update(bytes);
    }
    fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
    }
    fn tag(&mut self, tag: u8) {
        self.0.update(&[tag]);
    }
    fn flag(&mut self, flag: bool) {
        self.tag(flag.into());
    }
    fn count(&mut self, n: usize) {
        self.0.update(&(n as u64).to_le_bytes());
    }
    fn u32(&mut self, v: u32) {
        self.0.update(&v.to_le_bytes());
    }
    fn f32(&mut self, v: f32) {
        self.u32(v.to_bits());
    }
    fn f64(&mut self, v: f64) {
        self.0.update(&v.to_bits().to_le_bytes());
    }
    fn time(&mut self, t: Time) {
        self.0.update(&t.0.to_le_bytes());
    }
    /// Plain little-endian numbers in one go; every supported machine is little-endian or takes the loop.
    fn pods<T: bytemuck::Pod>(&mut self, list: &[T], word: usize) {
        self.count(list.len());
        let bytes: &[u8] = bytemuck::cast_slice(list);
        if cfg!(target_endian = "little") {
            self.0.update(bytes);
        } else {
            for chunk in bytes.chunks(word) {
                let mut chunk = chunk.to_vec();
                chunk.reverse();
                self.0.update(&chunk);
            }
        }
    }
    fn f32s(&mut self, list: &[f32]) {
        self.pods(list, 4);
    }
    fn vec2s(&mut self, list: &[Vec2]) {
        self.pods(list, 4);
    }
    fn vec3s(&mut self, list: &[Vec3]) {
        self.pods(list, 4);
    }
    fn vec4s(&mut self, list: &[Vec4]) {
        self.pods(list, 4);
    }
    fn vec3(&mut self, v: Vec3) {
        v.to_array().into_iter().for_each(|c| self.f32(c));
    }
    fn vec4(&mut self, v: Vec4) {
        v.to_array().into_iter().for_each(|c| self.f32(c));
    }
    fn quat(&mut self, q: Quat) {
        self.vec4(q.into());
    }
    fn mat4(&mut self, m: &Mat4) {
        m.to_cols_array().into_iter().for_each(|c| self.f32(c));
    }
    fn dvec3(&mut self, v: DVec3) {
        v.to_array().into_iter().for_each(|c| self.f64(c));
    }
    fn dquat(&mut self, q: DQuat) {
        q.to_array().into_iter().for_each(|c| self.f64(c));
    }
    fn affine2(&mut self, a: &Affine2) {
        a.to_cols_array().into_iter().for_each(|c| self.f32(c));
    }
    fn option<T>(&mut self, value: &Option<T>, write: impl FnOnce(&mut Writer, &T)) {
        self.flag(value.is_some());
        if let Some(value) = value {
            write(self, value);
        }
    }
    fn list<T>(&mut self, list: &[T], mut write: impl FnMut(&mut Writer, &T)) {
        self.count(list.len());
        for item in list {
            write(self, item);
        }
    }
    fn finish(self) -> ContentHash {
        *self.0.finalize().as_bytes()
    }
}

fn hash_of(write: impl FnOnce(&mut Writer)) -> ContentHash {
    let mut w = Writer::default();
    write(&mut w);
    w.finish()
}

impl Primitive {
    /// Everything drawn, the material index left out: equal geometry is shared whatever it is painted with.
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
        w.pods(indices, 4);
        w.vec3s(positions);
        w.vec3s(normals);
        w.vec4s(tangents);
        w.vec2s(&uvs[0]);
        w.vec2s(&uvs[1]);
        w.vec4s(colors);
        w.count(*influences);
        w.pods(joint_indices, 2);
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
    /// Everything but the name. Textures count by the content of their images where `images` has them, so that equal
    /// materials of two files are equal.
    pub fn content_hash(&self, images: &[Arc<Image>]) -> ContentHash {
        let of = |index: u32| images.get(index as usize).map(|image| image.content_hash());
        hash_of(|w| self.write(w, &of))
    }

    fn write(&self, w: &mut Writer, image_hash: &dyn Fn(u32) -> Option<ContentHash>) {
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
            occlusion_texture,
            occlusion_strength,
            emissive,
            emissive_texture,
            specular,
            specular_texture,
            specular_color,
            specular_color_texture,
            shininess,
            alpha_mode,
            double_sided,
        } = self;
        w.tag(match shading {
            Shading::MetallicRoughness => 0,
            Shading::BlinnPhong => 1,
            Shading::Unlit => 2,
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
        for texture in [
            base_color_texture,
            metallic_roughness_texture,
            normal_texture,
            occlusion_texture,
            emissive_texture,
            specular_texture,
            specular_color_texture,
        ] {
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
    }
}

/// Name, tree and rest pose.
pub fn skeleton_hash(skeleton: &Skeleton) -> ContentHash {
    hash_of(|w| {
        w.list(skeleton.names(), |w, name| w.text(name));
        w.list(skeleton.parents(), |w, parent| w.option(parent, |w, p| w.u32(*p)));
        w.list(skeleton.rest(), |w, rest| {
            w.vec3(rest.translation);
            w.quat(rest.rotation);
            w.vec3(rest.scale);
        });
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
            materials,
            images: _,
            cameras,
            lights,
            clips,
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
            w.pods(&skin.joints, 4);
            w.list(&skin.inverse_bind, |w, m| w.mat4(m));
        });
        w.list(instances, |w, instance| {
            w.u32(instance.joint);
            w.u32(instance.mesh);
            w.option(&instance.skin, |w, skin| w.u32(*skin));
            w.f32s(&instance.weights);
        });
        w.list(materials, |w, material| {
            material.write(w, &|index| images.get(index as usize).copied());
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
    })
}

impl Stage {
    /// Everything that a snapshot depends on; warnings are left out. Hooks count by [`FrameHook::identity`].
    pub fn content_hash(&self) -> ContentHash {
        // One clip or mask is used by many cues and its curves may be long: hashed once a pointer.
        let mut clips: BTreeMap<usize, ContentHash> = BTreeMap::new();
        let mut masks: BTreeMap<usize, ContentHash> = BTreeMap::new();
        hash_of(|w| {
            let Stage { settings, actors, cameras, cuts, lights, effects, hooks, warnings: _ } = self;
            w.settings(settings);
            w.list(actors, |w, actor| {
                let Actor {
                    name,
                    asset,
                    transform,
                    parent,
                    face,
                    layers,
                    channels,
                    look_at,
                    visible,
                    tint,
                    morphs,
                    file_lights,
                } = actor;
                w.text(name);
                w.bytes(&asset.content_hash());
                w.dvec3(transform.translation);
                w.dquat(transform.rotation);
                w.dvec3(transform.scale);
                w.option(parent, |w, parent| w.attachment(parent));
                w.option(face, |w, face| w.count(*face));
                w.list(layers, |w, layer| {
                    w.option(&layer.mask, |w, mask| {
                        let key = Arc::as_ptr(mask) as usize;
                        let hash = *masks.entry(key).or_insert_with(|| hash_of(|w| w.f32s(mask)));
                        w.bytes(&hash);
                    });
                    w.list(&layer.cues, |w, cue| {
                        let key = Arc::as_ptr(&cue.clip) as usize;
                        let hash = *clips.entry(key).or_insert_with(|| clip_hash(&cue.clip));
                        w.bytes(&hash);
                        w.cue(cue);
                    });
                });
                w.list(channels, |w, channel| w.channel(channel));
                w.list(look_at, |w, look| {
                    w.u32(look.joint);
                    w.target(&look.target);
                    w.time(look.start);
                    w.option(&look.end, |w, end| w.time(*end));
                    w.time(look.fade);
                    w.f32(look.weight);
                });
                w.flag(*visible);
                w.vec4(*tint);
                w.list(morphs, |w, (instance, target, weight)| {
                    w.u32(*instance);
                    w.u32(*target);
                    w.f32(*weight);
                });
                w.flag(*file_lights);
            });
            w.list(cameras, |w, camera| {
                w.text(&camera.name);
                w.projection(&camera.projection);
                w.rig(&camera.rig);
                w.list(&camera.channels, |w, channel| w.channel(channel));
            });
            w.list(cuts, |w, cut| {
                w.time(cut.at);
                w.count(cut.camera);
            });
            w.list(lights, |w, light| {
                w.text(&light.name);
                w.light(&light.light);
                w.dvec3(light.position);
                w.vec3(light.direction);
                w.option(&light.parent, |w, parent| w.attachment(parent));
                w.list(&light.channels, |w, channel| w.channel(channel));
            });
            w.list(effects, |w, effect| {
                w.text(&effect.plugin);
                w.list(&effect.parameters, |w, (name, value)| {
                    w.text(name);
                    w.f64(*value);
                });
                w.time(effect.start);
                w.option(&effect.end, |w, end| w.time(*end));
            });
            w.list(hooks, |w, hook| w.text(&hook.identity()));
        })
    }
}

impl Snapshot {
    /// Every bit of it: two evaluations of one stage at one time must agree, wherever they ran.
    pub fn content_hash(&self) -> ContentHash {
        hash_of(|w| {
            let Snapshot { time, actors, camera, lights, background, ambient_up, ambient_down, effects } =
                self;
            w.time(*time);
            w.list(actors, |w, actor| {
                let ActorState { visible, world_from_model, model_from_joint, morph_weights, tint } = actor;
                w.flag(*visible);
                world_from_model.to_cols_array().into_iter().for_each(|v| w.f64(v));
                w.list(model_from_joint, |w, m| m.to_cols_array().into_iter().for_each(|v| w.f32(v)));
                w.list(morph_weights, |w, weights| w.f32s(weights));
                w.vec4(*tint);
            });
            w.option(&camera.camera, |w, index| w.count(*index));
            camera.world_from_view.to_cols_array().into_iter().for_each(|v| w.f64(v));
            w.projection(&camera.projection);
            w.list(lights, |w, light| {
                w.light(&light.light);
                w.dvec3(light.position);
                w.vec3(light.direction);
            });
            w.background(background);
            w.vec3(*ambient_up);
            w.vec3(*ambient_down);
            w.list(effects, |w, effect| w.count(*effect));
        })
    }
}

impl Writer {
    fn settings(&mut self, settings: &Settings) {
        let Settings { size, fps, length, background, ambient_up, ambient_down, samples } = settings;
        for v in [size[0], size[1], fps.num, fps.den] {
            self.u32(v);
        }
        self.time(*length);
        self.background(background);
        self.vec3(*ambient_up);
        self.vec3(*ambient_down);
        self.option(samples, |w, n| w.u32(*n));
    }

    fn background(&mut self, background: &Background) {
        match background {
            Background::Color(color) => {
                self.tag(0);
                self.vec4(*color);
            }
            Background::Gradient { top, bottom } => {
                self.tag(1);
                self.vec3(*top);
                self.vec3(*bottom);
            }
        }
    }

    fn cue(&mut self, cue: &Cue) {
        let Cue { clip: _, start, end, fade_in, fade_out, ease, speed, trim, repeat, weight } = cue;
        self.time(*start);
        self.option(end, |w, end| w.time(*end));
        for t in [fade_in, fade_out, &trim.0, &trim.1] {
            self.time(*t);
        }
        self.tag(match ease {
            Ease::Linear => 0,
            Ease::Smooth => 1,
        });
        self.f64(*speed);
        self.tag(match repeat {
            Repeat::Once => 0,
            Repeat::Loop => 1,
            Repeat::PingPong => 2,
        });
        self.f32(*weight);
    }

    fn interpolation(&mut self, interpolation: Interpolation) {
        self.tag(match interpolation {
            Interpolation::Step => 0,
            Interpolation::Linear => 1,
            Interpolation::CubicSpline => 2,
        });
    }

    fn channel(&mut self, channel: &Channel) {
        match channel.property {
            Property::Translation => self.tag(0),
            Property::Rotation => self.tag(1),
            Property::Scale => self.tag(2),
            Property::Visible => self.tag(3),
            Property::Tint => self.tag(4),
            Property::Morph { instance, target } => {
                self.tag(5);
                self.u32(instance);
                self.u32(target);
            }
            Property::FieldOfView => self.tag(6),
            Property::Intensity => self.tag(7),
            Property::Color => self.tag(8),
        }
        self.interpolation(channel.interpolation);
        self.list(&channel.times, |w, t| w.time(*t));
        self.list(&channel.values, |w, v| w.f64(*v));
    }

    fn attachment(&mut self, attachment: &Attachment) {
        self.count(attachment.actor);
        self.option(&attachment.joint, |w, joint| w.u32(*joint));
    }

    fn target(&mut self, target: &Target) {
        match target {
            Target::Point(p) => {
                self.tag(0);
                self.dvec3(*p);
            }
            Target::Actor(actor) => {
                self.tag(1);
                self.count(*actor);
            }
            Target::Joint { actor, joint } => {
                self.tag(2);
                self.count(*actor);
                self.u32(*joint);
            }
        }
    }

    fn projection(&mut self, projection: &Projection) {
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

    fn rig(&mut self, rig: &Rig) {
        match rig {
            Rig::Fixed { position, rotation, look_at } => {
                self.tag(0);
                self.dvec3(*position);
                self.dquat(*rotation);
                self.option(look_at, |w, target| w.target(target));
            }
            Rig::Follow { target, offset } => {
                self.tag(1);
                self.target(target);
                self.dvec3(*offset);
            }
            Rig::Orbit { target, distance, elevation, azimuth, speed } => {
                self.tag(2);
                self.target(target);
                for v in [distance, elevation, azimuth, speed] {
                    self.f64(*v);
                }
            }
            Rig::File { actor, camera } => {
                self.tag(3);
                self.count(*actor);
                self.u32(*camera);
            }
            Rig::Frame { azimuth, elevation } => {
                self.tag(4);
                self.f64(*azimuth);
                self.f64(*elevation);
            }
        }
    }

    fn light(&mut self, light: &Light) {
        match light.kind {
            LightKind::Directional => self.tag(0),
            LightKind::Point => self.tag(1),
            LightKind::Spot { inner, outer } => {
                self.tag(2);
                self.f32(inner);
                self.f32(outer);
            }
        }
        self.vec3(light.color);
        self.f32(light.intensity);
        self.option(&light.range, |w, range| w.f32(*range));
    }
}
