//! The selection, by name: it survives a reload if the script still makes the object.

use choreo_stage::Stage;

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Selected {
    Actor(String),
    Cue {
        actor: String,
        layer: usize,
        cue: usize,
    },
    Camera(String),
    Light(usize),
    Effect(usize),
    /// A text, an image or a panel over the frame.
    Title(usize),
    /// The light from all around.
    Sky,
}

impl Selected {
    /// Whether the stage has it.
    pub fn is_on(&self, stage: &Stage) -> bool {
        match self {
            Selected::Actor(name) => actor(stage, name).is_some(),
            Selected::Cue { actor: name, layer, cue } => {
                let layer = actor(stage, name).and_then(|a| stage.actors[a].layers.get(*layer));
                layer.is_some_and(|layer| *cue < layer.cues.len())
            }
            Selected::Camera(name) => stage.cameras.iter().any(|c| c.name == *name),
            Selected::Light(index) => *index < stage.lights.len(),
            Selected::Effect(index) => *index < stage.effects.len(),
            Selected::Title(index) => *index < stage.layers_2d.len(),
            Selected::Sky => stage.sky.is_some(),
        }
    }

    /// The actor that it is, or is of.
    pub fn actor(&self) -> Option<&str> {
        match self {
            Selected::Actor(name) | Selected::Cue { actor: name, .. } => Some(name),
            _ => None,
        }
    }
}

pub fn actor(stage: &Stage, name: &str) -> Option<usize> {
    stage.actors.iter().position(|a| a.name == name)
}
