//! Root motion and path following: displacement of actors by clips and along paths.

pub(crate) mod apply;
pub(crate) mod track;
