//! Effects in use: what they apply to, when they are on, and their parameters.

use crate::stage::actor::Target;
use crate::stage::channel::Channel;
use choreo_asset::Image;
use choreo_asset::hash::ContentHash;
use choreo_motion::Time;
use std::borrow::Cow;
use std::sync::Arc;

/// An effect plugin in use, with its parameters as given in the script.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EffectUse {
    /// Name of the plugin.
    pub plugin: String,
    /// Parameters that the script sets, sorted by name.
    pub parameters: Vec<(String, f64)>,
    /// Images that the script has chosen, sorted by parameter.
    pub images: Vec<EffectImageUse>,
    /// Keyed parameters over stage time (`Property::Parameter`), in place of those in `parameters`; sorted by name.
    pub keys: Vec<(String, Channel)>,
    /// Parameters that follow a target, such as the focus; in place of those in `parameters` and `keys`.
    pub distances: Vec<EffectDistance>,
    /// Stage time at which the effect starts.
    pub start: Time,
    /// Stage time at which the effect ends; `None`: never.
    pub end: Option<Time>,
    /// Actors and materials to which it is limited, sorted; empty: everything.
    pub on: Vec<EffectTarget>,
    /// If not empty, the effect works only while one of these cameras is active (indices into `Stage::cameras`); sorted.
    pub cameras: Vec<usize>,
    /// The actors outside the image whose poses the plugin reads or changes.
    pub off_screen: OffScreenActors,
}

/// Actors outside the image whose poses an effect can need, so that they are not culled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OffScreenActors {
    /// Every actor: the effect reads the whole stage.
    #[default]
    All,
    /// Actors to which the effect applies: it draws beyond their meshes.
    Affected,
    /// No actor: the effect changes the color of what is in the image.
    None,
}

/// An image parameter of an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectImageUse {
    /// Name of the parameter.
    pub parameter: String,
    /// The image.
    pub image: Arc<Image>,
    /// Content hash of the image.
    pub hash: ContentHash,
}

/// A parameter that is the distance of a target in front of the camera, along its viewing direction, in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectDistance {
    /// Name of the parameter.
    pub parameter: String,
    /// Place whose distance is measured.
    pub target: Target,
    /// Smallest value that the effect allows, metres.
    pub least: f64,
    /// Largest value that the effect allows, metres.
    pub most: f64,
}

/// An actor, or one of its materials, to which an effect applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EffectTarget {
    /// Index into `Stage::actors`.
    pub actor: usize,
    /// A material of the actor's asset; `None`: all of them.
    pub material: Option<u32>,
}

/// A parameter that a callback sets for one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectEdit {
    /// Index into `Stage::effects`.
    pub effect: usize,
    /// Name of the parameter.
    pub parameter: String,
    /// Value in this frame.
    pub value: f64,
}

impl EffectTarget {
    /// Whether targets include the surfaces of an actor with a material. An empty list includes everything.
    pub fn targets_include(targets: &[EffectTarget], actor: usize, material: Option<u32>) -> bool {
        let covers = |t: &EffectTarget| t.actor == actor && (t.material.is_none() || t.material == material);
        targets.is_empty() || targets.iter().any(covers)
    }
}

impl EffectUse {
    /// Whether the effect can need the pose of an actor outside the image.
    pub(crate) fn needs_off_screen(&self, actor: usize) -> bool {
        match self.off_screen {
            OffScreenActors::All => true,
            OffScreenActors::Affected => self.on.is_empty() || self.on.iter().any(|t| t.actor == actor),
            OffScreenActors::None => false,
        }
    }

    /// Name under which the effect is drawn: the plugin's name, extended by the hashes of its images. Uses with equal images share a name.
    pub fn effect_name(&self) -> Cow<'_, str> {
        if self.images.is_empty() {
            return Cow::Borrowed(&self.plugin);
        }
        let mut name = format!("{} (", self.plugin);
        for (i, EffectImageUse { parameter, hash, .. }) in self.images.iter().enumerate() {
            let [a, b, c, d, e, f, ..] = hash;
            let comma = if i > 0 { ", " } else { "" };
            name += &format!("{comma}{parameter}: {a:02x}{b:02x}{c:02x}{d:02x}{e:02x}{f:02x}");
        }
        Cow::Owned(name + ")")
    }

    pub(crate) fn is_active(&self, time: Time) -> bool {
        self.start <= time && self.end.is_none_or(|end| time < end)
    }

    /// Parameters at a time, without the changes of callbacks.
    pub fn parameters_at(&self, time: Time) -> Vec<(String, f64)> {
        let mut now = self.parameters.clone();
        for (name, keys) in &self.keys {
            if let Some(value) = keys.at(time) {
                set_parameter(&mut now, name, value[0]);
            }
        }
        now
    }
}

pub(crate) fn set_parameter(parameters: &mut Vec<(String, f64)>, name: &str, value: f64) {
    match parameters.binary_search_by(|(n, _)| n.as_str().cmp(name)) {
        Ok(at) => parameters[at].1 = value,
        Err(at) => parameters.insert(at, (name.to_string(), value)),
    }
}
