//! Results that are computed once from the clips of a stage: root motion and inertialization.

use crate::pose::inertialization::Inertializations;
use crate::root_motion::track::{RootMotionTrack, RootMotionTracks};
use crate::stage::Stage;

/// Results that are computed once for a stage, by actor: root motion, and inertialization offsets of cues.
#[derive(Debug, Default)]
pub(crate) struct Motions {
    pub root_motion: RootMotionTracks,
    inertializations: Vec<Inertializations>,
}

impl Motions {
    pub fn new(stage: &Stage) -> Motions {
        let root_motion = RootMotionTracks::new(stage);
        let inertia = |(i, actor)| Inertializations::new(actor, root_motion.of(i));
        let inertializations = stage.actors.iter().enumerate().map(inertia).collect();
        Motions { root_motion, inertializations }
    }

    pub fn of(&self, actor: usize) -> (Option<&RootMotionTrack>, Option<&Inertializations>) {
        (self.root_motion.of(actor), self.inertializations.get(actor))
    }
}
