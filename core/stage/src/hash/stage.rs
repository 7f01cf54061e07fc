//! A stage, and a moment of it.

use super::ContentHash;
use super::asset::clip_hash;
use super::writer::{Writer, hash_of};
use crate::*;
use choreo_motion::Skinning;
use std::collections::BTreeMap;
use std::sync::Arc;

impl Stage {
    /// Everything that a snapshot depends on; warnings are left out. Hooks count by [`FrameHook::identity`].
    pub fn content_hash(&self) -> ContentHash {
        // One clip or mask is used by many cues and its curves may be long: hashed once a pointer.
        let mut clips: BTreeMap<usize, ContentHash> = BTreeMap::new();
        let mut masks: BTreeMap<usize, ContentHash> = BTreeMap::new();
        hash_of(|w| {
            let Stage { settings, actors, cameras, cuts, lights, sky, flats, effects, hooks, warnings: _ } =
                self;
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
                    goals,
                    limits,
                    springs,
                    walk,
                    visible,
                    tint,
                    pen_width,
                    copies,
                    morphs,
                    expressions,
                    file_lights,
                    skinning,
                    surfaces,
                } = actor;
                w.text(name);
                w.bytes(&asset.content_hash());
                w.dvec3(transform.translation);
                w.dquat(transform.rotation);
                w.dvec3(transform.scale);
                w.option(parent, |w, parent| w.attachment(parent));
                w.option(face, |w, face| w.count(*face));
                w.list(layers, |w, layer| {
                    w.layer(
                        layer,
                        |w, mask| {
                            let key = Arc::as_ptr(mask) as usize;
                            let hash = *masks.entry(key).or_insert_with(|| hash_of(|w| w.f32s(mask)));
                            w.bytes(&hash);
                        },
                        |clip| *clips.entry(Arc::as_ptr(clip) as usize).or_insert_with(|| clip_hash(clip)),
                    );
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
                w.list(goals, |w, goal| w.goal(goal));
                w.list(limits, |w, (joint, limit)| {
                    w.u32(*joint);
                    w.limit(limit);
                });
                w.option(springs, |w, springs| w.springs(springs));
                w.option(walk, |w, walk| {
                    w.list(&walk.path.points, |w, p| w.dvec3(*p));
                    w.flag(walk.path.closed);
                    w.time(walk.start);
                    match walk.pace {
                        Pace::OfClips => w.tag(0),
                        Pace::Constant(speed) => {
                            w.tag(1);
                            w.f64(speed);
                        }
                    }
                    w.flag(walk.turns);
                });
                w.flag(*visible);
                w.vec4(*tint);
                w.option(pen_width, |w, width| w.f32(*width));
                w.option(copies, |w, copies| w.u32(*copies));
                w.list(expressions, |w, (expression, weight)| {
                    w.u32(*expression);
                    w.f32(*weight);
                });
                w.list(morphs, |w, (instance, target, weight)| {
                    w.u32(*instance);
                    w.u32(*target);
                    w.f32(*weight);
                });
                w.flag(*file_lights);
                w.flag(*skinning == Skinning::DualQuaternion);
                w.list(surfaces, |w, rule| {
                    w.option(&rule.material, |w, material| w.u32(*material));
                    w.option(&rule.cutouts, |w, how| w.u32(*how as u32));
                    w.option(&rule.transparency, |w, how| w.u32(*how as u32));
                });
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
                w.shadow(&light.shadow);
                w.option(&light.attenuation, |w, a| w.f32s(a));
                w.option(&light.parent, |w, parent| w.attachment(parent));
                w.list(&light.channels, |w, channel| w.channel(channel));
            });
            w.list(flats, |w, flat| w.flat(flat));
            w.option(sky, |w, sky| {
                let Sky { panorama, turn, strength, background, channels } = sky;
                w.bytes(&panorama.hash());
                w.f64(*turn);
                w.f32(*strength);
                w.flag(*background);
                w.list(channels, |w, channel| w.channel(channel));
            });
            w.list(effects, |w, effect| {
                w.text(&effect.plugin);
                w.list(&effect.parameters, |w, (name, value)| {
                    w.text(name);
                    w.f64(*value);
                });
                w.time(effect.start);
                w.option(&effect.end, |w, end| w.time(*end));
                w.list(&effect.keys, |w, (name, keys)| {
                    w.text(name);
                    w.channel(keys);
                });
                w.list(&effect.on, |w, on| {
                    w.count(on.actor);
                    w.option(&on.material, |w, material| w.u32(*material));
                });
                w.list(&effect.cameras, |w, camera| w.count(*camera));
            });
            w.list(hooks, |w, hook| w.text(&hook.identity()));
        })
    }
}

impl Layer {
    /// Everything that a pose takes from it.
    pub fn content_hash(&self) -> ContentHash {
        hash_of(|w| {
            w.layer(self, |w, mask| w.f32s(mask), |clip| clip_hash(clip));
        })
    }
}

impl Snapshot {
    /// Every bit of it: two evaluations of one stage at one time must agree, wherever they ran.
    pub fn content_hash(&self) -> ContentHash {
        hash_of(|w| {
            let Snapshot {
                time,
                actors,
                camera,
                lights,
                sky,
                flats,
                background,
                ambient_up,
                ambient_down,
                effects,
            } = self;
            w.time(*time);
            w.list(actors, |w, actor| {
                let ActorState {
                    visible,
                    world_from_model,
                    model_from_joint,
                    morph_weights,
                    tint,
                    pen_width,
                    copies,
                    base_colors,
                    skinning,
                    materials,
                    // Of a picture, not of the stage.
                    out_of_view: _,
                } = actor;
                w.flag(*visible);
                world_from_model.to_cols_array().into_iter().for_each(|v| w.f64(v));
                w.list(model_from_joint, |w, m| m.to_cols_array().into_iter().for_each(|v| w.f32(v)));
                w.list(morph_weights, |w, weights| w.f32s(weights));
                w.vec4(*tint);
                w.option(pen_width, |w, width| w.f32(*width));
                w.option(copies, |w, copies| w.u32(*copies));
                w.vec4s(base_colors);
                w.flag(*skinning == Skinning::DualQuaternion);
                w.list(materials, |w, ChangedMaterial { material, now }| {
                    w.u32(*material);
                    now.write(w, &|_| None);
                });
            });
            w.option(&camera.camera, |w, index| w.count(*index));
            camera.world_from_view.to_cols_array().into_iter().for_each(|v| w.f64(v));
            w.projection(&camera.projection);
            w.list(lights, |w, light| {
                w.light(&light.light);
                w.dvec3(light.position);
                w.vec3(light.direction);
                w.shadow(&light.shadow);
                w.option(&light.attenuation, |w, a| w.f32s(a));
            });
            w.list(flats, |w, state| {
                let FlatState { flat, at, opacity, scale, words } = state;
                w.count(*flat);
                [at.x, at.y, *scale].into_iter().for_each(|v| w.f64(v));
                w.f32(*opacity);
                w.option(words, |w, words| w.text(words));
            });
            w.option(sky, |w, sky| {
                let SkyState { panorama, turn, strength, background } = sky;
                w.bytes(&panorama.hash());
                w.f64(*turn);
                w.f32(*strength);
                w.flag(*background);
            });
            w.background(background);
            w.vec3(*ambient_up);
            w.vec3(*ambient_down);
            w.list(effects, |w, state| {
                w.count(state.effect);
                w.list(&state.parameters, |w, (name, value)| {
                    w.text(name);
                    w.f64(*value);
                });
            });
        })
    }
}

impl Writer {
    fn settings(&mut self, settings: &Settings) {
        let Settings {
            size,
            fps,
            length,
            background,
            ambient_up,
            ambient_down,
            samples,
            cutouts,
            transparency,
            pipeline,
            skin_once,
        } = settings;
        for v in [size[0], size[1], fps.num, fps.den] {
            self.u32(v);
        }
        self.time(*length);
        self.background(background);
        self.vec3(*ambient_up);
        self.vec3(*ambient_down);
        self.option(samples, |w, n| w.u32(*n));
        // The usual choices write nothing: the hashes of stages before there were others stay.
        if *cutouts != Cutouts::default() || *transparency != Transparency::default() {
            self.u32(*cutouts as u32);
            self.u32(*transparency as u32);
        }
        if *pipeline != Pipeline::default() {
            self.text("pipeline");
            self.u32(*pipeline as u32);
        }
        if *skin_once != SkinOnce::default() {
            self.tag(1);
            self.u32(*skin_once as u32);
        }
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

    pub(super) fn channel(&mut self, channel: &Channel) {
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
            Property::Expression { expression } => {
                self.tag(9);
                self.u32(expression);
            }
            Property::FieldOfView => self.tag(6),
            Property::Intensity => self.tag(7),
            Property::Color => self.tag(8),
            Property::Weight => self.tag(10),
            Property::Speed => self.tag(11),
            Property::ClipTime => self.tag(12),
            Property::Parameter => self.tag(13),
            Property::Turn => self.tag(14),
            Property::Opacity => self.tag(15),
            Property::Range => self.tag(16),
            Property::Cone => self.tag(17),
            Property::PenWidth => self.tag(18),
            Property::Copies => self.tag(19),
        }
        self.interpolation(channel.interpolation);
        self.list(&channel.times, |w, t| w.time(*t));
        self.list(&channel.values, |w, v| w.f64(*v));
    }

    pub(super) fn attachment(&mut self, attachment: &Attachment) {
        self.count(attachment.actor);
        self.option(&attachment.joint, |w, joint| w.u32(*joint));
    }

    pub(super) fn target(&mut self, target: &Target) {
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
}
