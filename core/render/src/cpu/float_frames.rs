//! Frames of floats, assembled on the host for both renderers: the mean of the sub-frames, image effects (run by their CPU
//! functions, the reference of the GPU passes), dissolves, 2D layers, and the passes that [`FrameWish::Scene`] requests.

use super::id_mattes::IdSamples;
use super::image_passes;
use super::scene_inputs::InputImages;
use crate::effect_faults::EffectFaults;
use crate::error::RenderError;
use crate::plan::Plan;
use crate::plan::motion_blur::Accumulated;
use crate::plan::passes::sample_places;
use choreo_plugin::{Effect, FloatFrame, FrameWish, IdMatte, Passes, SceneImages};
use glam::{Vec2, Vec4, Vec4Swizzles};

/// A renderer that draws the images of a float frame.
pub(crate) trait FloatFrameRenderer {
    /// Renders the scene alone, in linear colors: without sub-frames, image effects and 2D layers in front.
    fn render_linear(&mut self, plan: &Plan) -> Result<Vec<Vec4>, RenderError>;
    /// Renders the inputs of image effects (depth, normals, motion, actors) that the plan requests.
    fn render_inputs(&mut self, plan: &Plan) -> Result<InputImages, RenderError>;
    fn effects(&self) -> &[Effect];
    fn faults(&self) -> &EffectFaults;
}

/// Renders the float frame of a plan whose wish is not [`FrameWish::Bytes`].
pub(crate) fn float_frame(
    plan: &Plan,
    renderer: &mut impl FloatFrameRenderer,
) -> Result<FloatFrame, RenderError> {
    let (passes, has_layers) = match plan.wish {
        FrameWish::Scene(passes) => (passes, false),
        _ => (Passes { color: true, ..Passes::default() }, true),
    };
    let mut frame = FloatFrame::new(plan.size);
    // ID mattes draw their own inputs, at several positions within each pixel.
    let needs_inputs = passes.color || passes.depth || passes.normal || passes.motion;
    let inputs = if needs_inputs { renderer.render_inputs(plan)? } else { InputImages::default() };
    if passes.color {
        frame.color = linear_image(plan, &inputs, renderer)?;
        if let Some(dissolve) = &plan.dissolve {
            let inputs = renderer.render_inputs(&dissolve.plan)?;
            let before = linear_image(&dissolve.plan, &inputs, renderer)?;
            mix_images(&mut frame.color, &before, dissolve.share);
        }
        if let Some(layers) = plan.layers_in_front.as_ref().filter(|_| has_layers) {
            layers.blend_over_floats(plan.size, &mut frame.color);
        }
    }
    let has_surface = |surface: &Vec4| *surface != SceneImages::NO_SURFACE;
    if passes.depth {
        let depth = |s: &Vec4| if has_surface(s) { s.w } else { FloatFrame::NO_DEPTH };
        frame.depth = inputs.surface.iter().map(depth).collect();
    }
    if passes.normal {
        frame.normal = inputs.surface.iter().map(|s| s.xyz()).collect();
    }
    if passes.motion {
        frame.motion = inputs.motion.iter().map(|m| Vec2::new(m.x, m.y)).collect();
    }
    if passes.albedo {
        frame.albedo = renderer.render_linear(&plan.albedo())?;
    }
    if passes.id {
        [frame.actors, frame.materials] = id_mattes(plan, passes, renderer)?;
    }
    Ok(frame)
}

/// ID mattes of actors and materials. The inputs are drawn once for each sample.
fn id_mattes(
    plan: &Plan,
    passes: Passes,
    renderer: &mut impl FloatFrameRenderer,
) -> Result<[Option<IdMatte>; 2], RenderError> {
    let [mut actors, mut materials] = [Vec::new(), Vec::new()];
    for position in sample_places(passes.samples_of_ids(plan.samples)) {
        let Some(sample_plan) = plan.of_inputs_at(*position) else { return Ok([None, None]) };
        let motion = renderer.render_inputs(&sample_plan)?.motion;
        actors.push(motion.iter().map(|texel| texel.z as u32).collect());
        materials.push(motion.iter().map(|texel| texel.w as u32).collect());
    }
    let names = plan.scene_inputs.as_ref().and_then(|pass| pass.names.clone());
    let [actor_names, material_names] = names.unwrap_or_default();
    let matte = |samples, names| Some(IdSamples(samples).matte(names));
    Ok([matte(actors, actor_names), matte(materials, material_names)])
}

/// The linear image of a plan: the mean of its sub-frames, with the image effects applied.
fn linear_image(
    plan: &Plan,
    inputs: &InputImages,
    renderer: &mut impl FloatFrameRenderer,
) -> Result<Vec<Vec4>, RenderError> {
    let mut sum = Accumulated::new(plan.size[0] as usize * plan.size[1] as usize);
    let whole_plan = std::slice::from_ref(plan);
    let sub_frames = if plan.subframes.is_empty() { whole_plan } else { &plan.subframes };
    for part in sub_frames {
        sum.add(renderer.render_linear(part)?.into_iter());
    }
    let before =
        plan.history.iter().map(|part| renderer.render_linear(part)).collect::<Result<Vec<_>, _>>()?;
    let passes = image_passes::resolve_passes(&plan.post, plan.size, renderer.effects())?;
    Ok(image_passes::run_linear(&passes, inputs.effect_inputs(plan), sum.mean(), &before, renderer.faults()))
}

/// Mixes in a share of another image. Both are premultiplied, so light is added to light.
fn mix_images(image: &mut [Vec4], other: &[Vec4], share: f32) {
    image.iter_mut().zip(other).for_each(|(pixel, other)| *pixel = *pixel * (1.0 - share) + *other * share);
}
