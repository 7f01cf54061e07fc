//! The keys of all pipelines, and those that a recording binds.

use crate::commands::preskin::PreskinVariant;
use crate::commands::{Command, EffectOnSurfaces, Recording, Target};
use crate::plan::Features;
use crate::shader::SceneVariant;

#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Id {
    /// Vertices into their poses.
    Pose(PreskinVariant),
    /// `surface`: the effects on it.
    Scene { variant: SceneVariant, samples: u32, float: bool, surface: Vec<EffectOnSurfaces> },
    /// `surface`: the effects on it.
    Background { samples: u32, float: bool, depth: bool, what: Backdrop, surface: Vec<EffectOnSurfaces> },
    /// `over`: not hidden by what is nearer.
    Overlay { samples: u32, float: bool, over: bool },
    /// One for each run of an effect: drivers that draw on the CPU execute both sides of a branch.
    Post { effect: String, number: u32, float: bool },
}

/// Background of pixels that the scene leaves empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Backdrop {
    Gradient,
    /// The sky, with those of [`Features::DISPLAY`] that the frame has.
    Sky(Features),
    /// Layers under the scene, over either.
    LayersBehind,
}

/// The pipeline of each command of a recording, in order (`None` for commands that bind none).
pub fn ids(recording: &Recording) -> Vec<Option<Id>> {
    let (mut samples, mut float, mut depth) = (1, false, false);
    let is_float = |t: &Target| *t != Target::Picture;
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
        Command::BeginShadows { .. } | Command::BeginGeometry | Command::BeginInputs { .. } => {
            (samples, float) = (1, false);
            None
        }
        Command::Preskin { variant, .. } => Some(Id::Pose(*variant)),
        Command::BindPipeline(variant) => {
            let surface = on_surface(recording, variant.key.effects());
            Some(Id::Scene { variant: *variant, samples, float, surface })
        }
        Command::DrawBackground { surface } | Command::DrawSky { surface, .. } => {
            let surface = on_surface(recording, *surface);
            let what = match command {
                Command::DrawSky { display, .. } => Backdrop::Sky(*display),
                _ => Backdrop::Gradient,
            };
            Some(Id::Background { samples, float, depth, what, surface })
        }
        Command::DrawLayersBehind => {
            Some(Id::Background { samples, float, depth, what: Backdrop::LayersBehind, surface: Vec::new() })
        }
        Command::DrawOverlay { over, .. } => Some(Id::Overlay { samples, float, over: *over }),
        Command::PostPass { effect, number, to, .. } => {
            Some(Id::Post { effect: effect.clone(), number: *number, float: is_float(to) })
        }
        _ => None,
    };
    recording.commands.iter().map(id).collect()
}

/// The effects of a set of bits.
fn on_surface(recording: &Recording, bits: u8) -> Vec<EffectOnSurfaces> {
    recording.scene_effects.iter().filter(|effect| bits >> effect.bit & 1 == 1).cloned().collect()
}
