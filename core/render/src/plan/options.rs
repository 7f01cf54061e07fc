//! What a frame is planned for.

use choreo_plugin::Effect;
use choreo_stage::Snapshot;
use std::sync::Arc;

/// What a frame is planned for. [`PlanOptions::new`] gives the usual choices.
#[derive(Clone)]
pub struct PlanOptions<'a> {
    /// Pixels.
    pub size: [u32; 2],
    /// 1 or 4.
    pub samples: u32,
    /// Effects known by name; one of the stage that is not among them is left out, and said.
    pub effects: &'a [Arc<dyn Effect>],
    /// The stage a frame ago, two frames ago and so on, for lines that effects draw of it ([`crate::plan::motion_blur::plan_alone`]).
    pub before: &'a [Snapshot],
    /// Every feature in, needed or not: the pixels must stay the same (tests).
    pub force_all: bool,
    /// Copies outside the view are drawn too.
    pub no_culling: bool,
    /// One draw a copy.
    pub no_instancing: bool,
    /// Copies of crowds are drawn as finely as their files say, however small they are.
    pub full_detail: bool,
    /// Every light at every pixel, however many there are.
    pub no_light_lists: bool,
}

impl PlanOptions<'_> {
    pub fn new(size: [u32; 2], samples: u32) -> Self {
        PlanOptions {
            size,
            samples,
            effects: &[],
            before: &[],
            force_all: false,
            no_culling: false,
            no_instancing: false,
            full_detail: false,
            no_light_lists: false,
        }
    }
}
