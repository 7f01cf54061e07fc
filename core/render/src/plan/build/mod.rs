//! Snapshot → plan: what is in view, the pipelines and matrices that it needs, and the order of drawing.

mod deferred;
mod display;
pub mod effects;
mod items;
mod lights;
mod lod;
mod mesh;
mod outlines;
mod overdraw;
pub(crate) mod overlay;
mod refraction;
pub(crate) mod scene_inputs;
pub(crate) mod shadow_cascades;
mod shadow_casters;
pub(crate) mod shadow_volumes;
pub(crate) mod skins;
mod transparency;

use crate::affine::Affine3x4;
use crate::effect_faults::PlanFault;
use crate::layers_2d::compose_layers;
use crate::plan::build::display::{Display, background, keep_light};
use crate::plan::build::effects::{
    SceneEffect, add_frame_numbers, background_effects, post_passes, scene_effects, shutter_faults,
};
use crate::plan::build::items::{DrawItem, sort};
use crate::plan::build::lights::{plan_lights, plan_sky};
use crate::plan::build::lod::ActorLevels;
use crate::plan::build::mesh::MeshContext;
use crate::plan::build::outlines::{OutlineKey, SurfaceLine, effect_lines};
use crate::plan::build::overdraw::OverdrawEstimate;
use crate::plan::build::overlay::{DrawnOverlays, overlays};
use crate::plan::build::scene_inputs::{FrameBefore, effect_frame, frame_times, inputs_of};
use crate::plan::build::shadow_casters::ShadowCaster;
use crate::plan::build::skins::SkinMatrices;
use crate::plan::build::transparency::TransparentCopy;
use crate::plan::dirty_rect::DirtyRect;
use crate::plan::features::{Facts, left_out};
use crate::plan::light_clusters::LightClusters;
use crate::plan::options::PlanOptions;
use crate::plan::{ActiveMorph, Features, LeftOut, Plan, PlanLight, View, light_clusters};
use crate::scene_resources::SceneResources;
use crate::scene_resources::material::MaterialResource;
use choreo_asset::Aabb;
use choreo_motion::Time;
use choreo_plugin::FrameWish;
use choreo_stage::{ActorShadow, ActorState, EffectTarget, Shadow, Snapshot, Stage};
use glam::{DAffine3, Vec3};
use std::sync::Arc;

impl Plan {
    /// Plans a frame. The same input gives the same plan, bit for bit.
    pub fn new(
        resources: &SceneResources,
        stage: &Stage,
        snapshot: &Snapshot,
        options: &PlanOptions,
    ) -> Plan {
        let view = View::new(&snapshot.camera, options.size);
        let (mut lights, mut shadows, dark_lights) = plan_lights(&snapshot.lights, &view);
        let many_lights = light_clusters::sort(&mut lights, &mut shadows);
        let display = Display::new(stage, snapshot, options);
        let mut effect_faults = Vec::new();
        let mut planner = Planner {
            resources,
            display,
            options,
            local_lights: lights.iter().any(PlanLight::is_local),
            polynomial: lights.iter().any(PlanLight::is_polynomial),
            sky: snapshot.sky.as_ref().is_some_and(|sky| sky.strength > 0.0),
            sky_background: snapshot.sky.as_ref().is_some_and(|sky| sky.background),
            stage,
            snapshot,
            transparent: Vec::new(),
            joint_matrices: Vec::new(),
            morphs: Vec::new(),
            items: Vec::new(),
            skins: Vec::new(),
            material_overrides: Vec::new(),
            overrides_of_actor: Vec::new(),
            levels: ActorLevels::default(),
            casting: shadows.iter().any(Option::is_some),
            casters: Vec::new(),
            receivers: Vec::new(),
            overdraw: OverdrawEstimate::of(stage.settings.pipeline, options),
            effect_lines: effect_lines(stage, snapshot, options, &mut effect_faults),
            effect_faults,
            scene_effects: scene_effects(stage, snapshot, options),
            before: options.moved_from.map(|before| FrameBefore::new(before, options.size)),
            outline_materials: Vec::new(),
            dirty_rect: DirtyRect::NOTHING,
            facts: Facts {
                lights_exist: !lights.is_empty(),
                in_stage: Features::SKY.when(snapshot.sky.is_some()),
                dark_lights,
                many_lights,
                ..Facts::default()
            },
            view,
            time: snapshot.time,
        };
        for (index, state) in snapshot.actors.iter().enumerate().take(stage.actors.len()) {
            planner.actor(index, state);
        }
        planner.facts.casting = planner.casting;
        planner.facts.unshadowed = stage.actors.iter().filter(|a| a.shadow != ActorShadow::default()).count();
        planner.finish(snapshot, lights, &shadows)
    }
}

struct Planner<'a> {
    resources: &'a SceneResources,
    options: &'a PlanOptions<'a>,
    view: View,
    time: Time,
    display: Display,
    /// Whether point or spot lights shine.
    local_lights: bool,
    /// Whether some light has a polynomial falloff.
    polynomial: bool,
    /// Whether the sky lights surfaces.
    sky: bool,
    /// Whether the sky is drawn as the background.
    sky_background: bool,
    stage: &'a Stage,
    snapshot: &'a Snapshot,
    /// Bounds of transparent copies.
    transparent: Vec<TransparentCopy>,
    joint_matrices: Vec<Affine3x4>,
    morphs: Vec<ActiveMorph>,
    items: Vec<DrawItem>,
    skins: Vec<SkinMatrices>,
    material_overrides: Vec<Arc<MaterialResource>>,
    /// Overrides of the current actor: (its asset's material, the scene resources' material, index into `material_overrides`).
    overrides_of_actor: Vec<(u32, u32, u32)>,
    /// Levels of detail of the current actor.
    levels: ActorLevels<'a>,
    /// Whether some light casts shadows, so that casters outside the view count, too.
    casting: bool,
    casters: Vec<ShadowCaster>,
    /// Outlines and wireframes of effects with their targets (empty: everything).
    effect_lines: Vec<(SurfaceLine, Vec<EffectTarget>)>,
    scene_effects: Vec<SceneEffect>,
    /// Faults of effects that were found so far.
    effect_faults: Vec<PlanFault>,
    /// Set if an effect reads motion vectors.
    before: Option<FrameBefore<'a>>,
    /// Index into `material_overrides` of each outline material made so far.
    outline_materials: Vec<(OutlineKey, u32)>,
    /// Bounds of lit copies in view, if a light casts shadows.
    receivers: Vec<Aabb>,
    overdraw: Option<OverdrawEstimate>,
    dirty_rect: DirtyRect,
    facts: Facts,
}

impl<'a> Planner<'a> {
    fn actor(&mut self, index: usize, state: &'a ActorState) {
        if !state.visible {
            self.facts.hidden_actors += 1;
            return;
        }
        if state.culled {
            self.facts.unposed_actors += 1;
            return;
        }
        // The only place where world positions become camera-relative.
        let relative_from_model = DAffine3 {
            translation: state.world_from_model.translation - self.view.position,
            ..state.world_from_model
        };
        let first_skin = self.skins.len();
        self.overrides_of_actor.clear();
        self.forget_skins_before();
        let asset = &*self.stage.actors[index].asset;
        let resources = self.resources;
        let entry = resources.entry(index);
        self.levels = self.actor_levels(index, entry, state, relative_from_model);
        for (i, (instance, primitives)) in asset.instances.iter().zip(&entry.primitives).enumerate() {
            let skin = instance.skin.filter(|s| (*s as usize) < asset.skins.len()).map(|skin| {
                let known = self.skins[first_skin..].iter().position(|s| s.skin == skin);
                known.map_or_else(
                    || {
                        self.skins.push(SkinMatrices::new(relative_from_model, asset, skin, state));
                        self.skins.len() - 1
                    },
                    |at| first_skin + at,
                )
            });
            let weights = state.morph_weights.get(i).unwrap_or(&instance.weights);
            let mut mesh = MeshContext {
                asset,
                state,
                actor: index,
                index: i,
                instance,
                relative_from_model,
                skin,
                weights,
                morphs: None,
            };
            self.mesh(primitives, &mut mesh);
        }
    }

    /// A material with its override in this frame, if any.
    fn material(&self, material: u32, material_override: Option<u32>) -> &MaterialResource {
        match material_override {
            Some(at) => &self.material_overrides[at as usize],
            None => &self.resources.materials[material as usize],
        }
    }

    /// Adds the shadow feature to lit items whose actors receive shadows.
    fn receive_shadows(&mut self) {
        let receives = |i: &DrawItem| self.stage.actors[i.actor as usize].shadow.receive;
        let lit = self.items.iter_mut().filter(|i| i.pipeline.features.is_lit() && receives(i));
        lit.for_each(|i| i.pipeline.features = i.pipeline.features.with(Features::SHADOW));
    }

    // Longer than 80 lines, because the plan has many fields.
    fn finish(mut self, snapshot: &Snapshot, mut lights: Vec<PlanLight>, shadows: &[Option<Shadow>]) -> Plan {
        let (stage, options) = (self.stage, self.options);
        let lit = self.facts.lit_drawn || options.force_all;
        let maps = self.fit_shadow_maps(&mut lights, shadows);
        if !maps.is_empty() || options.force_all {
            self.receive_shadows();
        }
        let first_transparent = sort(&mut self.items);
        let depth_peeling = self.depth_peeling(first_transparent);
        if depth_peeling.is_ok() {
            self.items[first_transparent..].iter_mut().for_each(|item| item.pipeline.peeled = true);
        }
        let (mut draws, mut instances, all) = self.draws();
        let mut instance_actors: Vec<u32> = self.items.iter().map(|item| item.actor).collect();
        let light_clusters = (lit && self.facts.many_lights && !options.no_light_clusters)
            .then(|| LightClusters::new(&lights, &self.view, options.size));
        let deferred = self.deferred(&mut draws, (lights.len(), light_clusters.as_ref()));
        let DrawnOverlays { overlay, labels, left_out: overlay_left_out, faults } =
            overlays(stage, snapshot, &self.view, options);
        self.effect_faults.extend(faults);
        self.effect_faults.extend(shutter_faults(stage, snapshot, options.effects));
        let [layers_behind, layers_in_front] = compose_layers(stage, snapshot, &labels, options.size);
        let (mut post, mut effects_left_out) = post_passes(stage, snapshot, options);
        self.display.add_pass(&mut post, options);
        if let FrameWish::Scene(_) = options.wish {
            effects_left_out.extend(keep_light(&mut post, options));
        }
        let times = frame_times(stage, snapshot);
        post.iter_mut().for_each(|pass| add_frame_numbers(pass, &times, options));
        let inputs = inputs_of(stage, snapshot, options);
        let effect_frame = effect_frame(stage, snapshot, inputs, &self.view, &lights);
        self.facts = Facts {
            layers_2d: usize::from(layers_behind.is_some()) + usize::from(layers_in_front.is_some()),
            blended: self.items.len() - first_transparent,
            draws: draws.len(),
            drawn_copies: instances.len(),
            samples: options.samples,
            post_passes: post.len(),
            inputs,
            surface_effects: self.scene_effects.len(),
            shadow_views: maps.len(),
            overlays: overlay.parts.len(),
            ..self.facts
        };
        let scene_inputs = self.input_pass(inputs, &mut instances, &mut instance_actors);
        let shadow_maps = self.shadow_maps(maps, &mut instances, &mut instance_actors);
        let mut left_out = left_out(all, &self.facts);
        left_out.extend(LeftOut::unless("order-independent transparency", &depth_peeling));
        left_out.extend(LeftOut::unless("deferred shading", &deferred));
        left_out.extend(effects_left_out.into_iter().chain(overlay_left_out));
        Plan {
            size: options.size,
            samples: options.samples,
            wish: options.wish,
            view: self.view,
            background: background(snapshot.background, options.wish),
            ambient_up: if lit { snapshot.ambient_up } else { Vec3::ZERO },
            ambient_down: if lit { snapshot.ambient_down } else { Vec3::ZERO },
            exposure: self.display.exposure,
            display: self.display.features,
            light_clusters,
            lights: if lit { lights } else { Vec::new() },
            layers_behind,
            layers_in_front,
            sky: snapshot.sky.as_ref().and_then(|sky| plan_sky(sky, all.has(Features::SKY))),
            instances,
            instance_actors,
            draws,
            shadow_maps,
            scene_color_copy: self.scene_color_copy(),
            depth_peeling: depth_peeling.ok(),
            deferred: deferred.ok(),
            background_effects: background_effects(&self.scene_effects, options),
            displacement_limits: std::array::from_fn(|i| self.scene_effects.get(i).map_or(0.0, |e| e.reach)),
            joint_matrices: self.joint_matrices,
            morphs: self.morphs,
            material_overrides: self.material_overrides,
            scene_effects: self.scene_effects.into_iter().map(|e| e.used).collect(),
            dirty_rect: self.dirty_rect,
            post,
            scene_inputs,
            inputs_only: false,
            effect_frame,
            overlay,
            subframes: Vec::new(),
            shutter_motion: None,
            history: Vec::new(),
            dissolve: None,
            linear: false,
            pre_skinning: stage.settings.pre_skinning,
            left_out,
            effect_faults: self.effect_faults,
        }
    }
}
