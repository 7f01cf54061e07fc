//! The functions and methods of the script, as tables.

pub mod actor;
pub mod asset;
pub mod body;
pub mod camera;
pub mod clip;
pub mod clip_edit;
pub mod compare;
pub mod cue;
pub mod effect;
pub mod expect;
pub mod expression;
pub mod flat;
pub mod goals;
pub mod joint;
pub mod keys;
pub mod light;
pub mod look;
pub mod made;
pub mod maths;
pub mod sky;
mod span;
pub mod stage;
pub mod surfaces;
mod swing;
pub mod test;
pub mod together;
pub mod travel;
pub mod values;

use crate::call::Def;

/// Every function and method, in the order of the reference.
pub const TABLES: &[(&str, &[&[Def]])] = &[
    ("The stage", &[stage::DEFS]),
    ("Assets and clips", &[asset::DEFS]),
    ("Shapes, meshes and pictures", &[made::DEFS]),
    ("Clips made from clips", &[clip::DEFS]),
    ("Clips: editing and keys", &[clip_edit::DEFS]),
    ("Actors", &[actor::DEFS, surfaces::DEFS, span::DEFS, joint::DEFS, look::DEFS]),
    ("Bodies: reaching, aiming, standing, swinging", &[body::DEFS]),
    ("Cues: what plays when", &[cue::DEFS]),
    ("Root motion and paths", &[travel::DEFS]),
    ("Together: markers, groups, sequences", &[together::DEFS]),
    ("Cameras", &[camera::DEFS]),
    ("Lights", &[light::DEFS, sky::DEFS]),
    ("Words and pictures over the scene", &[flat::DEFS]),
    ("Effects", &[effect::DEFS]),
    ("Tests: sections", &[test::DEFS]),
    ("Tests: what is looked at", &[expect::DEFS]),
    ("Tests: comparisons", &[compare::DEFS]),
];

pub fn all() -> impl Iterator<Item = &'static Def> {
    TABLES.iter().flat_map(|(_, tables)| tables.iter().copied().flatten())
}
