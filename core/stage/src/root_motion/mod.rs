//! Root motion and path following: where clips and paths carry an actor.

pub(crate) mod apply;
pub(crate) mod track;
