//! Costs of float frames: their passes, and their images on the host.

use crate::explain::{CostKind, Costs, RequestedBy, plural};
use crate::plan::passes::sample_places;
use choreo_plugin::{FrameWish, IdMatte, Passes};

impl Costs<'_> {
    /// Adds the costs of the passes that `--passes` requests, which are not among the commands of the plan.
    pub(super) fn add_float_frame(&mut self) {
        let FrameWish::Scene(passes) = self.plan.wish else { return };
        let [width, height] = self.plan.size;
        let pixels = u64::from(width) * u64::from(height);
        if passes.albedo {
            let plan = self.plan.albedo();
            let draws = plural(plan.draws.len(), "draw");
            let samples = plural(plan.samples as usize, "sample");
            let what = format!("base colors without light: {draws}, {samples} per pixel");
            self.add(CostKind::Pass, what, None, RequestedBy::named("the pass albedo"));
        }
        let samples = sample_places(passes.samples_of_ids(self.plan.samples)).len();
        if passes.id {
            let draws = self.plan.scene_inputs.as_ref().map_or(0, |pass| pass.draws.len());
            let what = format!(
                "actors and materials: {}, {}, 1 sample per pixel each",
                plural(draws, "draw"),
                plural(samples, "time")
            );
            self.add(CostKind::Pass, what, None, RequestedBy::named("the pass id"));
        }
        let ids = 2 * 8 * samples.min(IdMatte::MOST_RANKS) as u64;
        let Passes { color, depth, normal, motion, albedo, id, .. } = passes;
        let images = [
            (color, "color, 32-bit floats", 16, "the pass color"),
            (depth, "depth, 32-bit floats", 4, "the pass depth"),
            (normal, "normals, 32-bit floats", 12, "the pass normal"),
            (motion, "motion vectors, 32-bit floats", 8, "the pass motion"),
            (albedo, "base colors, 32-bit floats", 16, "the pass albedo"),
            (id, "ids and their shares", ids, "the pass id"),
        ];
        for (_, name, bytes, by) in images.into_iter().filter(|(on, ..)| *on) {
            let what = format!("on the host {width}×{height}: {name}");
            self.add(CostKind::Target, what, Some(bytes * pixels), RequestedBy::named(by));
        }
    }

    /// The effects and the passes of the frame that read depth, normals and motion.
    pub(crate) fn input_readers(&self) -> RequestedBy {
        let effects = self.plan.scene_inputs.iter().flat_map(|pass| pass.effects.iter().cloned()).collect();
        let other = match self.plan.wish {
            FrameWish::Scene(passes) if passes.reads_inputs() => Some("the passes of the frame"),
            _ => None,
        };
        RequestedBy { effects, other, ..RequestedBy::default() }
    }
}
