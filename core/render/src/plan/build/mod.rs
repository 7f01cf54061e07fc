//! Snapshot → plan: what is in view, which pipelines and matrices it needs, in which order it is drawn.

pub(crate) mod deferred;
pub mod dirty_rect;
pub(crate) mod effects;
pub(crate) mod items;
pub mod light_clusters;
pub(crate) mod lights;
pub(crate) mod overdraw;
pub(crate) mod overlay;
pub(crate) mod refraction;
pub(crate) mod shadow_cascades;
pub(crate) mod shadow_casters;
pub(crate) mod skins;
pub(crate) mod transparency;

use crate::layers_2d::flats;
use crate::plan::build::dirty_rect::Area;
use crate::plan::build::effects::{Line, SceneUse, background_effects, post_passes, shells, surface_effects};
use crate::plan::build::items::{Item, Phase, sort};
use crate::plan::build::light_clusters::LightLists;
use crate::plan::build::lights::{plan_lights, plan_sky};
use crate::plan::build::overdraw::Overdraw;
use crate::plan::build::overlay::overlays;
use crate::plan::build::shadow_casters::Caster;
use crate::plan::build::skins::{PosedSkin, daffine};
use crate::plan::build::transparency::SeenThrough;
use crate::plan::features::{DrawNeeds, Facts, features, left_out, shell_features};
use crate::plan::options::PlanOptions;
use crate::plan::*;
use crate::scene_resources::bounds::{Aabb, moved, outside};
use crate::scene_resources::thick_lines;
use crate::scene_resources::watertight::is_before;
use crate::scene_resources::{Catalog, CatalogMaterial, PrimitiveEntry};
use choreo_asset::{AlphaMode, Asset, MeshInstance};
use choreo_motion::Time;
use choreo_stage::{ActorState, EffectTarget, Shadow, Snapshot, Stage};
use glam::{Affine3A, DAffine3, Vec2, Vec3, Vec4};
use std::sync::Arc;

impl Plan {
    /// The same input gives the same plan, bit for bit.
    pub fn new(catalog: &Catalog, stage: &Stage, snapshot: &Snapshot, options: &PlanOptions) -> Plan {
        let view = View::new(&snapshot.camera, options.size);
        let (mut lights, mut shadows, dark_lights) = plan_lights(&snapshot.lights, &view);
        let many_lights = light_clusters::sort(&mut lights, &mut shadows);
        let mut planner = Planner {
            catalog,
            options,
            local_lights: lights.iter().any(|l| l.direction.w != 0.0),
            polynomial: lights.iter().any(|l| l.position.w < 0.0),
            sky: snapshot.sky.as_ref().is_some_and(|sky| sky.strength > 0.0),
            sky_seen: snapshot.sky.as_ref().is_some_and(|sky| sky.background),
            stage,
            seen_through: Vec::new(),
            joint_matrices: Vec::new(),
            morphs: Vec::new(),
            items: Vec::new(),
            skins: Vec::new(),
            materials: Vec::new(),
            changed: Vec::new(),
            casting: shadows.iter().any(Option::is_some),
            casters: Vec::new(),
            receivers: Vec::new(),
            overdraw: Overdraw::of(stage.settings.pipeline, options),
            shells: shells(stage, snapshot, options),
            surface: surface_effects(stage, snapshot, options),
            shell_materials: Vec::new(),
            area: Area::NOTHING,
            facts: Facts {
                lights_exist: !lights.is_empty(),
                sky_exists: snapshot.sky.is_some(),
                dark_lights,
                many_lights,
                ..Facts::default()
            },
            view,
            time: snapshot.time,
        };
        for (index, (actor, state)) in stage.actors.iter().zip(&snapshot.actors).enumerate() {
            planner.actor(index, &actor.asset, state);
        }
        planner.facts.casting = planner.casting;
        planner.finish(stage, snapshot, lights, &shadows)
    }
}

/// Which of the effects' lines, the catalogue's material, of the changed ones.
type ShellKey = (usize, u32, Option<u32>);

pub(crate) struct Planner<'a> {
    pub catalog: &'a Catalog,
    pub options: &'a PlanOptions<'a>,
    pub view: View,
    time: Time,
    local_lights: bool,
    polynomial: bool,
    sky: bool,
    /// Behind everything.
    sky_seen: bool,
    pub stage: &'a Stage,
    /// Boxes of what is seen through.
    pub seen_through: Vec<SeenThrough>,
    pub joint_matrices: Vec<Rows>,
    morphs: Vec<ActiveMorph>,
    pub items: Vec<Item>,
    pub skins: Vec<PosedSkin>,
    pub materials: Vec<Arc<CatalogMaterial>>,
    /// Of the actor at hand: (its material, the catalogue's, place in `materials`).
    pub changed: Vec<(u32, u32, u32)>,
    /// Some light casts shadows: those outside the view count too.
    pub casting: bool,
    pub casters: Vec<Caster>,
    /// Outlines by effects, and what has them (empty: all).
    pub shells: Vec<(Line, Vec<EffectTarget>)>,
    /// Effects that are part of the scene's shaders.
    pub surface: Vec<SceneUse>,
    /// Place in `materials` of each that was made.
    pub shell_materials: Vec<(ShellKey, u32)>,
    /// Boxes of what is lit and in view; where some light casts, and where light could wait.
    pub receivers: Vec<Aabb>,
    pub overdraw: Option<Overdraw>,
    /// What of the picture they reach.
    area: Area,
    pub facts: Facts,
}

impl Planner<'_> {
    fn actor(&mut self, index: usize, asset: &Asset, state: &ActorState) {
        if !state.visible {
            self.facts.hidden_actors += 1;
            return;
        }
        if state.out_of_view {
            self.facts.unposed_actors += 1;
            return;
        }
        // The only place where world coordinates are subtracted.
        let relative_from_model = DAffine3 {
            translation: state.world_from_model.translation - self.view.position,
            ..state.world_from_model
        };
        let first_skin = self.skins.len();
        self.changed.clear();
        let catalog = self.catalog;
        let entry = catalog.entry(index);
        for (i, (instance, primitives)) in asset.instances.iter().zip(&entry.primitives).enumerate() {
            let skin = instance.skin.filter(|s| (*s as usize) < asset.skins.len()).map(|skin| {
                let known = self.skins[first_skin..].iter().position(|s| s.skin == skin);
                known.map_or_else(
                    || {
                        self.skins.push(PosedSkin::new(relative_from_model, asset, skin, state));
                        self.skins.len() - 1
                    },
                    |at| first_skin + at,
                )
            });
            let weights = state.morph_weights.get(i).unwrap_or(&instance.weights);
            let (first, first_caster) = (self.items.len(), self.casters.len());
            self.mesh(primitives, instance, relative_from_model, skin, weights, (asset, state, index));
            self.items[first..].iter_mut().for_each(|item| item.actor = index as u32);
            self.casters[first_caster..].iter_mut().for_each(|caster| caster.actor = index as u32);
        }
    }

    fn mesh(
        &mut self,
        primitives: &[PrimitiveEntry],
        instance: &MeshInstance,
        relative_from_model: DAffine3,
        skin: Option<usize>,
        weights: &[f32],
        (asset, state, index): (&Asset, &ActorState, usize),
    ) {
        let model_from_joint = state.model_from_joint.get(instance.joint as usize);
        let model_from_joint = model_from_joint.copied().unwrap_or(Affine3A::IDENTITY);
        let catalog = self.catalog;
        let active = |&(_, w): &(usize, &f32)| *w != 0.0 && w.is_finite();
        let size = self.options.size;
        let mut morph_range = None;
        for entry in primitives {
            let entry = &catalog.showing(entry, self.time);
            let primitive = &catalog.primitives[entry.primitive as usize];
            let info = &primitive.info;
            let changed = self.changed_material(entry, state);
            let now = changed.map(|c| self.materials[c as usize].clone());
            let material = now.as_deref().unwrap_or(&catalog.materials[entry.material as usize]);
            if !info.valid || primitive.primitive().indices.is_empty() {
                continue;
            }
            self.facts.copies += asset.standing(instance, state.copies).count();
            let posed_skin = skin.filter(|s| {
                // A joint list shorter than the vertices' indices cannot be drawn skinned.
                info.influences > 0 && info.joint_count() <= self.skins[*s].rows.len()
            });
            let morph_count = weights.iter().take(info.morph_bounds.len()).enumerate().filter(active).count();
            self.facts.skins_exist |= posed_skin.is_some();
            self.facts.morphs_exist |= !info.morph_bounds.is_empty();
            self.facts.lit_exist |= is_lit(material.material.shading);

            let base_color = entry.animated.map_or(Vec4::ONE, |m| {
                let rest = asset.materials.get(m as usize).map_or(Vec4::ONE, |m| m.base_color);
                state.base_colors.get(m as usize).copied().unwrap_or(rest)
            });
            let tint = state.tint * base_color;
            let offset = info.morph_offset(weights);
            let needs = DrawNeeds {
                skinned: posed_skin.is_some(),
                placed: !asset.places.is_empty(),
                dual: posed_skin.is_some_and(|s| !self.skins[s].carriers.is_empty()),
                morphed: morph_count > 0,
                local_lights: self.local_lights,
                sky: self.sky,
                polynomial: self.polynomial,
            };
            let mut features = features(primitive, material, needs, self.options.force_all);
            let effects = self.effects_of(index, entry.of_asset);
            let seen = effects.needs;
            let has = |on: bool, there: bool, bit| if on && there { bit } else { Features::default() };
            let shape = primitive.primitive();
            features = features
                .with(has(seen.normals, !shape.normals.is_empty(), Features::SEEN_NORMALS))
                .with(has(seen.uvs, !shape.uvs[0].is_empty(), Features::UV0))
                // What is behind it, where an effect asks.
                .with(has(effects.surface != 0, self.sky && self.sky_seen, Features::SKY))
                .with(has(seen.joints, needs.skinned && !needs.dual, Features::SEEN_JOINTS))
                .with(has(seen.shadow, is_lit(material.material.shading), Features::SEEN_SHADOW));
            let of_corners = effects.of_corners(shape);
            let drawn_wide = features.has(Features::WIDE);
            let wide = thick_lines::pen(shape.topology, &material.material).filter(|_| drawn_wide);
            let in_model = posed_skin.and_then(|s| self.skins[s].in_model(primitive, offset));
            let smooth = self.smooth_cutouts(index, entry.of_asset);
            for (number, (place, copy)) in asset.standing(instance, state.copies).enumerate() {
                let after_pose = needs.skinned && (needs.dual || needs.placed);
                let relative_from_place = match needs.placed {
                    true => relative_from_model * daffine(place),
                    false => relative_from_model,
                };
                let rigid = Rows::from_affine(match instance.copies.is_empty() {
                    _ if after_pose => relative_from_place,
                    true => relative_from_place * daffine(model_from_joint),
                    false => relative_from_place * daffine(model_from_joint) * daffine(copy),
                });
                let bounds = match posed_skin.map(|s| &self.skins[s]) {
                    Some(_) if let Some(in_model) = in_model => moved(in_model, &rigid),
                    Some(s) if needs.dual => {
                        info.dual_skinned(primitive.primitive(), &s.carriers, &rigid, offset)
                    }
                    Some(s) => info.skinned(&s.rows, offset),
                    None => info.posed(&rigid, offset),
                };
                let width = wide.map_or(0.0, |pen| thick_lines::width(pen, state.pen_width, &rigid));
                if wide.is_some() && width == 0.0 {
                    continue;
                }
                let around = Vec3::splat(effects.reach);
                let bounds = Aabb { min: bounds.min - around, max: bounds.max + around };
                let (metres, share) = self.reach(entry, changed, index);
                let metres = metres + (-width).max(0.0);
                // Half of it, and no less than half a pixel to each side.
                let pen = if wide.is_some() { (0.5 * width + 1.0) / size[1] as f32 } else { 0.0 };
                let share = share.max(pen);
                let margin = Vec2::new(share * size[1] as f32 / size[0].max(1) as f32, share) * 2.0;
                let around = Vec3::splat(metres);
                let reached = Aabb { min: bounds.min - around, max: bounds.max + around };
                let unseen =
                    !self.options.no_culling && outside(reached, &self.view.clip_from_relative, margin);
                self.facts.culled += usize::from(unseen);
                if unseen && !self.casting {
                    continue;
                }

                let entry = &self.entry_by_size(entry, bounds, posed_skin, &rigid);
                let (determinant, one_handed) = self.handedness(info, posed_skin, &rigid);
                let blend =
                    alpha_blends(material.material.alpha_mode) || state.tint.w < 1.0 || seen.see_through;
                let glass = features.has(Features::TRANSMISSION);
                let cut = matches!(material.material.alpha_mode, AlphaMode::Mask(cutoff) if cutoff > 0.0);
                let key = PipelineKey {
                    features,
                    topology: primitive.primitive().topology.into(),
                    double_sided: material.material.double_sided || features.has(Features::WIDE),
                    mirrored: determinant < 0.0,
                    blend,
                    peeled: false,
                    coverage: smooth && cut && !blend && !glass,
                    glass: Glass::No,
                    surface: effects.surface,
                    displaced: effects.displaced,
                    lighting: effects.lighting,
                }
                .of_lit();
                let closed = self.closed(&catalog.primitives[entry.primitive as usize], &key, one_handed);
                let casts = self.casting && key.topology == TopologyKey::Triangles && !key.blend && !glass;
                if unseen && !casts {
                    continue;
                }
                let mut planned = Instance { relative_from_mesh: rigid, tint, width, ..Instance::default() };
                if let Some(s) = posed_skin {
                    // Whoever is only a caster comes in once a map shows it.
                    if !unseen {
                        planned.first_joint = self.first_joint(s);
                    }
                } else if self.options.force_all {
                    // A skin of one joint, on which every vertex hangs with weight one.
                    planned.first_joint = self.joint_matrices.len() as u32;
                    self.joint_matrices.push(rigid);
                }
                if morph_count > 0 {
                    let (first, count) = *morph_range.get_or_insert_with(|| {
                        let first = self.morphs.len();
                        let pairs = weights.iter().take(info.morph_bounds.len()).enumerate().filter(active);
                        self.morphs.extend(pairs.map(|(t, w)| ActiveMorph { target: t as u32, weight: *w }));
                        (first as u32, (self.morphs.len() - first) as u32)
                    });
                    planned.first_morph = first;
                    // Fewer targets in this primitive than in the mesh: the pairs are in target order.
                    planned.morph_count = count.min(morph_count as u32);
                }
                if casts {
                    let key = PipelineKey {
                        features: features.of_depth().with(of_corners),
                        coverage: false,
                        surface: 0,
                        lighting: 0,
                        ..key
                    };
                    self.casters.push(Caster {
                        entry: *entry,
                        changed,
                        key,
                        instance: planned,
                        bounds,
                        closed,
                        skin: posed_skin,
                        actor: 0,
                    });
                }
                if unseen {
                    continue;
                }
                let closed = if is_before(bounds, &self.view.clip_from_relative) { closed } else { 0 };
                self.facts.closed += closed as usize / 3;
                self.area.add(reached, &self.view.clip_from_relative, size, share * size[1] as f32);
                let lit = key.features.is_lit();
                self.facts.lit_drawn |= lit;
                self.facts.coverage |= key.coverage;
                self.lit_box(bounds, &key, (entry.material, changed), glass);
                let phase = match material.material.alpha_mode {
                    _ if key.blend || glass => Phase::Blend,
                    AlphaMode::Mask(_) => Phase::Mask,
                    _ => Phase::Opaque,
                };
                let depth = self.view.depth(bounds.center());
                let seen_through = (phase == Phase::Blend).then(|| {
                    let rigid_box = posed_skin.is_none() && morph_count == 0 && effects.reach == 0.0;
                    let own = rigid_box.then_some((info.bounds, &rigid));
                    self.see_through(bounds, own, &key, ([index, number], entry.of_asset))
                });
                let passes = match glass {
                    true if key.features.has(Features::REFRACTION) => &[Glass::Refract][..],
                    true => &[Glass::Filter, Glass::Light],
                    false => &[Glass::No],
                };
                self.items.extend(passes.iter().map(|glass| Item {
                    phase,
                    pipeline: PipelineKey { glass: *glass, ..key },
                    entry: *entry,
                    changed,
                    depth,
                    nearest: depth,
                    closed,
                    instance: planned,
                    actor: 0,
                    seen_through,
                }));
                if key.topology == TopologyKey::Triangles && !primitive.primitive().normals.is_empty() {
                    for (edges, changed) in self.hulls(entry, changed, index) {
                        let now = changed.map(|c| self.materials[c as usize].clone());
                        let of = now.as_deref().unwrap_or(&catalog.materials[entry.material as usize]);
                        let features = match edges {
                            true => key.features.of_alpha(key.blend).with(Features::EDGES),
                            false => shell_features(key.features, primitive, of, key.blend),
                        };
                        let topology = if edges { TopologyKey::Lines } else { key.topology };
                        let features = features.with(of_corners);
                        let pipeline =
                            PipelineKey { features, topology, double_sided: edges, ..key }.of_lit();
                        let entry = *entry;
                        let nearest = depth;
                        // Of what is seen through, a hull shows itself around the surface and not before it.
                        let depth = if phase == Phase::Blend && !edges { depth.next_up() } else { depth };
                        self.items.push(Item {
                            phase,
                            pipeline,
                            entry,
                            changed,
                            depth,
                            nearest,
                            closed: 0,
                            instance: planned,
                            actor: 0,
                            seen_through,
                        });
                    }
                }
            }
        }
    }

    fn finish(
        mut self,
        stage: &Stage,
        snapshot: &Snapshot,
        mut lights: Vec<PlanLight>,
        shadows: &[Option<Shadow>],
    ) -> Plan {
        let lit = self.facts.lit_drawn || self.options.force_all;
        let maps = self.fit_shadows(&mut lights, shadows);
        if !maps.is_empty() || self.options.force_all {
            let lit = self.items.iter_mut().filter(|i| i.pipeline.features.is_lit());
            lit.for_each(|i| i.pipeline.features = i.pipeline.features.with(Features::SHADOW));
        }
        let first_blended = sort(&mut self.items);
        let peel = self.peel(first_blended);
        if peel.is_ok() {
            self.items[first_blended..].iter_mut().for_each(|item| item.pipeline.peeled = true);
        }
        let (mut draws, mut instances, all) = self.draws();
        let mut instance_actors: Vec<u32> = self.items.iter().map(|item| item.actor).collect();
        let light_lists = (lit && self.facts.many_lights && !self.options.no_light_lists)
            .then(|| LightLists::new(&lights, &self.view, self.options.size));
        let lamps = (lights.len(), light_lists.as_ref());
        let deferred = self.deferred(stage.settings.pipeline, &mut draws, lamps);
        let (overlay, labels, beyond) = overlays(stage, snapshot, &self.view, self.options);
        let [under, over] = flats(stage, snapshot, &labels, self.options.size);
        self.facts.flats = usize::from(under.is_some()) + usize::from(over.is_some());
        let (post, unknown) = post_passes(stage, snapshot, self.options.effects, self.options.size);
        self.facts.blended = self.items.len() - first_blended;
        self.facts.draws = draws.len();
        self.facts.drawn_copies = instances.len();
        self.facts.samples = self.options.samples;
        self.facts.post_passes = post.len();
        self.facts.surface_effects = self.surface.len();
        self.facts.shadow_views = maps.len();
        let behind = self.behind();
        self.facts.overlays = overlay.parts.len();
        let shadows = self.draw_shadows(maps, &mut instances, &mut instance_actors);
        let mut left_out = left_out(all, &self.facts);
        left_out.extend(LeftOut::unless("order-independent transparency", &peel));
        left_out.extend(LeftOut::unless("deferred shading", &deferred));
        left_out.extend(unknown.into_iter().chain(beyond));
        Plan {
            size: self.options.size,
            samples: self.options.samples,
            view: self.view,
            background: snapshot.background,
            ambient_up: if lit { snapshot.ambient_up } else { Vec3::ZERO },
            ambient_down: if lit { snapshot.ambient_down } else { Vec3::ZERO },
            light_lists,
            lights: if lit { lights } else { Vec::new() },
            under,
            over,
            sky: snapshot.sky.as_ref().and_then(|sky| plan_sky(sky, all.has(Features::SKY))),
            instances,
            instance_actors,
            joint_matrices: self.joint_matrices,
            morphs: self.morphs,
            draws,
            materials: self.materials,
            shadows,
            behind,
            peel: peel.ok(),
            deferred: deferred.ok(),
            background_effects: background_effects(&self.surface, self.options),
            reaches: std::array::from_fn(|i| self.surface.get(i).map_or(0.0, |e| e.reach)),
            surface: self.surface.into_iter().map(|e| e.used).collect(),
            area: self.area,
            post,
            overlay,
            exposed: Vec::new(),
            before: Vec::new(),
            linear: false,
            skin_once: stage.settings.skin_once,
            left_out,
        }
    }
}
