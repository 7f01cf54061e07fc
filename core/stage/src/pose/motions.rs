//! Motion data that is computed once for a stage.

use crate::pose::inertialization::Inertializations;
use crate::root_motion::track::{RootMotionTrack, RootMotionTracks};
use crate::stage::Stage;
use std::sync::Arc;

/// Results that are computed once for a stage, by actor: root motion, and inertialization offsets of cues.
#[derive(Debug, Default)]
pub(crate) struct Motions {
    pub root_motion: RootMotionTracks,
    inertializations: Vec<Arc<Inertializations>>,
}

impl Motions {
    pub(crate) fn new(stage: &Stage) -> Motions {
        let root_motion = RootMotionTracks::new(stage);
        let inertia = |(i, actor)| Arc::new(Inertializations::new(actor, root_motion.of(i)));
        let inertializations = stage.actors.iter().enumerate().map(inertia).collect();
        Motions { root_motion, inertializations }
    }

    /// The motions of one actor, as if it were the only one of the stage.
    pub(crate) fn for_actor(&self, actor: usize) -> Motions {
        let inertializations = self.inertializations.get(actor).into_iter().cloned().collect();
        Motions { root_motion: self.root_motion.for_actor(actor), inertializations }
    }

    pub(crate) fn of(&self, actor: usize) -> (Option<&RootMotionTrack>, Option<&Inertializations>) {
        (self.root_motion.of(actor), self.inertializations.get(actor).map(Arc::as_ref))
    }
}
