//! Layers of clips on an actor.

use crate::stage::channel::{Channel, Property};
use crate::stage::described::{Described, FieldType, described};
use crate::stage::root_motion::CueRootMotion;
use crate::stage::time_remapping::TimeRemapping;
use choreo_motion::{Clip, Ease, PhaseMatchedFade, Repeat, Time};
use std::sync::Arc;

/// A layer of clips on one actor. Layer 0 is the base; the others come over it by rank.
#[derive(Clone, Debug, Default)]
pub struct Layer {
    /// One weight for each joint of the actor's skeleton, 0..=1; `None` = all joints.
    pub mask: Option<Arc<Vec<f32>>>,
    /// Its effect on the layers below.
    pub mode: LayerMode,
    /// Layers are sorted by rank, the base left out. A higher rank lies over a lower one. Those of one rank are equal: their
    /// order changes nothing but rounding. First those that override are mixed, by weight, over what is below
    /// ([`choreo_motion::WeightedBlend`]), then the additive ones are summed and laid on top ([`choreo_motion::AdditiveLayers`]).
    pub rank: u32,
    /// `Property::Weight` over stage time: of the layer as a whole, times its cues'; upper layers only.
    pub weight_keys: Option<Arc<Channel>>,
    /// Sorted by start. A cue fades in over what came before it.
    pub cues: Vec<Cue>,
}

/// How a layer changes the layers below it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LayerMode {
    /// Goes towards the layer's pose, by its weight.
    #[default]
    Override,
    /// Adds what each of its clips does beyond a reference pose.
    Additive(Reference),
    /// Takes it away.
    Subtractive(Reference),
}

/// The pose that an additive clip is a difference to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// The clip where its trim begins.
    FirstFrame,
    /// The clip at this time.
    At(Time),
    /// The skeleton's rest pose.
    Rest,
}

described! {
    /// A clip placed on the timeline. By default all of the clip, looped from time zero on, without fades.
    #[derive(Clone, Debug)]
    pub struct Cue(
        /// Bound to the actor's own skeleton (see `bind_clip`).
        clip: Arc<Clip>,
    ) {
        /// Stage time at which it begins.
        start: Time = Time::ZERO;
        /// The base layer holds its last pose from this time on, unless the next cue begins at once: it fades in over the
        /// clip, which goes on. On upper layers: faded out (over `fade_out`) by then. `None`: until the next cue or for ever.
        end: Option<Time> = None;
        /// How long it takes to fade in.
        fade_in: Time = Time::ZERO;
        /// How long it takes to fade out before its end.
        fade_out: Time = Time::ZERO;
        /// The part of the clip that is played.
        trim: (Time, Time) = (Time::ZERO, clip.duration);
        /// Course of the fades.
        ease: Ease = Ease::Linear;
        /// Clip seconds per stage second; negative plays backwards from `trim.1`.
        speed: f64 = 1.0;
        /// Behavior at the end of the clip.
        repeat: Repeat = Repeat::Loop;
        /// 0 to 1, times the fades. The first cue of the base layer always has all the weight.
        weight: f32 = 1.0;
        /// `Property::Weight` over stage time, in place of `weight`; what a spline overshoots is cut off at 0 and 1.
        weight_keys: Option<Arc<Channel>> = None;
        /// Clip time keyed over stage time. It replaces |`speed`|; the sign still sets the direction.
        time_remapping: Option<Arc<TimeRemapping>> = None;
        /// Spans of stage time in which the clip stands still; sorted, one after the other.
        freezes: Vec<(Time, Time)> = Vec::new();
        /// Base layer: phase matching with the cue that fades into this one, and with the one that this one fades into.
        in_step: [Option<Arc<PhaseMatchedFade>>; 2] = [None, None];
        /// Base layer: above zero, the cue begins at once with all its weight, and the offset from the pose before decays in this
        /// time ([`choreo_motion::Inertialization`]). In place of `fade_in`.
        inertialization: Time = Time::ZERO;
        /// Base layer: the root motion that is taken out of the clip.
        root: Option<Arc<CueRootMotion>> = None;
    }
    fields {
        from: start, FieldType::Time;
        until: end, FieldType::Time;
        fade: fade_in, FieldType::Duration;
        fade_out: fade_out, FieldType::Duration;
        inertial: inertialization, FieldType::Duration;
        speed: speed, FieldType::Number(-1000.0, 1000.0, "×"), keys "speed" Speed;
        weight: weight, FieldType::Number(0.0, 1.0, ""), keys "weight" Weight;
    }
}

impl Cue {
    /// The options that keyframes animate, by their names in scripts, with the property of the keyframes.
    pub fn keyed_options() -> impl Iterator<Item = (&'static str, Property)> {
        let of_fields = Cue::FIELDS.iter().filter_map(|field| field.keyed);
        of_fields.chain([("clip_time", Property::ClipTime)])
    }

    /// The keyframes of such an option over stage time.
    pub fn keys(&self, property: Property) -> Option<&Channel> {
        match (property, self.time_remapping.as_deref()) {
            (Property::Weight, _) => self.weight_keys.as_deref(),
            (Property::Speed, Some(TimeRemapping::Speed(curve))) => Some(&curve.keys),
            (Property::ClipTime, Some(TimeRemapping::ClipTime(keys))) => Some(keys),
            _ => None,
        }
    }
}
