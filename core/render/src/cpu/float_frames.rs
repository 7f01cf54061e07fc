//! Float frames, assembled on the host for both renderers: the mean of the sub-frames, image effects by their CPU functions (the
//! reference of the GPU passes), dissolves, 2D layers, and the passes that [`FrameWish::Scene`] names.

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

/// Images that a renderer draws for a float frame.
pub(crate) trait DrawsFloats {
    /// Image of the scene alone: linear, without sub-frames, effects on images and layers over it.
    fn linear(&mut self, plan: &Plan) -> Result<Vec<Vec4>, RenderError>;
    /// Depth, normals, motion and actors, as far as the plan has them.
    fn inputs(&mut self, plan: &Plan) -> Result<InputImages, RenderError>;
    fn effects(&self) -> &[Effect];
    fn faults(&self) -> &EffectFaults;
}

/// Renders the float frame of a plan whose wish is not [`FrameWish::Bytes`].
pub(crate) fn float_frame(plan: &Plan, renderer: &mut impl DrawsFloats) -> Result<FloatFrame, RenderError> {
    let (passes, finished) = match plan.wish {
        FrameWish::Scene(passes) => (passes, false),
        _ => (Passes { color: true, ..Passes::default() }, true),
    };
    let mut frame = FloatFrame::new(plan.size);
    // ID mattes draw inputs of their own, at several places within the pixel.
    let of_pixels = passes.color || passes.depth || passes.normal || passes.motion;
    let inputs = if of_pixels { renderer.inputs(plan)? } else { InputImages::default() };
    if passes.color {
        frame.color = image(plan, &inputs, renderer)?;
        if let Some(dissolve) = &plan.dissolve {
            let inputs = renderer.inputs(&dissolve.plan)?;
            let before = image(&dissolve.plan, &inputs, renderer)?;
            mix(&mut frame.color, &before, dissolve.share);
        }
        if let Some(layers) = plan.layers_in_front.as_ref().filter(|_| finished) {
            layers.over_floats(plan.size, &mut frame.color);
        }
    }
    let there = |surface: &Vec4| *surface != SceneImages::NO_SURFACE;
    if passes.depth {
        let depth = |s: &Vec4| if there(s) { s.w } else { FloatFrame::NO_DEPTH };
        frame.depth = inputs.surface.iter().map(depth).collect();
    }
    if passes.normal {
        frame.normal = inputs.surface.iter().map(|s| s.xyz()).collect();
    }
    if passes.motion {
        frame.motion = inputs.motion.iter().map(|m| Vec2::new(m.x, m.y)).collect();
    }
    if passes.albedo {
        frame.albedo = renderer.linear(&plan.albedo())?;
    }
    if passes.id {
        [frame.actors, frame.materials] = ids(plan, passes, renderer)?;
    }
    Ok(frame)
}

/// ID mattes of actors and materials. Draws the inputs once for each sample.
fn ids(
    plan: &Plan,
    passes: Passes,
    renderer: &mut impl DrawsFloats,
) -> Result<[Option<IdMatte>; 2], RenderError> {
    let [mut actors, mut materials] = [Vec::new(), Vec::new()];
    for place in sample_places(passes.samples_of_ids(plan.samples)) {
        let Some(seen) = plan.of_inputs_at(*place) else { return Ok([None, None]) };
        let motion = renderer.inputs(&seen)?.motion;
        actors.push(motion.iter().map(|texel| texel.z as u32).collect());
        materials.push(motion.iter().map(|texel| texel.w as u32).collect());
    }
    let names = plan.scene_inputs.as_ref().and_then(|pass| pass.names.clone());
    let [of_actors, of_materials] = names.unwrap_or_default();
    let matte = |samples, names| Some(IdSamples(samples).matte(names));
    Ok([matte(actors, of_actors), matte(materials, of_materials)])
}

/// The linear image of a plan: the mean of its sub-frames, with the effects on images applied.
fn image(
    plan: &Plan,
    inputs: &InputImages,
    renderer: &mut impl DrawsFloats,
) -> Result<Vec<Vec4>, RenderError> {
    let mut sum = Accumulated::new(plan.size[0] as usize * plan.size[1] as usize);
    let alone = std::slice::from_ref(plan);
    let exposed = if plan.subframes.is_empty() { alone } else { &plan.subframes };
    for part in exposed {
        sum.add(renderer.linear(part)?.into_iter());
    }
    let before = plan.history.iter().map(|part| renderer.linear(part)).collect::<Result<Vec<_>, _>>()?;
    let passes = image_passes::passes(&plan.post, plan.size, renderer.effects())?;
    Ok(image_passes::run_linear(&passes, inputs.of(plan), sum.mean(), &before, renderer.faults()))
}

/// Mixes in a share of another image. Both are premultiplied, so light is added to light.
fn mix(image: &mut [Vec4], other: &[Vec4], share: f32) {
    image.iter_mut().zip(other).for_each(|(pixel, other)| *pixel = *pixel * (1.0 - share) + *other * share);
}
