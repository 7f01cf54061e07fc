//! Effects in a plan: passes over the picture, functions on surfaces, geometry of their own.

use crate::plan::build::Planner;
use crate::plan::options::PlanOptions;
use crate::plan::{Features, LeftOut, PostPass};
use crate::scene_resources::{CatalogMaterial, PrimitiveEntry};
use choreo_asset::{Outline, Primitive, Shading};
use choreo_plugin::{Effect, Exposure, Hook, OptionKind, SurfaceNeeds};
use choreo_stage::{EffectState, EffectTarget, EffectUse, Snapshot, Stage};
use glam::Vec3;
use std::sync::Arc;

impl Planner<'_> {
    /// Which effects an actor's surfaces of a material of its asset have, and what they need together.
    pub fn effects_of(&self, actor: usize, material: Option<u32>) -> OnSurface {
        let mut all = OnSurface::default();
        for (i, effect) in self.surface.iter().enumerate() {
            if !EffectTarget::among(&effect.on, actor, material) {
                continue;
            }
            let needs = &effect.needs;
            match effect.hook {
                Hook::Vertex => {
                    all.displaced |= 1 << i;
                    all.reach += effect.reach;
                    all.corners.normals |= needs.normals;
                    all.corners.uvs |= needs.uvs;
                }
                Hook::Lighting => all.lighting |= 1 << i,
                _ => all.surface |= 1 << i,
            }
            all.needs.normals |= needs.normals;
            all.needs.uvs |= needs.uvs;
            all.needs.joints |= needs.joints;
            all.needs.shadow |= needs.shadow;
            all.needs.see_through |= needs.see_through;
        }
        all
    }

    /// How far outlines reach beyond a primitive of an actor: metres, and a share of the picture's height.
    pub fn reach(&self, entry: &PrimitiveEntry, changed: Option<u32>, actor: usize) -> (f32, f32) {
        let material = match changed {
            Some(c) => &*self.materials[c as usize],
            None => &self.catalog.materials[entry.material as usize],
        };
        let own = has_outline(material).then(|| material.material.toon.as_ref()?.outline.as_ref()).flatten();
        let mine = self.shells.iter().filter(|(_, on)| EffectTarget::among(on, actor, entry.of_asset));
        let lines = mine.filter_map(|(line, _)| match line {
            Line::Hull(outline) => Some(outline),
            Line::Edges(_) => None,
        });
        own.into_iter().chain(lines).fold((0.0, 0.0), |(metres, share), outline| match outline.on_screen {
            true => (metres, outline.width.max(share)),
            false => (outline.width.max(metres), share),
        })
    }

    /// The materials of the hulls around a primitive of an actor, or of its edges (true): its own outline's, then those of effects.
    pub fn hulls(
        &mut self,
        entry: &PrimitiveEntry,
        changed: Option<u32>,
        actor: usize,
    ) -> Vec<(bool, Option<u32>)> {
        let base = match changed {
            Some(c) => self.materials[c as usize].clone(),
            None if self.shells.is_empty() => {
                let own = has_outline(&self.catalog.materials[entry.material as usize]);
                return Vec::from_iter(own.then_some((false, None)));
            }
            None => Arc::new(self.catalog.materials[entry.material as usize].clone()),
        };
        let mut out = Vec::from_iter(has_outline(&base).then_some((false, changed)));
        for (i, (line, on)) in self.shells.iter().enumerate() {
            if !EffectTarget::among(on, actor, entry.of_asset) {
                continue;
            }
            let key = (i, entry.material, changed);
            let known = self.shell_materials.iter().find(|(k, _)| *k == key).map(|(_, place)| *place);
            let edges = matches!(line, Line::Edges(_));
            let place = Some(known.unwrap_or_else(|| {
                let mut material = CatalogMaterial::clone(&base);
                let toon = material.material.toon.get_or_insert_default();
                Arc::make_mut(toon).outline = Some(line.outline());
                material.toon[0] = None;
                let place = self.materials.len() as u32;
                self.materials.push(Arc::new(material));
                self.shell_materials.push((key, place));
                place
            }));
            out.push((edges, place));
        }
        out
    }
}

/// What a script gives an effect, in manifest order and cut off at its ranges; defaults where it gives nothing.
pub fn effect_parameters(effect: &dyn Effect, given: &[(String, f64)]) -> [f32; 8] {
    let mut parameters = [0.0; 8];
    for (slot, option) in parameters.iter_mut().zip(&effect.manifest().options) {
        let value = given.iter().rev().find(|(name, _)| *name == option.name).map(|(_, value)| *value);
        *slot = match (value, &option.kind) {
            // A spline between keys may leave the range.
            (Some(value), OptionKind::Number { min, max, .. }) => value.clamp(*min, *max) as f32,
            (Some(value), _) => value as f32,
            (None, OptionKind::Number { default, .. }) => *default as f32,
            (None, OptionKind::Bool { default }) => f32::from(u8::from(*default)),
            // Texts are handed over as their place in the list.
            (None, OptionKind::Text { default, one_of }) => {
                one_of.iter().position(|o| o == default).unwrap_or(0) as f32
            }
        };
    }
    parameters
}

fn has_outline(m: &CatalogMaterial) -> bool {
    m.material.shading == Shading::Toon && m.material.toon.as_ref().is_some_and(|t| t.outline.is_some())
}

/// What an effect draws around or on surfaces.
#[derive(Clone, Debug)]
pub enum Line {
    Hull(Outline),
    /// Linear colour.
    Edges(Vec3),
}

impl Line {
    /// Edges keep their colour where a hull's stands.
    fn outline(&self) -> Outline {
        match self {
            Line::Hull(outline) => outline.clone(),
            Line::Edges(color) => Outline {
                width: 0.0,
                on_screen: false,
                width_texture: None,
                color: *color,
                lighting_mix: 0.0,
            },
        }
    }
}

/// The last exposure that is on.
pub fn exposure_of(stage: &Stage, snapshot: &Snapshot, effects: &[Arc<dyn Effect>]) -> Option<Exposure> {
    let exposures = uses(stage, snapshot).filter_map(|(used, state)| {
        let effect = effects.iter().find(|e| e.manifest().name == used.plugin)?;
        let effect = Some(effect).filter(|e| e.hook() == Hook::Exposure)?;
        effect.exposure(&effect_parameters(effect.as_ref(), &state.parameters))
    });
    exposures.last().filter(|e| e.samples > 1 && e.open > 0.0)
}

/// How many frames back the effects of a hook that are on look.
pub fn history_of(stage: &Stage, snapshot: &Snapshot, effects: &[Arc<dyn Effect>], hook: Hook) -> u32 {
    let frames = uses(stage, snapshot).filter_map(|(used, state)| {
        let effect = effects.iter().find(|e| e.manifest().name == used.plugin)?;
        let effect = Some(effect).filter(|e| e.hook() == hook)?;
        Some(effect.history(&effect_parameters(effect.as_ref(), &state.parameters)))
    });
    frames.max().unwrap_or(0)
}

/// Those that are on.
pub fn uses<'a>(
    stage: &'a Stage,
    snapshot: &'a Snapshot,
) -> impl Iterator<Item = (&'a EffectUse, &'a EffectState)> {
    snapshot.effects.iter().filter_map(|state| Some((stage.effects.get(state.effect)?, state)))
}

/// Those of the effects that are on, with what has them.
pub fn shells(stage: &Stage, snapshot: &Snapshot, options: &PlanOptions) -> Vec<(Line, Vec<EffectTarget>)> {
    let mut out = Vec::new();
    for (used, state) in uses(stage, snapshot) {
        let effect = options.effects.iter().find(|e| e.manifest().name == used.plugin);
        let Some(effect) = effect.filter(|e| e.hook() == Hook::Shell) else { continue };
        let parameters = effect_parameters(effect.as_ref(), &state.parameters);
        if let Some(shell) = effect.shell(&parameters).filter(|s| s.width > 0.0) {
            let outline = Outline {
                width: shell.width / options.size[1].max(1) as f32,
                on_screen: true,
                width_texture: None,
                color: shell.color,
                lighting_mix: shell.lighting_mix,
            };
            out.push((Line::Hull(outline), used.on.clone()));
        }
        out.extend(effect.edges(&parameters).map(|color| (Line::Edges(color), used.on.clone())));
    }
    out
}

/// As many as there are bits for; further ones are said in `left_out`.
pub const MOST_SURFACE_EFFECTS: usize = 8;

/// An effect that is part of the scene's shaders, with what has it (empty: all).
pub struct SceneUse {
    pub used: PostPass,
    pub hook: Hook,
    pub needs: SurfaceNeeds,
    /// How far it moves anything at most, metres.
    pub reach: f32,
    pub on: Vec<EffectTarget>,
}

/// The effects of one surface, a bit each, and what they need together.
#[derive(Default)]
pub struct OnSurface {
    pub surface: u8,
    pub displaced: u8,
    pub lighting: u8,
    pub needs: SurfaceNeeds,
    /// What those that move it need, seen from a light too.
    pub corners: SurfaceNeeds,
    /// How far it is moved at most, metres.
    pub reach: f32,
}

impl OnSurface {
    /// What a shader that moves the corners of a shape reads of them, seen from a light too.
    pub fn of_corners(&self, shape: &Primitive) -> Features {
        let has = |on: bool, there: bool, bit| if on && there { bit } else { Features::default() };
        has(self.corners.normals, !shape.normals.is_empty(), Features::SEEN_NORMALS).with(has(
            self.corners.uvs,
            !shape.uvs[0].is_empty(),
            Features::UV0,
        ))
    }
}

pub fn surface_effects(stage: &Stage, snapshot: &Snapshot, options: &PlanOptions) -> Vec<SceneUse> {
    let on_surface = |(used, state): (&EffectUse, &EffectState)| {
        let effect = options.effects.iter().find(|e| e.manifest().name == used.plugin)?;
        effect.hook().is_in_scene().then(|| {
            let parameters = effect_parameters(effect.as_ref(), &state.parameters);
            let reach = effect.reach(&parameters);
            SceneUse {
                used: PostPass { effect: used.plugin.clone(), parameters, number: 0, shrink: 1 },
                hook: effect.hook(),
                needs: effect.surface_needs(&parameters),
                reach: if reach.is_finite() { reach.max(0.0) } else { 0.0 },
                on: used.on.clone(),
            }
        })
    };
    uses(stage, snapshot).filter_map(on_surface).take(MOST_SURFACE_EFFECTS).collect()
}

/// Those of the effects on surfaces that are on everything and change the background, a bit each.
pub fn background_effects(surface: &[SceneUse], options: &PlanOptions) -> u8 {
    let changes = |SceneUse { used, hook, on, .. }: &SceneUse| {
        let effect = options.effects.iter().find(|e| e.manifest().name == used.effect);
        *hook == Hook::Surface && on.is_empty() && effect.is_some_and(|e| e.of_background(&used.parameters))
    };
    surface.iter().enumerate().map(|(i, used)| u8::from(changes(used)) << i).sum()
}

/// Effects that are on, with parameters in manifest order; defaults where the script gives none.
pub fn post_passes(
    stage: &Stage,
    snapshot: &Snapshot,
    effects: &[Arc<dyn Effect>],
    size: [u32; 2],
) -> (Vec<PostPass>, Vec<LeftOut>) {
    let mut passes = Vec::new();
    let mut unknown = Vec::new();
    let mut surfaces = 0;
    for (used, state) in uses(stage, snapshot) {
        let Some(effect) = effects.iter().find(|e| e.manifest().name == used.plugin) else {
            let why = "no plugin of this name is known".into();
            unknown.push(LeftOut { what: format!("effect \"{}\"", used.plugin), why });
            continue;
        };
        surfaces += usize::from(effect.hook().is_in_scene());
        if effect.hook().is_in_scene() && surfaces > MOST_SURFACE_EFFECTS {
            let why = format!("at most {MOST_SURFACE_EFFECTS} effects on surfaces are on at once");
            unknown.push(LeftOut { what: format!("effect \"{}\"", used.plugin), why });
        }
        if !matches!(effect.hook(), Hook::Pixel | Hook::Picture) {
            continue;
        }
        let parameters = effect_parameters(effect.as_ref(), &state.parameters);
        let times = if effect.hook() == Hook::Picture { effect.passes() } else { 1 };
        passes.extend((0..times).map(|number| {
            let smaller = effect.hook() == Hook::Picture && number + 1 < times;
            let shrink = if smaller { effect.shrink(number, size, &parameters).max(1) } else { 1 };
            PostPass { effect: used.plugin.clone(), parameters, number, shrink }
        }));
    }
    (passes, unknown)
}
