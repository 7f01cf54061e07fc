//! Plans of the passes of a float frame: base colors without light, and effect inputs sampled at given positions within each
//! pixel.

use crate::plan::dirty_rect::DirtyRect;
use crate::plan::{Features, Glass, PipelineKey, Plan, PlanOverlay};
use choreo_plugin::FrameWish;
use choreo_stage::Background;
use glam::{DMat4, DVec4, Mat4, Vec3, Vec4};

/// Sample positions in a pixel, in sixteenths of its side from the top left: Vulkan's standard positions (1.3, "Multisampling").
const ONE_SAMPLE: [[u8; 2]; 1] = [[8, 8]];
const FOUR_SAMPLES: [[u8; 2]; 4] = [[6, 2], [14, 6], [2, 10], [10, 14]];
const SIXTEEN_SAMPLES: [[u8; 2]; 16] = [
    [9, 9],
    [7, 5],
    [5, 10],
    [12, 7],
    [3, 6],
    [10, 13],
    [13, 11],
    [11, 3],
    [6, 14],
    [8, 1],
    [4, 2],
    [2, 12],
    [0, 8],
    [15, 4],
    [14, 15],
    [1, 0],
];

/// The positions of 1, 4 or 16 samples.
pub(crate) fn sample_places(samples: u32) -> &'static [[u8; 2]] {
    match samples {
        1 => &ONE_SAMPLE,
        16 => &SIXTEEN_SAMPLES,
        _ => &FOUR_SAMPLES,
    }
}

impl Plan {
    /// The plan that is drawn first: if no color is requested, the plan of the inputs or of base colors.
    pub fn first_drawn(self) -> Plan {
        match self.wish {
            FrameWish::Scene(passes) if !passes.color => self.of_inputs().unwrap_or_else(|| self.albedo()),
            FrameWish::Scene(_) => Plan { linear: true, ..self },
            _ => self,
        }
    }

    /// The plan of base colors: the surfaces of the frame without light, exposure and color effects, over a transparent
    /// background.
    pub(crate) fn albedo(&self) -> Plan {
        let mut plan = Plan {
            background: Background::Color(Vec4::ZERO),
            ambient_up: Vec3::ZERO,
            ambient_down: Vec3::ZERO,
            display: Features::default(),
            lights: Vec::new(),
            light_clusters: None,
            sky: None,
            layers_behind: None,
            shadow_maps: None,
            scene_color_copy: None,
            deferred: None,
            background_effects: 0,
            dirty_rect: DirtyRect::EVERYTHING,
            overlay: PlanOverlay::default(),
            ..self.scene_alone()
        };
        let lines = Features::OUTLINE.with(Features::WIREFRAME);
        // Thin glass is drawn twice, once with `Glass::Filter`; base colors need one draw.
        plan.draws
            .retain(|draw| draw.pipeline.glass != Glass::Filter && !draw.pipeline.features.has_any(lines));
        for draw in &mut plan.draws {
            let key = draw.pipeline;
            let of_lines = Features::THICK_LINES.with(Features::ROUND_LINES);
            let mut features = key.features.of_alpha(true).with(key.features.only(of_lines));
            if key.displaced != 0 {
                features = features.with(key.features.only(Features::EFFECT_NORMALS));
            }
            draw.pipeline = PipelineKey { features, glass: Glass::No, surface: 0, lighting: 0, ..key };
            draw.deferred = false;
        }
        plan
    }

    /// The plan that only draws the inputs of effects, sampled at a position in each pixel other than its center. `place`: in
    /// sixteenths.
    pub(crate) fn of_inputs_at(&self, place: [u8; 2]) -> Option<Plan> {
        let mut plan = self.of_inputs()?;
        let shift = |i: usize| (8.0 - f64::from(place[i])) / 8.0 / f64::from(self.size[i]);
        let shift = DMat4::from_cols(DVec4::X, DVec4::Y, DVec4::Z, DVec4::new(shift(0), shift(1), 0.0, 1.0));
        let clip = |m: Mat4| (shift * m.as_dmat4()).as_mat4();
        plan.view.clip_from_view = clip(plan.view.clip_from_view);
        plan.view.clip_from_relative = clip(plan.view.clip_from_relative);
        if let Some(pass) = &mut plan.scene_inputs {
            pass.clip_before = clip(pass.clip_before);
        }
        Some(plan)
    }
}
