//! The selection. Objects are identified by name where they have one, so that it survives a reload if the script still creates the object.

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
    /// A 2D layer: a text, an image or a panel.
    Title(usize),
    /// The sky, an environment light.
    Sky,
}

impl Selected {
    /// Whether the object is on the stage.
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

    /// Name of the actor that is selected, or that the cue belongs to.
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
