//! Layers of clips on an actor.

use crate::stage::channel::Channel;
use crate::stage::root_motion::CueRoot;
use crate::stage::time_remapping::Warp;
use choreo_motion::{Clip, Ease, PhaseFade, Repeat, Time};
use std::sync::Arc;

/// A layer of clips on one actor. Layer 0 is the base; the others come over it by rank.
#[derive(Clone, Debug, Default)]
pub struct Layer {
    /// One weight a joint of the actor's skeleton, 0..=1; `None` = all joints.
    pub mask: Option<Arc<Vec<f32>>>,
    pub mode: LayerMode,
    /// Layers are sorted by rank, the base left out. A higher rank lies over a lower one. Those of one rank are equal: their
    /// order changes nothing but rounding. First those that override are mixed, by weight, over what is below
    /// ([`choreo_motion::Mix`]), then the additive ones are summed and laid on top ([`choreo_motion::Deltas`]).
    pub rank: u32,
    /// `Property::Weight` over stage time: of the layer as a whole, times its cues'; upper layers only.
    pub weight_keys: Option<Arc<Channel>>,
    /// Sorted by start. A cue fades in over what came before it.
    pub cues: Vec<Cue>,
}

/// What a layer does to what is below it.
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

/// A clip placed on the timeline.
#[derive(Clone, Debug)]
pub struct Cue {
    /// Bound to the actor's own skeleton (see `bind_clip`).
    pub clip: Arc<Clip>,
    pub start: Time,
    /// On the base layer: the pose is held from here on, where no cue follows at once (one that does fades in over the
    /// playing clip). On upper layers: faded out (over `fade_out`) by then. `None` = until the next cue or for ever.
    pub end: Option<Time>,
    pub fade_in: Time,
    pub fade_out: Time,
    pub ease: Ease,
    /// Clip seconds a stage second; negative plays backwards from `trim.1`.
    pub speed: f64,
    /// The part of the clip that is played.
    pub trim: (Time, Time),
    pub repeat: Repeat,
    /// 0..=1, times the fades. The first cue of the base layer always has all the weight.
    pub weight: f32,
    /// `Property::Weight` over stage time, in place of `weight`; what a spline overshoots is cut off at 0 and 1.
    pub weight_keys: Option<Arc<Channel>>,
    /// Clip time keyed over stage time, in place of the amount of `speed`, whose sign still says from which end.
    pub warp: Option<Arc<Warp>>,
    /// When the clip stands still, from and to on stage; sorted, one after the other.
    pub freezes: Vec<(Time, Time)>,
    /// Base layer: keeps step with the cue that fades into this one, or out of it.
    pub in_step: [Option<Arc<PhaseFade>>; 2],
    /// Base layer: above zero, it begins at once with all its weight, and what the cues before it were away from it dies
    /// down in this time ([`choreo_motion::Inertia`]). In place of `fade_in`.
    pub inertial: Time,
    /// Base layer: the root motion that is taken out of the clip.
    pub root: Option<Arc<CueRoot>>,
}
