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
use crate::transforms::parents::{ActiveParents, KeptTransforms, times_of_change};
use choreo_asset::{Asset, Projection};
use choreo_motion::{Interpolation, Playback, Time};

/// Collects the errors of one stage, each with its place.
struct Checker<'a> {
    stage: &'a Stage,
    problems: Vec<StageError>,
}

impl Stage {
    /// Finds all errors at once; empty if every frame can be evaluated. Hooks are not run.
    pub fn check(&self) -> Vec<StageError> {
        let mut checker = Checker { stage: self, problems: Vec::new() };
        checker.settings();
        for (index, actor) in self.actors.iter().enumerate() {
            checker.actor(index, actor);
        }
        checker.parents();
        for camera in &self.cameras {
            checker.camera(camera);
        }
        checker.cuts();
        for light in &self.lights {
            checker.light(light);
        }
        if let Some(sky) = &self.sky {
            checker.sky(sky);
        }
        for (index, layer_2d) in self.layers_2d.iter().enumerate() {
            checker.layer_2d(index, layer_2d);
        }
        for effect in &self.effects {
            let place = format!("effect \"{}\"", effect.plugin);
            for (name, value) in &effect.parameters {
                checker.need(value.is_finite(), &place, || format!("\"{name}\" is {value}, must be finite"));
            }
            checker.span(&place, effect.start, effect.end);
            for (name, keys) in &effect.keys {
                let place = format!("{place}, \"{name}\"");
                checker.channel(&place, keys, keys.property == Property::Parameter);
            }
            for on in &effect.on {
                checker.index(&place, "actor", on.actor, self.actors.len());
                if let (Some(actor), Some(material)) = (self.actors.get(on.actor), on.material) {
                    checker.index(&place, "material", material as usize, actor.asset.materials.len());
                }
            }
            for camera in &effect.cameras {
                checker.index(&place, "camera", *camera, self.cameras.len());
            }
        }
        checker.problems
    }
}

impl Checker<'_> {
    fn need(&mut self, fine: bool, place: &str, what: impl FnOnce() -> String) {
        if !fine {
            self.problems.push(StageError::Bad { place: place.to_string(), what: what() });
        }
    }

    /// Checks the values of all described fields.
    fn fields(&mut self, place: &str, of: &impl Described) {
        for what in of.problems() {
            self.need(false, place, || what);
        }
    }

    /// Checks keyframes of described fields.
    fn channels<T: Described>(&mut self, place: &str, of: &T, channels: &[Channel]) {
        for channel in channels {
            self.channel(place, channel, of.is_keyed(channel.property));
        }
    }

    fn index(&mut self, place: &str, what: &str, index: usize, count: usize) {
        self.need(index < count, place, || format!("{what} {index} does not exist, there are {count}"));
    }

    fn span(&mut self, place: &str, start: Time, end: Option<Time>) {
        if let Some(end) = end {
            self.need(start <= end, place, || {
                format!("ends at {} s, before it starts at {} s", end.as_secs(), start.as_secs())
            });
        }
    }

    fn settings(&mut self) {
        let Settings { size, fps, length, background, ambient_up, ambient_down, exposure, samples, .. } =
            &self.stage.settings;
        let place = "settings";
        let sizes = 1..=16384;
        self.need(size.iter().all(|n| sizes.contains(n)), place, || {
            format!("size is {} x {} pixels, each must be 1 to 16384", size[0], size[1])
        });
        self.need(fps.num > 0 && fps.den > 0, place, || {
            format!("fps is {}/{}, must be positive", fps.num, fps.den)
        });
        self.need(*length >= Time::ZERO, place, || format!("length is {} s, must be ≥ 0", length.as_secs()));
        let finite = match background {
            Background::Color(color) => color.is_finite(),
            Background::Gradient { top, bottom } => top.is_finite() && bottom.is_finite(),
        };
        self.need(finite, place, || "background is not finite".to_string());
        self.need(ambient_up.is_finite() && ambient_down.is_finite(), place, || {
            "ambient light is not finite".to_string()
        });
        self.need(Settings::EXPOSURES.contains(exposure), place, || {
            format!("exposure is {exposure} stops, must be from -20 to 20")
        });
        self.need(matches!(samples, None | Some(1 | 4)), place, || {
            format!("samples is {}, must be 1 or 4", samples.unwrap_or(0))
        });
    }

    fn actor(&mut self, index: usize, actor: &Actor) {
        let place = format!("actor \"{}\"", actor.name);
        let joints = actor.asset.skeleton.len();
        let actors = self.stage.actors.len();
        self.fields(&place, actor);
        self.fields(&format!("{place}, shadow"), &actor.shadow);
        for parent in actor.parents.iter().filter_map(|parent| parent.to.as_ref()) {
            self.attachment(&place, parent);
        }
        let sorted = actor.parents.windows(2).all(|pair| pair[0].start < pair[1].start);
        self.need(sorted, &place, || "two parents start at one time, or are not sorted by start".to_string());
        if let Some(face) = actor.face {
            self.index(&place, "faced actor", face, actors);
            self.need(face != index, &place, || "faces itself".to_string());
        }
        for (l, layer) in actor.layers.iter().enumerate() {
            if let Some(mask) = &layer.mask {
                let place = format!("{place}, layer {l}");
                self.need(mask.len() == joints, &place, || {
                    format!("the mask has {} weights, the skeleton {joints} joints", mask.len())
                });
                self.need(mask.iter().all(|w| (0.0..=1.0).contains(w)), &place, || {
                    "the mask has a weight outside 0..=1".to_string()
                });
            }
            let place_of_layer = format!("{place}, layer {l}");
            self.need(l > 0 || layer.mode == LayerMode::Override, &place_of_layer, || {
                "the base layer cannot be additive: there is nothing below it".to_string()
            });
            let ranked = l < 2 || actor.layers[l - 1].rank <= layer.rank;
            self.need(ranked, &place_of_layer, || {
                "has a lower rank than the layer before it; sort by rank".to_string()
            });
            if let Some(keys) = &layer.weight_keys {
                self.channel(&place_of_layer, keys, l > 0 && keys.property == Property::Weight);
            }
            for (c, cue) in layer.cues.iter().enumerate() {
                let place = format!("{place}, layer {l}, cue {c} (\"{}\")", cue.clip.name);
                self.cue(&place, cue, joints);
                let sorted = c == 0 || layer.cues[c - 1].start <= cue.start;
                self.need(sorted, &place, || "starts before the cue before it; sort by start".to_string());
            }
        }
        for look in &actor.look_at {
            let place = format!("{place}, look_at");
            self.index(&place, "joint", look.joint as usize, joints);
            self.target(&place, &look.target);
            self.span(&place, look.start, look.end);
            self.fields(&place, look);
        }
        for (part, what) in crate::constraints::check::problems(self.stage, actor) {
            self.need(false, &format!("{place}, {part}"), || what);
        }
        for (instance, target, weight) in &actor.morphs {
            self.morph(&place, &actor.asset, *instance, *target);
            self.need(weight.is_finite(), &place, || format!("morph weight is {weight}, must be finite"));
        }
        for (expression, weight) in &actor.expressions {
            self.index(&place, "expression", *expression as usize, actor.asset.expressions.len());
            self.need(weight.is_finite(), &place, || {
                format!("weight of an expression is {weight}, must be finite")
            });
        }
        for channel in &actor.channels {
            let fits = match channel.property {
                Property::Morph { instance, target } => {
                    self.morph(&place, &actor.asset, instance, target);
                    true
                }
                Property::Expression { expression } => {
                    self.index(&place, "expression", expression as usize, actor.asset.expressions.len());
                    true
                }
                property => Actor::FIELDS.iter().any(|f| f.keyed.is_some_and(|(_, keyed)| keyed == property)),
            };
            self.channel(&place, channel, fits);
        }
    }

    fn cue(&mut self, place: &str, cue: &Cue, joints: usize) {
        let playback = Playback { speed: cue.speed, trim: cue.trim, repeat: cue.repeat };
        if let Err(what) = playback.check() {
            // The speed is a described field, too, so a check of the fields would report it twice.
            self.need(false, place, || what.to_string());
        } else {
            self.fields(place, cue);
        }
        self.need(cue.clip.joint_count() == joints, place, || {
            format!(
                "the clip is for a skeleton of {} joints, the actor's has {joints}; bind it first",
                cue.clip.joint_count()
            )
        });
        for (_, property) in Cue::keyed_options() {
            if let Some(keys) = cue.keys(property) {
                self.channel(place, keys, keys.property == property);
            }
        }
        let apart = cue.freezes.windows(2).all(|pair| pair[0].1 <= pair[1].0);
        self.need(apart && cue.freezes.iter().all(|f| f.0 <= f.1), place, || {
            "its freezes overlap or run backwards; sort them".to_string()
        });
        if let Some(root) = &cue.root {
            self.index(place, "root joint", root.motion.joint() as usize, joints);
        }
        if let Err(what) = cue.ease.check() {
            self.need(false, place, || what.to_string());
        }
        self.span(place, cue.start, cue.end);
    }

    fn morph(&mut self, place: &str, asset: &Asset, instance: u32, target: u32) {
        self.index(place, "mesh instance", instance as usize, asset.instances.len());
        let mesh = asset.instances.get(instance as usize).and_then(|i| asset.meshes.get(i.mesh as usize));
        if let Some(mesh) = mesh {
            self.index(place, "morph target", target as usize, mesh.morph_targets);
        }
    }

    /// Checks for cycles of parents at every time at which a parent changes. Reports the first one only.
    fn parents(&mut self) {
        let (mut parents, mut order) = (ActiveParents::default(), PlacementOrder::default());
        for time in times_of_change(self.stage) {
            parents.find(self.stage, time, &[], &KeptTransforms::default());
            let Err(error) = order::find(self.stage, &parents, &mut order) else { continue };
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

    fn attachment(&mut self, place: &str, at: &Attachment) {
        self.index(place, "parent actor", at.actor, self.stage.actors.len());
        if let (Some(parent), Some(joint)) = (self.stage.actors.get(at.actor), at.joint) {
            let joints = parent.asset.skeleton.len();
            self.index(place, "parent joint", joint as usize, joints);
        }
    }

    fn target(&mut self, place: &str, target: &Target) {
        match *target {
            Target::Point(point) => {
                self.need(point.is_finite(), place, || format!("the target is {point}, must be finite"));
            }
            Target::Actor(actor) => self.index(place, "target actor", actor, self.stage.actors.len()),
            Target::Joint { actor, joint } => {
                self.index(place, "target actor", actor, self.stage.actors.len());
                if let Some(actor) = self.stage.actors.get(actor) {
                    self.index(place, "target joint", joint as usize, actor.asset.skeleton.len());
                }
            }
        }
    }

    fn channel(&mut self, place: &str, channel: &Channel, fits: bool) {
        let place = format!("{place}, keys of {:?}", channel.property);
        self.need(fits, &place, || "this property cannot be keyed here".to_string());
        self.need(!channel.times.is_empty(), &place, || "there are no keys".to_string());
        let sorted = channel.times.windows(2).all(|w| w[0] < w[1]);
        self.need(sorted, &place, || "key times must increase".to_string());
        let tangents = if channel.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let wanted = channel.times.len() * channel.property.width() * tangents;
        self.need(channel.values.len() == wanted, &place, || {
            format!("{} keys need {wanted} numbers, there are {}", channel.times.len(), channel.values.len())
        });
        self.need(channel.values.iter().all(|v| v.is_finite()), &place, || {
            "a key holds a number that is not finite".to_string()
        });
    }

    fn camera(&mut self, camera: &Camera) {
        let place = format!("camera \"{}\"", camera.name);
        match camera.projection {
            Projection::Perspective { yfov, near, far } => {
                self.need(yfov > 0.0 && yfov < std::f32::consts::PI, &place, || {
                    format!("field of view is {yfov} rad, must be above 0 and below π")
                });
                self.need(near > 0.0 && near.is_finite(), &place, || {
                    format!("near plane is at {near} m, must be above 0")
                });
                self.need(far.is_none_or(|far| far > near), &place, || {
                    "the far plane must lie behind the near plane".to_string()
                });
            }
            Projection::Orthographic { height, near, far } => {
                self.need(height > 0.0 && height.is_finite(), &place, || {
                    format!("height is {height} m, must be above 0")
                });
                self.need(near < far && near.is_finite() && far.is_finite(), &place, || {
                    format!("planes are at {near} m and {far} m, must be finite and in this order")
                });
            }
        }
        let numbers = match &camera.rig {
            Rig::Fixed { position, rotation, look_at } => {
                if let Some(target) = look_at {
                    self.target(&place, target);
                }
                self.need((rotation.length() - 1.0).abs() < 1e-3, &place, || {
                    format!("rotation has length {}, must be 1", rotation.length())
                });
                position.is_finite()
            }
            Rig::Follow { target, offset } => {
                self.target(&place, target);
                offset.is_finite()
            }
            Rig::Orbit { target, distance, elevation, azimuth, speed } => {
                self.target(&place, target);
                [distance, elevation, azimuth, speed].iter().all(|v| v.is_finite())
            }
            Rig::File { actor, camera } => {
                self.index(&place, "actor", *actor, self.stage.actors.len());
                if let Some(actor) = self.stage.actors.get(*actor) {
                    self.index(&place, "camera of the file", *camera as usize, actor.asset.cameras.len());
                }
                true
            }
            Rig::Frame { azimuth, elevation } => azimuth.is_finite() && elevation.is_finite(),
        };
        self.need(numbers, &place, || "its place is not finite".to_string());
        self.channels(&place, camera, &camera.channels);
        self.camera_moves(&place, camera);
    }

    fn camera_moves(&mut self, place: &str, camera: &Camera) {
        camera
            .looks
            .iter()
            .filter_map(|look| look.target.as_ref())
            .for_each(|target| self.target(place, target));
        let sorted = camera.looks.is_sorted_by_key(|look| look.start);
        self.need(sorted, place, || "looks must be sorted by their starts".to_string());
        let finite = |shake: &CameraShake| {
            [shake.angle, shake.shift, shake.frequency].iter().all(|n| n.is_finite() && *n >= 0.0)
        };
        self.need(camera.shakes.iter().all(finite), place, || {
            "a shake's angle, shift and frequency must be finite and not negative".to_string()
        });
    }

    fn cuts(&mut self) {
        for (index, cut) in self.stage.cuts.iter().enumerate() {
            let place = format!("cut {index} at {} s", cut.at.as_secs());
            self.index(&place, "camera", cut.camera, self.stage.cameras.len());
            let sorted = index == 0 || self.stage.cuts[index - 1].at <= cut.at;
            self.need(sorted, &place, || "comes before the cut before it; sort by time".to_string());
        }
    }

    fn sky(&mut self, sky: &Sky) {
        self.fields("sky", sky);
        self.channels("sky", sky, &sky.channels);
    }

    fn layer_2d(&mut self, index: usize, layer_2d: &Layer2d) {
        let place = format!("layer_2d {index}");
        self.fields(&place, layer_2d);
        let sized = match &layer_2d.content {
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
        self.need(sized, &place, || "its size and color must be finite and above 0".to_string());
        self.span(&place, layer_2d.start, layer_2d.end);
        self.channels(&place, layer_2d, &layer_2d.channels);
    }

    fn light(&mut self, light: &StageLight) {
        let place = format!("light \"{}\"", light.name);
        self.fields(&place, light);
        if let Some(problem) = light.light.kind.problem() {
            self.need(false, &place, || problem);
        }
        if let Some(shadow) = &light.shadow {
            self.fields(&format!("{place}, shadow"), shadow);
        }
        let falls = light
            .attenuation
            .is_none_or(|a| a.iter().all(|v| v.is_finite() && *v >= 0.0) && a.iter().any(|v| *v > 0.0));
        self.need(falls, &place, || "its attenuation must be ≥ 0, and one of it above".to_string());
        if let Some(parent) = &light.parent {
            self.attachment(&place, parent);
        }
        for channel in &light.channels {
            let fits = channel.property == Property::Visible || light.is_keyed(channel.property);
            self.channel(&place, channel, fits);
        }
    }
}
