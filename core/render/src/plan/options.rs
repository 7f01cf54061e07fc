//! Options of a plan.

use choreo_plugin::{Effect, FrameWish};
use choreo_stage::Snapshot;

/// Options of a frame's plan. [`PlanOptions::new`] gives the usual ones.
#[derive(Clone, Default)]
pub struct PlanOptions<'a> {
    /// Pixels.
    pub size: [u32; 2],
    /// Size in pixels of the image that this one previews: thick lines, and effect parameters with the unit "px", keep their
    /// share of that image's height. `None`: pixels are those of this image.
    pub preview_of: Option<[u32; 2]>,
    /// Samples per pixel: 1 or 4.
    pub samples: u32,
    /// The requested kind of pixels.
    pub wish: FrameWish,
    /// Available effects. An effect of the stage that is not among them is left out, and reported.
    pub effects: &'a [Effect],
    /// The stage one frame ago, two frames ago and so on, for overlays that draw its history
    /// ([`crate::plan::motion_blur::plan_alone`]).
    pub before: &'a [Snapshot],
    /// The stage one frame ago, for motion vectors, which are zero without it.
    pub moved_from: Option<&'a Snapshot>,
    /// Turns every shader feature on, needed or not: the pixels must stay the same (tests).
    pub force_all: bool,
    /// Draws instances outside the view, too.
    pub no_culling: bool,
    /// Makes a separate draw for each instance.
    pub no_instancing: bool,
    /// Draws all triangles, without levels of detail.
    pub full_detail: bool,
    /// Draws all sub-frames of a shutter, however little moves.
    pub all_sub_frames: bool,
    /// Evaluates every light at every pixel, however many there are.
    pub no_light_clusters: bool,
}

impl PlanOptions<'_> {
    pub fn new(size: [u32; 2], samples: u32) -> Self {
        PlanOptions { size, samples, ..PlanOptions::default() }
    }

    /// Pixels of this image per pixel of the image that it previews.
    pub(crate) fn pixel_scale(&self) -> f32 {
        self.preview_of.map_or(1.0, |of| self.size[1] as f32 / of[1].max(1) as f32)
    }

    /// Numeric parameters of an effect, with those in pixels scaled to this image.
    pub(crate) fn effect_parameters(&self, effect: &Effect, given: &[(String, f64)]) -> Vec<f32> {
        let mut parameters = effect.manifest().parameters(given);
        effect.manifest().scale_pixels(&mut parameters, f64::from(self.pixel_scale()));
        parameters
    }
}
