//! Display of a frame's light: exposure and view transform, as part of shading or, if an effect on images needs light, as a pass
//! over the image.

use crate::plan::build::effects::{active_uses, effect_parameters};
use crate::plan::options::PlanOptions;
use crate::plan::{Features, LeftOut, PostPass};
use choreo_plugin::{Effect, FrameWish, OptionKind, ViewOrder};
use choreo_stage::{Background, Snapshot, Stage, ViewTransform};

/// Exposure and view transform of a frame.
#[derive(Clone, Debug)]
pub(super) struct Display {
    /// Factor on all light.
    pub exposure: f32,
    /// The features of [`Features::DISPLAY`] that surfaces and the sky use.
    pub features: Features,
    /// The name of the view transform that runs as a pass over the image, after the last effect that works on light.
    pass: Option<&'static str>,
}

impl Display {
    pub(super) fn new(stage: &Stage, snapshot: &Snapshot, options: &PlanOptions) -> Display {
        let settings = &stage.settings;
        let exposure = libm::exp2f(settings.exposure);
        let is_on =
            |order| active_uses(stage, snapshot, options.effects).any(|(e, ..)| e.view_order() == order);
        let (curve, of_surfaces) = match settings.view_transform {
            ViewTransform::None => (None, Features::default()),
            ViewTransform::Neutral => (Some("neutral"), Features::VIEW_TRANSFORM),
            ViewTransform::Agx => (Some("agx"), Features::VIEW_TRANSFORM.with(Features::AGX)),
        };
        let replaced = is_on(ViewOrder::Replaces);
        let pass = curve.filter(|_| !replaced && is_on(ViewOrder::Before));
        // The pass needs an effect that implements the view transform.
        let pass = pass.filter(|curve| view_effect(options.effects, curve).is_some());
        // A frame of light is delivered without a view transform; its user applies one.
        let light = matches!(options.wish, FrameWish::Scene(_));
        let linear = replaced || pass.is_some() || light;
        let features = Features::EXPOSURE.when(settings.exposure != 0.0);
        Display {
            exposure,
            features: features.with(of_surfaces.when(!linear)),
            pass: pass.filter(|_| !light),
        }
    }

    /// Inserts the pass of the view transform after the last effect that works on light.
    pub(crate) fn add_pass(&self, passes: &mut Vec<PostPass>, options: &PlanOptions) {
        let Some((effect, parameters)) = self.pass.and_then(|curve| view_effect(options.effects, curve))
        else {
            return;
        };
        let after = after_light(passes, options);
        let pass = PostPass::only(effect.manifest().name.clone(), parameters);
        passes.insert(after, pass);
    }
}

/// The number of passes up to the last one that works on light.
fn after_light(passes: &[PostPass], options: &PlanOptions) -> usize {
    let is_light = |pass: &PostPass| {
        let of_pass = options.effects.iter().find(|e| e.manifest().name == pass.effect);
        of_pass.is_some_and(|e| e.view_order() == ViewOrder::Before)
    };
    passes.iter().rposition(is_light).map_or(0, |last| last + 1)
}

/// Leaves out the passes that work on the colors of a display.
pub(super) fn keep_light(passes: &mut Vec<PostPass>, options: &PlanOptions) -> Vec<LeftOut> {
    let rest = passes.split_off(after_light(passes, options));
    let first = rest.into_iter().filter(|pass| pass.number == 0);
    let left_out = |pass: PostPass| LeftOut {
        part: format!("effect \"{}\"", pass.effect),
        why: "it works on display colors, but the frame is linear light before the view transform".into(),
    };
    first.map(left_out).collect()
}

/// The background as drawn into the image: premultiplied in float images.
pub(super) fn background(background: Background, wish: FrameWish) -> Background {
    match background {
        Background::Color(color) if wish != FrameWish::Bytes => {
            Background::Color((color.truncate() * color.w).extend(color.w))
        }
        other => other,
    }
}

/// The effect with a view transform of this name among its curves, and its parameters for that.
fn view_effect<'a>(effects: &'a [Effect], name: &str) -> Option<(&'a Effect, Vec<f32>)> {
    effects.iter().filter(|e| e.view_order() == ViewOrder::Replaces).find_map(|effect| {
        effect.manifest().options.iter().find_map(|option| {
            let OptionKind::Text { one_of, .. } = &option.kind else { return None };
            let curve = one_of.iter().position(|o| o == name)?;
            let given = [(option.name.clone(), curve as f64)];
            Some((effect, effect_parameters(effect, &given)))
        })
    })
}
