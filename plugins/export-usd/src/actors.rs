//! Actors: each prim refers to its model and adds transform, motion and material differences.

use crate::frames::Frames;
use crate::layer::{MATRIX4D, Prim, Samples};
use crate::lights;
use crate::materials::{self, Network};
use crate::meshes;
use crate::model::{self, Common, Model, material_context};
use crate::motion::{self, Sets};
use choreo_exporter_kit::bake::rig;
use choreo_exporter_kit::bake::signals::{MaterialPart, Quantity, material_now, set_material_part};
use choreo_exporter_kit::{Baked, Series};
use choreo_plugin::asset::{Material, widen};
use choreo_plugin::glam::Affine3A;
use choreo_plugin::motion::{Skinning, Time, Transform};
use choreo_plugin::stage::{Actor, Property as StageProperty, Stage};
use std::collections::BTreeMap;
use std::rc::Rc;

/// The largest rotation of a texture between two keys, radians. The texture's offset moves on an arc, which more keys follow
/// closely.
const MAX_ROTATION_STEP: f32 = 0.05;

/// The inputs that actors are written from.
pub(crate) struct ActorWriter<'a, 'b> {
    pub stage: &'a Stage,
    pub baked: &'b Baked<'a>,
    pub sets: &'b Sets<'a>,
    pub frames: Frames,
    /// Path of the prim that holds the actors.
    pub path: String,
}

/// Paths of written animations, by the track set that moves the joints.
pub(crate) type KnownAnimations = BTreeMap<usize, String>;

impl<'a> ActorWriter<'a, '_> {
    /// The prim of an actor.
    pub(crate) fn actor(
        &self,
        index: usize,
        name: &str,
        model: &Model<'a>,
        (known, common): (&mut KnownAnimations, &mut Common),
    ) -> Prim<'a> {
        let actor = &self.stage.actors[index];
        let still = self.baked.still_rig(actor, index);
        let path = format!("{}/{name}", self.path);
        let sets: Vec<_> = self.baked.motions[index].sets.iter().map(|set| &self.sets[*set]).collect();
        let count = self.copy_count(index, common);
        let material_overrides = self.material_overrides(index, model, common);
        let asset = &actor.asset;
        let mut prim = match asset.placements.is_empty() {
            true => self.model_reference(index, (name, &path), model, (&still, material_overrides, known)),
            false => {
                let mut above = Prim::new("Xform", name);
                let places: Vec<Affine3A> = asset.first_placements(count).collect();
                match model.joints {
                    None => {
                        let mut copies =
                            model::instancer("copies", &places, format!("{path}/copies/prototype"));
                        let at = format!("{path}/copies/prototype");
                        let still = (&still[..], material_overrides, known);
                        copies.children.push(self.model_reference(index, ("prototype", &at), model, still));
                        above.children.push(copies);
                    }
                    Some(_) => {
                        for (number, place) in places.iter().enumerate() {
                            let name = format!("body_{number}");
                            let at = format!("{path}/{name}");
                            let still = (&still[..], material_overrides.clone(), &mut *known);
                            let mut body = self.model_reference(index, (&name, &at), model, still);
                            let place = rig::decompose(&widen(place), &Transform::IDENTITY);
                            motion::add_transform_ops(&mut body, &place);
                            above.children.push(body);
                        }
                    }
                }
                above
            }
        };
        prim.display_name = (actor.name != name).then(|| actor.name.clone());
        motion::place_actor(&mut prim, &still[0], &sets, self.frames);
        if actor.file_lights && asset.placements.is_empty() && !asset.lights.is_empty() {
            lights::of_file(&mut prim, asset, &still[1..]);
            if motion::joint_set(self.baked, self.sets, index).is_some() {
                common.losses.insert("the motion of lights that follow joints");
            }
        }
        prim
    }

    /// The number of copies at the start; `None` where it changes over time or no number is set.
    fn copy_count(&self, index: usize, common: &mut Common) -> Option<u32> {
        let actor = &self.stage.actors[index];
        let varies = actor.channels.iter().any(|c| c.property == StageProperty::Copies)
            || !self.stage.frame_callbacks.is_empty();
        let copies = self.baked.first.actors[index].copies.filter(|_| !varies);
        if copies.is_some() && actor.asset.placements.is_empty() {
            common.losses.insert("a smaller number of copies");
        }
        copies
    }

    /// A prim that refers to a model, with its animation.
    fn model_reference(
        &self,
        index: usize,
        (name, path): (&str, &str),
        model: &Model<'a>,
        (still, material_overrides, known): (&[Transform], Option<Prim<'a>>, &mut KnownAnimations),
    ) -> Prim<'a> {
        let actor = &self.stage.actors[index];
        let mut prim = Prim::new(if model.joints.is_some() { "SkelRoot" } else { "Xform" }, name);
        prim.reference = Some(model.path.clone());
        prim.children.extend(material_overrides);
        if model.joints.is_none() {
            return prim;
        }
        if actor.skinning == Skinning::DualQuaternion {
            prim.api.push("SkelBindingAPI");
            prim.set_uniform_token("primvars:skel:skinningMethod", "dualQuaternion");
        }
        let mut skeleton = Prim::over("skeleton");
        let rest = actor.asset.skeleton.rest();
        if rest != &still[1..] {
            // Helper joints of further skins keep the model's rest transforms.
            let extra = model.joints.as_ref().map_or(0, Vec::len) - rest.len();
            let helpers = crate::joints::Joints::of(model.asset).rest.split_off(rest.len());
            debug_assert_eq!(helpers.len(), extra);
            let all = still[1..].iter().map(crate::joints::matrix).chain(helpers).collect();
            skeleton.set(MATRIX4D, "restTransforms", meshes::matrices(all)).uniform = true;
        }
        if let Some(source) = self.animation_path(index, path, model, still, known, &mut prim) {
            skeleton.api.push("SkelBindingAPI");
            skeleton.add_relationship("skel:animationSource", vec![source]);
        }
        if !skeleton.properties.is_empty() {
            prim.children.insert(0, skeleton);
        }
        prim
    }

    /// The path of the actor's animation: one that another actor with the same curves wrote, or a new one, added below the prim.
    fn animation_path(
        &self,
        index: usize,
        path: &str,
        model: &Model<'a>,
        still: &[Transform],
        known: &mut KnownAnimations,
        prim: &mut Prim<'a>,
    ) -> Option<String> {
        let actor = &self.stage.actors[index];
        let of_actor =
            |(signal, _): &(choreo_exporter_kit::bake::signals::Signal, Series)| match signal.quantity {
                Quantity::Weights { actor, .. } => actor == index,
                _ => false,
            };
        let set = motion::joint_set(self.baked, self.sets, index);
        let shared = set.filter(|_| !self.baked.series.iter().any(of_actor));
        if let Some(source) = shared.and_then(|set| known.get(&set)) {
            return Some(source.clone());
        }
        let from = (self.baked, self.sets, self.frames);
        let animation = motion::animation(model, (index, actor), from, still)?;
        let source = format!("{path}/animation");
        prim.children.push(animation);
        if let Some(set) = shared {
            known.insert(set, source.clone());
        }
        Some(source)
    }

    /// Overrides for the materials of the actor that differ from the model's.
    fn material_overrides(&self, index: usize, model: &Model<'a>, common: &mut Common) -> Option<Prim<'a>> {
        let mut material_overrides = Prim::over("materials");
        for (number, of_model) in model.materials.iter().enumerate() {
            let Some(of_model) = of_model else { continue };
            let (times, states) = self.material_states(index, number);
            let mut networks = Vec::with_capacity(states.len());
            for state in &states {
                let material = (number < model.asset.materials.len()).then_some(number as u32);
                let Common { textures, losses } = &mut *common;
                let material_context = material_context(model.asset, material);
                networks.push(materials::network(state, material_context, textures, losses));
            }
            if networks.iter().any(|network| !network.is_alike(&of_model.network)) {
                common.losses.insert("materials whose textures or kinds change");
                continue;
            }
            let times = self.frames.time_codes(&times);
            let mut material = Prim::over(of_model.name.clone());
            add_differing_inputs(&of_model.network, &networks, &times, &mut material);
            material_overrides.children.extend((!material.children.is_empty()).then_some(material));
        }
        (!material_overrides.children.is_empty()).then_some(material_overrides)
    }

    /// The times at which a material changes, and the material at each; a single one where it does not change.
    fn material_states(&self, index: usize, number: usize) -> (Vec<Time>, Vec<Material>) {
        let actor: &Actor = &self.stage.actors[index];
        let state = &self.baked.first.actors[index];
        let now = match number < actor.asset.materials.len() {
            true => material_now(&actor.asset, state, number as u32),
            false => Material { base_color: state.tint, ..Material::default() },
        };
        let mut moving: Vec<(MaterialPart, &Series)> = Vec::new();
        for (signal, series) in self.baked.series.iter().filter(|(_, series)| !series.is_still()) {
            if let Quantity::Material { actor, material, part } = signal.quantity
                && (actor, material as usize) == (index, number)
            {
                moving.push((part, series));
            }
        }
        let mut times: Vec<Time> =
            moving.iter().flat_map(|(_, series)| series.times.iter().copied()).collect();
        for (_, series) in moving.iter().filter(|(part, _)| matches!(part, MaterialPart::UvRotation(_))) {
            add_rotation_times(series, &mut times);
        }
        times.sort_unstable();
        times.dedup();
        if times.is_empty() {
            return (vec![self.baked.start], vec![now]);
        }
        let at = |time: &Time| {
            let mut state = now.clone();
            for (part, series) in &moving {
                set_material_part(&mut state, *part, &series.at(*time));
            }
            state
        };
        let states = times.iter().map(at).collect();
        (times, states)
    }
}

/// Adds times between the keys of a rotation, so that no step exceeds [`MAX_ROTATION_STEP`].
fn add_rotation_times(series: &Series, times: &mut Vec<Time>) {
    for (pair, values) in series.times.windows(2).zip(series.values.windows(2)) {
        let parts = ((values[1] - values[0]).abs() / MAX_ROTATION_STEP).ceil().clamp(1.0, 1000.0) as i64;
        let length = (pair[1] - pair[0]).0;
        times.extend((1..parts.min(length)).map(|part| pair[0] + Time(length * part / parts)));
    }
}

/// Adds the inputs whose numbers change over time, or differ from those of the model's material.
fn add_differing_inputs<'a>(model: &Network, networks: &[Network], times: &Rc<[f64]>, out: &mut Prim<'a>) {
    for (number, shader) in model.shaders.iter().enumerate() {
        let mut over = Prim::over(shader.name.clone());
        for (place, input) in shader.inputs.iter().enumerate() {
            let Some(own) = model.numbers(number, place) else { continue };
            let all: Vec<&[f32]> = networks.iter().filter_map(|n| n.numbers(number, place)).collect();
            let Some(first) = all.first() else { continue };
            let name = format!("inputs:{}", input.name);
            if all.iter().any(|numbers| numbers != first) {
                let numbers = all.concat().into_iter().map(f64::from).collect();
                let samples = Samples::of(times.clone(), None, input.value_type.width, numbers);
                over.add_attribute(input.value_type, name).set_samples(samples);
            } else if *first != own {
                over.set_number(input.value_type, name, first);
            }
        }
        out.children.extend((!over.properties.is_empty()).then_some(over));
    }
}
