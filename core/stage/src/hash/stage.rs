//! A stage, and a moment of it.

use crate::hash::cues::write_layer;
use crate::hash::flat::write_flat;
use crate::hash::goals::{write_goal, write_limit, write_springs};
use crate::snapshot::ChangedMaterial;
use crate::snapshot::FlatState;
use crate::snapshot::SkyState;
use crate::snapshot::{ActorState, Snapshot};
use crate::stage::actor::{Actor, Attachment, Target};
use crate::stage::camera::Rig;
use crate::stage::channel::{Channel, Property};
use crate::stage::clips::Layer;
use crate::stage::light::Shadow;
use crate::stage::path::Pace;
use crate::stage::sky::Sky;
use crate::stage::{Background, Cutouts, Pipeline, Settings, SkinOnce, Stage, Transparency};
use choreo_asset::clip_hash;
use choreo_asset::hash::{ContentHash, Writer, hash_of};
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
            write_settings(w, settings);
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
                w.option(parent, |w, parent| write_attachment(w, parent));
                w.option(face, |w, face| w.count(*face));
                w.list(layers, |w, layer| {
                    write_layer(
                        w,
                        layer,
                        |w, mask| {
                            let key = Arc::as_ptr(mask) as usize;
                            let hash = *masks.entry(key).or_insert_with(|| hash_of(|w| w.f32s(mask)));
                            w.bytes(&hash);
                        },
                        |clip| *clips.entry(Arc::as_ptr(clip) as usize).or_insert_with(|| clip_hash(clip)),
                    );
                });
                w.list(channels, |w, channel| write_channel(w, channel));
                w.list(look_at, |w, look| {
                    w.u32(look.joint);
                    write_target(w, &look.target);
                    w.time(look.start);
                    w.option(&look.end, |w, end| w.time(*end));
                    w.time(look.fade);
                    w.f32(look.weight);
                });
                w.list(goals, |w, goal| write_goal(w, goal));
                w.list(limits, |w, (joint, limit)| {
                    w.u32(*joint);
                    write_limit(w, limit);
                });
                w.option(springs, |w, springs| write_springs(w, springs));
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
                write_rig(w, &camera.rig);
                w.list(&camera.channels, |w, channel| write_channel(w, channel));
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
                write_shadow(w, &light.shadow);
                w.option(&light.attenuation, |w, a| w.f32s(a));
                w.option(&light.parent, |w, parent| write_attachment(w, parent));
                w.list(&light.channels, |w, channel| write_channel(w, channel));
            });
            w.list(flats, |w, flat| write_flat(w, flat));
            w.option(sky, |w, sky| {
                let Sky { panorama, turn, strength, background, channels } = sky;
                w.bytes(&panorama.hash());
                w.f64(*turn);
                w.f32(*strength);
                w.flag(*background);
                w.list(channels, |w, channel| write_channel(w, channel));
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
                    write_channel(w, keys);
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
            write_layer(w, self, |w, mask| w.f32s(mask), |clip| clip_hash(clip));
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
                    now.write_content(w, &|_| None);
                });
            });
            w.option(&camera.camera, |w, index| w.count(*index));
            camera.world_from_view.to_cols_array().into_iter().for_each(|v| w.f64(v));
            w.projection(&camera.projection);
            w.list(lights, |w, light| {
                w.light(&light.light);
                w.dvec3(light.position);
                w.vec3(light.direction);
                write_shadow(w, &light.shadow);
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
            write_background(w, background);
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

pub(super) fn write_settings(w: &mut Writer, settings: &Settings) {
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
        w.u32(v);
    }
    w.time(*length);
    write_background(w, background);
    w.vec3(*ambient_up);
    w.vec3(*ambient_down);
    w.option(samples, |w, n| w.u32(*n));
    // The usual choices write nothing: the hashes of stages before there were others stay.
    if *cutouts != Cutouts::default() || *transparency != Transparency::default() {
        w.u32(*cutouts as u32);
        w.u32(*transparency as u32);
    }
    if *pipeline != Pipeline::default() {
        w.text("pipeline");
        w.u32(*pipeline as u32);
    }
    if *skin_once != SkinOnce::default() {
        w.tag(1);
        w.u32(*skin_once as u32);
    }
}

pub(super) fn write_background(w: &mut Writer, background: &Background) {
    match background {
        Background::Color(color) => {
            w.tag(0);
            w.vec4(*color);
        }
        Background::Gradient { top, bottom } => {
            w.tag(1);
            w.vec3(*top);
            w.vec3(*bottom);
        }
    }
}

pub(super) fn write_channel(w: &mut Writer, channel: &Channel) {
    match channel.property {
        Property::Translation => w.tag(0),
        Property::Rotation => w.tag(1),
        Property::Scale => w.tag(2),
        Property::Visible => w.tag(3),
        Property::Tint => w.tag(4),
        Property::Morph { instance, target } => {
            w.tag(5);
            w.u32(instance);
            w.u32(target);
        }
        Property::Expression { expression } => {
            w.tag(9);
            w.u32(expression);
        }
        Property::FieldOfView => w.tag(6),
        Property::Intensity => w.tag(7),
        Property::Color => w.tag(8),
        Property::Weight => w.tag(10),
        Property::Speed => w.tag(11),
        Property::ClipTime => w.tag(12),
        Property::Parameter => w.tag(13),
        Property::Turn => w.tag(14),
        Property::Opacity => w.tag(15),
        Property::Range => w.tag(16),
        Property::Cone => w.tag(17),
        Property::PenWidth => w.tag(18),
        Property::Copies => w.tag(19),
    }
    w.interpolation(channel.interpolation);
    w.list(&channel.times, |w, t| w.time(*t));
    w.list(&channel.values, |w, v| w.f64(*v));
}

pub(super) fn write_attachment(w: &mut Writer, attachment: &Attachment) {
    w.count(attachment.actor);
    w.option(&attachment.joint, |w, joint| w.u32(*joint));
}

pub(super) fn write_target(w: &mut Writer, target: &Target) {
    match target {
        Target::Point(p) => {
            w.tag(0);
            w.dvec3(*p);
        }
        Target::Actor(actor) => {
            w.tag(1);
            w.count(*actor);
        }
        Target::Joint { actor, joint } => {
            w.tag(2);
            w.count(*actor);
            w.u32(*joint);
        }
    }
}

pub(super) fn write_rig(w: &mut Writer, rig: &Rig) {
    match rig {
        Rig::Fixed { position, rotation, look_at } => {
            w.tag(0);
            w.dvec3(*position);
            w.dquat(*rotation);
            w.option(look_at, |w, target| write_target(w, target));
        }
        Rig::Follow { target, offset } => {
            w.tag(1);
            write_target(w, target);
            w.dvec3(*offset);
        }
        Rig::Orbit { target, distance, elevation, azimuth, speed } => {
            w.tag(2);
            write_target(w, target);
            for v in [distance, elevation, azimuth, speed] {
                w.f64(*v);
            }
        }
        Rig::File { actor, camera } => {
            w.tag(3);
            w.count(*actor);
            w.u32(*camera);
        }
        Rig::Frame { azimuth, elevation } => {
            w.tag(4);
            w.f64(*azimuth);
            w.f64(*elevation);
        }
    }
}

pub(super) fn write_shadow(w: &mut Writer, shadow: &Option<Shadow>) {
    w.option(shadow, |w, Shadow { size, softness }| {
        w.u32(*size);
        w.f32(*softness);
    });
}
