//! The keys of all pipelines, and the pipelines that a recording binds.

use crate::commands::preskin::PreskinVariant;
use crate::commands::{Command, EffectOnSurfaces, Recording, Target};
use crate::plan::Features;
use crate::shader::SceneVariant;

#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum PipelineId {
    /// A compute pipeline for pre-skinning.
    Pose(PreskinVariant),
    /// A pipeline of surfaces. `surface`: the effects that its shader calls.
    Scene { variant: SceneVariant, samples: u32, float: bool, surface: Vec<EffectOnSurfaces> },
    /// A pipeline of backgrounds. `surface`: the effects that its shader calls.
    Background { samples: u32, float: bool, depth: bool, what: Backdrop, surface: Vec<EffectOnSurfaces> },
    /// A pipeline of overlays. `over`: without a depth test.
    Overlay { samples: u32, float: bool, over: bool },
    /// A full-screen pass, with a pipeline for each pass of an effect: drivers that draw on the CPU execute both sides of a
    /// branch.
    Post { effect: String, number: u32, float: bool },
}

/// Background of pixels that the scene leaves empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Backdrop {
    Gradient,
    /// The sky, with the frame's features of [`Features::DISPLAY`].
    Sky(Features),
    /// 2D layers over the gradient or the sky.
    LayersBehind,
}

/// The pipeline of each command of a recording, in order (`None` for commands that bind none).
pub(super) fn ids(recording: &Recording) -> Vec<Option<PipelineId>> {
    let (mut samples, mut float, mut depth) = (1, false, false);
    let is_float = |t: &Target| *t != Target::Image;
    let id = |command: &Command| match command {
        Command::BeginPass { target, samples: s, depth: d, .. } => {
            (samples, float, depth) = (*s, is_float(target), *d);
            None
        }
        Command::BeginPeel { samples: s, .. } => {
            samples = *s;
            None
        }
        Command::BeginLayer { target, samples: s, .. } => {
            (samples, float, depth) = (*s, is_float(target), true);
            None
        }
        Command::BeginShadows { .. } | Command::BeginGBuffer | Command::BeginInputs { .. } => {
            (samples, float) = (1, false);
            None
        }
        Command::Preskin { variant, .. } => Some(PipelineId::Pose(*variant)),
        Command::BindPipeline(variant) => {
            let surface = effects_of_bits(recording, variant.key.effects());
            Some(PipelineId::Scene { variant: *variant, samples, float, surface })
        }
        Command::DrawBackground { surface } | Command::DrawSky { surface, .. } => {
            let surface = effects_of_bits(recording, *surface);
            let what = match command {
                Command::DrawSky { display, .. } => Backdrop::Sky(*display),
                _ => Backdrop::Gradient,
            };
            Some(PipelineId::Background { samples, float, depth, what, surface })
        }
        Command::DrawLayersBehind => Some(PipelineId::Background {
            samples,
            float,
            depth,
            what: Backdrop::LayersBehind,
            surface: Vec::new(),
        }),
        Command::DrawOverlay { over, .. } => Some(PipelineId::Overlay { samples, float, over: *over }),
        Command::PostPass { effect, number, to, .. } => {
            Some(PipelineId::Post { effect: effect.clone(), number: *number, float: is_float(to) })
        }
        _ => None,
    };
    recording.commands.iter().map(id).collect()
}

/// The effects whose bits are set.
fn effects_of_bits(recording: &Recording, bits: u8) -> Vec<EffectOnSurfaces> {
    recording.scene_effects.iter().filter(|effect| bits >> effect.bit & 1 == 1).cloned().collect()
}
