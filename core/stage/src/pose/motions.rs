//! What is computed once of the clips of a stage: root motion and inertialization.

use crate::pose::inertialization::Inertias;
use crate::root_motion::travel::{Travel, Travels};
use crate::stage::Stage;

/// What is found out once for a stage, by actor: how far root motion leads, what dies down after inertialized cues.
#[derive(Debug, Default)]
pub(crate) struct Motions {
    pub travels: Travels,
    inertias: Vec<Inertias>,
}

impl Motions {
    pub fn new(stage: &Stage) -> Motions {
        let travels = Travels::new(stage);
        let inertia = |(i, actor)| Inertias::new(actor, travels.of(i));
        let inertias = stage.actors.iter().enumerate().map(inertia).collect();
        Motions { travels, inertias }
    }

    pub fn of(&self, actor: usize) -> (Option<&Travel>, Option<&Inertias>) {
        (self.travels.of(actor), self.inertias.get(actor))
    }
}
