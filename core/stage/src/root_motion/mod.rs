//! Root motion and path following: where clips and paths carry an actor.

pub(crate) mod carry;
pub(crate) mod travel;
