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
    /// Effect on the layers below.
    pub mode: LayerMode,
    /// Rank of the layer. All layers except the base are sorted by rank; a higher rank lies over a lower one. The order of layers of the
    /// same rank changes nothing but rounding: first the overriding layers are averaged by weight over the layers below
    /// ([`choreo_motion::WeightedBlend`]), then the additive layers are summed on top ([`choreo_motion::AdditiveLayers`]).
    pub rank: u32,
    /// Keyed weight of the layer as a whole over stage time (`Property::Weight`), a factor of its cues' weights; upper layers only.
    pub weight_keys: Option<Arc<Channel>>,
    /// Cues, sorted by start. A cue fades in over the cues before it.
    pub cues: Vec<Cue>,
}

/// Mode in which a layer changes the layers below it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LayerMode {
    /// Blends towards the layer's pose by its weight.
    #[default]
    Override,
    /// Adds the difference of each of its clips from a reference pose.
    Additive(Reference),
    /// Subtracts the difference of each of its clips from a reference pose.
    Subtractive(Reference),
}

/// Reference pose, from which an additive clip is the difference.
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
        /// The clip, bound to the actor's own skeleton (see `bind_clip`).
        clip: Arc<Clip>,
    ) {
        /// Stage time at which the cue begins.
        start: Time = Time::ZERO;
        /// Stage time at which the cue ends; `None`: at the next cue, or never. The base layer holds the last pose from then on, unless the
        /// next cue begins at that time: then it fades in over the clip, which plays on. On an upper layer the cue has faded out by then,
        /// over `fade_out`.
        end: Option<Time> = None;
        /// Duration of the fade-in.
        fade_in: Time = Time::ZERO;
        /// Duration of the fade-out before `end`.
        fade_out: Time = Time::ZERO;
        /// The part of the clip that is played.
        trim: (Time, Time) = (Time::ZERO, clip.duration);
        /// Easing of the fades.
        ease: Ease = Ease::Linear;
        /// Clip seconds per stage second; negative plays backwards from `trim.1`.
        speed: f64 = 1.0;
        /// Behavior at the end of the clip.
        repeat: Repeat = Repeat::Loop;
        /// Weight, 0..=1, a factor of the fades. The first cue of the base layer always has full weight.
        weight: f32 = 1.0;
        /// Keyed weight over stage time (`Property::Weight`), in place of `weight`; clamped to 0..=1.
        weight_keys: Option<Arc<Channel>> = None;
        /// Clip time keyed over stage time. It replaces |`speed`|; the sign still sets the direction.
        time_remapping: Option<Arc<TimeRemapping>> = None;
        /// Spans of stage time in which the clip stands still; sorted, one after the other.
        freezes: Vec<(Time, Time)> = Vec::new();
        /// Base layer: phase matching with the cue that fades into this one, and with the one that this one fades into.
        phase_matched_fades: [Option<Arc<PhaseMatchedFade>>; 2] = [None, None];
        /// Base layer: duration of the inertialization, in place of `fade_in`; 0: none. The cue begins at once with full weight, and the
        /// offset from the pose before decays in this time ([`choreo_motion::Inertialization`]).
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

    /// Keyframes, over stage time, of one of the [`Cue::keyed_options`]; `None` if it has none.
    pub fn keys(&self, property: Property) -> Option<&Channel> {
        match (property, self.time_remapping.as_deref()) {
            (Property::Weight, _) => self.weight_keys.as_deref(),
            (Property::Speed, Some(TimeRemapping::Speed(curve))) => Some(&curve.keys),
            (Property::ClipTime, Some(TimeRemapping::ClipTime(keys))) => Some(keys),
            _ => None,
        }
    }
}
