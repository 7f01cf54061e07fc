//! Effects in a plan: full-screen passes, and functions in the scene's shaders.

use crate::effect_faults::{FaultPlace, PlanFault};
use crate::plan::build::Planner;
use crate::plan::build::scene_inputs::frame_times;
use crate::plan::options::PlanOptions;
use crate::plan::{Features, LeftOut, PostPass};
use choreo_asset::Primitive;
use choreo_plugin::{Effect, EffectFrame, Hook, ImagePass, Shutter, SurfaceInputs};
use choreo_stage::{EffectState, EffectTarget, EffectUse, Snapshot, Stage};

/// Largest number of effects in the scene's shaders: one for each bit. Further ones are reported in `left_out`.
const MOST_SURFACE_EFFECTS: usize = 8;

/// An effect in the scene's shaders, with its targets in `on` (empty: everything).
pub(super) struct SceneEffect {
    pub used: PostPass,
    hook: Hook,
    needs: SurfaceInputs,
    /// Largest displacement in metres.
    pub reach: f32,
    on: Vec<EffectTarget>,
}

/// The effects of one surface, one bit each, and the union of their inputs.
#[derive(Default)]
pub(super) struct SurfaceEffects {
    pub surface: u8,
    pub displaced: u8,
    pub lighting: u8,
    pub needs: SurfaceInputs,
    /// Inputs of displacements, which shadow maps need, too.
    displacement_needs: SurfaceInputs,
    /// Largest displacement in metres.
    pub reach: f32,
}

impl SurfaceEffects {
    /// Features of a shader that displaces the vertices of a shape, in shadow maps too.
    pub(super) fn of_vertices(&self, shape: &Primitive) -> Features {
        let read = &self.displacement_needs;
        let normals = Features::EFFECT_NORMALS.when(read.normals && !shape.normals.is_empty());
        normals.with(Features::UV0.when(read.uvs && !shape.uvs[0].is_empty()))
    }
}

impl Planner<'_> {
    /// Effects on the surfaces of an actor with a material of its asset.
    pub(crate) fn effects_of(&self, actor: usize, material: Option<u32>) -> SurfaceEffects {
        let mut all = SurfaceEffects::default();
        for (i, effect) in self.scene_effects.iter().enumerate() {
            if !EffectTarget::targets_include(&effect.on, actor, material) {
                continue;
            }
            let needs = &effect.needs;
            match effect.hook {
                Hook::Vertex => {
                    all.displaced |= 1 << i;
                    all.reach += effect.reach;
                    all.displacement_needs.normals |= needs.normals;
                    all.displacement_needs.uvs |= needs.uvs;
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

    /// Whether a key's effects on the surface read neither textures nor joints.
    pub(crate) fn effects_read_position_only(&self, surface: u8) -> bool {
        let on = self.scene_effects.iter().enumerate().filter(|(bit, _)| surface >> bit & 1 == 1);
        on.map(|(_, effect)| &effect.needs).all(|needs| !needs.uvs && !needs.joints)
    }
}

/// Numeric parameters of an effect, clamped to their ranges; defaults where the script gives none. Does not include the frame's
/// numbers.
pub fn effect_parameters(effect: &Effect, given: &[(String, f64)]) -> Vec<f32> {
    effect.manifest().parameters(given)
}

/// The effect plugin that draws an effect of the stage.
fn effect_of<'a>(used: &EffectUse, effects: &'a [Effect]) -> Option<&'a Effect> {
    let name = used.effect_name();
    effects.iter().find(|e| e.manifest().name == name)
}

/// Active effects whose plugin is known and which change something.
pub(crate) fn active_uses<'a>(
    stage: &'a Stage,
    snapshot: &'a Snapshot,
    effects: &'a [Effect],
) -> impl Iterator<Item = (&'a Effect, &'a EffectUse, &'a EffectState)> {
    snapshot.effects.iter().filter_map(|state| {
        let used = stage.effects.get(state.effect)?;
        let effect = effect_of(used, effects)?;
        let why = effect.off(&effect_parameters(effect, &state.parameters));
        why.is_none().then_some((effect, used, state))
    })
}

/// The shutter of the last active effect that sets one.
pub(crate) fn shutter_of(stage: &Stage, snapshot: &Snapshot, effects: &[Effect]) -> Option<Shutter> {
    let last = shutters(stage, snapshot, effects).last().map(|(_, shutter)| shutter);
    last.filter(|s| s.samples > 1 && s.open > 0.0 && s.open.is_finite() && s.before.is_finite())
}

/// The shutters of the active effects that set one.
fn shutters<'a>(
    stage: &'a Stage,
    snapshot: &'a Snapshot,
    effects: &'a [Effect],
) -> impl Iterator<Item = (&'a Effect, Shutter)> {
    active_uses(stage, snapshot, effects).filter_map(|(effect, _, state)| match effect {
        Effect::Shutter(shutter) => {
            Some((effect, shutter.shutter(&effect_parameters(effect, &state.parameters))?))
        }
        _ => None,
    })
}

/// Faults in the shutters that active effects set.
pub(super) fn shutter_faults<'a>(
    stage: &'a Stage,
    snapshot: &'a Snapshot,
    effects: &'a [Effect],
) -> impl Iterator<Item = PlanFault> {
    shutters(stage, snapshot, effects).filter_map(|(effect, shutter)| {
        PlanFault::of(effect, &[shutter.open as f32, shutter.before as f32], FaultPlace::Shutter)
    })
}

/// Number of earlier frames that the active effects of a hook read.
pub(crate) fn history_of(stage: &Stage, snapshot: &Snapshot, effects: &[Effect], hook: Hook) -> u32 {
    let of_hook = active_uses(stage, snapshot, effects).filter(|(effect, ..)| effect.hook() == hook);
    let frames =
        of_hook.map(|(effect, _, state)| effect.history(&effect_parameters(effect, &state.parameters)));
    frames.max().unwrap_or(0)
}

/// Appends the numbers of the frame to the parameters of an effect that reads them.
pub(super) fn add_frame_numbers(pass: &mut PostPass, frame: &EffectFrame, options: &PlanOptions) {
    let effect = options.effects.iter().find(|e| e.manifest().name == pass.effect);
    if effect.is_some_and(Effect::reads_frame) {
        pass.parameters.extend(frame.numbers(options.size));
    }
}

pub(super) fn scene_effects(stage: &Stage, snapshot: &Snapshot, options: &PlanOptions) -> Vec<SceneEffect> {
    let in_scene =
        active_uses(stage, snapshot, options.effects).filter(|(effect, ..)| effect.hook().is_in_scene());
    let frame = frame_times(stage, snapshot);
    let scene_effect = |(effect, used, state): (&Effect, &EffectUse, &EffectState)| {
        let parameters = options.effect_parameters(effect, &state.parameters);
        let reach = effect.reach(&parameters);
        SceneEffect {
            hook: effect.hook(),
            needs: effect.surface_inputs(&parameters),
            used: {
                let mut used = PostPass::only(used.effect_name().into_owned(), parameters);
                add_frame_numbers(&mut used, &frame, options);
                used
            },
            reach: if reach.is_finite() { reach.max(0.0) } else { 0.0 },
            on: used.on.clone(),
        }
    };
    in_scene.map(scene_effect).take(MOST_SURFACE_EFFECTS).collect()
}

/// Bits of the surface effects on everything that change the background, too.
pub(super) fn background_effects(effects: &[SceneEffect], options: &PlanOptions) -> u8 {
    let changes = |SceneEffect { used, hook, on, .. }: &SceneEffect| {
        let effect = options.effects.iter().find(|e| e.manifest().name == used.effect);
        *hook == Hook::Surface
            && on.is_empty()
            && effect.is_some_and(|e| e.changes_background(&used.parameters))
    };
    effects.iter().enumerate().map(|(i, used)| u8::from(changes(used)) << i).sum()
}

/// Full-screen passes of the active effects, and effects that are left out.
pub(super) fn post_passes(
    stage: &Stage,
    snapshot: &Snapshot,
    options: &PlanOptions,
) -> (Vec<PostPass>, Vec<LeftOut>) {
    let (mut passes, mut left_out, mut in_scene) = (Vec::new(), Vec::new(), 0);
    for state in &snapshot.effects {
        let Some(used) = stage.effects.get(state.effect) else { continue };
        let mut leave_out =
            |why: String| left_out.push(LeftOut { part: format!("effect \"{}\"", used.plugin), why });
        let Some(effect) = effect_of(used, options.effects) else {
            leave_out("no plugin of this name is known".into());
            continue;
        };
        let parameters = options.effect_parameters(effect, &state.parameters);
        if let Some(why) = effect.off(&parameters) {
            leave_out(why);
            continue;
        }
        in_scene += usize::from(effect.hook().is_in_scene());
        if effect.hook().is_in_scene() && in_scene > MOST_SURFACE_EFFECTS {
            leave_out(format!("at most {MOST_SURFACE_EFFECTS} effects on surfaces are on at once"));
        }
        if !matches!(effect.hook(), Hook::Pixel | Hook::Image) {
            continue;
        }
        let times = effect.passes();
        let named = effect.named_passes();
        let runs = running_passes(named);
        passes.extend((0..times).filter(|number| runs.get(*number as usize) != Some(&false)).map(|number| {
            let smaller = number + 1 < times;
            let shrink = if smaller { effect.shrink(number, options.size, &parameters).max(1) } else { 1 };
            let pass = named.get(number as usize);
            PostPass {
                number,
                shrink,
                texture: pass.filter(|_| smaller).map(|pass| pass.name.clone()),
                reads: pass.map_or_else(Vec::new, |pass| reads_of(pass, number).collect()),
                ..PostPass::only(used.effect_name().into_owned(), parameters.clone())
            }
        }));
        for (pass, _) in named.iter().zip(&runs).filter(|(_, runs)| !**runs) {
            let part = format!("pass {} of the effect \"{}\"", pass.name, used.plugin);
            left_out.push(LeftOut { part, why: "nothing reads its texture".into() });
        }
    }
    (passes, left_out)
}

/// The textures that a pass reads: those of passes before it.
fn reads_of(pass: &ImagePass, number: u32) -> impl Iterator<Item = u32> + '_ {
    pass.reads.iter().copied().filter(move |read| *read < number).take(ImagePass::MOST_READ)
}

/// Which passes run: the last one, and those whose textures are read by a pass that runs.
fn running_passes(passes: &[ImagePass]) -> Vec<bool> {
    let mut runs = vec![false; passes.len()];
    if let Some(last) = runs.last_mut() {
        *last = true;
    }
    for (number, pass) in passes.iter().enumerate().rev() {
        if runs[number] {
            reads_of(pass, number as u32).for_each(|read| runs[read as usize] = true);
        }
    }
    runs
}
