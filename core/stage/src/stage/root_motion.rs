//! Root motion of a cue.

use choreo_motion::RootMotion;

/// What a clip's root motion is for.
#[derive(Clone, Debug)]
pub struct CueRootMotion {
    pub motion: RootMotion,
    /// Carries the actor; else it is only taken out of the clip, which then plays on the spot.
    pub carries: bool,
}
