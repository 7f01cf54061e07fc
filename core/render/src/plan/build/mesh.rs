//! Draw items and shadow casters of one mesh instance of an actor.

use crate::affine::{Affine3x4, to_f64};
use crate::plan::build::Planner;
use crate::plan::build::effects::SurfaceEffects;
use crate::plan::build::items::{DrawItem, DrawPhase};
use crate::plan::build::shadow_casters::ShadowCaster;
use crate::plan::build::shadow_volumes::CasterBounds;
use crate::plan::features::{DrawNeeds, features};
use crate::plan::{ActiveMorph, Features, Glass, Instance, PipelineKey, TopologyKey, alpha_blends, is_lit};
use crate::scene_resources::bounds::{is_beyond_near_plane, is_outside_frustum, transformed};
use crate::scene_resources::{PrimitiveEntry, PrimitiveResource, thick_lines};
use choreo_asset::{Aabb, AlphaMode, Asset, LineStyle, MeshInstance};
use choreo_stage::ActorState;
use glam::{Affine3A, DAffine3, DVec3, Vec2, Vec3, Vec4};

/// A mesh instance of an actor.
pub(super) struct MeshContext<'a> {
    pub asset: &'a Asset,
    pub state: &'a ActorState,
    pub actor: usize,
    /// Index of the mesh instance in its asset.
    pub index: usize,
    pub instance: &'a MeshInstance,
    pub relative_from_model: DAffine3,
    /// Index into `Planner::skins`.
    pub skin: Option<usize>,
    pub weights: &'a [f32],
    /// Range of the mesh's active morph targets in the plan's list, once they are added.
    pub morphs: Option<(u32, u32)>,
}

/// A primitive of the mesh, with everything that its copies share.
pub(super) struct PrimitiveContext<'a> {
    /// Index of the primitive in its mesh.
    index: usize,
    entry: PrimitiveEntry,
    pub primitive: &'a PrimitiveResource,
    material_override: Option<u32>,
    alpha_mode: AlphaMode,
    double_sided: bool,
    /// Set if the primitive is skinned.
    pub skin: Option<usize>,
    pub morph_count: usize,
    morph_offset: Aabb,
    needs: DrawNeeds,
    features: Features,
    effects: SurfaceEffects,
    line_style: Option<LineStyle>,
    tint: Vec4,
    /// Bounds in model space, for a skinned model that its file places several times.
    bounds_in_model: Option<Aabb>,
    smooth_cutouts: bool,
}

/// One copy of the primitive.
struct CopyContext {
    number: usize,
    relative_from_mesh: Affine3x4,
    /// Line width as in [`Instance::width`].
    width: f32,
    bounds: Aabb,
    /// Bounds widened by outlines and thick lines whose width is in metres.
    drawn_bounds: Aabb,
    /// Margin around `drawn_bounds` for outlines and thick lines whose width is on screen, as a share of the image's height.
    drawn_margin: f32,
    /// Whether the copy is outside the view.
    culled: bool,
}

fn is_active_morph(&(_, weight): &(usize, &f32)) -> bool {
    *weight != 0.0 && weight.is_finite()
}

impl<'a> Planner<'a> {
    pub(super) fn mesh(&mut self, primitives: &[PrimitiveEntry], mesh: &mut MeshContext<'a>) {
        for (index, entry) in primitives.iter().enumerate() {
            let Some(p) = self.primitive((index, entry), mesh) else { continue };
            for (number, (place, copy)) in
                mesh.asset.drawn_copies(mesh.instance, mesh.state.copies).enumerate()
            {
                if let Some(copy) = self.copy(&p, mesh, number, (place, copy)) {
                    self.add_copy(&p, mesh, &copy);
                }
            }
        }
    }

    /// Features for effects on a surface that sample the sky behind it.
    fn sky_of_effects(&self, effects: &SurfaceEffects) -> Features {
        let sampled = effects.surface != 0 && self.sky && self.sky_background;
        Features::SKY.with(self.display.features).when(sampled)
    }

    fn primitive(
        &mut self,
        (index, entry): (usize, &PrimitiveEntry),
        mesh: &MeshContext<'a>,
    ) -> Option<PrimitiveContext<'a>> {
        let (asset, state) = (mesh.asset, mesh.state);
        let entry = self.resources.with_sequence_image_at(entry, self.time);
        let primitive = &self.resources.primitives[entry.primitive as usize];
        let (info, shape) = (&primitive.info, primitive.primitive());
        let material_override = self.material_override(&entry, state);
        if !info.valid || shape.indices.is_empty() {
            return None;
        }
        self.facts.copies += asset.drawn_copies(mesh.instance, state.copies).count();
        let skin = mesh.skin.filter(|s| {
            // Vertices whose joint indices exceed the skin's joints cannot be skinned.
            info.influences > 0 && info.joint_count() <= self.skins[*s].matrices.len()
        });
        let morph_count =
            mesh.weights.iter().take(info.morph_bounds.len()).enumerate().filter(is_active_morph).count();
        let resource = self.material(entry.material, material_override);
        let material = &resource.material;
        let lit = is_lit(material.shading);
        let needs = DrawNeeds {
            skinned: skin.is_some(),
            placed: !asset.placements.is_empty(),
            dual: skin.is_some_and(|s| !self.skins[s].dual_quaternions.is_empty()),
            morphed: morph_count > 0,
            local_lights: self.local_lights,
            sky: self.sky,
            polynomial: self.polynomial,
            display: self.display.features,
        };
        let effects = self.effects_of(mesh.actor, entry.of_asset);
        let read = effects.needs;
        let features = features(primitive, resource, needs, self.options.force_all)
            .with(Features::EFFECT_NORMALS.when(read.normals && !shape.normals.is_empty()))
            .with(Features::UV0.when(read.uvs && !shape.uvs[0].is_empty()))
            .with(self.sky_of_effects(&effects))
            .with(Features::EFFECT_JOINTS.when(read.joints && needs.skinned && !needs.dual))
            .with(Features::EFFECT_SHADOW.when(read.shadow && lit));
        let morph_offset = info.morph_offset(mesh.weights);
        let context = PrimitiveContext {
            index,
            line_style: thick_lines::line_style(shape.topology, material)
                .filter(|_| features.has(Features::THICK_LINES)),
            alpha_mode: material.alpha_mode,
            double_sided: material.double_sided || features.has(Features::THICK_LINES),
            tint: state.tint * animated_base_color(&entry, asset, state),
            bounds_in_model: skin.and_then(|s| self.skins[s].bounds_in_model(primitive, morph_offset)),
            smooth_cutouts: self.smooth_cutouts(mesh.actor, entry.of_asset),
            entry,
            primitive,
            material_override,
            skin,
            morph_count,
            morph_offset,
            needs,
            features,
            effects,
        };
        let morphs = Features::MORPH.when(!info.morph_bounds.is_empty());
        self.facts.in_stage = self.facts.in_stage.with(Features::SKIN.when(skin.is_some())).with(morphs);
        self.facts.lit_exist |= lit;
        Some(context)
    }

    /// Plans one copy; `None` if it is neither drawn nor casts a shadow.
    fn copy(
        &mut self,
        p: &PrimitiveContext,
        mesh: &MeshContext,
        number: usize,
        (place, copy): (Affine3A, Affine3A),
    ) -> Option<CopyContext> {
        let size = self.options.size;
        let relative_from_mesh = copy_transform(p, mesh, place, copy);
        let width = p.line_style.map_or(0.0, |line_style| {
            thick_lines::relative_width(
                line_style,
                mesh.state.line_width,
                &relative_from_mesh,
                self.options.pixel_scale(),
            )
        });
        if p.line_style.is_some() && width == 0.0 {
            return None;
        }
        let info = &p.primitive.info;
        let bounds = match p.skin.map(|s| &self.skins[s]) {
            Some(_) if let Some(in_model) = p.bounds_in_model => transformed(in_model, &relative_from_mesh),
            Some(s) if p.needs.dual => info.dual_quaternion_bounds(
                p.primitive.primitive(),
                &s.dual_quaternions,
                &relative_from_mesh,
                p.morph_offset,
            ),
            Some(s) => info.skinned_bounds(&s.matrices, p.morph_offset),
            None => info.rigid_bounds(&relative_from_mesh, p.morph_offset),
        };
        let bounds = grown(bounds, p.effects.reach);
        let (outline_meters, outline_share) = self.outline_width(&p.entry, p.material_override, mesh.actor);
        let drawn_bounds = grown(bounds, outline_meters + (-width).max(0.0));
        // Half the line width on each side, at least half a pixel.
        let line_share = if p.line_style.is_some() { (0.5 * width + 1.0) / size[1] as f32 } else { 0.0 };
        let drawn_margin = outline_share.max(line_share);
        let margin = Vec2::new(drawn_margin * size[1] as f32 / size[0].max(1) as f32, drawn_margin) * 2.0;
        let culled = !self.options.no_culling
            && is_outside_frustum(drawn_bounds, &self.view.clip_from_relative, margin);
        self.facts.culled += usize::from(culled);
        let copy =
            CopyContext { number, relative_from_mesh, width, bounds, drawn_bounds, drawn_margin, culled };
        (!culled || self.casting).then_some(copy)
    }

    fn add_copy(&mut self, p: &PrimitiveContext, mesh: &mut MeshContext<'a>, copy: &CopyContext) {
        let at = (copy.bounds, &copy.relative_from_mesh);
        let Some(entry) = self.at_level(&p.entry, mesh, (copy.number, p.index), at) else { return };
        let (determinant, one_handed) = self.handedness(&p.primitive.info, p.skin, &copy.relative_from_mesh);
        let transmits = p.features.has(Features::TRANSMISSION);
        let blend = alpha_blends(p.alpha_mode) || mesh.state.tint.w < 1.0 || p.effects.needs.see_through;
        let cut_out = matches!(p.alpha_mode, AlphaMode::Mask(cutoff) if cutoff > 0.0);
        let key = PipelineKey {
            topology: p.primitive.primitive().topology.into(),
            double_sided: p.double_sided,
            mirrored: determinant < 0.0,
            blend,
            coverage: p.smooth_cutouts && cut_out && !blend && !transmits,
            surface: p.effects.surface,
            displaced: p.effects.displaced,
            lighting: p.effects.lighting,
            ..PipelineKey::of(p.features)
        }
        .of_lit();
        let watertight = self.watertight(entry.primitive, &key, one_handed);
        let casts = self.casting && self.stage.actors[mesh.actor].shadow.cast;
        let casts = casts && key.topology == TopologyKey::Triangles && !key.blend && !transmits;
        if copy.culled && !casts {
            return;
        }
        let instance = self.instance(p, mesh, copy);
        if casts {
            let features = p.features.of_depth().with(p.effects.of_vertices(p.primitive.primitive()));
            self.casters.push(ShadowCaster {
                entry,
                material_override: p.material_override,
                key: PipelineKey { features, coverage: false, surface: 0, lighting: 0, ..key },
                instance,
                bounds: CasterBounds { bounds: copy.bounds, filled: filled_box(p, copy, &key) },
                watertight,
                skin: p.skin,
                actor: mesh.actor as u32,
            });
        }
        if copy.culled {
            return;
        }
        let outside = is_beyond_near_plane(copy.bounds, &self.view.clip_from_relative);
        let phase = match p.alpha_mode {
            _ if key.blend || transmits => DrawPhase::Transparent,
            AlphaMode::Mask(_) => DrawPhase::AlphaTested,
            _ => DrawPhase::Opaque,
        };
        let depth = self.view.depth(copy.bounds.center());
        let item = DrawItem {
            phase,
            pipeline: key,
            entry,
            material_override: p.material_override,
            depth,
            nearest: depth,
            watertight: if outside { watertight } else { 0 },
            instance,
            before: if phase == DrawPhase::Transparent {
                None
            } else {
                self.instance_before(p, mesh, copy.number)
            },
            actor: mesh.actor as u32,
            transparent: None,
        };
        self.add_items(p, mesh, copy, item);
    }

    /// Adds a visible copy's draws and those of its outlines.
    fn add_items(
        &mut self,
        p: &PrimitiveContext,
        mesh: &MeshContext,
        copy: &CopyContext,
        mut item: DrawItem,
    ) {
        let key = item.pipeline;
        let (clip, size) = (self.view.clip_from_relative, self.options.size);
        self.dirty_rect.add(copy.drawn_bounds, &clip, size, copy.drawn_margin * size[1] as f32);
        self.facts.closed += item.watertight as usize / 3;
        self.facts.lit_drawn |= key.features.is_lit();
        self.facts.coverage |= key.coverage;
        self.add_receiver(mesh.actor, copy.bounds, &key, (item.entry.material, item.material_override));
        if item.phase == DrawPhase::Transparent {
            let rigid = p.skin.is_none() && p.morph_count == 0 && p.effects.reach == 0.0;
            let own = rigid.then_some((p.primitive.info.bounds, &copy.relative_from_mesh));
            let of = ([mesh.actor, copy.number], p.entry.of_asset);
            item.transparent = Some(self.add_transparent(copy.bounds, own, &key, of));
        }
        let passes = match key.features.has(Features::TRANSMISSION) {
            true if key.features.has(Features::REFRACTION) => &[Glass::Refract][..],
            true => &[Glass::Filter, Glass::Light],
            false => &[Glass::No],
        };
        let pass = |glass: &Glass| DrawItem { pipeline: PipelineKey { glass: *glass, ..key }, ..item };
        self.items.extend(passes.iter().map(pass));
        let shape = p.primitive.primitive();
        if key.topology == TopologyKey::Triangles && !shape.normals.is_empty() {
            self.add_outlines(p.primitive, p.effects.of_vertices(shape), &item);
        }
    }

    fn instance(&mut self, p: &PrimitiveContext, mesh: &mut MeshContext, copy: &CopyContext) -> Instance {
        let CopyContext { relative_from_mesh, width, culled, .. } = *copy;
        let mut instance = Instance { relative_from_mesh, tint: p.tint, width, ..Instance::default() };
        if let Some(s) = p.skin {
            // The matrices of a copy that only casts a shadow are added once a shadow map shows it.
            if !culled {
                instance.first_joint = self.first_joint(s);
            }
        } else if self.options.force_all {
            // The instance gets a skin of one joint, to which every vertex is bound with weight 1.
            instance.first_joint = self.joint_matrices.len() as u32;
            self.joint_matrices.push(relative_from_mesh);
        }
        if p.morph_count > 0 {
            let targets = p.primitive.info.morph_bounds.len();
            let (first, count) = *mesh.morphs.get_or_insert_with(|| {
                let first = self.morphs.len();
                let pairs = mesh.weights.iter().take(targets).enumerate().filter(is_active_morph);
                self.morphs.extend(pairs.map(|(t, w)| ActiveMorph { target: t as u32, weight: *w }));
                (first as u32, (self.morphs.len() - first) as u32)
            });
            instance.first_morph = first;
            // A primitive may have fewer targets than the mesh: the pairs are in target order.
            instance.morph_count = count.min(p.morph_count as u32);
        }
        instance
    }

    /// Number of a copy's indices ([`crate::scene_resources::watertight::WatertightOrder::indices`]) that belong to watertight
    /// surfaces. `one_handed`: the determinants of all joints have the same sign.
    fn watertight(&self, primitive: u32, key: &PipelineKey, one_handed: bool) -> u32 {
        let solid = key.topology == TopologyKey::Triangles
            && key.double_sided
            && !key.is_transparent()
            && !key.features.has(Features::ALPHA_MASK)
            && key.displaced == 0;
        match solid && one_handed && !self.options.force_all {
            true => self.resources.primitives[primitive as usize].watertight().count,
            false => 0,
        }
    }
}

/// The material's base color if clips animate it, else white.
fn animated_base_color(entry: &PrimitiveEntry, asset: &Asset, state: &ActorState) -> Vec4 {
    entry.animated_color.map_or(Vec4::ONE, |m| {
        let rest = asset.materials.get(m as usize).map_or(Vec4::ONE, |m| m.base_color);
        state.base_colors.get(m as usize).copied().unwrap_or(rest)
    })
}

/// relative-from-mesh; relative-from-model if the transform is applied after the skin.
pub(super) fn copy_transform(
    p: &PrimitiveContext,
    mesh: &MeshContext,
    place: Affine3A,
    copy: Affine3A,
) -> Affine3x4 {
    let relative_from_place = match p.needs.placed {
        true => mesh.relative_from_model * to_f64(place),
        false => mesh.relative_from_model,
    };
    let model_from_joint = mesh.state.model_from_joint.get(mesh.instance.joint as usize);
    let model_from_joint = to_f64(model_from_joint.copied().unwrap_or(Affine3A::IDENTITY));
    Affine3x4::from_affine(match mesh.instance.copies.is_empty() {
        _ if p.needs.skinned && (p.needs.dual || p.needs.placed) => relative_from_place,
        true => relative_from_place * model_from_joint,
        false => relative_from_place * model_from_joint * to_f64(copy),
    })
}

/// Center and half axes of a copy that is a filled rectangle or box.
fn filled_box(p: &PrimitiveContext, copy: &CopyContext, key: &PipelineKey) -> Option<[DVec3; 4]> {
    let rigid = p.skin.is_none() && p.morph_count == 0 && key.displaced == 0;
    if !(p.primitive.info.covers_bounding_box && rigid && !matches!(p.alpha_mode, AlphaMode::Mask(_))) {
        return None;
    }
    let Aabb { min, max } = p.primitive.info.bounds;
    let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
    let rows = copy.relative_from_mesh.0.map(|r| r.as_dvec4());
    let axis = |k: usize| DVec3::new(rows[0][k], rows[1][k], rows[2][k]) * f64::from(half[k]);
    let center = DVec3::from_array(rows.map(|r| r.dot(center.as_dvec3().extend(1.0))));
    Some([center, axis(0), axis(1), axis(2)])
}

fn grown(b: Aabb, by: f32) -> Aabb {
    Aabb { min: b.min - Vec3::splat(by), max: b.max + Vec3::splat(by) }
}
