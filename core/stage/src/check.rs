//! Checks a stage for errors that prevent rendering. `Stage::at` itself is lenient and skips references to things that do not exist.

use crate::stage::actor::{Actor, Attachment, Target};
use crate::stage::camera::{Camera, Rig};
use crate::stage::camera_moves::CameraShake;
use crate::stage::channel::{Channel, Property};
use crate::stage::clips::{Cue, LayerMode};
use crate::stage::described::Described;
use crate::stage::layers_2d::{Fit, Layer2d, Layer2dContent};
use crate::stage::light::StageLight;
use crate::stage::sky::Sky;
use crate::stage::{Background, Settings, Stage, StageError};
use crate::transforms::order;
use crate::transforms::order::PlacementOrder;
use crate::transforms::parents::{ActiveParents, KeptTransforms, parent_change_times};
use choreo_asset::{Asset, Projection};
use choreo_motion::{Interpolation, Playback, Time};

/// Collects the errors of one stage, each with its place.
struct Checker<'a> {
    stage: &'a Stage,
    problems: Vec<StageError>,
}

impl Stage {
    /// Finds all errors at once; empty if every frame can be evaluated. Callbacks are not run.
    pub fn check(&self) -> Vec<StageError> {
        let mut checker = Checker { stage: self, problems: Vec::new() };
        checker.check_settings();
        for (index, actor) in self.actors.iter().enumerate() {
            checker.check_actor(index, actor);
        }
        checker.check_parents();
        for camera in &self.cameras {
            checker.check_camera(camera);
        }
        checker.check_cuts();
        for light in &self.lights {
            checker.check_light(light);
        }
        if let Some(sky) = &self.sky {
            checker.check_sky(sky);
        }
        for (index, layer_2d) in self.layers_2d.iter().enumerate() {
            checker.check_layer_2d(index, layer_2d);
        }
        for effect in &self.effects {
            let place = format!("effect \"{}\"", effect.plugin);
            for (name, value) in &effect.parameters {
                checker
                    .require(value.is_finite(), &place, || format!("\"{name}\" is {value}, must be finite"));
            }
            checker.check_span(&place, effect.start, effect.end);
            for (name, keys) in &effect.keys {
                let place = format!("{place}, \"{name}\"");
                checker.check_channel(&place, keys, keys.property == Property::Parameter);
            }
            for on in &effect.on {
                checker.check_index(&place, "actor", on.actor, self.actors.len());
                if let (Some(actor), Some(material)) = (self.actors.get(on.actor), on.material) {
                    checker.check_index(&place, "material", material as usize, actor.asset.materials.len());
                }
            }
            for camera in &effect.cameras {
                checker.check_index(&place, "camera", *camera, self.cameras.len());
            }
        }
        checker.problems
    }
}

impl Checker<'_> {
    fn require(&mut self, fine: bool, place: &str, what: impl FnOnce() -> String) {
        if !fine {
            self.problems.push(StageError::Invalid { place: place.to_string(), what: what() });
        }
    }

    /// Checks the values of all described fields.
    fn check_fields(&mut self, place: &str, of: &impl Described) {
        for what in of.problems() {
            self.require(false, place, || what);
        }
    }

    /// Checks keyframes of described fields.
    fn check_channels<T: Described>(&mut self, place: &str, of: &T, channels: &[Channel]) {
        for channel in channels {
            self.check_channel(place, channel, of.is_keyed(channel.property));
        }
    }

    fn check_index(&mut self, place: &str, what: &str, index: usize, count: usize) {
        self.require(index < count, place, || format!("{what} {index} does not exist (count: {count})"));
    }

    fn check_span(&mut self, place: &str, start: Time, end: Option<Time>) {
        if let Some(end) = end {
            self.require(start <= end, place, || {
                format!("ends at {} s, before it starts at {} s", end.as_secs(), start.as_secs())
            });
        }
    }

    fn check_settings(&mut self) {
        let Settings { size, fps, length, background, ambient_up, ambient_down, exposure, samples, .. } =
            &self.stage.settings;
        let place = "settings";
        let sizes = 1..=16384;
        self.require(size.iter().all(|n| sizes.contains(n)), place, || {
            format!("size is {} x {} pixels, each must be 1 to 16384", size[0], size[1])
        });
        self.require(fps.num > 0 && fps.den > 0, place, || {
            format!("fps is {}/{}, must be positive", fps.num, fps.den)
        });
        self.require(*length >= Time::ZERO, place, || {
            format!("length is {} s, must be ≥ 0", length.as_secs())
        });
        let finite = match background {
            Background::Color(color) => color.is_finite(),
            Background::Gradient { top, bottom } => top.is_finite() && bottom.is_finite(),
        };
        self.require(finite, place, || "the background has a color that is not finite".to_string());
        self.require(ambient_up.is_finite(), place, || {
            format!("ambient light from above is {ambient_up}, must be finite")
        });
        self.require(ambient_down.is_finite(), place, || {
            format!("ambient light from below is {ambient_down}, must be finite")
        });
        self.require(Settings::EXPOSURES.contains(exposure), place, || {
            format!("exposure is {exposure} stops, must be from -20 to 20")
        });
        self.require(matches!(samples, None | Some(1 | 4)), place, || {
            format!("samples is {}, must be 1 or 4", samples.unwrap_or(0))
        });
    }

    fn check_actor(&mut self, index: usize, actor: &Actor) {
        let place = format!("actor \"{}\"", actor.name);
        let joints = actor.asset.skeleton.len();
        let actors = self.stage.actors.len();
        self.check_fields(&place, actor);
        self.check_fields(&format!("{place}, shadow"), &actor.shadow);
        for parent in actor.parents.iter().filter_map(|parent| parent.to.as_ref()) {
            self.check_attachment(&place, parent);
        }
        let sorted = actor.parents.windows(2).all(|pair| pair[0].start < pair[1].start);
        self.require(sorted, &place, || {
            "two parents start at one time, or are not sorted by start".to_string()
        });
        if let Some(face) = actor.face {
            self.check_index(&place, "faced actor", face, actors);
            self.require(face != index, &place, || "faces itself".to_string());
        }
        for layer in 0..actor.layers.len() {
            self.check_layer(&format!("{place}, layer {layer}"), actor, layer);
        }
        for look in &actor.look_at {
            let place = format!("{place}, look_at");
            self.check_index(&place, "joint", look.joint as usize, joints);
            self.check_target(&place, &look.target);
            self.check_span(&place, look.start, look.end);
            self.check_fields(&place, look);
        }
        for (part, what) in crate::constraints::check::constraint_problems(self.stage, actor) {
            self.require(false, &format!("{place}, {part}"), || what);
        }
        for (instance, target, weight) in &actor.morphs {
            self.check_morph(&place, &actor.asset, *instance, *target);
            self.require(weight.is_finite(), &place, || format!("morph weight is {weight}, must be finite"));
        }
        for (expression, weight) in &actor.expressions {
            self.check_index(&place, "expression", *expression as usize, actor.asset.expressions.len());
            self.require(weight.is_finite(), &place, || {
                format!("weight of an expression is {weight}, must be finite")
            });
        }
        self.check_actor_channels(&place, actor);
    }

    fn check_layer(&mut self, place: &str, actor: &Actor, index: usize) {
        let joints = actor.asset.skeleton.len();
        let layer = &actor.layers[index];
        if let Some(mask) = &layer.mask {
            self.require(mask.len() == joints, place, || {
                format!("the number of mask weights is {}, must be that of joints, {joints}", mask.len())
            });
            let invalid = mask.iter().enumerate().find(|(_, weight)| !(0.0..=1.0).contains(*weight));
            if let Some((joint, weight)) = invalid {
                self.require(false, place, || {
                    format!("the mask weight of joint {joint} is {weight}, must be from 0 to 1")
                });
            }
        }
        self.require(index > 0 || layer.mode == LayerMode::Override, place, || {
            "the base layer cannot be additive: there is nothing below it".to_string()
        });
        let is_sorted_by_rank = index < 2 || actor.layers[index - 1].rank <= layer.rank;
        self.require(is_sorted_by_rank, place, || {
            "has a lower rank than the layer before it; sort by rank".to_string()
        });
        if let Some(keys) = &layer.weight_keys {
            self.check_channel(place, keys, index > 0 && keys.property == Property::Weight);
        }
        for (c, cue) in layer.cues.iter().enumerate() {
            let place = format!("{place}, cue {c} (\"{}\")", cue.clip.name);
            self.check_cue(&place, cue, joints);
            let sorted = c == 0 || layer.cues[c - 1].start <= cue.start;
            self.require(sorted, &place, || "starts before the cue before it; sort by start".to_string());
        }
    }

    fn check_actor_channels(&mut self, place: &str, actor: &Actor) {
        for channel in &actor.channels {
            let can_be_keyed = match channel.property {
                Property::Morph { instance, target } => {
                    self.check_morph(place, &actor.asset, instance, target);
                    true
                }
                Property::Expression { expression } => {
                    self.check_index(place, "expression", expression as usize, actor.asset.expressions.len());
                    true
                }
                property => Actor::FIELDS.iter().any(|f| f.keyed.is_some_and(|(_, keyed)| keyed == property)),
            };
            self.check_channel(place, channel, can_be_keyed);
        }
    }

    fn check_cue(&mut self, place: &str, cue: &Cue, joints: usize) {
        let playback = Playback { speed: cue.speed, trim: cue.trim, repeat: cue.repeat };
        if let Err(what) = playback.check() {
            // The speed is a described field, too, so a check of the fields would report it twice.
            self.require(false, place, || what.to_string());
        } else {
            self.check_fields(place, cue);
        }
        self.require(cue.clip.joint_count() == joints, place, || {
            format!(
                "the clip is for a skeleton of {} joints, the actor's has {joints}; bind it first",
                cue.clip.joint_count()
            )
        });
        for (_, property) in Cue::keyed_options() {
            if let Some(keys) = cue.keys(property) {
                self.check_channel(place, keys, keys.property == property);
            }
        }
        let are_disjoint = cue.freezes.windows(2).all(|pair| pair[0].1 <= pair[1].0);
        self.require(are_disjoint && cue.freezes.iter().all(|f| f.0 <= f.1), place, || {
            "its freezes overlap or run backwards; sort them".to_string()
        });
        if let Some(root) = &cue.root {
            self.check_index(place, "root joint", root.motion.joint() as usize, joints);
        }
        if let Err(what) = cue.ease.check() {
            self.require(false, place, || what.to_string());
        }
        self.check_span(place, cue.start, cue.end);
    }

    fn check_morph(&mut self, place: &str, asset: &Asset, instance: u32, target: u32) {
        self.check_index(place, "mesh instance", instance as usize, asset.instances.len());
        let mesh = asset.instances.get(instance as usize).and_then(|i| asset.meshes.get(i.mesh as usize));
        if let Some(mesh) = mesh {
            self.check_index(place, "morph target", target as usize, mesh.morph_targets);
        }
    }

    /// Checks for cycles of parents at every time at which a parent changes. Reports the first one only.
    fn check_parents(&mut self) {
        let (mut parents, mut order) = (ActiveParents::default(), PlacementOrder::default());
        for time in parent_change_times(self.stage) {
            parents.find_active(self.stage, time, &[], &KeptTransforms::default());
            let Err(error) = order::sort_placement_steps(self.stage, &parents, &mut order) else { continue };
            self.problems.push(match error {
                StageError::Cycle(actor, through) if time > Time::MIN => {
                    let secs = (time.as_secs() * 1e6).round() / 1e6;
                    StageError::Cycle(actor, format!("{through}, at {secs} s"))
                }
                error => error,
            });
            return;
        }
    }

    fn check_attachment(&mut self, place: &str, at: &Attachment) {
        self.check_index(place, "parent actor", at.actor, self.stage.actors.len());
        if let (Some(parent), Some(joint)) = (self.stage.actors.get(at.actor), at.joint) {
            let joints = parent.asset.skeleton.len();
            self.check_index(place, "parent joint", joint as usize, joints);
        }
    }

    fn check_target(&mut self, place: &str, target: &Target) {
        match *target {
            Target::Point(point) => {
                self.require(point.is_finite(), place, || format!("the target is {point}, must be finite"));
            }
            Target::Actor(actor) => self.check_index(place, "target actor", actor, self.stage.actors.len()),
            Target::Joint { actor, joint } => {
                self.check_index(place, "target actor", actor, self.stage.actors.len());
                if let Some(actor) = self.stage.actors.get(actor) {
                    self.check_index(place, "target joint", joint as usize, actor.asset.skeleton.len());
                }
            }
        }
    }

    fn check_channel(&mut self, place: &str, channel: &Channel, can_be_keyed: bool) {
        let place = format!("{place}, keys of {:?}", channel.property);
        self.require(can_be_keyed, &place, || "this property cannot be keyed here".to_string());
        self.require(!channel.times.is_empty(), &place, || {
            "there are no keys, at least one is needed".to_string()
        });
        let sorted = channel.times.windows(2).all(|w| w[0] < w[1]);
        self.require(sorted, &place, || "key times must increase".to_string());
        let tangents = if channel.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let wanted = channel.times.len() * channel.property.width() * tangents;
        self.require(channel.values.len() == wanted, &place, || {
            format!(
                "the number of values is {}, must be {wanted} for the number of keys, {}",
                channel.values.len(),
                channel.times.len()
            )
        });
        self.require(channel.values.iter().all(|v| v.is_finite()), &place, || {
            "a key has a value that is not finite".to_string()
        });
    }

    fn check_camera(&mut self, camera: &Camera) {
        let place = format!("camera \"{}\"", camera.name);
        match camera.projection {
            Projection::Perspective { yfov, near, far } => {
                self.require(yfov > 0.0 && yfov < std::f32::consts::PI, &place, || {
                    format!("field of view is {yfov} rad, must be above 0 and below π")
                });
                self.require(near > 0.0 && near.is_finite(), &place, || {
                    format!("near plane is at {near} m, must be above 0")
                });
                self.require(far.is_none_or(|far| far > near), &place, || {
                    format!(
                        "far plane is at {} m, must be beyond the near plane at {near} m",
                        far.unwrap_or(f32::INFINITY)
                    )
                });
            }
            Projection::Orthographic { height, near, far } => {
                self.require(height > 0.0 && height.is_finite(), &place, || {
                    format!("height is {height} m, must be above 0")
                });
                self.require(near < far && near.is_finite() && far.is_finite(), &place, || {
                    format!("planes are at {near} m and {far} m, must be finite and in this order")
                });
            }
        }
        let is_rig_finite = match &camera.rig {
            Rig::Fixed { position, rotation, look_at } => {
                if let Some(target) = look_at {
                    self.check_target(&place, target);
                }
                self.require((rotation.length() - 1.0).abs() < 1e-3, &place, || {
                    format!("rotation has length {}, must be 1", rotation.length())
                });
                position.is_finite()
            }
            Rig::Follow { target, offset } => {
                self.check_target(&place, target);
                offset.is_finite()
            }
            Rig::Orbit { target, distance, elevation, azimuth, speed } => {
                self.check_target(&place, target);
                [distance, elevation, azimuth, speed].iter().all(|v| v.is_finite())
            }
            Rig::File { actor, camera } => {
                self.check_index(&place, "actor", *actor, self.stage.actors.len());
                if let Some(actor) = self.stage.actors.get(*actor) {
                    self.check_index(
                        &place,
                        "camera of the file",
                        *camera as usize,
                        actor.asset.cameras.len(),
                    );
                }
                true
            }
            Rig::Frame { azimuth, elevation } => azimuth.is_finite() && elevation.is_finite(),
        };
        self.require(is_rig_finite, &place, || {
            "its rig has a position, offset, distance, angle or speed that is not finite".to_string()
        });
        self.check_channels(&place, camera, &camera.channels);
        self.check_camera_moves(&place, camera);
    }

    fn check_camera_moves(&mut self, place: &str, camera: &Camera) {
        camera
            .looks
            .iter()
            .filter_map(|look| look.target.as_ref())
            .for_each(|target| self.check_target(place, target));
        let sorted = camera.looks.is_sorted_by_key(|look| look.start);
        self.require(sorted, place, || "looks must be sorted by start".to_string());
        let finite = |shake: &CameraShake| {
            [shake.angle, shake.shift, shake.frequency].iter().all(|n| n.is_finite() && *n >= 0.0)
        };
        self.require(camera.shakes.iter().all(finite), place, || {
            "a shake's angle, shift and frequency must be finite and not negative".to_string()
        });
    }

    fn check_cuts(&mut self) {
        for (index, cut) in self.stage.cuts.iter().enumerate() {
            let place = format!("cut {index} at {} s", cut.at.as_secs());
            self.check_index(&place, "camera", cut.camera, self.stage.cameras.len());
            let sorted = index == 0 || self.stage.cuts[index - 1].at <= cut.at;
            self.require(sorted, &place, || "comes before the cut before it; sort by time".to_string());
        }
    }

    fn check_sky(&mut self, sky: &Sky) {
        self.check_fields("sky", sky);
        self.check_channels("sky", sky, &sky.channels);
    }

    fn check_layer_2d(&mut self, index: usize, layer_2d: &Layer2d) {
        let place = format!("layer_2d {index}");
        self.check_fields(&place, layer_2d);
        let is_content_valid = match &layer_2d.content {
            Layer2dContent::Text { size, width, line_height, color, outline, panel, .. } => {
                let sizes = [*size, width.unwrap_or(1.0), *line_height];
                let outlined =
                    outline.is_none_or(|o| o.width.is_finite() && o.width >= 0.0 && o.color.is_finite());
                let backed = panel.is_none_or(|p| {
                    p.padding.is_finite() && p.radius.is_finite() && p.radius >= 0.0 && p.color.is_finite()
                });
                sizes.iter().all(|v| v.is_finite() && *v > 0.0) && color.is_finite() && outlined && backed
            }
            Layer2dContent::Picture { fit, .. } => match fit {
                Fit::Height(share) | Fit::Width(share) => share.is_finite() && *share > 0.0,
                Fit::Contain | Fit::Cover => true,
            },
            Layer2dContent::Panel { size, color } => size.is_finite() && color.is_finite(),
            Layer2dContent::Bars { ratio, color } => ratio.is_finite() && *ratio > 0.0 && color.is_finite(),
        };
        self.require(is_content_valid, &place, || {
            "its sizes must be finite and above 0, its colors finite".to_string()
        });
        self.check_span(&place, layer_2d.start, layer_2d.end);
        self.check_channels(&place, layer_2d, &layer_2d.channels);
    }

    fn check_light(&mut self, light: &StageLight) {
        let place = format!("light \"{}\"", light.name);
        self.check_fields(&place, light);
        if let Some(problem) = light.light.kind.problem() {
            self.require(false, &place, || problem);
        }
        if let Some(shadow) = &light.shadow {
            self.check_fields(&format!("{place}, shadow"), shadow);
        }
        let is_attenuation_valid = light
            .attenuation
            .is_none_or(|a| a.iter().all(|v| v.is_finite() && *v >= 0.0) && a.iter().any(|v| *v > 0.0));
        self.require(is_attenuation_valid, &place, || {
            "the coefficients of its attenuation must be at least 0, and one of them above 0".to_string()
        });
        if let Some(parent) = &light.parent {
            self.check_attachment(&place, parent);
        }
        for channel in &light.channels {
            let can_be_keyed = channel.property == Property::Visible || light.is_keyed(channel.property);
            self.check_channel(&place, channel, can_be_keyed);
        }
    }
}
