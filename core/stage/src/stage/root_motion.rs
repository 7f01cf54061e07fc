//! Root motion of a cue.

use choreo_motion::RootMotion;

/// The root motion of a cue's clip.
#[derive(Clone, Debug)]
pub struct CueRootMotion {
    pub motion: RootMotion,
    /// Carries the actor; else it is only taken out of the clip, which then plays on the spot.
    pub carries: bool,
}
