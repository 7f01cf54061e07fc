//! Root motion of a cue.

use choreo_motion::RootMotion;

/// The root motion of a cue's clip.
#[derive(Clone, Debug)]
pub struct CueRootMotion {
    /// Motion of the root in the clip.
    pub motion: RootMotion,
    /// Whether the root motion carries the actor; else it is only removed from the clip, which then plays on the spot.
    pub carries: bool,
}
