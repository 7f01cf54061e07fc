//! Costs of the passes of a frame, and of pipelines that belong to one pass.

use crate::commands::{Command, PassPart, Recording};
use crate::explain::{CostKind, Costs, RequestedBy, plural, target_name};
use crate::plan::DeferredCause;
use crate::shader::{DeferredPass, SceneVariant, switches};

impl Costs<'_> {
    pub(super) fn add_passes(&mut self, recording: &Recording) {
        if !recording.preskinned.is_empty() {
            self.add_preskinning(recording);
        }
        for command in &recording.commands {
            match command {
                Command::BeginPass { .. } => self.add_scene_pass(command),
                Command::BeginGBuffer => self.add_gbuffer_pass(),
                Command::BeginInputs { motion } => self.add_input_pass(*motion),
                Command::BindPipeline(v) if v.deferred == DeferredPass::Light => self.add_lighting_pass(v),
                Command::BeginPeel { layer, .. } => {
                    let what = format!("depth of transparent layer {}", layer + 1);
                    self.add(CostKind::Pass, what, None, self.depth_peeling_cause());
                }
                Command::BeginLayer { layer, nearer, .. } => {
                    let what = match nearer {
                        true => "transparent surfaces nearer than all layers, sorted".to_string(),
                        false => format!("color of transparent layer {}", layer + 1),
                    };
                    self.add(CostKind::Pass, what, None, self.depth_peeling_cause());
                }
                Command::BeginShadows { size: [w, h], .. } => {
                    let maps = self.plan.shadow_maps.as_ref().map_or(0, |s| s.views.len());
                    let what = format!("{}, {w}×{h} texels", plural(maps, "shadow map"));
                    self.add(CostKind::Pass, what, None, self.requested_by_actors(self.plan.shadow_draws()));
                }
                Command::DrawOverlay { effect, count, .. } => {
                    let what = format!(
                        "overlay in the scene: {} of {effect}",
                        plural(*count as usize / 3, "triangle")
                    );
                    self.add(CostKind::Pass, what, None, RequestedBy::effect(effect));
                }
                Command::PostPass { .. } => self.add_effect_pass(command),
                Command::CopySceneColor { from, levels } => {
                    let levels = plural(*levels as usize, "level");
                    let what = format!("copy of the {} for refraction, {levels}", target_name(*from));
                    self.add(CostKind::Pass, what, None, self.requested_by(self.refracting_draws()));
                }
                Command::CopyBackground => {
                    let background = RequestedBy::named("the stage's background");
                    self.add(CostKind::Pass, "copy of the background".into(), None, background);
                }
                Command::DrawLayersBehind => {
                    self.add_background_pipeline("2D layers", "text, images and panels")
                }
                Command::DrawSky { .. } => self.add_background_pipeline("sky", "the stage's sky"),
                Command::DrawBackground { .. } => {
                    self.add_background_pipeline("gradient", "the stage's background")
                }
                _ => {}
            }
        }
    }

    fn add_effect_pass(&mut self, command: &Command) {
        let Command::PostPass { index, effect, from, to, size: [w, h], .. } = command else { return };
        let post = &self.plan.post;
        let Some(pass) = post.get(*index) else { return };
        let texture_name = |number: &u32| {
            let mut before = post[..*index].iter().rev();
            before.find(|pass| pass.number == *number).and_then(|pass| pass.texture.as_deref())
        };
        let textures: String =
            pass.reads.iter().filter_map(texture_name).map(|name| format!(", {name}")).collect();
        let from = target_name(*from);
        let what = match &pass.texture {
            Some(texture) => {
                format!("effect {effect}, pass {texture}: {from}{textures} → texture {texture}, {w}×{h}")
            }
            None => format!("effect {effect}: {from}{textures} → {}, {w}×{h}", target_name(*to)),
        };
        self.add(CostKind::Pass, what, None, RequestedBy::effect(effect));
    }

    fn add_background_pipeline(&mut self, content: &str, requested_by: &'static str) {
        let what = format!("pipeline of the {content} behind the scene");
        self.add(CostKind::Pipeline, what, None, RequestedBy::named(requested_by));
    }

    fn add_scene_pass(&mut self, command: &Command) {
        let Command::BeginPass { target, samples, depth, part, area, .. } = command else { return };
        let depth = if *depth { ", depth" } else { "" };
        let samples = plural(*samples as usize, "sample");
        let part = match part {
            PassPart::Whole | PassPart::UntilCopy | PassPart::UntilLayers => "",
            PassPart::AfterLayers => ", continued after the transparent layers",
            PassPart::AfterCopy => ", continued after the copy for refraction",
        };
        let area = area.map_or(String::new(), |[_, _, w, h]| format!(", only {w}×{h} pixels of it"));
        let what = format!("scene → {}, {samples} per pixel{depth}{part}{area}", target_name(*target));
        let requested_by = match self.plan.draws.is_empty() {
            true => RequestedBy::named("the stage's background: nothing else is in view"),
            false => self.requested_by_actors(self.plan.draws.iter()),
        };
        self.add(CostKind::Pass, what, None, requested_by);
    }

    pub(crate) fn deferred_shading_cause(&self) -> RequestedBy {
        let other = Some(match self.plan.deferred.as_ref().map(|d| d.cause) {
            Some(DeferredCause::Pays { .. }) => "many lights on overlapping surfaces",
            _ => "the stage's pipeline \"deferred\"",
        });
        RequestedBy { other, ..self.requested_by_actors(self.plan.draws.iter().filter(|d| d.deferred)) }
    }

    fn add_gbuffer_pass(&mut self) {
        let deferred = self.plan.draws.iter().filter(|d| d.deferred).count();
        let forward = self.plan.draws.len() - deferred;
        let mut what = format!(
            "G-buffer and depth: {}, {}",
            plural(deferred, "deferred draw"),
            plural(forward, "forward draw")
        );
        let cause = self.plan.deferred.as_ref().map(|d| d.cause);
        if let Some(DeferredCause::Pays { lights, surfaces, wasted }) = cause {
            what += &format!(
                "; with about {lights:.1} lights per surface and {surfaces:.1} overlapping surfaces, it saves {wasted:.1} light evaluations per pixel"
            );
        }
        self.add(CostKind::Pass, what, None, self.deferred_shading_cause());
    }

    fn add_input_pass(&mut self, motion: bool) {
        let Some(pass) = &self.plan.scene_inputs else { return };
        let what = if motion { "depth, normals, motion vectors and actors" } else { "depth and normals" };
        let readers = if pass.effects.is_empty() { "passes" } else { "effects" };
        let what = format!("{what} for {readers}: {}, 1 sample per pixel", plural(pass.draws.len(), "draw"));
        self.add(CostKind::Pass, what, None, self.input_readers());
    }

    fn add_lighting_pass(&mut self, variant: &SceneVariant) {
        let lights = plural(self.plan.lights.len(), "light");
        let what = format!("lighting of the G-buffer, {lights}: {}", switches(variant).join(" "));
        self.add(CostKind::Pipeline, what, None, self.deferred_shading_cause());
    }
}
